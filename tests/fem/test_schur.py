"""Solves through the rim's reduced system, and factorisations in a given order."""

import signal
from dataclasses import replace

import numpy as np
import pytest
from structured import sector

from bladefem.fem import cyclic_schur as core
from bladefem.fem import ordering, schur
from bladefem.fem.body import assemble
from bladefem.fem.constraint import at_diameter, transformation
from bladefem.fem.flexibility import flexible
from bladefem.fem.modes import modes
from bladefem.fem.schur import solve_through_boundary
from bladefem.scene.tables import Material


def opened(divisions=(4, 3, 1)):
    return transformation(
        assemble(sector(8, divisions, bump=0.2), "blade", Material()), "clamp", True
    )


@pytest.mark.parametrize("n", [0, 1, 4])
@pytest.mark.parametrize("columns", [1, 40])
def test_one_sweep_each_way_equals_two_solves(n, columns):
    rim = flexible(at_diameter(opened(), n)).factor.parts
    size = len(rim.faces.inner) + len(rim.faces.masters)
    B = np.random.default_rng(1).standard_normal((size, columns)) + (1j if n == 1 else 0)
    assert rim.core.bridge is not None
    X = core.solve_diameter(replace(rim, core=replace(rim.core, bridge=None)), B)
    np.testing.assert_allclose(core.solve_diameter(rim, B), X, atol=1e-11 * abs(X).max())


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
def test_what_the_answer_raises_comes_through(error):
    """An interrupt too: ctypes would drop it and hand PETSc a random error code."""
    made = opened().opened.core.bridge

    def fails(r):
        raise error("on purpose")

    B = np.ones((made.factor.matrix.size[0], 1))
    with pytest.raises(error, match="on purpose"):
        solve_through_boundary(made, B, fails)
    assert solve_through_boundary(made, B, lambda r: r).shape == B.shape


def test_a_signal_waits_for_the_end_of_the_sweep():
    """Its handler must not raise at the entry of the call back, where nothing can catch it; here it
    would at once.
    """
    made = opened().opened.core.bridge
    B, done = np.ones((made.factor.matrix.size[0], 1)), []

    def stop(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        with pytest.raises(KeyboardInterrupt):
            solve_through_boundary(
                made, B, lambda r: (signal.raise_signal(signal.SIGTERM), done.append(1), r)[-1]
            )
        assert done and signal.getsignal(signal.SIGTERM) is stop
    finally:
        signal.signal(signal.SIGTERM, before)
    assert solve_through_boundary(made, B, lambda r: r).shape == B.shape


def test_where_petsc_does_not_call_back_two_solves_take_its_place(monkeypatch):
    """The places of the dense solve in its table of operations could move again."""
    expected = modes(at_diameter(opened(), 1), 3).frequencies
    monkeypatch.setattr(schur, "MATSOLVE", ())
    schur._petsc_calls_back.cache_clear()
    try:
        other = opened()
        assert other.opened.core.bridge is None
        found = modes(at_diameter(other, 1), 3).frequencies
    finally:
        schur._petsc_calls_back.cache_clear()
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_a_sweep_is_tried_once_and_on_a_small_matrix(monkeypatch):
    """A sector's own would cost as much as one of SLEPc's steps."""
    opened().opened.core
    solved = []
    monkeypatch.setattr(
        schur, "solve_matrix", lambda factor, *_, **__: solved.append(factor.matrix.size[0])
    )
    assert opened().opened.core.bridge is not None
    schur._petsc_calls_back.cache_clear()
    try:
        assert opened().opened.core.bridge is None
    finally:
        schur._petsc_calls_back.cache_clear()
    assert solved == [3]


def test_given_order_gives_the_same_modes(monkeypatch):
    """Nested dissection puts the interior first, is taken by MUMPS (ordering 1), and changes
    nothing else.
    """
    own = opened()
    monkeypatch.setattr(ordering, "MIN_METIS_UNKNOWNS", 0)
    given = opened()
    found, kept = given.opened.core, own.opened.core
    assert kept.order is None and found.factor.ordering == 1
    assert sorted(found.order) == list(range(len(found.order)))
    assert found.order[found.rim].min() == len(found.inner)
    a, b = (modes(at_diameter(t, 3), 6).frequencies for t in (own, given))
    np.testing.assert_allclose(a, b, rtol=1e-11)


def test_the_order_is_found_from_the_mass(monkeypatch):
    """It joins the same nodes as the stiffness, which is not read for that: the order is the
    same.
    """
    seen = []
    plain = ordering.chosen_rows
    monkeypatch.setattr(ordering, "MIN_METIS_UNKNOWNS", 0)
    monkeypatch.setattr(ordering, "chosen_rows", lambda A, rows: seen.append(A) or plain(A, rows))
    found = opened((5, 3, 2)).opened
    assert len(seen) == 1 and seen[0] is found.M
    rim, nodes = found.elimination.rim, found.places // 3
    expected = ordering.interior_first(found.K, rim, nodes)
    assert seen[1] is found.K
    np.testing.assert_array_equal(found.elimination.order, expected)


def test_factors_that_were_given_back_are_made_again():
    """A count may take their memory; what comes later finds them."""
    t = opened()
    con = at_diameter(t, 3)
    first = t.opened.core
    a = modes(con, 6).frequencies
    assert t.opened.core is not first
    kept = flexible(con)
    b = modes(con, 6, kept).frequencies
    assert t.opened.core is kept.factor.parts.core
    np.testing.assert_allclose(a, b, rtol=1e-11)


def test_cut_faces_fold_as_the_triple_product_says():
    """What the first nodal diameter leaves for the others is theirs, and a map from the bare matrix
    of one nodal diameter says the same.
    """
    t = opened()
    S = t.opened.core.S
    for n in [1, 0, 3, 4]:
        stiffness = at_diameter(t, n).K
        C = stiffness.C[t.opened.core.rim][:, stiffness.faces.masters].toarray()
        plain = C.conj().T @ S @ C
        for faces in (stiffness.faces, core.face_map(stiffness.C)):
            np.testing.assert_array_equal(faces.C.toarray(), C)
            found = core._folded_complement(t.opened.core, faces)
            assert found.dtype == plain.dtype
            np.testing.assert_allclose(found, plain, atol=1e-14 * abs(plain).max())
