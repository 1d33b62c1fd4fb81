"""A leaning, twisted blade on which linear and nonlinear preload differ."""

import numpy as np
from structured import box, straightened


def twisted():
    """34 degrees of twist, 20 mm of lean over 200 mm of span, 6 mm thick, foot 300 mm from the
    axis; straight edges.
    """

    def bend(x):
        span, angle = x[:, 0], 3.0 * x[:, 0]
        cos, sin = np.cos(angle), np.sin(angle)
        return np.stack(
            [
                0.3 + span,
                x[:, 1] * cos - x[:, 2] * sin + 0.5 * span**2,
                x[:, 1] * sin + x[:, 2] * cos,
            ],
            1,
        )

    return straightened(
        box((4, 1, 2), (0.2, 0.006, 0.04), "tetra10", origin=(0, -0.003, -0.02), map=bend)
    )
