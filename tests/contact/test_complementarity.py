"""The complementarity solver against Hertz on a half-space, against its own slow twin, and on
awkward input.
"""

import numpy as np
import pytest
from half_space import rectangle_flexibility, square_grid
from scipy.integrate import simpson

from bladefem.contact import complementarity as lcp
from bladefem.contact.complementarity import solve_lcp
from bladefem.contact.partial_slip import slip_step
from bladefem.errors import InputError

MODULUS, RADIUS, A = 1.0, 1.0, 0.1  # E*, sphere radius, contact radius
FORCE = 4 * MODULUS * A**3 / (3 * RADIUS)
PEAK = 2 * MODULUS * A / (np.pi * RADIUS)


def sphere(n):
    x, y, h = square_grid(n, 1.3 * A)
    C = rectangle_flexibility(x, y, h, h, MODULUS)
    return C, (x**2 + y**2) / (2 * RADIUS), -np.ones((len(x), 1)), np.hypot(x, y), h


def test_hertz_on_a_half_space():
    """h = a/10: peak 0.1 %, L2 1.4 %, approach a^2/R 0.1 % (constant pressure on each cell)."""
    C, g0, R, r, h = sphere(27)
    s = solve_lcp(C, g0, R, [-FORCE])
    p, exact = s.force / h**2, PEAK * np.sqrt(np.clip(1 - (r / A) ** 2, 0, None))
    assert s.reason == "" and s.residual < 1e-12
    assert p.max() == pytest.approx(PEAK, rel=3e-3)
    assert np.linalg.norm(p - exact) < 0.02 * np.linalg.norm(exact)
    assert np.sqrt(s.active.sum() * h**2 / np.pi) == pytest.approx(A, rel=0.03)
    assert s.rigid[0] == pytest.approx(A**2 / RADIUS, rel=2e-3)


def random_problem(seed, n=40, d=3, rank=20):
    """Positive definite but far from an M-matrix, so that plain active-set updates may cycle."""
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((n, rank))
    C = B @ B.T / n + 1e-3 * np.eye(n)
    R = rng.standard_normal((n, d))
    return C, rng.standard_normal(n), R, R.T @ rng.random(n)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("floating", [False, True])
def test_random_problems_are_solved_with_proof(seed, floating):
    C, g0, R, load = random_problem(seed)
    s = solve_lcp(C, g0, R, load) if floating else solve_lcp(C, g0)
    assert s.reason == "" and s.residual < 1e-9
    assert (s.force >= 0).all()
    gap = g0 + C @ s.force + (R @ s.rigid if floating else 0.0)
    assert np.allclose(gap, s.gap, atol=1e-10) and gap.min() > -1e-9
    assert np.abs(s.force * gap).max() < 1e-8 * s.force.max() * np.abs(gap).max()


def test_the_fallback_was_needed_and_agrees():
    """Some of the random problems do cycle; the primal method gives the same answer where both
    work.
    """
    cycled = 0
    for seed in range(40):
        C, g0, R, load = random_problem(seed)
        U, S, V = lcp.held_directions(R)
        reduced = (V.T @ load) / S
        f, _, _, _, settled = lcp._primal_dual(C, g0, U, reduced, np.ones(len(g0), bool), 60)
        twin = lcp._primal_active_set(C, g0, U, reduced)
        assert twin[4]
        cycled += not settled
        if settled:
            assert np.abs(f - twin[0]).max() < 1e-8 * f.max()
    assert cycled > 0


def test_warm_start_needs_fewer_steps():
    C, g0, R, _, _ = sphere(21)
    cold = solve_lcp(C, g0, R, [-FORCE])
    warm = solve_lcp(C, g0, R, [-1.02 * FORCE], start=cold.active)
    assert warm.iterations <= 3 and warm.reason == ""
    again = solve_lcp(C, g0, R, [-1.02 * FORCE])
    assert np.abs(warm.force - again.force).max() < 1e-12 * again.force.max()


def test_a_held_body_may_stay_open():
    s = solve_lcp(np.eye(3), np.ones(3))
    assert s.reason == "" and (s.force == 0).all() and s.residual == 0


@pytest.mark.parametrize("load", [[1.0], [0.0]])
def test_lift_off_is_a_reason(load):
    s = solve_lcp(np.eye(3), np.zeros(3), -np.ones((3, 1)), load)
    assert "load" in s.reason and not s.active.any()


def test_indefinite_flexibility_is_a_reason():
    assert "positive definite" in solve_lcp(-np.eye(3), -np.ones(3)).reason


