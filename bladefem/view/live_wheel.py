"""All blades of a wheel in motion, for a page with script: plates round a rim that bend by the
amplitude at the probe, since the finite elements are those of one blade.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..util.arrays import ComplexArray, RealArray
from .live_shapes import HARMONIC_SHARE, pack_numbers, packed_shape

# of a wheel whose blades end at radius 1: rim and its inner side; half a plate's width over the
# pitch of the blades
RIM_RADIUS = 0.55
INNER_RADIUS = 0.48
HALF_WIDTH_SHARE = 0.32
# rows of nodes along a blade
ROWS = 7
# largest displacement as drawn, over the length of a blade
DRAWN_SHARE = 0.6
PHASES = np.radians(np.arange(0, 360, 5))


def live_wheel(probe: ComplexArray, title: str) -> dict[str, Any]:
    """Plates and their motion along the axis, for ``page.js``.

    Args:
        probe: (N, H) complex amplitudes of harmonics 1..H at the probe of each blade [m].
    """
    count, H = probe.shape
    points, triangles, along = _plates(count)
    sizes = np.linalg.norm(probe, axis=1)
    largest = float(sizes.max())
    factor = DRAWN_SHARE * (1 - RIM_RADIUS) / max(largest, np.finfo(float).tiny)
    # bends as a cantilever does, and stays on the rim
    share = np.tile(np.repeat(along**2, 2), count)
    moved = np.repeat(probe, 2 * ROWS, axis=0) * share[:, None]
    harmonics = []
    for h in range(H):
        if abs(probe[:, h]).max() <= HARMONIC_SHARE * abs(probe).max():
            continue
        drawn = np.zeros((len(points), 3), dtype=complex)
        drawn[: len(moved), 2] = factor * moved[:, h]
        harmonics.append({"order": h + 1, **packed_shape(drawn)})
    worst = probe[int(np.argmax(sizes))]
    turns = np.exp(1j * PHASES[:, None] * np.arange(1, H + 1))
    start = np.degrees(PHASES[int(np.argmax((turns * worst).real.sum(axis=1)))])
    return {
        "kind": "shape",
        "choice": "load",
        "points": pack_numbers(points, np.float32),
        "triangles": pack_numbers(triangles, np.uint32),
        "modes": [
            {
                "title": title,
                "amplitude": 1e6 * largest,
                "start": float(start),
                "harmonics": harmonics,
            }
        ],
        "eye": [0.6, -1.4, 1.6],
        "up": [0.0, 0.0, 1.0],
    }


def _plates(count: int) -> tuple[RealArray, np.ndarray, RealArray]:
    """Nodes (., 3), blade after blade and row by row, then those of the rim, triangles (., 3), and
    how far along the blade each row is (ROWS,).
    """
    along = np.linspace(0.0, 1.0, ROWS)
    radius = RIM_RADIUS + (1 - RIM_RADIUS) * along
    half = HALF_WIDTH_SHARE * 2 * np.pi * RIM_RADIUS / count
    plate = np.stack(
        [np.repeat(radius, 2), np.tile([-half, half], ROWS), np.zeros(2 * ROWS)], axis=1
    )
    angle = 2 * np.pi * np.arange(count) / count
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x = c * plate[:, 0] - s * plate[:, 1]
    y = s * plate[:, 0] + c * plate[:, 1]
    points = np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3)
    corner = 2 * np.arange(ROWS - 1)
    one = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + 2], axis=1),
            np.stack([corner + 1, corner + 3, corner + 2], axis=1),
        ]
    )
    # the rim joins the feet of neighbouring blades
    feet = 2 * ROWS * np.arange(count)
    ahead = np.roll(feet, -1)
    inner = 2 * ROWS * count + np.arange(count)
    rim = np.concatenate(
        [
            np.stack([feet, feet + 1, inner], axis=1),
            np.stack([feet + 1, ahead, inner], axis=1),
            np.stack([ahead, np.roll(inner, -1), inner], axis=1),
        ]
    )
    hub = np.stack([INNER_RADIUS * c[:, 0], INNER_RADIUS * s[:, 0], np.zeros(count)], axis=1)
    points = np.concatenate([points, hub])
    triangles = np.concatenate([(one[None] + feet[:, None, None]).reshape(-1, 3), rim])
    return points, triangles, along
