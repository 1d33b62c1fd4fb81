"""Two elastic blocks facing each other at z = 0 (y = 0 in the plane), meshed and solved without
bladefem.fem.

The lower block is the "blade" (its normal points up into the other), the upper one the "damper".
Elements are straight quadratic simplices on a graded grid; x = 0 and y = 0 are symmetry planes when
asked.
"""

from itertools import permutations

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from bladefem.contact.patch import normal_ports, port_matrix
from geometry.mesh import Mesh, Pair

EDGES = {3: [(0, 1), (1, 2), (0, 2)], 4: [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]}


def graded(h, fine, end, growth=1.4):
    """Grid from 0: steps of h up to fine, then growing by a factor until end."""
    x = list(np.linspace(0.0, fine, round(fine / h) + 1))
    step = h
    while x[-1] < end:
        step *= growth
        x.append(x[-1] + step)
    return np.array(x)


def simplices(*axes):
    """Points (n, d) and simplices (m, d + 1) of a grid, each cell cut along its main diagonal
    (Kuhn).
    """
    shape = [len(a) for a in axes]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
    number = np.arange(len(points)).reshape(shape)
    cells = []
    for order in permutations(range(len(axes))):
        corner = np.zeros(len(axes), int)
        nodes = []
        for k in (None, *order):
            if k is not None:
                corner[k] = 1
            nodes.append(
                number[
                    tuple(slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=True))
                ].ravel()
            )
        cells.append(np.stack(nodes, 1))
    cells = np.concatenate(cells)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    flip = np.linalg.det(edges) < 0
    cells[flip, :2] = cells[flip, 1::-1]
    return points, cells


