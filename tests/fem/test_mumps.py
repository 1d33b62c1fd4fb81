"""What MUMPS cannot do becomes one sentence, with its own code in it."""

import numpy as np
import pytest
from structured import box

from bladefem.errors import NotSolvedError
from bladefem.fem import mumps
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI, PETSc
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import flexible
from bladefem.scene.tables import Material


@pytest.fixture(scope="module")
def bar():
    return constrain(
        assemble(box((6, 2, 2), (0.1, 0.02, 0.02)), "blade", Material(), MPI.COMM_SELF)
    )


def test_out_of_memory(bar, monkeypatch):
    """A workspace below MUMPS's own estimate: the code of a real machine without memory is among
    the same.
    """
    monkeypatch.setattr(mumps, "EXTRA_MEMORY_PERCENTS", (-95,))
    monkeypatch.setattr(mumps, "EXACT_MEMORY_PERCENTS", (-97, -95))
    with pytest.raises(
        NotSolvedError, match=r"memory ran out.* fewer unknowns \(INFOG\(1\) = -\d+"
    ):
        flexible(bar)


def test_estimate_exceeded(bar, monkeypatch):
    """Where the room by MUMPS's estimate is too little, as on some small matrices, it gets more."""
    load = np.ones(bar.K.size[0])[:, None]
    usual = mumps.solve_matrix(mumps.factorise_matrix(bar.K, definite=True), load)
    given = []
    real = mumps._set_controls
    monkeypatch.setattr(
        mumps,
        "_set_controls",
        lambda F, percent, *rest: given.append(percent) or real(F, percent, *rest),
    )
    monkeypatch.setattr(mumps, "EXACT_MEMORY_PERCENTS", (-95, 40))
    again = mumps.solve_matrix(mumps.factorise_matrix(bar.K, definite=True), load)
    assert given == [-95, 40]
    np.testing.assert_array_equal(again, usual)


@pytest.mark.parametrize(
    "code, words",
    [
        (-9, "memory ran out"),
        (-13, "memory ran out"),
        (-10, "singular"),
        (-40, "not positive definite"),
        (-99, "the factorisation failed"),
    ],
)
def test_codes_in_words(code, words):
    assert words in mumps._failure_reason(
        code, 7, 1000
    ) and f"INFOG(1) = {code}" in mumps._failure_reason(code, 7, 1000)


def test_petsc_without_mumps(bar, monkeypatch):
    class Without(PETSc.PC):
        def setFactorSetUpSolverType(self):  # what PETSc answers when the package is not there
            raise PETSc.Error(92)

    monkeypatch.setattr(mumps.PETSc, "PC", Without)
    with pytest.raises(NotSolvedError, match="PETSc was built without MUMPS"):
        flexible(bar)
