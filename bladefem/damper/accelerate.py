"""Iterations on the platform motion: Picard, the paper's discrete Newton (Eq. 34) in three
readings, and better ones.

Eq. 34 does not say what a division of vectors is. Read by amplitude of each component (phases from
the map), as a complex secant, or on real and imaginary parts apart, it behaves differently; none
converges everywhere. Its stopping rule, Eq. 35, measures a step, and a small step is no
equilibrium: accept on the residual (criterion="residual"). Anderson mixing works on the same map.
``describing`` is Newton on the additive equation, with the derivative of the damper's describing
function by differences: no quotient, no spurious fixed point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bladefem.errors import InputError
from bladefem.hbm.solution import probe_motion
from bladefem.util.newton import Outcome, StepError, halve_step, iterate_newton

from .paper import DamperResponse, PlatformSide, balance, damper_response, equivalent, residual

# growth over the free motion at which an iteration is given up
DIVERGED_GROWTH = 1e4
# step share below which Newton's search direction is given up
SHORTEST_STEP_SHARE = 2.0**-7


@dataclass(frozen=True)
class Rules:
    """How the loop runs and when it stops."""

    # one K_ad, C_ad for all harmonics, or one pair for each
    averaged: bool = True
    # "step" (Eq. 35) or "residual" of the equilibrium
    criterion: str = "step"
    # of the criterion, relative [1]; the paper's 2 %
    tolerance: float = 0.02
    # evaluations of the map
    most: int = 60
    # how the damper is solved: "march" from rest (the paper's) or "shooting"
    damper: str = "shooting"
    # time steps a period of the march
    steps: int = 512

    def __post_init__(self) -> None:
        for name, choices in (
            ("criterion", ("step", "residual")),
            ("damper", ("march", "shooting")),
        ):
            if getattr(self, name) not in choices:
                raise InputError(
                    f"{name} = '{getattr(self, name)}': expected one of {', '.join(choices)}"
                )


@dataclass(frozen=True)
class Iterated:
    """Result of an iteration, converged or not."""

    method: str
    # (H, n) platform motion [m]
    u: np.ndarray
    # (H + 1, probes) response of the blade [m]
    probe: np.ndarray
    # by its own criterion
    converged: bool
    # equilibrium |u - u_free + G f(u)| / |u| with the periodic damper motion [1]
    residual: float
    # evaluations of the damper
    iterations: int
    # periods of the damper that were integrated
    periods: int
    reason: str
    # left side of Eq. 35 over the motion, turn by turn [1]
    steps: tuple[float, ...] = ()

    @property
    def false(self) -> bool:
        """Said to have converged, though the equilibrium is violated by more than five times 2
        %.
        """
        return self.converged and not self.residual < 0.1


class _Map:
    """g(u) in the independent platform motions c, packed as a real vector; counts its work."""

    def __init__(
        self,
        side: PlatformSide,
        rules: Rules,
    ):
        self.side = side
        self.rules = rules
        self.calls = 0
        self.periods = 0
        self.last: DamperResponse | None = None
        self.steps: list[float] = []
        self.shape = (len(side.free), len(side.rows))

    def spread(self, c: np.ndarray) -> np.ndarray:
        return np.einsum("hnr,hr->hn", self.side.T, c)

    @property
    def latest(self) -> DamperResponse:
        """The damper's motion under the platform motion that was tried last."""
        if self.last is None:
            raise RuntimeError("no motion of the damper was computed yet")
        return self.last

    def force(self, u: np.ndarray) -> np.ndarray:
        self.last = damper_response(self.side, u, self.rules.damper, steps=self.rules.steps)
        self.calls, self.periods = self.calls + 1, self.periods + self.last.periods
        return self.last.force

    def __call__(self, c: np.ndarray) -> np.ndarray:
        u = self.spread(c)
        stiffness = equivalent(self.force(u), u, self.side.omega, self.rules.averaged)
        return balance(self.side, stiffness)[:, self.side.rows]

    def error(self, c: np.ndarray) -> float:
        u = self.spread(c)
        return float(np.linalg.norm(residual(self.side, u, self.force(u))) / np.linalg.norm(u))


