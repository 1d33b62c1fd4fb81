"""SLEPc on the same pencils: an independent eigensolver with MUMPS behind it."""

import numpy as np
import pytest
from structured import sector

from bladefem.fem.body import assemble
from bladefem.fem.compat import SLEPc
from bladefem.fem.constraint import at_diameter, transformation
from bladefem.fem.linalg import Doubled
from bladefem.fem.modes import modes
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
