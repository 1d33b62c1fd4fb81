"""Reduction to ports against the full model."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from structured import box, sector

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import at_diameter, constrain, restrict_load, transformation
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.linalg import combined, factorise, inner_products, solve_block
from bladefem.fem.modes import modes
from bladefem.fem.ports import PortReduction, port_model, port_models
from bladefem.scene.tables import Material

CASES = [
    ("sector", 0, "clamp"),
    ("sector", 1, "clamp"),
    ("sector", 1, None),
    ("sector", 0, None),
    ("box", None, None),
    ("box", None, "clamp"),
]


def model(kind, n, clamp):
    """A constrained body and 9 port vectors on it."""
    mesh = sector(5, (2, 2, 1), bump=0.2) if kind == "sector" else box((3, 1, 1), (0.1, 0.02, 0.02))
    con = constrain(assemble(mesh, "blade", Material()), clamp, n)
    nodes = np.unique(mesh.faces["x1"])[[0, 2, 5]]
    P = sp.lil_matrix((3 * len(mesh.points), 9))
    for i, node in enumerate(nodes):
        P[3 * node : 3 * node + 3, 3 * i : 3 * i + 3] = np.linalg.qr(
            np.random.default_rng(i).normal(size=(3, 3))
        )[0]
    return con, P.tocsr(), {"contact": slice(0, 6), "probe": slice(6, 9)}


def full_receptance(con, P, w):
    """P^T (K - w^2 M)^-1 P by a direct solve."""
    F = restrict_load(con, P).astype(con.dtype)
    return inner_products(
        con.body.comm, F, solve_block(factorise(combined(con.K, -(w**2), con.M), definite=False), F)
    )


def receptance(ports, w):
    return (ports.shapes / (ports.omega**2 - w**2)) @ ports.shapes.conj().T + ports.residual


@pytest.mark.parametrize("kind, n, clamp", CASES)
def test_all_modes_are_the_full_model(kind, n, clamp):
    con, P, names = model(kind, n, clamp)
    w = 0.37 * 2 * np.pi * modes(con, 8).frequencies[7]
    ports = port_model(con, PortReduction(P, names, con.T.shape[1]))
    exact = full_receptance(con, P, w)
    np.testing.assert_allclose(receptance(ports, w), exact, atol=1e-10 * abs(exact).max())


@pytest.mark.parametrize("kind, n, clamp", CASES)
def test_rubin_is_statically_exact_with_few_modes(kind, n, clamp):
    con, P, names = model(kind, n, clamp)
    ports = port_model(con, PortReduction(P, names, 12))
    low = (
        0.001 * 2 * np.pi * modes(con, 8).frequencies[7]
    )  # leaves (w / omega_13)^2 of the residual part
    exact = full_receptance(con, P, low)
    np.testing.assert_allclose(receptance(ports, low), exact, atol=1e-8 * abs(exact).max())
    np.testing.assert_array_equal(ports.residual, ports.residual.conj().T)
    assert np.linalg.eigvalsh(ports.residual)[0] > -1e-12 * abs(ports.residual).max()


@pytest.mark.parametrize("kind, n, clamp", CASES)
def test_craig_bampton_is_statically_exact_and_complete(kind, n, clamp):
    con, P, names = model(kind, n, clamp)
    f = modes(con, 8).frequencies
    low, within = (2 * np.pi * f[7] * factor for factor in (0.001, 0.37))
    few, all_ = (
        port_model(con, PortReduction(P, names, count, kind="craig-bampton"))
        for count in (6, con.T.shape[1] - 9)
    )
    exact = full_receptance(con, P, low)
    np.testing.assert_allclose(receptance(few, low), exact, atol=1e-7 * abs(exact).max())
    exact = full_receptance(con, P, within)
    np.testing.assert_allclose(receptance(all_, within), exact, atol=1e-9 * abs(exact).max())


def test_static_flexibility_and_offset():
    con, P, names = model("sector", 0, "clamp")
    load = np.random.default_rng(1).normal(size=con.T.shape[0])
    ports = port_model(con, PortReduction(P, names, 5, static_load=load))
    F, loaded = (restrict_load(con, sp.csc_matrix(B)) for B in (P, load[:, None]))
    moved = inner_products(con.body.comm, F, compliance(flexible(con), loaded))
    np.testing.assert_allclose(ports.static_offset, moved[:, 0], rtol=1e-9)


@pytest.mark.mpi
@pytest.mark.two_ranks
@pytest.mark.parametrize(
    "kind, clamp", [("rubin", "clamp"), ("rubin", None), ("craig-bampton", "clamp")]
)
def test_shared_sweep_equals_each_alone(kind, clamp):
    """Ports inside and on the cut faces, five diameters at once and one by one."""
    mesh = sector(9, (3, 2, 1), bump=0.2)
    t = transformation(assemble(mesh, "blade", Material()), clamp, True)
    nodes = [
        *np.unique(mesh.faces["x1"])[[0, 3]],
        mesh.pairs["cyclic"].nodes[0, -1],
        mesh.pairs["cyclic"].nodes[1, -2],
    ]
    places = (3 * np.array(nodes)[:, None] + np.arange(3)).ravel()
    P = sp.csr_matrix((np.ones(12), (places, np.arange(12))), shape=(3 * len(mesh.points), 12))
    load = np.random.default_rng(1).normal(size=P.shape[0])
    wanted = PortReduction(P, {"contact": slice(0, 12)}, 8, load, kind)
    together = dict(port_models(t, wanted, [0, 1, 2, 3, 4]))
    for n, a in together.items():
        alone = wanted if n == 0 else replace(wanted, static_load=None)
        b = port_model(at_diameter(t, n), alone)
        # the upper Craig-Bampton values belong to nearly dependent columns, and MUMPS on several
        # ranks does not round alike twice (5e-10 to 2e-9 seen there): of these the eight that were
        # asked for count, the rest by what follows
        np.testing.assert_allclose(a.omega[:8], b.omega[:8], rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(
            a.residual, b.residual, atol=1e-8 * max(abs(b.residual).max(), 1e-12)
        )
        if kind == "rubin":
            np.testing.assert_allclose(a.shapes, b.shapes, atol=1e-6 * abs(b.shapes).max())
        else:  # eigenvectors of the small matrices have no sign or phase of their own: what they give together has
            w2 = (0.3 * b.omega[0]) ** 2
            one, other = ((m.shapes / (m.omega**2 - w2)) @ m.shapes.conj().T for m in (a, b))
            np.testing.assert_allclose(one, other, atol=1e-8 * abs(other).max())
        assert (a.static_offset is None) == (n != 0)
    np.testing.assert_allclose(
        together[0].static_offset,
        port_model(at_diameter(t, 0), PortReduction(P, {}, 2, load)).static_offset,
        rtol=1e-8,
    )


def test_props_of_a_floating_body_leave_no_trace():
    con, P, names = model("box", None, None)
    wanted = PortReduction(P, names, 12)
    soft, hard = (port_model(con, wanted, flexible(con, prop=p)) for p in (0.01, 100.0))
    np.testing.assert_allclose(soft.omega, hard.omega, rtol=1e-10)
    np.testing.assert_allclose(soft.residual, hard.residual, atol=1e-10 * abs(hard.residual).max())


def test_bad_port_vectors_are_refused():
    con, P, names = model("box", None, "clamp")
    with pytest.raises(InputError, match="rows, expected"):
        port_model(con, PortReduction(P[:-3], names, 5))
    with pytest.raises(InputError, match="did you mean 'rubin'"):
        port_model(con, PortReduction(P, names, 5, kind="ruben"))