def iterate(
    side: PlatformSide,
    method: str = "amplitude",
    rules: Rules | None = None,
) -> Iterated:
    """Look for the equilibrium of blade and damper.

    Args:
        method: one of METHODS: "picard", "amplitude", "complex", "parts" (Eq. 34 three ways),
            "anderson", "describing".

    Raises:
        InputError: unknown method.
    """
    if method not in METHODS:
        raise InputError(f"method = '{method}': expected one of {', '.join(METHODS)}")
    rules = rules or Rules()
    g = _Map(side, rules)
    # without damper, as in Fig. 14
    c = side.free[:, side.rows]
    with np.errstate(all="ignore"):
        c, converged, reason = METHODS[method](g, c)
    return _finished_result(method, g, c, converged, reason)


def _finished_result(
    method: str,
    g: _Map,
    c: np.ndarray,
    converged: bool,
    reason: str,
) -> Iterated:
    side = g.side
    u = g.spread(c)
    force = np.full_like(u, np.nan)
    error = np.inf
    if np.isfinite(u).all() and np.abs(u).max() > 0:
        exact = damper_response(side, u, "shooting")
        force = exact.force
        error = float(np.linalg.norm(residual(side, u, force)) / np.linalg.norm(u))
    forces = np.concatenate([np.zeros((1, u.shape[1])), force])
    probe = probe_motion(side.model, side.omega, forces, np.zeros(1))
    return Iterated(method, u, probe, converged, error, g.calls, g.periods, reason, tuple(g.steps))


def _fixed_point_loop(
    g: _Map,
    c: np.ndarray,
    propose: Callable[[list, list], np.ndarray],
) -> tuple[np.ndarray, bool, str]:
    """The shell of all fixed-point methods: ``propose`` makes the next motion from the lists of
    motions and images.
    """
    rules = g.rules
    size = np.linalg.norm(c)
    motions = [c]
    images = [g(c)]
    while g.calls < rules.most:
        new = images[0] if len(images) == 1 else propose(motions, images)
        step = np.linalg.norm(new - motions[-1]) / np.linalg.norm(new)
        g.steps.append(float(step))
        if not np.isfinite(step) or np.linalg.norm(new) > DIVERGED_GROWTH * size:
            solved = g.latest.reason == "periodic" or rules.damper == "march"
            return (
                motions[-1],
                False,
                "diverged" if solved else f"damper not solved: {g.latest.reason}",
            )
        if rules.criterion == "step" and step < rules.tolerance:
            return new, True, f"step {step:.1e} below {rules.tolerance:.1e}"
        motions.append(new)
        images.append(g(new))
        if rules.criterion == "residual":
            u = g.spread(new)
            error = np.linalg.norm(residual(g.side, u, g.latest.force)) / np.linalg.norm(u)
            if error < rules.tolerance:
                return new, True, f"residual {error:.1e} below {rules.tolerance:.1e}"
    return motions[-1], False, f"no convergence in {rules.most} evaluations"


def _picard_iteration(g: _Map, c: np.ndarray) -> tuple[np.ndarray, bool, str]:
    return _fixed_point_loop(g, c, lambda motions, images: images[-1])


def _secant_step(
    u1: np.ndarray,
    u0: np.ndarray,
    g1: np.ndarray,
    g0: np.ndarray,
) -> np.ndarray:
    """Eq. 34, component by component; the image where the denominator vanishes."""
    below = g1 - u1 - g0 + u0
    return np.where(below != 0, (g1 * u0 - g0 * u1) / np.where(below != 0, below, 1), g1)


def _amplitude_form(g: _Map, c: np.ndarray) -> tuple[np.ndarray, bool, str]:
    def propose(motions: list, images: list) -> np.ndarray:
        size = _secant_step(
            *(np.abs(x) for x in (motions[-1], motions[-2], images[-1], images[-2]))
        )
        return np.abs(size) * np.exp(1j * np.angle(images[-1]))

    return _fixed_point_loop(g, c, propose)


