"""Without friction, the mistuned wheel from one sector against the complete mesh of all sectors."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve
from structured import sector, wheel

from bladefem.data import Elements
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.ports import PortReduction, port_model
from bladefem.hbm.model import Damping
from bladefem.scene.tables import Material
from bladefem.wheel.linear_motion import free_wheel
from bladefem.wheel.model import Pattern, engine_order, tuned_wheel

COUNT = 6
ORDER = 2
ALPHA = 50.0


def dof_columns(mesh, node):
    """Unit readings of a node's displacement, (n_points*3, 3)."""
    columns = np.zeros((3 * len(mesh.points), 3))
    columns[3 * node + np.arange(3), np.arange(3)] = 1.0
    return columns


def matrices(body):
    """K and M in mesh numbering."""
    rows = body.scalar_rows
    pick = sp.csr_matrix((np.ones(len(rows)), (np.arange(len(rows)), rows)))

    def whole(A):
        i, j, v = A.getValuesCSR()
        return pick @ sp.csr_matrix((v, j, i), shape=A.getSize()) @ pick.T

    return whole(body.K), whole(body.M)


def test_mistuned_sector_equals_the_complete_mesh():
    """Masses of 5 to 20 % of a sector on one node of each blade, mass-proportional damping."""
    mesh = sector(COUNT, (2, 2, 1), "tetra10", bump=0.2)
    body = assemble(mesh, "blade", Material())
    low, high = mesh.pairs["cyclic"].nodes
    held = np.unique(mesh.faces["clamp"])
    inner = np.setdiff1d(np.arange(len(mesh.points)), np.concatenate([low, high, held]))
    node = int(inner[np.argmax(np.linalg.norm(mesh.points[inner, :2], axis=1))])
    columns = dof_columns(mesh, node)
    P = sp.csc_matrix(np.hstack([columns] * 4))
    names = {
        name: slice(3 * i, 3 * i + 3)
        for i, name in enumerate(("contact", "blade", "load", "probe"))
    }
    sectors = {
        n: port_model(constrain(body, "clamp", n), PortReduction(P, names, 60))
        for n in range(COUNT // 2 + 1)
    }
    K, M = matrices(body)
    mass = M.sum() / 3
    added = mass * np.array([0.05, 0.2, 0.1, 0.0, 0.15, 0.12])
    nothing = np.zeros(1)
    force = np.array([1.0, 0.5, 0.2])
    free = Elements(nothing, nothing, nothing, nothing)
    found_wheel = tuned_wheel(
        COUNT,
        sectors,
        slice(0, 0),
        free,
        {1: engine_order(COUNT, ORDER, force)},
        damping=Damping(mass=ALPHA),
    )
    pattern = Pattern(mass=added[:, None, None] * np.eye(3))
    whole_mesh, number = wheel(mesh)
    complete = assemble(whole_mesh, "blade", Material())
    K, M = matrices(complete)
    fixed = np.unique(whole_mesh.faces["clamp"])
    kept = np.setdiff1d(np.arange(K.shape[0]), (3 * fixed[:, None] + np.arange(3)).ravel())
    omega = 0.97 * sectors[ORDER].omega[0]
    F = np.zeros(K.shape[0], dtype=complex)
    extra = np.zeros(K.shape[0])
    turned = engine_order(COUNT, ORDER, force)
    for s in range(COUNT):
        R = np.linalg.matrix_power(mesh.sector.rotation, s)
        dofs = 3 * number[s, node] + np.arange(3)
        F[dofs] = R @ turned[s]
        extra[dofs] = added[s]
    dynamic = K + 1j * omega * ALPHA * M - omega**2 * (M + sp.diags(extra))
    u = np.zeros(K.shape[0], dtype=complex)
    u[kept] = spsolve(dynamic.tocsc()[kept][:, kept], F[kept])
    found = free_wheel(found_wheel, omega, 1, pattern)[:, 1]
    for s in range(COUNT):
        R = np.linalg.matrix_power(mesh.sector.rotation, s)
        expected = R.T @ u[3 * number[s, node] + np.arange(3)]
        np.testing.assert_allclose(found[s], expected, atol=1e-6 * abs(u).max())
    # the pattern is felt
    tuned = free_wheel(found_wheel, omega, 1)[:, 1]
    assert abs(abs(found) - abs(tuned)).max() > 0.1 * abs(tuned).max()
