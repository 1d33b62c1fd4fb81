"""SLEPc: set up by hand on the doubled pencil with MUMPS behind it, and as the modes use it."""

import numpy as np
import pytest
from structured import box, sector

from bladefem.errors import InputError, NotSolvedError
from bladefem.fem import modes as modal
from bladefem.fem.all_diameters import all_diameters
from bladefem.fem.body import assemble
from bladefem.fem.compat import SLEPc
from bladefem.fem.constraint import at_diameter, constrain, transformation
from bladefem.fem.eigensolver import Eigensolver, krylov_schur
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.lanczos import WantedPairs
from bladefem.fem.linalg import Doubled, apply_block, solve_block
from bladefem.fem.mode_count import _counting_shift as common_shift
from bladefem.fem.modes import BLOCKS, SLEPC, _counting_shift, lowest_pairs, modes, pairs_together
from bladefem.scene.tables import Material


def slepc_frequencies(con, count):
    """Shift-invert at 0 on the (doubled) real pencil [Hz]."""
    K, M = (A.matrix if isinstance(A, Doubled) else A for A in (con.K, con.M))
    eps = SLEPc.EPS().create(K.comm)
    eps.setOperators(K, M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(0.0)
    eps.setDimensions(count)
    eps.setTolerances(1e-12)
    spectral = eps.getST()
    spectral.setType(SLEPc.ST.Type.SINVERT)
    solver = spectral.getKSP()
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    eps.solve()
    return np.sqrt(np.sort([eps.getEigenvalue(i).real for i in range(eps.getConverged())])) / (
        2 * np.pi
    )


@pytest.mark.mpi
@pytest.mark.two_ranks
@pytest.mark.parametrize("n", [0, 1, 3])
def test_same_frequencies(n):
    """Each frequency of the doubled pencil comes once or twice; as a set they are ours."""
    t = transformation(
        assemble(sector(6, (3, 2, 1), bump=0.2), "blade", Material()), "clamp", True, one_core=False
    )
    con = at_diameter(t, n)
    ours, theirs = modes(con, 10).frequencies, slepc_frequencies(con, 24)
    for f in ours:
        assert abs(theirs / f - 1).min() < 1e-9
    for f in theirs[theirs < ours[-1] * (1 + 1e-6)]:
        assert abs(ours / f - 1).min() < 1e-9


def square_beam():
    """Bending modes of a square beam come in pairs of one frequency."""
    return constrain(
        assemble(box((10, 2, 2), (0.3, 0.02, 0.02), "hexahedron27"), "blade", Material())
    )


def test_double_frequencies_are_both_found():
    """One start vector sees one of a pair; the inertia notices, and blocks find the other."""
    found = modes(square_beam(), 6).frequencies
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert found[3] == pytest.approx(found[2], rel=1e-9)
    blocks = modes(square_beam(), 6, solver=BLOCKS).frequencies
    np.testing.assert_allclose(found, blocks, rtol=1e-9)


@pytest.mark.parametrize("n", [0, 3, 6])
def test_slepc_and_blocks_are_the_same(n):
    """Frequencies, and shapes up to the phase that both are given; no pair twice or lost."""
    t = transformation(
        assemble(sector(13, (5, 2, 1), bump=0.2), "blade", Material()), "clamp", True
    )
    con = at_diameter(t, n)
    slepc, blocks = (modes(con, 12, tolerance=1e-9, solver=solver) for solver in (SLEPC, BLOCKS))
    np.testing.assert_allclose(slepc.frequencies, blocks.frequencies, rtol=1e-11)
    scale = abs(blocks.shapes).max()
    np.testing.assert_allclose(slepc.shapes, blocks.shapes, atol=1e-6 * scale)
    assert slepc.residuals.max() < 1e-8


def test_restarts_of_a_complex_pencil_keep_every_pair_single():
    """A basis as small as SLEPc takes: directions that a restart threw away come back."""
    t = transformation(
        assemble(sector(13, (5, 2, 1), bump=0.2), "blade", Material()), "clamp", True
    )
    flex = flexible(at_diameter(t, 4))
    small = Eigensolver(vectors=12)
    wanted = WantedPairs(10, 1e-10)
    lam, X = lowest_pairs(flex, wanted, solver=small)
    exact, _ = lowest_pairs(flex, wanted, solver=BLOCKS)
    np.testing.assert_allclose(lam, exact, rtol=1e-10)
    gram = X.conj().T @ apply_block(flex.con.M, X)
    np.testing.assert_allclose(gram, np.eye(10), atol=1e-10)


@pytest.mark.parametrize("n", [0, 2])
def test_slepc_makes_the_first_solve_itself(n, monkeypatch):
    """A load solved for beforehand would only be one sweep more."""
    flex = flexible(constrain(assemble(sector(8, (4, 3, 1)), "blade", Material()), "clamp", n))
    solves, solved_before = [], []

    def inverse(load):
        solves.append(load)
        return compliance(flex, load)

    def begins(*given):
        solved_before.append(len(solves))
        return krylov_schur(*given)

    monkeypatch.setattr(modal, "krylov_schur", begins)
    lam, _ = lowest_pairs(flex, WantedPairs(4), inverse=inverse)
    assert solved_before == [0]
    np.testing.assert_allclose(lam, lowest_pairs(flex, WantedPairs(4), solver=BLOCKS)[0], rtol=1e-9)


def test_options_of_petsc_reach_the_solver(monkeypatch):
    """An iteration that may not restart says that it did not converge."""
    from bladefem.fem.compat import PETSc

    con = constrain(assemble(box((12, 2, 2), (0.3, 0.02, 0.03), "tetra10"), "blade", Material()))
    try:
        with pytest.raises(NotSolvedError, match="SLEPc found . of 10 modes: too many restarts"):
            modes(con, 10, solver=Eigensolver(options="-eps_max_it 1 -eps_ncv 12 -eps_tol 1e-13"))
    finally:
        for name in ("eps_max_it", "eps_ncv", "eps_tol"):
            PETSc.Options().delValue(name)


def test_a_misspelt_option_is_refused():
    """PETSc keeps it in silence."""
    from bladefem.fem.compat import PETSc

    con = constrain(assemble(box((12, 2, 2), (0.3, 0.02, 0.03), "tetra10"), "blade", Material()))
    try:
        with pytest.raises(InputError, match=r"-eps_monitr: .* did you mean .-eps_monitor"):
            modes(con, 4, solver=Eigensolver(options="-eps_tol 1e-9 -eps_monitr"))
        PETSc.Options().delValue("eps_monitr")
        modes(con, 4, solver=Eigensolver(options="-eps_tol 1e-9 -mat_mumps_icntl_14 40"))
    finally:
        for name in ("eps_tol", "eps_monitr", "mat_mumps_icntl_14"):
            PETSc.Options().delValue(name)


@pytest.mark.parametrize("solver", [SLEPC, BLOCKS])
def test_diameters_solved_together_are_those_solved_alone(solver):
    """Real and complex pencils share the sweeps over the factors, not the iterations."""
    t = transformation(
        assemble(sector(12, (5, 2, 2), bump=0.2), "blade", Material()), "clamp", True
    )
    bodies = [flexible(at_diameter(t, n)) for n in (0, 3, 6)]
    wanted = WantedPairs(8, 1e-9, guard=2)
    together = pairs_together(bodies, wanted, solver)
    for flex, (lam, X) in zip(bodies, together, strict=True):
        alone, Y = lowest_pairs(flex, wanted, solver=solver)
        np.testing.assert_allclose(lam[:8], alone[:8], rtol=1e-11)
        overlap = abs(X[:, :8].conj().T @ apply_block(flex.con.M, Y[:, :8]))
        np.testing.assert_allclose(overlap, np.eye(8), atol=1e-6)


@pytest.mark.parametrize("error", [NotSolvedError, KeyboardInterrupt])
def test_what_a_solve_raises_comes_out_of_slepc(error):
    """An exception that went through SLEPc would leave objects that cannot be destroyed."""
    flex = flexible(square_beam())
    left = [3]

    def inverse(B):
        left[0] -= 1
        if left[0] < 0:
            raise error("no")
        return solve_block(flex.factor, B)

    with pytest.raises(error, match="no"):
        lowest_pairs(flex, WantedPairs(4), inverse=inverse)
    assert len(lowest_pairs(flex, WantedPairs(4))[0]) == 4


def test_modes_that_are_missing_below_the_highest_gap_are_counted():
    """Two modes were lost below the highest two found: what is counted below the last gap shows
    it.
    """
    true = np.array([3295.0, 15799, 20930, 49666, 52500, 53190, 98180, 101931]) ** 2
    found = np.r_[true[:6], np.array([111307.0, 159004]) ** 2]
    shift, expected = _counting_shift(found)
    assert expected == 7 and np.count_nonzero(true < shift) == 8
    assert np.count_nonzero(true < common_shift([found, found])) == 8


def test_the_twin_below_the_last_mode_is_not_lost():
    """A sector with two equal frequencies next to the end of the table, where wider gaps are below
    them: single vectors find one of the two, and the count must show it.
    """
    body = assemble(sector(9, (8, 4, 2), "tetra10", straight=True), "blade", Material())
    more = modes(constrain(body, "clamp", 0), 8).frequencies[:6]
    assert more[5] == pytest.approx(more[4], rel=1e-9)
    for found in (modes(constrain(body, "clamp", 0), 6), all_diameters(body, 6, [0])[0]):
        np.testing.assert_allclose(found.frequencies, more, rtol=1e-9)


@pytest.mark.parametrize("cell_type", ["hexahedron", "hexahedron27"])
def test_one_double_eigenvalue_alone(cell_type):
    """Both first bending modes of a square beam, and nothing else to count between: the inertia of
    a shift between the two is rounding.
    """
    body = assemble(box((6, 1, 1), (0.2, 0.02, 0.02), cell_type), "blade", Material())
    more = modes(constrain(body), 4).frequencies
    found = modes(constrain(body), 2).frequencies
    np.testing.assert_allclose(found, more[:2], rtol=1e-8)
    shift = common_shift([(2 * np.pi * found) ** 2] * 2)
    assert not found[0] <= np.sqrt(shift) / (2 * np.pi) <= found[1]
