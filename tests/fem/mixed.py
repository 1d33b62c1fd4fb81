"""Meshes of mixed shapes without a mesher, and CalculiX's own elements assembled in NumPy."""

from dataclasses import replace
from itertools import product

import numpy as np
import scipy.sparse as sp

from bladefem.fem import shape_functions as shape
from geometry.mesh import Mesh
from geometry.raw_mesh import RawMesh
from geometry.solid_cells import solid_cells
from geometry.topology import EDGES, QUADS, boundary_facets, outward_faces

HEXAHEDRON = shape.reference_nodes("hexahedron").astype(int)


def skew(points):
    """Points (n, 3) of straight cells that are no boxes."""
    return points @ np.array([[1.0, 0.1, 0.05], [0.2, 1.0, 0.1], [0.1, 0.3, 1.0]])


def row(size=(0.5, 0.1, 0.1), map=None, order=2, corners_to=None):
    """Five cubes in a row along x: a hexahedron, two wedges, five pyramids with two tetrahedra, a
    hexahedron, two wedges. Node sets "clamp" (x = 0) and "end", faces x0, x1, y0, ...

    ``map`` moves all nodes, ``corners_to`` the corners, and leaves edges straight (x -> x).
    """
    grid = list(product(range(6), (0, 1), (0, 1)))
    points = np.array([*grid, (2.5, 0.5, 0.5)], float)
    number = {place: i for i, place in enumerate(grid)}
    apex = len(grid)

    def corners(i):
        return [number[i + a, b, c] for a, b, c in HEXAHEDRON]

    def wedges(i):
        h = corners(i)
        # triangles across y
        return [[h[0], h[4], h[5], h[3], h[7], h[6]], [h[0], h[5], h[1], h[3], h[6], h[2]]]

    h = corners(2)
    sides = [(0, 3, 7, 4), (1, 5, 6, 2), (0, 4, 5, 1), (3, 2, 6, 7), (0, 1, 2, 3)]
    top = [h[4], h[5], h[6], h[7]]
    blocks = [
        ("hexahedron", np.array([corners(0), corners(3)])),
        ("wedge", np.array([*wedges(1), *wedges(4)])),
        ("pyramid", np.array([[*(h[k] for k in side), apex] for side in sides])),
        ("tetra", np.array([[top[0], top[2], top[1], apex], [top[0], top[3], top[2], apex]])),
    ]
    how = "promote" if order == 2 else "keep"
    solids = solid_cells(RawMesh(points, blocks, {}, {}), "row", how, np.array([0, 0, 1.0]))
    points = places = solids.points / [5, 1, 1] * size
    if corners_to is not None:
        moved = RawMesh(corners_to(points[: len(grid) + 1]), blocks, {}, {})
        solids = solid_cells(moved, "row", how, np.array([0, 0, 1.0]))
        places = solids.points
    on = {"clamp": points[:, 0] == 0, "end": points[:, 0] == size[0]}
    skin = boundary_facets(solids.cells, solids.cell_type)
    faces = {
        f"{'xyz'[i]}{side}": skin[(points[skin, i] == side * size[i]).all(axis=1)]
        for i in range(3)
        for side in (0, 1)
    }
    return Mesh(
        places if map is None else map(places),
        solids.cell_type,
        {"blade": _positive(solids.points, solids.cells)},
        {n: outward_faces(places, solids.cells, solids.cell_type, f) for n, f in faces.items()},
        nodes={name: np.flatnonzero(there) for name, there in on.items()},
        whole={"blade": solids.whole},
    )


def cut(mesh, divisions, pattern):
    """A mesh of hexahedra of 27 nodes whose columns (i, j), all along the last direction, stay "h",
    become two wedges "w" or six pyramids "p" each, by ``pattern(i, j)``. Geometry stays.
    """
    cells = mesh.bodies["blade"]
    i, j, _ = np.unravel_index(np.arange(len(cells)), divisions)
    kind = np.array([pattern(a, b) for a, b in zip(i, j, strict=True)])
    low = {frozenset(pair): 8 + n for n, pair in enumerate(EDGES["hexahedron"])}
    low |= {frozenset(quad): 20 + n for n, quad in enumerate(QUADS["hexahedron"])}
    low |= {frozenset((0, 2)): 20, frozenset((4, 6)): 25}
    # the middle of what a wedge's third quadrilateral is
    low |= {frozenset((0, 2, 6, 4)): 26}
    wedges = []
    for half in ((0, 1, 2), (0, 2, 3)):
        corners = [*half, *(c + 4 for c in half)]
        groups = [*EDGES["wedge"], *QUADS["wedge"]]
        local = [*corners, *(low[frozenset(corners[c] for c in group)] for group in groups)]
        wedges.append(cells[kind == "w"][:, local])
    points, pyramids = mesh.points, []
    some = cells[kind == "p"]
    values, _ = shape.tabulate("hexahedron27", (HEXAHEDRON + 0.5) / 2)
    new = np.einsum("qk,ckd->cqd", values, points[some])
    number = len(points) + np.arange(8 * len(some)).reshape(-1, 8)
    points = np.vstack([points, new.reshape(-1, 3)])
    for quad in QUADS["hexahedron"]:
        columns = [some[:, c] for c in quad] + [some[:, 26]]
        for a, b in EDGES["pyramid"]:
            columns.append(
                number[:, quad[a]] if b == 4 else some[:, low[frozenset((quad[a], quad[b]))]]
            )
        columns.append(some[:, low[frozenset(quad)]])
        pyramids.append(np.column_stack(columns))
    blocks = [
        ("hexahedron27", cells[kind == "h"]),
        ("wedge18", np.vstack(wedges)),
        ("pyramid14", np.vstack(pyramids)),
    ]
    blocks = [(word, found) for word, found in blocks if len(found)]
    solids = solid_cells(RawMesh(points, blocks, {}, {}), "cut", "refuse", np.array([0, 0, 1.0]))
    skin = boundary_facets(solids.cells, solids.cell_type)
    faces = {}
    for name, facets in mesh.faces.items():
        found = skin[np.isin(skin, facets).all(axis=1)]
        faces[name] = outward_faces(points, solids.cells, solids.cell_type, found)
    return replace(
        mesh,
        points=points,
        cell_type=solids.cell_type,
        bodies={"blade": _positive(points, solids.cells)},
        faces=faces,
        whole={"blade": solids.whole},
    )


