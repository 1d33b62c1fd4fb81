"""A wedge damper between two stubby blades, meshed by NumPy: small, exact flanks, matched nodes on
both seats.
"""

import numpy as np
from blocks import quadratic, simplices, surface

from geometry.mesh import Mesh, Pair, Sector


def wedge_mesh(
    alpha,
    sectors=36,
    divisions=(4, 3, 4),
    dimension=3,
    radius=0.2,
    height=0.01,
    foot=0.012,
    length=0.03,
):
    """Blade and damper of one sector.

    alpha: angle of each flank to the radial plane [rad]; divisions along (flank, across, axis);
    foot: half width of the wedge's lower side [m]; the blade is clamped on its lower side.
    """
    theta = np.pi / sectors
    out, side = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    axes = [np.linspace(0, 1, divisions[0] + 1), np.linspace(-1, 1, divisions[1] + 1)]
    if dimension == 3:
        axes.append(np.linspace(-length / 2, length / 2, divisions[2] + 1))
    grid, cells = quadratic(*simplices(*axes))
    r, s = radius + height * grid[:, :1], grid[:, 1:2]
    half = foot - height * grid[:, :1] * np.tan(alpha)
    damper = r * out + half * s * side
    right = r * out - half * side
    blade = np.hstack([right[:, :1], right[:, 1:] * s])
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(2 * theta), -np.sin(2 * theta)], [np.sin(2 * theta), np.cos(2 * theta)]]
    n, corners = len(grid), dimension + 1
    points = np.zeros((2 * n, 3))
    points[:, :2] = np.vstack([blade, damper])
    if dimension == 3:
        points[:, 2] = np.tile(grid[:, 2], 2)
    plus, minus = surface(grid, cells, corners, 1, 1.0), surface(grid, cells, corners, 1, -1.0)
    faces = {
        "clamp": surface(grid, cells, corners, 0, 0.0),
        "seat_right": plus,
        "seat_left": minus,
        "damper_left": minus + n,
        "damper_right": plus + n,
    }
    pairs = {
        "this": _pair(points, faces, "seat_right", "damper_left", np.eye(3)),
        "next": _pair(points, faces, "seat_left", "damper_right", turn),
    }
    return Mesh(
        points,
        "triangle6" if dimension == 2 else "tetra10",
        {"blade": cells, "damper": cells + n},
        faces,
        pairs=pairs,
        sector=Sector(sectors, turn, np.zeros(3)),
        depth=0.03 if dimension == 2 else 1.0,
    )


def _pair(points, faces, master, slave, rotation):
    a, b = np.unique(faces[master]), np.unique(faces[slave])
    distance = np.linalg.norm((points[a] @ rotation.T)[:, None] - points[b][None], axis=2)
    assert distance.min(axis=1).max() < 1e-12
    return Pair(master, slave, np.stack([a, b[distance.argmin(axis=1)]]), rotation, np.zeros(3))
