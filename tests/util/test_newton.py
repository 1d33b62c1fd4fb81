"""The Newton loop: quadratic convergence, and each way to end with its outcome and sentence."""

import numpy as np
import pytest

from bladefem.util.newton import Outcome, StepError, halve_step, iterate_newton


def _run(function, derivative, first, iterations=50, search=True):
    def advance(x):
        step = function(x) / derivative(x)
        if not search:
            return x - step
        return halve_step(
            lambda share: x - share * step,
            lambda trial, _: abs(function(trial)) < abs(function(x)),
            2.0**-8,
        )

    return iterate_newton(first, lambda x: abs(function(x)), advance, 1e-12, iterations)


def test_the_root_of_two():
    run = _run(lambda x: x * x - 2, lambda x: 2 * x, 1.0)
    assert run.converged
    assert run.state == pytest.approx(np.sqrt(2), abs=1e-12)
    assert run.iterations <= 6
    assert run.reason == "residual within tolerance"


def test_the_line_search_saves_a_step_that_overshoots():
    """Newton's steps on arctan from 3 grow without end."""
    far = _run(np.arctan, lambda x: 1 / (1 + x * x), 3.0, iterations=5, search=False)
    near = _run(np.arctan, lambda x: 1 / (1 + x * x), 3.0)
    assert not far.converged
    assert near.converged
    assert near.state == pytest.approx(0.0, abs=1e-12)


def test_iterations_exhausted():
    run = _run(lambda x: x**4, lambda x: 4 * x**3, 1.0, iterations=3)
    assert run.outcome is Outcome.EXHAUSTED
    assert run.iterations == 3
    assert run.state == pytest.approx(0.75**3)
    assert run.reason == f"residual {run.error:.1e} after 3 iterations"


def test_a_step_too_small_is_a_stall():
    """x^2 + 1 has no root: near its minimum no share of the step lowers it."""
    run = _run(lambda x: x * x + 1, lambda x: 2 * x, 1e-12)
    assert run.outcome is Outcome.STALLED
    assert run.reason.startswith("line search stalled at residual 1.0e+00")


def test_a_residual_that_is_not_finite():
    run = iterate_newton(1.0, lambda x: np.nan, lambda x: x, 1e-12, 5)
    assert run.outcome is Outcome.NOT_FINITE
    assert run.iterations == 0


def test_a_singular_jacobian_ends_with_the_solvers_words():
    def advance(x):
        return x - np.linalg.solve(np.zeros((1, 1)), x)

    run = iterate_newton(np.ones(1), lambda x: float(abs(x).max()), advance, 1e-12, 5)
    assert run.outcome is Outcome.SINGULAR
    assert "ingular" in run.reason


def test_a_step_may_say_itself_why_it_failed():
    def advance(x):
        raise StepError(Outcome.EXHAUSTED, "no convergence in 60 evaluations")

    run = iterate_newton(1.0, abs, advance, 1e-12, 5)
    assert (run.outcome, run.reason) == (Outcome.EXHAUSTED, "no convergence in 60 evaluations")
