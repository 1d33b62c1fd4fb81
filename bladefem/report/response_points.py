"""Points of a response as a table: of a load's curve, and of a linear limit."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..hbm.stability import STABLE
from ..study.pipeline.curve import Curve
from ..study.pipeline.linear_limits import Limit
from ..view.response import FOLLOWED, MARCHED

# method of the points of a linear limit
LINEAR = "linear"


def points_of(curve: Curve) -> pd.DataFrame:
    """One row a response point, and one of a resonance that a march in time gives in place of the
    balance.
    """
    mass = {} if curve.mass is None else {"mass": curve.mass}
    table = pd.DataFrame(
        {
            "load": curve.load,
            **mass,
            "frequency": curve.frequency,
            "amplitude": curve.amplitude,
            "phase": np.angle(curve.first),
            "converged": curve.converged,
            "method": curve.method,
            "route": curve.route,
            "residual": curve.residual,
            "iterations": curve.iterations,
            "slipping": curve.slipping,
            "drift": curve.drift,
            "dissipated": curve.dissipated,
            "imbalance": curve.imbalance,
            "estimated_error": curve.estimated,
            "tolerated_error": curve.tolerated,
            "error_checked": curve.checked,
            **({"branch": curve.branch} if curve.branch.any() else {}),
            **(
                {
                    "stability": curve.stability,
                    "multiplier": curve.multiplier,
                    "bifurcation": curve.bifurcation,
                }
                if any(curve.stability)
                else {}
            ),
        }
    )
    if curve.peak_amplitude != curve.balance_amplitude:
        table = _with_marched(table, curve)
    return table if curve.lower is None else _with_lower(table, curve)


def _with_lower(table: pd.DataFrame, curve: Curve) -> pd.DataFrame:
    """The table with the lower motion at the resonance beside that, in a column of its own."""
    assert curve.lower is not None
    beside = np.full(len(table), np.nan)
    off = abs(table["amplitude"] / curve.peak_amplitude - 1).where(table["converged"].astype(bool))
    beside[int(np.nanargmin(off))] = curve.lower.rounded
    return table.assign(lower_amplitude=beside)


def _with_marched(table: pd.DataFrame, curve: Curve) -> pd.DataFrame:
    """The table with the resonance that a march or a stiff layer gives, as a motion next to those
    of the curve.
    """
    method = FOLLOWED if curve.reaches_layer else MARCHED
    branch = table["branch"] if "branch" in table else table["converged"].astype(int)
    row = table.iloc[[0]].assign(
        frequency=curve.peak_frequency,
        amplitude=curve.peak_amplitude,
        phase=np.nan,
        converged=True,
        method=method,
        route=method,
        residual=np.nan,
        iterations=0,
        slipping=curve.slipping_at_peak,
        drift=curve.drift_at_peak,
        dissipated=curve.friction_work,
        imbalance=np.nan,
        estimated_error=curve.error,
        tolerated_error=np.nan,
        error_checked=True,
        branch=branch.max() + 1,
    )
    if "stability" in table:
        row = row.assign(stability=STABLE, multiplier=np.nan, bifurcation="")
    return pd.concat([table.assign(branch=branch), row], ignore_index=True)


def linear_points(limit: Limit) -> pd.DataFrame:
    """One row a point of a linear limit, with the columns of :func:`points_of`."""
    mass = {} if limit.mass is None else {"mass": limit.mass}
    return pd.DataFrame(
        {
            "load": limit.load,
            **mass,
            "frequency": limit.frequency,
            "amplitude": abs(limit.first),
            "phase": np.angle(limit.first),
            "converged": True,
            "method": LINEAR,
            "route": LINEAR,
            "residual": 0.0,
            "iterations": 0,
            "slipping": 0,
            "drift": 0.0,
            "dissipated": 0.0,
            "imbalance": 0.0,
            "estimated_error": limit.estimated,
            "tolerated_error": np.nan,
            "error_checked": np.isfinite(limit.estimated),
        }
    )
