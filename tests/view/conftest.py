"""A small bladed sector made by hand: boxes in polar coordinates, split into P2 tetrahedra, with
known modes.
"""

from itertools import permutations

import numpy as np
import pytest

from bladefem.data import ModeSet
from geometry.mesh import Mesh, Sector

SECTORS = 12


def box(lower, upper, shape):
    """Points (n, 3) and hexahedra of a regular grid."""
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, shape, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([n + 1 for n in shape])
    i, j, k = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    corner = {
        (a, b, c): number[i + a, j + b, k + c].ravel()
        for a in (0, 1)
        for b in (0, 1)
        for c in (0, 1)
    }
    return points, corner


def tetrahedra(corner):
    """Kuhn's six tetrahedra of each box, all positively oriented."""
    cells = []
    for order in permutations(range(3)):
        path = [np.zeros(3, int)]
        for axis in order:
            path.append(path[-1] + np.eye(3, dtype=int)[axis])
        cell = np.stack([corner[tuple(p)] for p in path], axis=1)
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        cells.append(cell[:, [0, 2, 1, 3]] if odd else cell)
    return np.concatenate(cells)


def second_order(points, cells):
    """Mid-side nodes in gmsh's order."""
    edges = [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)]
    pairs = np.sort(cells[:, edges].reshape(-1, 2), axis=1)
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    middle = len(points) + inverse.reshape(-1, 6)
    return np.concatenate([points, points[unique].mean(axis=1)]), np.hstack([cells, middle])


def polar(points):
    """(r, angle, z) to x, y, z."""
    r, angle, z = points.T
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def merge(parts):
    """Glue coincident points of several boxes of one body."""
    points = np.concatenate([p for p, _ in parts])
    offsets = np.cumsum([0] + [len(p) for p, _ in parts[:-1]])
    cells = np.concatenate([c + o for (_, c), o in zip(parts, offsets, strict=True)])
    _, first, inverse = np.unique(
        np.round(points, 9), axis=0, return_index=True, return_inverse=True
    )
    return points[first], inverse.reshape(-1)[cells]


def boundary_where(points, cells, test):
    """Second-order boundary triangles whose corners all satisfy a test on (r, angle, z)."""
    from bladefem.view.skin import outer_faces

    faces = outer_faces(cells, "tetra10")
    r, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    good = test(r, angle, points[:, 2])
    return faces[np.all(good[faces[:, :3]], axis=1)]


@pytest.fixture(scope="session")
def sector():
    """Disc segment with a blade (one body) and a damper box, P2 tetrahedra, 12 sectors."""
    half = np.pi / SECTORS
    disc = box((0.1, -half, -0.02), (0.16, half, 0.02), (3, 8, 2))
    blade = box((0.16, -half / 4, -0.02), (0.28, half / 4, 0.02), (6, 2, 2))
    points, cells = merge([(polar(p), tetrahedra(c)) for p, c in (disc, blade)])
    block = box((0.18, 0.9 * half, -0.015), (0.2, 1.1 * half, 0.015), (1, 1, 2))
    cells = [cells, tetrahedra(block[1]) + len(points)]
    points = np.concatenate([points, polar(block[0])])
    points, all_cells = second_order(points, np.concatenate(cells))
    bodies = {"blade": all_cells[: len(cells[0])], "damper": all_cells[len(cells[0]) :]}
    faces = {
        name: boundary_where(points, bodies["blade"], test)
        for name, test in {
            "clamp": lambda r, a, z: r < 0.1 + 1e-9,
            "cyclic_low": lambda r, a, z: a < -half + 1e-9,
            "cyclic_high": lambda r, a, z: a > half - 1e-9,
            "tip": lambda r, a, z: r > 0.28 * 0.995,
        }.items()
    }
    turn = np.array(
        [
            [np.cos(2 * half), -np.sin(2 * half), 0],
            [np.sin(2 * half), np.cos(2 * half), 0],
            [0, 0, 1],
        ]
    )
    return Mesh(points, "tetra10", bodies, faces, sector=Sector(SECTORS, turn, np.zeros(3)))


@pytest.fixture(scope="session")
def plane_row():
    """Two triangles per square of a plane strip: a row of blades without end."""
    points, corner = box((0.0, 0.0, 0.0), (0.15, 0.01, 1.0), (10, 2, 1))
    squares = [corner[a, b, 0] for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    cells = np.concatenate(
        [
            np.stack([squares[0], squares[1], squares[2]], 1),
            np.stack([squares[0], squares[2], squares[3]], 1),
        ]
    )
    used, inverse = np.unique(cells, return_inverse=True)
    cells = inverse.reshape(-1, 3)
    points = points[used]
    clamp = np.array([[0, 1], [1, 2]])
    return Mesh(
        points,
        "triangle",
        {"blade": cells},
        {"clamp": clamp},
        sector=Sector(0, np.eye(3), np.array([0.0, 0.03, 0.0])),
    )


@pytest.fixture(scope="session")
def wave(sector):
    """Two modes of nodal diameter 3: axial bending with 0 and 1 nodal circles, e^{3 j angle} round
    the wheel.
    """
    r, angle = (
        np.hypot(sector.points[:, 0], sector.points[:, 1]),
        np.arctan2(sector.points[:, 1], sector.points[:, 0]),
    )
    shapes = np.zeros((2, len(r), 3), complex)
    shapes[0, :, 2] = (r - 0.1) ** 2 * np.exp(3j * angle)
    shapes[1, :, 2] = (r - 0.1) * (r - 0.2) * np.exp(3j * angle)
    return ModeSet(np.array([812.4, 2311.0]), shapes, 3, np.zeros(2))


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pictures")