def _as_complex(g: _Map, c: np.ndarray) -> tuple[np.ndarray, bool, str]:
    return _fixed_point_loop(
        g, c, lambda motions, images: _secant_step(motions[-1], motions[-2], images[-1], images[-2])
    )


def _real_parts(g: _Map, c: np.ndarray) -> tuple[np.ndarray, bool, str]:
    def propose(motions: list, images: list) -> np.ndarray:
        four = (motions[-1], motions[-2], images[-1], images[-2])
        return _secant_step(*(x.real for x in four)) + 1j * _secant_step(*(x.imag for x in four))

    return _fixed_point_loop(g, c, propose)


def _anderson_mixing(
    g: _Map,
    c: np.ndarray,
    depth: int = 5,
) -> tuple[np.ndarray, bool, str]:
    def propose(motions: list, images: list) -> np.ndarray:
        x, y = (
            np.array([_as_real(v) for v in values[-depth - 1 :]]) for values in (motions, images)
        )
        f = y - x
        weights = np.linalg.lstsq((f[1:] - f[:-1]).T, f[-1], rcond=1e-10)[0]
        return _packed_motion(y[-1] - weights @ (y[1:] - y[:-1]), c.shape)

    return _fixed_point_loop(g, c, propose)


def _describing_function(g: _Map, c: np.ndarray) -> tuple[np.ndarray, bool, str]:
    """Newton on the additive residual, first from full stick, then from the motion without
    damper.
    """
    side = g.side
    stuck = balance(side, np.full_like(side.free, 1.0) * side.model.elements.kt)[:, side.rows]
    found, converged, reason = _damped_newton(g, stuck)
    return (found, True, reason) if converged else _damped_newton(g, c)


# real unknowns, residual there
_Guess = tuple[np.ndarray, np.ndarray]


def _damped_newton(g: _Map, c: np.ndarray) -> tuple[np.ndarray, bool, str]:
    """Step halving; Jacobian by differences in 2 H r directions."""
    side = g.side
    goal = min(g.rules.tolerance, 1e-2)
    most = g.calls + g.rules.most

    def r(x: np.ndarray) -> np.ndarray:
        u = g.spread(_packed_motion(x, c.shape))
        return _as_real(residual(side, u, g.force(u))[:, side.rows])

    def advance(guess: _Guess) -> _Guess | None:
        if g.calls >= most:
            raise StepError(Outcome.EXHAUSTED, f"no convergence in {g.rules.most} evaluations")
        x, value = guess
        delta = 1e-6 * np.linalg.norm(x)
        J = np.column_stack([(r(x + delta * e) - value) / delta for e in np.eye(len(x))])
        if not np.isfinite(J).all():
            raise StepError(Outcome.NOT_FINITE, "Jacobian is not finite")
        step = np.linalg.lstsq(J, -value, rcond=None)[0]
        before = np.linalg.norm(value)
        return halve_step(
            lambda share: (x + share * step, r(x + share * step)),
            lambda trial, _: bool(np.linalg.norm(trial[1]) < before),
            SHORTEST_STEP_SHARE,
        )

    first = _as_real(c)
    run = iterate_newton(
        (first, r(first)),
        lambda guess: float(
            np.linalg.norm(guess[1]) / max(np.linalg.norm(guess[0]), np.finfo(float).tiny)
        ),
        advance,
        goal,
        g.rules.most,
    )
    unsolved = run.outcome is Outcome.NOT_FINITE
    reason = f"damper not solved: {g.latest.reason}" if unsolved else run.reason
    return _packed_motion(run.state[0], c.shape), run.converged, reason


def _as_real(c: np.ndarray) -> np.ndarray:
    return np.concatenate([c.real.ravel(), c.imag.ravel()])


def _packed_motion(x: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    half = len(x) // 2
    return (x[:half] + 1j * x[half:]).reshape(shape)


METHODS = {
    "picard": _picard_iteration,
    "amplitude": _amplitude_form,
    "complex": _as_complex,
    "parts": _real_parts,
    "anderson": _anderson_mixing,
    "describing": _describing_function,
}