def chequered(i, j):
    """All three shapes beside each other."""
    return "hwp"[(i + 2 * j) % 3]


def _positive(points, cells):
    x = points[cells[:, :4]]
    assert (np.linalg.det(x[:, 1:] - x[:, :1]) > 0).all()
    return cells


GAUSS = (np.array([-np.sqrt(0.6), 0, np.sqrt(0.6)]) + 1) / 2, np.array([5, 8, 5]) / 18


def _rule(family, exact):
    """Points and weights of 20-node hexahedra and 15-node wedges; CalculiX has nine points in a
    wedge, which leave its mass inexact.
    """
    at, w = GAUSS
    if family == "hexahedron":
        return np.array(list(product(at, at, at))), np.array([np.prod(c) for c in product(w, w, w)])
    if exact:
        triangle, area = shape.quadrature("triangle", 6)
    else:
        triangle = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
        area = np.full(3, 1 / 6)
    places = np.array([(*a, z) for a in triangle for z in at])
    return places, np.outer(area, w).ravel()


def _serendipity(family, x):
    """Values (q, k) and gradients (q, k, 3) of the shape functions of corners and edges."""
    if family == "hexahedron":
        corner = shape.reference_nodes("hexahedron")
        powers = [e for e in product(range(3), repeat=3) if e.count(2) <= 1]
    else:
        corner = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
        powers = [
            (a, b, c)
            for a, b, c in product(range(3), repeat=3)
            if a + b <= 2 and (c < 2 or a + b <= 1)
        ]
    nodes = np.vstack([corner, corner[np.array(EDGES[family])].mean(axis=1)])
    e = np.array(powers)
    coefficients = np.linalg.inv(np.prod(nodes[:, None] ** e, axis=2))
    lowered = [
        np.prod(x[:, None] ** np.maximum(e - step, 0), axis=2) * (e @ step)
        for step in np.eye(3, dtype=int)
    ]
    return (
        np.prod(x[:, None] ** e, axis=2) @ coefficients,
        np.stack([part @ coefficients for part in lowered], axis=2),
    )


def serendipity_matrices(model, E, nu, rho, exact):
    """Stiffness and mass (3n, 3n) of a model of C3D20 and C3D15."""
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    law = np.zeros((6, 6))
    law[:3, :3] = lam
    law[range(6), range(6)] += [2 * mu] * 3 + [mu] * 3
    entries = []
    for word, cells in model.blocks:
        family = word.rstrip("0123456789")
        at, weight = _rule(family, exact)
        N, dN = _serendipity(family, at)
        nc, k = cells.shape
        J = np.einsum("ckg,qkd->cqgd", model.points[cells], dN)
        volume = np.linalg.det(J) * weight
        g = np.einsum("qkd,cqdg->cqkg", dN, np.linalg.inv(J))
        B = np.zeros((nc, len(at), 6, k, 3))
        for a in range(3):
            B[:, :, a, :, a] = g[..., a]
            b = (a + 1) % 3
            B[:, :, 3 + a, :, a] = g[..., b]
            B[:, :, 3 + a, :, b] = g[..., a]
        B = B.reshape(nc, len(at), 6, 3 * k)
        K = np.einsum("cqia,ij,cqjb,cq->cab", B, law, B, volume, optimize=True)
        m = rho * np.einsum("qa,qb,cq->cab", N, N, volume)
        M = np.einsum("cab,ij->caibj", m, np.eye(3)).reshape(K.shape)
        dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(nc, -1)
        rows = np.repeat(dofs, 3 * k, axis=1).ravel()
        entries.append((rows, np.tile(dofs, (1, 3 * k)).ravel(), K.ravel(), M.ravel()))
    rows, columns, K, M = (np.concatenate(part) for part in zip(*entries, strict=True))
    size = (3 * len(model.points),) * 2
    return sp.csr_matrix((K, (rows, columns)), size), sp.csr_matrix((M, (rows, columns)), size)
