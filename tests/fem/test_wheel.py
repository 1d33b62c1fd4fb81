"""All nodal diameters from a few: the same as each solved from scratch, and nothing lost."""

from dataclasses import replace

import numpy as np
import pytest
from structured import sector

from bladefem.errors import InputError, NotSolvedError
from bladefem.fem import all_diameters as wheel
from bladefem.fem import mode_count
from bladefem.fem.all_diameters import all_diameters, eigenpairs
from bladefem.fem.body import assemble
from bladefem.fem.constraint import at_diameter, constrain, transformation
from bladefem.fem.linalg import COLUMNS_AT_A_TIME, apply_block
from bladefem.fem.modes import count_below, modes
from bladefem.scene.tables import Material


@pytest.mark.mpi
@pytest.mark.two_ranks
@pytest.mark.parametrize("count, clamp", [(13, "clamp"), (14, None)])
def test_warm_start_equals_direct(count, clamp):
    """Frequencies, phases and shapes, for odd and even numbers of sectors, held and floating."""
    body = assemble(sector(count, (4, 2, 1), bump=0.2), "blade", Material())
    warm = all_diameters(body, 9, clamp=clamp)
    cold = all_diameters(body, 9, clamp=clamp, direct=True)
    assert [m.nodal_diameter for m in warm] == list(range(count // 2 + 1))
    for a, b in zip(warm, cold, strict=True):
        np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-10)
        np.testing.assert_allclose(
            a.shapes, b.shapes, atol=1e-4 * abs(b.shapes).max()
        )  # 5e-6 over relative gaps
        assert max(a.residuals.max(), b.residuals.max()) < 5e-5


@pytest.mark.mpi
@pytest.mark.two_ranks
def test_one_core_equals_three_matrices():
    """The interior eliminated once, and the doubled pencil of each diameter."""
    body = assemble(sector(9, (3, 2, 1), bump=0.2), "blade", Material())
    one, three = (
        all_diameters(transformation(body, "clamp", True, one_core=flag), 7)
        for flag in (None, False)
    )
    for a, b in zip(one, three, strict=True):
        np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-10)


@pytest.mark.parametrize("count", [3, 24, 36])
def test_sectors_with_fewer_unknowns_than_guesses(count):
    """The motions of three nodal diameters span all of a sector of 36 degrees of freedom."""
    body = assemble(sector(13, (3, 2, 1), "hexahedron"), "blade", Material())
    some = all_diameters(body, count)
    for a, b in zip(some, all_diameters(body, count, direct=True), strict=True):
        assert len(a.frequencies) == count
        np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-9)


@pytest.mark.mpi
def test_cut_faces_that_are_held():
    """Nothing joins the sectors: the modes of one alone in each nodal diameter."""
    mesh = sector(9, (3, 2, 2), "hexahedron")
    held = np.concatenate([mesh.faces["y0"], mesh.faces["y1"]])
    body = assemble(replace(mesh, faces={**mesh.faces, "clamp": held}), "blade", Material())
    alone = modes(constrain(body, "clamp"), 5).frequencies
    for found in all_diameters(body, 5):
        np.testing.assert_allclose(found.frequencies, alone, rtol=1e-9)


def test_chosen_diameters_keep_their_order():
    body = assemble(sector(8, (2, 2, 1)), "blade", Material())
    assert [m.nodal_diameter for m in all_diameters(body, 3, [4, 0, 2])] == [4, 0, 2]
    with pytest.raises(InputError, match="nodal_diameter is 5"):
        all_diameters(body, 3, [5])
    with pytest.raises(InputError, match="count is 0"):
        all_diameters(body, 0)


def test_a_lost_mode_is_noticed_and_found():
    t = transformation(assemble(sector(8, (3, 2, 1), bump=0.2), "blade", Material()), "clamp", True)
    found = {p.con.nodal_diameter: p for p in eigenpairs(t, 6, [0, 1, 2])}
    whole = found[1]
    found[1] = replace(whole, lam=np.delete(whole.lam, 2), X=np.delete(whole.X, 2, axis=1))
    repaired = wheel._check_inertia(t, dict(found), 6)[1]
    np.testing.assert_allclose(repaired.lam[:6], whole.lam[:6], rtol=1e-10)


def test_factors_of_cut_faces_go_with_their_diameter(monkeypatch):
    """Kept of all nodal diameters they were a tenth of the memory; a reduction that follows has
    them.
    """
    body = assemble(sector(8, (3, 2, 1), bump=0.2), "blade", Material())
    counted = []
    plain = wheel._check_inertia

    def look(t, found, *rest):
        counted.append([p.flex is None for p in found.values()])
        return plain(t, found, *rest)

    monkeypatch.setattr(wheel, "_check_inertia", look)
    a = all_diameters(body, 3)
    b = all_diameters(body, 3, kept=wheel.KeptPairs(3))
    assert all(counted[0]) and not any(counted[1])
    for one, other in zip(a, b, strict=True):
        np.testing.assert_allclose(one.frequencies, other.frequencies, rtol=1e-9)


def test_products_a_few_columns_at_a_time():
    """Of real and complex pencils, also of real vectors."""
    t = transformation(assemble(sector(8, (2, 2, 1), bump=0.2), "blade", Material()), "clamp", True)
    random = np.random.default_rng(3)
    for n in (0, 3):
        con = at_diameter(t, n)
        X = np.asfortranarray(random.standard_normal((con.T.shape[1], 2 * COLUMNS_AT_A_TIME + 1)))
        for A in (con.K, con.M):
            apart = np.hstack([apply_block(A, X[:, [i]]) for i in range(X.shape[1])])
            whole = apply_block(A, X)
            assert whole.dtype == con.dtype
            np.testing.assert_allclose(whole, apart, rtol=1e-12, atol=1e-12 * abs(apart).max())


def test_guesses_wait_in_half_the_memory(monkeypatch):
    """In single precision, and no space beside them once no more guesses are made."""
    body = assemble(sector(16, (3, 2, 1), bump=0.2), "blade", Material())
    given = {}
    plain = wheel.lowest_pairs

    def look(flex, wanted, start, *rest):
        given[flex.con.nodal_diameter] = None if start is None else start.dtype
        return plain(flex, wanted, start, *rest)

    monkeypatch.setattr(wheel, "lowest_pairs", look)
    all_diameters(body, 4)
    assert {n: np.dtype(d).itemsize for n, d in given.items() if d is not None} == dict.fromkeys(
        given, 8
    )
    assert len(given) == 9 - wheel.SOLVED_DIAMETERS_BY_LEVEL[0]


def test_inertia_counts_like_the_spectrum():
    t = transformation(assemble(sector(8, (3, 2, 1), bump=0.2), "blade", Material()), "clamp", True)
    for p in eigenpairs(t, 8, [0, 1, 4]):
        for k in (1, 4, 7):
            assert count_below(p.con, (p.lam[k - 1] + p.lam[k]) / 2) == k


def test_a_wrong_count_is_an_error(monkeypatch):
    body = assemble(sector(8, (2, 2, 1), bump=0.2), "blade", Material())
    monkeypatch.setattr(mode_count, "_count_below", lambda *_: 99)
    with pytest.raises(NotSolvedError, match="the inertia counts 99"):
        all_diameters(body, 3, [0, 1])
