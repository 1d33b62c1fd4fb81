"""Error of a recovered stress at one node, by what the mesh leaves open there."""

from __future__ import annotations

import numpy as np

from geometry.topology import FACETS, FAMILY

from . import shape_functions as shape
from .body import Body
from .stress import patch_stress, von_mises


def mesh_error(
    body: Body,
    u: np.ndarray,
    recovered: np.ndarray,
    node: int,
    touched: np.ndarray | None = None,
) -> float:
    """Relative error of the recovered stress at a node: root of the sum of two squares.

    The first is the spread between the recovered stress, a linear and a quadratic continuation of
    the stresses at the Gauss points (superconvergent patch recovery, Zienkiewicz and Zhu 1992,
    doi:10.1002/nme.1620330702): where the stress varies too fast for the elements, as at a sharp
    corner, these disagree however fine the mesh is. The second is the traction that the recovered
    stress leaves on free faces, where the true one is zero.

    Args:
        u: (n_points, dim) displacements, complex or real [m].
        recovered: (n_points, 6) their recovered stress [Pa].
        touched: (n_points,) True where tractions may act, such as clamp, cuts and seats; no face
            counts as free when left out.
    """
    here = recovered[node]
    size = max(float(von_mises(here)), np.finfo(float).tiny)
    first, second = patch_stress(body, u, node)
    spread = max(
        float(von_mises(difference)) for difference in (first - here, second - here, first - second)
    )
    traction = 0.0 if touched is None else free_traction(body, here, node, touched)
    return float(np.hypot(spread, traction) / size)


def free_traction(
    body: Body,
    stress: np.ndarray,
    node: int,
    touched: np.ndarray,
) -> float:
    """Root mean square [Pa] of the traction of a stress (6,) on the free faces at a node; 0 where
    none are.
    """
    normals = free_normals(body, node, touched)
    if not len(normals):
        return 0.0
    xx, yy, zz, xy, yz, zx = stress
    tensor = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    tractions = tensor[:, : body.dim] @ normals.T
    return float(np.sqrt((np.abs(tractions) ** 2).sum(axis=0).mean()))


def free_normals(
    body: Body,
    node: int,
    touched: np.ndarray,
) -> np.ndarray:
    """(k, dim) unit normals, at a node, of the boundary facets there that are not touched."""
    mesh = body.mesh
    facets = np.array(FACETS[FAMILY[mesh.cell_type]])
    cells = np.vstack([mesh.bodies[name] for name in body.material])
    cells = cells[(cells == node).any(axis=1)]
    corners = cells[:, facets]
    # facets inside the body belong to two cells at the node
    keys = np.sort(corners.reshape(-1, facets.shape[1]), axis=1)
    _, inverse, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    single = (count[inverse.ravel()] == 1).reshape(corners.shape[:2])
    free = single & ~touched[corners].all(axis=2)
    found = []
    reference = shape.reference_nodes(mesh.cell_type)
    for row, side in zip(*np.nonzero(free), strict=True):
        own = reference[np.flatnonzero(cells[row] == node)]
        flat = reference[facets[side]]
        # facets next to the node are not faces of it
        normal = _reference_normal(flat)
        if abs(normal @ (own[0] - flat[0])) > 1e-9:
            continue
        _, gradients = shape.tabulate(mesh.cell_type, own)
        tangents = mesh.points[cells[row]][:, : body.dim].T @ gradients[0]
        normal = np.linalg.solve(tangents.T, normal)
        found.append(normal / np.linalg.norm(normal))
    return np.array(found).reshape(-1, body.dim)


def _reference_normal(corners: np.ndarray) -> np.ndarray:
    """Normal (d,) of a facet of the unit cell, by its corners (k, d)."""
    edge = corners[1] - corners[0]
    if len(edge) == 2:
        return np.array([edge[1], -edge[0]])
    return np.cross(edge, corners[2] - corners[0])