def test_cattaneo_mindlin():
    """Stick radius c = a (1 - Q / mu P)^(1/3) and the loop energy by Masing's rule; nu = 0, so C_t
    = C_n.

    Johnson, Contact Mechanics (1985), Sect. 7.2: shift = 3 mu P / (16 a G*) (1 - (1 - Q / mu
    P)^(2/3)) with 1 / G* = sum (2 - nu) / G, here 4 / E* for one half-space with nu = 0 and a rigid
    sphere.
    """
    C, g0, R, _, h = sphere(27)
    mu, P = 0.3, FORCE
    limit = mu * solve_lcp(C, g0, R, [-P]).force
    Q = 0.6 * mu * P
    state = slip_step(C, limit, total=Q)
    c = np.sqrt((state.state[limit > 0] == 0).sum() * h**2 / np.pi)
    assert c == pytest.approx(A * (1 - Q / (mu * P)) ** (1 / 3), rel=0.03)

    def law(q):
        return 3 * mu * P / (4 * A * MODULUS) * (1 - (1 - q / (mu * P)) ** (2 / 3))

    assert state.shift == pytest.approx(law(Q), rel=0.01)
    shift, area = state.shift, 0.0
    for target in [*np.linspace(1, -1, 9)[1:] * shift, *np.linspace(-1, 1, 9)[1:] * shift]:
        state = slip_step(C, limit, state, shift=target)
        area += state.work
    q = np.linspace(0, Q, 4001)
    # Masing: the loop is eight times the area between the first loading and its chord
    exact = 8 * (0.5 * Q * law(Q) - simpson(law(q), q))
    assert area == pytest.approx(exact, rel=0.03)
    assert state.force.sum() == pytest.approx(Q, rel=0.01)  # the loop closes


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((np.eye(4), [0, np.nan, 0, 0]), r"g0\[1\] is nan"),
        ((np.nan * np.eye(4), np.zeros(4)), r"C\[0, 0\] is nan"),
        ((np.eye(3), np.zeros(4)), r"C has shape \(3, 3\), expected \(4, 4\)"),
        ((np.eye(4), np.zeros((4, 1))), r"g0 has shape \(4, 1\)"),
        ((np.zeros((0, 0)), []), "g0 is empty"),
        (
            (np.eye(4), np.zeros(4), -np.ones((3, 1)), [-1.0]),
            r"R has shape \(3, 1\), expected \(4, any\)",
        ),
        ((np.eye(4), np.zeros(4), -np.ones((4, 1)), [-1.0, 0.0]), r"load has shape \(2,\)"),
        ((np.eye(4), np.zeros(4), -np.ones((4, 1)), [-np.inf]), r"load\[0\] is -inf"),
        ((np.eye(4), np.zeros(4), -np.ones((4, 1)), [np.nan]), r"load\[0\] is nan"),
        ((np.eye(4), np.zeros(4), None, [-1.0]), "load is given without R"),
        ((np.eye(4), np.zeros(4), None, None, np.ones(3, bool)), r"start has shape \(3,\)"),
    ],
)
def test_contact_problem_that_makes_no_sense(arguments, word):
    with pytest.raises(InputError, match=word):
        solve_lcp(*arguments)


@pytest.mark.parametrize(
    ("C", "limit", "given", "word"),
    [
        (np.eye(2), [1.0, np.nan], {"shift": 1.0}, r"limit\[1\] is nan"),
        (np.eye(2), [1.0, -1.0], {"shift": 1.0}, "limit of a node is -1 N"),
        (np.eye(2), np.ones(2), {"shift": np.nan}, "shift is nan"),
        (np.eye(2), np.ones(2), {"total": np.inf}, "total is inf"),
        (np.eye(2) * np.nan, np.ones(2), {"shift": 1.0}, r"C\[0, 0\] is nan"),
        (np.eye(3), np.ones(2), {"shift": 1.0}, r"C has shape \(3, 3\)"),
        (-np.eye(2), np.ones(2), {"shift": 1.0}, "C is not positive definite"),
        (
            np.eye(2),
            np.ones(2),
            {"shift": 1.0, "before": slip_step(np.eye(3), np.ones(3), shift=0.1)},
            r"before\.force",
        ),
    ],
)
def test_slip_that_makes_no_sense(C, limit, given, word):
    with pytest.raises(InputError, match=word):
        slip_step(C, np.array(limit), **given)


def test_slip_step_input():
    with pytest.raises(InputError, match="exactly one"):
        slip_step(np.eye(2), np.ones(2))
    with pytest.raises(InputError, match="limits' sum"):
        slip_step(np.eye(2), np.ones(2), total=3.0)
