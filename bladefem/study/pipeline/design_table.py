"""The design table: resonance of each load from no damper to full stick, one row a load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...hbm.history_interval import POINT
from ...util.arrays import RealArray
from .curve import Curve
from .linear_limits import Limit


def design_table(curves: list[Curve], limits: Sequence[Limit]) -> dict[str, np.ndarray]:
    """The design table: one row a load, from no damper (load 0) to full stick (load inf), of each
    mass of the damper where several are studied.
    """
    free, *stuck = (_linear_row(limit) for limit in limits)
    rows = [free, *map(_row, curves), *stuck]
    if any(c.interval is not None for c in curves):
        first, *last = (_certain(limit.peak_amplitude) for limit in limits)
        added = [first, *(_interval_row(c) for c in curves), *last]
        rows = [row | more for row, more in zip(rows, added, strict=True)]
        free = rows[0]
    table = {name: np.array([row[name] for row in rows]) for name in free}
    if any(c.lower is not None for c in curves):
        lower = [np.nan if c.lower is None else c.lower.rounded for c in curves]
        table["lower_amplitude"] = np.array([np.nan, *lower, *(np.nan for _ in stuck)])
    if any(c.mass is not None for c in curves):
        masses = [None, *(c.mass for c in curves), *(limit.mass for limit in limits[1:])]
        table["mass"] = np.array([np.nan if mass is None else mass for mass in masses])
    table["reduction"] = free["peak_amplitude"] / table["peak_amplitude"]
    return table


def equivalent_damping(
    own: float, frequency: npt.ArrayLike, amplitude: npt.ArrayLike, free: tuple[float, float]
) -> RealArray:
    """(rows,) damping ratios of linear blades with the same amplitudes, at the same frequencies,
    under the same force; NaN where that is no positive number, as without damping or motion.

    A mode of mass m under the force F resonates with the amplitude F / (2 zeta m omega^2), so that
    the ratio is the blade's own times the ratio of amplitudes and the square of that of
    frequencies. That the damper changes the shape of the mode is left out.

    Args:
        own: damping ratio of the blade without damper.
        frequency: (rows,) of the resonances.
        amplitude: (rows,) of the resonances, in the unit of the one without damper.
        free: frequency and amplitude without damper.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        shift = free[0] / np.asarray(frequency, dtype=float)
        ratio = own * free[1] / np.asarray(amplitude, dtype=float) * shift**2
    return np.asarray(np.where(np.isfinite(ratio) & (ratio > 0), ratio, np.nan))


def _row(c: Curve) -> dict[str, Any]:
    return {
        "load": c.load,
        "peak_frequency": c.peak_frequency,
        "peak_amplitude": c.peak_amplitude,
        "reduction": 1.0,
        "dissipated": c.friction_work,
        "slipping": c.slipping_at_peak,
        "drift": c.drift_at_peak,
        "error": np.nan if c.error is None else c.error,
        "halved": c.halved,
        "body_mesh": c.body_mesh,
        "layer_law": c.layer_law,
        "harmonics": c.settings.harmonics,
        "points": len(c.frequency),
        "unconverged": int((~c.converged).sum()),
    }


def _certain(amplitude: float) -> dict[str, float | str]:
    """Columns of the interval where the response is linear."""
    return {"lowest": amplitude, "highest": amplitude, "interval": POINT}


def _interval_row(c: Curve) -> dict[str, float | str]:
    if c.interval is None:
        return {"lowest": np.nan, "highest": np.nan, "interval": ""}
    return {
        # the curve's highest point may lie below its maximum by the tolerance
        "lowest": min(c.interval.lowest, c.peak_amplitude),
        "highest": max(c.interval.highest, c.peak_amplitude),
        "interval": c.interval.certificate,
    }


def _linear_row(limit: Limit) -> dict[str, Any]:
    return {
        "load": limit.load,
        "peak_frequency": limit.peak_frequency,
        "peak_amplitude": limit.peak_amplitude,
        "reduction": 1.0,
        "dissipated": 0.0,
        "slipping": 0,
        "drift": 0.0,
        "error": limit.error,
        "halved": limit.halved,
        "body_mesh": limit.body_mesh,
        "layer_law": 0.0,
        "harmonics": 1,
        "points": len(limit.frequency),
        "unconverged": 0,
    }