def quadratic(points, cells):
    """Add mid-edge nodes in gmsh's order."""
    pairs = EDGES[cells.shape[1]]
    edges = np.sort(np.stack([cells[:, p] for p in pairs], 1).reshape(-1, 2), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    mids = points[unique].mean(axis=1)
    return np.vstack([points, mids]), np.hstack(
        [cells, len(points) + inverse.reshape(len(cells), -1)]
    )


def surface(points, cells, corners, axis, value):
    """Quadratic faces whose corners all have points[:, axis] == value."""
    k = cells.shape[1]
    mid = {frozenset(p): corners + i for i, p in enumerate(EDGES[corners])}
    on = np.isclose(points[:, axis], value, atol=1e-12)
    faces = []
    for drop in range(corners):
        c = [i for i in range(corners) if i != drop]
        ring = list(zip(c, c[1:] + c[:1], strict=True)) if len(c) == 3 else [tuple(c)]
        local = c + [mid[frozenset(p)] for p in ring]
        faces.append(cells[on[cells[:, c]].all(axis=1)][:, local])
    assert k > corners
    return np.concatenate(faces)


def stiffness(points, cells, E, nu):
    """Stiffness (d n, d n) of straight quadratic simplices; in the plane: plane strain."""
    d = points.shape[1]
    corners = d + 1
    lam, mu = E * nu / (1 + nu) / (1 - 2 * nu), E / 2 / (1 + nu)
    edge = points[cells[:, 1:corners]] - points[cells[:, :1]]
    volume = np.abs(np.linalg.det(edge)) / np.prod(np.arange(1, d + 1))
    grad = np.concatenate(
        [-np.linalg.inv(edge).sum(2)[:, None, :], np.linalg.inv(edge).transpose(0, 2, 1)], 1
    )
    a, b = ((5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20) if d == 3 else (1 / 6, 2 / 3)
    k = cells.shape[1]
    K = np.zeros((len(cells), k, d, k, d))
    for q in range(corners):
        L = np.full(corners, a)
        L[q] = b
        G = np.concatenate(
            [(4 * L[:, None] - 1) * grad]
            + [4 * (L[i] * grad[:, j] + L[j] * grad[:, i])[:, None] for i, j in EDGES[corners]],
            1,
        )
        dot = np.einsum("cai,cbi->cab", G, G)
        block = lam * np.einsum("cai,cbj->caibj", G, G) + mu * np.einsum("caj,cbi->caibj", G, G)
        for i in range(d):
            block[:, :, i, :, i] += mu * dot
        K += block * (volume / corners)[:, None, None, None, None]
    dofs = (cells[:, :, None] * d + np.arange(d)).reshape(len(cells), -1)
    rows, cols = np.repeat(dofs, dofs.shape[1], axis=1), np.tile(dofs, (1, dofs.shape[1]))
    n = d * len(points)
    return sp.coo_matrix((K.ravel(), (rows.ravel(), cols.ravel())), shape=(n, n)).tocsr()


def flexibility(K, fixed, P):
    """P^T K^-1 P with the fixed freedoms removed, by MUMPS Cholesky."""
    free = np.setdiff1d(np.arange(K.shape[0]), fixed)
    A, B = K[free][:, free].tocsr(), P.tocsr()[free].toarray()
    A.sum_duplicates()
    mat = PETSc.Mat().createAIJ(
        A.shape, csr=(A.indptr.astype("i4"), A.indices.astype("i4"), A.data), comm=PETSc.COMM_SELF
    )
    mat.setOption(PETSc.Mat.Option.SPD, True)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOperators(mat)
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    pc.setUp()
    X = PETSc.Mat().createDense(B.shape, comm=PETSc.COMM_SELF)
    X.setUp()
    pc.getFactorMatrix().matSolve(
        PETSc.Mat().createDense(B.shape, array=B.copy(order="F"), comm=PETSc.COMM_SELF), X
    )
    return B.T @ X.getDenseArray()


def block(x, depth, y=None, sign=1):
    """Points (n, 3), quadratic cells and the faces at depth 0 of a block over the grid x (and
    y).
    """
    axes = [x] if y is None else [x, y]
    flat, cells = quadratic(*simplices(*axes, depth))
    corners = flat.shape[1] + 1
    faces = surface(flat, cells, corners, corners - 2, 0.0)
    points = np.zeros((len(flat), 3))
    points[:, : flat.shape[1]] = flat
    points[:, flat.shape[1] - 1] *= sign
    return points, cells, faces


def facing_blocks(x, depth, y=None, upper=None):
    """Mesh of two blocks over the grid x (and y), `depth` the grid of distances from the contact
    plane.

    upper: another (x, depth, y) for the upper block, which then does not match.
    """
    low, cells, top = block(x, depth, y, -1)
    high, over, bottom = block(*(upper or (x, depth, y)))
    n, matched = len(low), np.unique(top)
    nodes = np.zeros((2, 0), int) if upper else np.stack([matched, matched + n])
    return Mesh(
        points=np.vstack([low, high]),
        cell_type="triangle6" if y is None else "tetra10",
        bodies={"blade": cells, "damper": over + n},
        faces={"seat_right": top, "damper_left": bottom + n},
        pairs={"this": Pair("seat_right", "damper_left", nodes, np.eye(3), np.zeros(3))},
    )


def compliances(mesh, patch, E, nu, hold, nodes=slice(None), tangential=False):
    """Flexibilities (blade, damper) at the normal (or t1) ports of some nodes; hold(points) gives
    the held freedoms.

    Freedoms are numbered within each body; an E of None is a rigid body without flexibility.
    """
    d, out = mesh.dimension, []
    columns = (normal_ports([patch], mesh) + tangential)[nodes]
    for side, e, v in zip(("blade", "damper"), E, nu, strict=True):
        if e is None:
            out.append(np.zeros((len(columns),) * 2))
            continue
        used, local = np.unique(mesh.bodies[side], return_inverse=True)
        points = mesh.points[used][:, :d]
        P = port_matrix([patch], mesh, side)[:, columns].tocsr()
        rows = (used[:, None] * d + np.arange(d)).ravel()
        K = stiffness(points, local.reshape(mesh.bodies[side].shape), e, v)
        out.append(flexibility(K, hold(points), P[rows]))
    return out


def rollers(points):
    """Normal displacement held on the far side and on the planes x = 0 (and y = 0): uniform
    compression is free.
    """
    d = points.shape[1]
    far = np.abs(points[:, d - 1]).max()
    out = [np.flatnonzero(np.isclose(np.abs(points[:, d - 1]), far)) * d + d - 1]
    return np.unique(
        np.concatenate(
            out + [np.flatnonzero(np.isclose(points[:, k], 0)) * d + k for k in range(d - 1)]
        )
    )


def clamped(points):
    """All held on the far side; symmetry at x = 0 (and y = 0)."""
    return held(points, np.abs(points[:, -1]).max())


def clamped_odd(points):
    """All held on the far side; antisymmetry at x = 0 of a plane block: only the normal
    displacement is held there.
    """
    far = np.flatnonzero(np.isclose(np.abs(points[:, 1]), np.abs(points[:, 1]).max()))
    middle = np.flatnonzero(np.isclose(points[:, 0], 0.0))
    return np.unique(np.concatenate([2 * far, 2 * far + 1, 2 * middle + 1]))


def held(points, depth):
    """Freedoms (d n numbering) held by symmetry at x = 0 (and y = 0) and by the far side, z =
    +-depth.
    """
    d = points.shape[1]
    out = [np.flatnonzero(np.isclose(np.abs(points[:, d - 1]), depth)) * d + k for k in range(d)]
    out += [np.flatnonzero(np.isclose(points[:, k], 0.0)) * d + k for k in range(d - 1)]
    return np.unique(np.concatenate(out))
