"""Ranks share one sector: their parts add up to what one rank has, matrix by matrix and solve by
solve.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import sector

from bladefem.errors import NotSolvedError
from bladefem.fem import cyclic_schur as core
from bladefem.fem import mode_count
from bladefem.fem.all_diameters import all_diameters
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import (
    at_diameter,
    restrict_load,
    transformation,
    transformation_about,
    unknowns,
)
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.linalg import apply_block, mean_diagonal
from bladefem.fem.modes import count_below
from bladefem.fem.open_matrix import entries
from bladefem.fem.ports import PortReduction, port_models
from bladefem.fem.rotation import body_under_rotation
from bladefem.scene.tables import Material

pytestmark = pytest.mark.mpi
DIVISIONS = (6, 3, 2)


@pytest.fixture(scope="module", params=["tetra10", "hexahedron27"])
def both(request):
    """The transformation on all ranks, and each rank's own on its own."""
    mesh = sector(8, DIVISIONS, request.param, bump=0.2)
    return [
        transformation(assemble(mesh, "blade", Material(), comm), "clamp", True)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]


def in_mesh(con, X):
    return con.T @ unknowns(con, X)


def loads(con, k=3):
    values = np.random.default_rng(3).standard_normal((con.T.shape[0], k))
    return restrict_load(con, values).astype(con.dtype)


def test_parts_are_shared(both):
    """Each rank has less than the whole; boundaries are those of the mesh's parts."""
    together, alone = (t.opened for t in both)
    ranks = MPI.COMM_WORLD.size
    assert (together.shared is None) == (ranks == 1)
    if ranks > 1:
        inside = MPI.COMM_WORLD.allreduce(len(together.shared.inside))
        boundary = len(together.shared.cut.separator)
        assert inside + boundary == len(alone.places)
        rim = np.count_nonzero(~together.shared.cut.separator)
        assert rim == len(alone.core.rim)
        assert len(together.places) < len(alone.places)


@pytest.mark.parametrize("n", [0, 3, 4])
def test_products_and_solves_are_those_of_one_rank(both, n):
    together, alone = (at_diameter(t, n) for t in both)
    B, C = loads(together), loads(alone)
    for one, other in ((together.K, alone.K), (together.M, alone.M)):
        a = in_mesh(together, apply_block(one, B))
        b = in_mesh(alone, apply_block(other, C))
        np.testing.assert_allclose(a, b, atol=1e-12 * abs(b).max())
    assert mean_diagonal(together.K) == pytest.approx(mean_diagonal(alone.K), rel=1e-12)
    a = in_mesh(together, compliance(flexible(together), B))
    b = in_mesh(alone, compliance(flexible(alone), C))
    np.testing.assert_allclose(a, b, atol=1e-10 * abs(b).max())


def test_without_the_call_back_two_solves_do_the_same(both):
    together = at_diameter(both[0], 3)
    flex = flexible(together)
    B = loads(together)
    rim = flex.factor.parts
    a = core.solve_diameter(rim, B)
    b = core.solve_diameter(replace(rim, core=replace(rim.core, bridge=None)), B)
    np.testing.assert_allclose(a, b, atol=1e-11 * MPI.COMM_WORLD.allreduce(abs(a).max()))


def test_floating_sectors_are_propped_on_the_cut_face():
    mesh = sector(8, DIVISIONS, "tetra10", bump=0.2)
    frames = [
        transformation(assemble(mesh, "blade", Material(), comm), None, True)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]
    together, alone = (at_diameter(t, 1) for t in frames)
    a = in_mesh(together, compliance(flexible(together), loads(together)))
    b = in_mesh(alone, compliance(flexible(alone), loads(alone)))
    np.testing.assert_allclose(a, b, atol=1e-9 * abs(b).max())


