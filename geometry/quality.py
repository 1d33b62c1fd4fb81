"""Checks of a mesh before it is solved: Jacobians and shapes of its cells, as a table; bad
second-order cells are straightened.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bladefem.errors import InputError

from .jacobian import scaled_jacobian, straight_jacobian
from .mesh import Mesh, Pair
from .topology import EDGES, FAMILY, corner_count

# smallest accepted ratio of a curved cell's Jacobian to the straight cell's
MIN_JACOBIAN = 0.1


def shape_quality(
    points: np.ndarray,
    cells: np.ndarray,
    cell_type: str,
) -> np.ndarray:
    """Ratio (nc,) of inscribed to circumscribed radius, 1 for the regular simplex; of the corners
    only.

    For quads and hexes: the smallest corner Jacobian over the product of its edges.
    """
    x = points[cells[:, : corner_count(cell_type)]]

    def side(a: int, b: int) -> np.ndarray:
        return np.linalg.norm(x[:, a] - x[:, b], axis=1)

    if cell_type.startswith("triangle"):
        a = side(1, 2)
        b = side(2, 0)
        c = side(0, 1)
        return (b + c - a) * (c + a - b) * (a + b - c) / (a * b * c)
    if cell_type.startswith("tetra"):
        volume = np.abs(straight_jacobian(points, cells, cell_type)) / 6
        area = sum(
            np.linalg.norm(np.cross(x[:, j] - x[:, i], x[:, k] - x[:, i]), axis=1) / 2
            for i, j, k in [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]
        )
        a = side(0, 1) * side(2, 3)
        b = side(0, 2) * side(1, 3)
        c = side(0, 3) * side(1, 2)
        heron = np.sqrt(np.maximum((a + b + c) * (a + b - c) * (a - b + c) * (b + c - a), 0))
        return 216 * volume**2 / (area * np.maximum(heron, 1e-300))
    edges = np.array([side(a, b) for a, b in EDGES[FAMILY[cell_type]]])
    return straight_jacobian(points, cells, cell_type) / edges.max(axis=0) ** (
        3 if cell_type[0] == "h" else 2
    )


def edge_of_middle(mesh: Mesh) -> np.ndarray:
    """Corner nodes (n, 2) of the edge that each mid-side node lies on; -1 for corner nodes."""
    edges = np.array(EDGES[FAMILY[mesh.cell_type]])
    k = corner_count(mesh.cell_type)
    ends = np.full((len(mesh.points), 2), -1)
    for cells in mesh.bodies.values():
        if cells.shape[1] >= k + len(edges):
            ends[cells[:, k : k + len(edges)]] = cells[:, edges]
    return ends


def straighten_cells(mesh: Mesh) -> tuple[np.ndarray, int]:
    """Points (n, 3) [m] where no second-order cell has a doubtful Jacobian, and how many cells were
    touched.

    The edges of a doubtful cell lose half of their curvature, then another half, then all of it.
    Only second-order triangles and tetrahedra are touched. Paired nodes move together.

    gmsh's own optimisers were measured and are not used: on sectors of 3400 to 12 300 cells with 15
    to 56 inverted ones, HighOrderElastic left most of them inverted, and HighOrder, which cures
    them, moves corners too and left cells of shape quality 1e-6 in two cases of six.
    """
    points = mesh.points.copy()
    ends = edge_of_middle(mesh)
    if mesh.cell_type not in ("tetra10", "triangle6"):
        return points, 0
    cells = np.vstack(list(mesh.bodies.values()))
    k = corner_count(mesh.cell_type)
    bad = np.zeros(len(cells), dtype=bool)
    rounds = np.zeros(len(points), dtype=int)
    # ends: an edge is touched three times at most, then it is straight
    while True:
        doubtful = scaled_jacobian(points, cells, mesh.cell_type) < MIN_JACOBIAN
        todo = _with_partners(np.unique(cells[doubtful][:, k:]), mesh.pairs, len(points)) & (
            rounds < 3
        )
        if not todo.any():
            return points, int(bad.sum())
        bad |= doubtful
        rounds[todo] += 1
        straight = points[ends[todo]].mean(axis=1)
        points[todo] = straight + np.where(rounds[todo] < 3, 0.5, 0.0)[:, None] * (
            points[todo] - straight
        )


def _with_partners(
    nodes: np.ndarray,
    pairs: dict[str, Pair],
    count: int,
) -> np.ndarray:
    """Mask (count,) of the nodes and of every node paired with one of them."""
    mask = np.zeros(count, dtype=bool)
    mask[nodes] = True
    for pair in pairs.values():
        either = mask[pair.nodes[0]] | mask[pair.nodes[1]]
        mask[pair.nodes[:, either]] = True
    return mask


def quality_report(
    mesh: Mesh,
    straightened: int,
    size: float,
) -> dict[str, Any]:
    """What Mesh.report holds: counts, worst Jacobian and shape, cells straightened, element size
    wanted [m] and mean edge length [m].

    Raises:
        InputError: a cell has a Jacobian that is not positive.
    """
    jacobian = {n: scaled_jacobian(mesh.points, c, mesh.cell_type) for n, c in mesh.bodies.items()}
    shape = {n: shape_quality(mesh.points, c, mesh.cell_type) for n, c in mesh.bodies.items()}
    worst = min(j.min() for j in jacobian.values())
    if not worst > 0:
        count = sum(np.count_nonzero(~(j > 0)) for j in jacobian.values())
        raise InputError(
            f"mesh: {count} cells are turned inside out (smallest scaled Jacobian {worst:.3g}), "
            "expected a smaller mesh.size or less extreme proportions"
        )
    every = np.concatenate(list(shape.values()))
    return {
        "cells": len(every),
        "nodes": len(mesh.points),
        "cell type": mesh.cell_type,
        "size": size,
        "edge": _mean_edge(mesh),
        "min scaled jacobian": float(worst),
        "worst quality": float(every.min()),
        "mean quality": float(every.mean()),
        "straightened": straightened,
        "pairs": {name: pair.nodes.shape[1] for name, pair in mesh.pairs.items()},
    }


def _mean_edge(mesh: Mesh) -> float:
    """Mean length [m] of the straight edges."""
    edges = np.unique(
        np.sort(
            np.vstack(
                [
                    cells[:, edge]
                    for cells in mesh.bodies.values()
                    for edge in EDGES[FAMILY[mesh.cell_type]]
                ]
            ),
            axis=1,
        ),
        axis=0,
    )
    return float(np.linalg.norm(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]], axis=1).mean())


COLUMN_WORDS = {
    "size": "element size, wanted [mm]",
    "edge": "mean edge length [mm]",
    "cells": "elements",
    "min scaled jacobian": "smallest scaled Jacobian (straight: 1)",
    "worst quality": "worst shape (regular: 1)",
    "mean quality": "mean shape",
    "straightened": "elements straightened",
    "pairs": "matched nodes of pair",
    "notes": "note",
}


def quality_rows(mesh: Mesh) -> list[tuple[str, str]]:
    """Mesh.report for the eye: what, and its value as text."""
    rows = []
    for name, value in mesh.report.items():
        words = COLUMN_WORDS.get(name, name)
        if name == "notes":
            rows += [(words, note) for note in value]
            continue
        value = 1e3 * value if name in ("size", "edge") else value
        for part, number in value.items() if isinstance(value, dict) else (("", value),):
            text = f"{number:.4g}" if isinstance(number, float) else str(number)
            rows.append((f"{words} {part}".strip(), text))
    return rows
