"""Points of a response as a table: of a load's curve, and of a linear limit."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..study.pipeline.linear_limits import Limit
from ..study.pipeline.loads import Curve


def points_of(curve: Curve) -> pd.DataFrame:
    """One row a response point."""
    mass = {} if curve.mass is None else {"mass": curve.mass}
    return pd.DataFrame(
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


def linear_points(limit: Limit) -> pd.DataFrame:
    """One row a point of a linear limit, with the columns of :func:`points_of`."""
    return pd.DataFrame(
        {
            "load": limit.load,
            "frequency": limit.frequency,
            "amplitude": abs(limit.first),
            "phase": np.angle(limit.first),
            "converged": True,
            "method": "linear",
            "route": "linear",
            "residual": 0.0,
            "iterations": 0,
            "slipping": 0,
            "drift": 0.0,
            "dissipated": 0.0,
            "imbalance": 0.0,
            "estimated_error": 0.0,
            "tolerated_error": 0.0,
            "error_checked": False,
        }
    )