def test_all_diameters_and_counts_are_those_of_one_rank(both):
    found, expected = (all_diameters(t, 8) for t in both)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-10)
    shift = (2 * np.pi * 1.01 * expected[2].frequencies[5]) ** 2
    a, b = (count_below(at_diameter(t, 2), shift) for t in both)
    assert a == b


def test_port_models_are_those_of_one_rank(both):
    P, names = _ports(both[1])
    load = np.random.default_rng(4).standard_normal(P.shape[0])
    wanted = PortReduction(P, names, 6, load)
    a, b = (dict(port_models(t, wanted, [0, 2, 4])) for t in both)
    for n in (0, 2, 4):
        np.testing.assert_allclose(a[n].omega, b[n].omega, rtol=1e-10)
        np.testing.assert_allclose(
            a[n].residual, b[n].residual, atol=1e-9 * abs(b[n].residual).max()
        )
        np.testing.assert_allclose(a[n].shapes, b[n].shapes, atol=1e-6 * abs(b[n].shapes).max())
    a0, b0 = a[0].static_offset, b[0].static_offset
    np.testing.assert_allclose(a0, b0, atol=1e-9 * abs(b0).max())


def test_a_failure_of_one_rank_ends_all(both, monkeypatch):
    opened = both[0].opened
    plain = core.factorise_matrix

    def fails(*args, **kwargs):
        if MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
            raise NotSolvedError("memory ran out")
        return plain(*args, **kwargs)

    monkeypatch.setattr(core, "factorise_matrix", fails)
    with pytest.raises(NotSolvedError, match="memory ran out"):
        opened.elimination.shifted(entries(opened.K))


def test_a_count_that_fails_on_one_rank_ends_all(both, monkeypatch):
    plain = mode_count._count_below

    def fails(*args):
        if MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
            raise NotSolvedError("the shift is an eigenvalue")
        return plain(*args)

    monkeypatch.setattr(mode_count, "_count_below", fails)
    # one for each of up to four ranks
    with pytest.raises(NotSolvedError, match="the shift is an eigenvalue"):
        all_diameters(both[0], 4, [0, 1, 2, 3])


def _ports(t):
    """A few displacements anywhere as ports."""
    import scipy.sparse as sp

    places = np.flatnonzero(np.diff(t.low.indptr))[:: len(t.low.indptr) // 12][:9]
    P = sp.csc_matrix(
        (np.ones(len(places)), (places, np.arange(len(places)))), (t.low.shape[0], len(places))
    )
    return P, {"all": slice(0, len(places))}


def test_a_stiffness_put_in_later_is_shared_as_the_first(both):
    """The parts of a sector under rotation are those at rest, whose own stiffness stays."""
    together = both[0]
    load = loads(at_diameter(together, 3))
    before = apply_block(at_diameter(together, 3).K, load)
    body = body_under_rotation(together.body, 3000.0, linear=True)
    found, expected = (
        at_diameter(t, 3)
        for t in (transformation_about(together, body), transformation(body, "clamp", True))
    )
    for one, other in ((found.K, expected.K), (found.M, expected.M)):
        a, b = (in_mesh(found, apply_block(A, load)) for A in (one, other))
        np.testing.assert_allclose(a, b, atol=1e-12 * abs(b).max())
    a, b = (in_mesh(con, compliance(flexible(con), load)) for con in (found, expected))
    np.testing.assert_allclose(a, b, atol=1e-10 * abs(b).max())
    np.testing.assert_array_equal(apply_block(at_diameter(together, 3).K, load), before)


def test_products_with_wide_blocks_are_those_of_their_columns(both):
    con = at_diameter(both[0], 3)
    B = loads(con, 9)
    for A in (con.K, con.M):
        wide = apply_block(A, B)
        columns = np.hstack([apply_block(A, B[:, i : i + 1]) for i in range(B.shape[1])])
        assert wide.flags.f_contiguous
        np.testing.assert_allclose(wide, columns, atol=1e-13 * abs(columns).max(initial=1e-30))
