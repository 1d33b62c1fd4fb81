"""Linear limits of a response as tables read them."""

from types import SimpleNamespace

import numpy as np


def linear_limits():
    """No damper and full stick."""
    return [
        SimpleNamespace(
            load=load,
            peak_frequency=800.0,
            peak_amplitude=1e-4,
            frequency=np.arange(3.0),
            error=0.002,
            halved=np.nan,
            body_mesh=0.001,
            mass=None,
        )
        for load in (0.0, np.inf)
    ]
