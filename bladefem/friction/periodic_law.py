"""Harmonics of the forces of any friction law, by marching its state to the periodic one.

The state is stepped along straight increments between the samples. What one period does to it is a
map; its fixed point is found by marching two periods and then by Newton with the map's derivative,
node by node. The derivative of the periodic force by the motion follows from the same fixed point:
with x0 the state at the start, x0' = Phi x0' + q, where Phi is the map's derivative by the state
and q by the motion. Where I - Phi is singular (a node that sticks remembers its start) the
derivative of the first step from rest rules.

Only the march runs sample after sample, with all nodes at once; derivatives of the steps are asked
of the law for all samples in one call. The arrays run over samples first: (S, n, ..).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bladefem.data import Elements
from bladefem.friction.fourier import analysis, harmonics_of, synthesis
from bladefem.friction.law import DIFFERENCE_STEP, FrictionLaw, Slopes, slopes_of
from bladefem.friction.law_table import select_elements

# of the largest state of a node: how well it must repeat itself
PERIODIC_TOLERANCE = 1e-12
# periods marched before Newton: states that varying loads allow are chosen by marching
MARCHED_PERIODS = 2
# singular values of I - Phi below which the state keeps a memory of its start; differences leave
# errors of 1e-9 in Phi
MIN_SINGULAR_VALUE = 1e-6


@dataclass(frozen=True)
class LawForces:
    """Forces of n nodes of one law with t tangents, K coefficients."""

    # (n, 1 + t, K) [N]
    f: np.ndarray
    # (n, 1 + t, K, 1 + t, K) [N/m], or None
    dfdw: np.ndarray | None
    # (n, 3) share of the samples in stick, slip and separation
    shares: np.ndarray
    # (n,) periods that were marched, negative where the state did not repeat itself
    cycles: np.ndarray


@dataclass(frozen=True)
class _Steps:
    """Steps of all nodes, as the law takes them: the part after closing, loads that are not
    negative.
    """

    law: FrictionLaw
    elements: Elements
    # (S, n, t) whole increments [m]
    increment: np.ndarray
    # (S, n) normal load before and now [N], negative where open
    before: np.ndarray
    load: np.ndarray
    # (n,) displacement that the law resolves [m]
    sizes: np.ndarray

    @cached_property
    def closed(self) -> np.ndarray:
        """(S, n) contact at the end."""
        return self.load > 0

    @cached_property
    def closing(self) -> np.ndarray:
        """(S, n) contact at the end and none before."""
        return self.closed & (self.before <= 0)

    @cached_property
    def rise(self) -> np.ndarray:
        """(S, n) what the load rises by where it closes, else 1 [N]."""
        return np.where(self.closing, self.load - self.before, 1.0)

    @cached_property
    def part(self) -> np.ndarray:
        """(S, n) part of the increment after the contact."""
        return np.where(self.closing, self.load / self.rise, 1.0)

    @cached_property
    def arguments(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Increments (S, n, t) and loads before and now (S, n) of the law; where it ends open any
        load.
        """
        return (
            self.part[:, :, None] * self.increment,
            np.maximum(self.before, 0.0),
            np.where(self.closed, self.load, 1.0),
        )

    @cached_property
    def repeated(self) -> Elements:
        """The elements, once a sample."""
        return select_elements(self.elements, np.tile(np.arange(len(self.sizes)), len(self.load)))


def periodic_forces(
    law: FrictionLaw,
    elements: Elements,
    w: np.ndarray,
    samples: int,
    *,
    load: np.ndarray | None = None,
    jacobian: bool = True,
    cycles: int = 4000,
    walk: np.ndarray | float = 0.0,
) -> LawForces:
    """Forces of elements that all follow the law, for relative motion w (n, 1 + t, K) [m].

    walk (n, t) [m] is how far the motion goes on in each period, for laws that forget where they
    began. load (n, samples) [N] replaces the constant n0, as in `bladefem.friction.aft.evaluate`.
    """
    basis = synthesis(harmonics_of(w), samples)
    constant = elements.n0[:, None] if load is None else load
    normal = (constant + elements.kn[:, None] * (w[:, 0] @ basis.T)).T
    u = np.moveaxis(w[:, 1:] @ basis.T, 2, 0)
    reach = abs(u).max(axis=(0, 2))
    sizes = np.where(reach > 0, reach, 1.0)
    increment = u - np.roll(u, 1, axis=0) + np.asarray(walk) / samples
    period = _Steps(law, elements, increment, np.roll(normal, 1, axis=0), normal, sizes)
    # from rest to the last sample, under its load
    first = _Steps(law, elements, u[-1:], normal[-1:], normal[-1:], sizes)
    start, states, used = _periodic_state(period, first, cycles)
    force = law.force(
        states.reshape(-1, states.shape[2]),
        u.reshape(-1, u.shape[2]),
        period.arguments[2].ravel(),
        period.repeated,
    )
    force = np.where(period.closed[:, :, None], force.reshape(u.shape), 0.0)
    weights = analysis(harmonics_of(w), samples)
    f = np.moveaxis(np.tensordot(weights, np.dstack([np.maximum(normal, 0.0), force]), 1), 0, 2)
    before = np.concatenate([start[None], states[:-1]])
    dfdw = None
    if jacobian:
        dfdw = _force_derivative(period, first, before, states, u, (basis, weights))
    return LawForces(f, dfdw, _state_shares(period, before, states), used)


def _march_period(steps: _Steps, start: np.ndarray) -> np.ndarray:
    """(S, n, s) states at the samples of a period, which begins in the state (n, s)."""
    increments, before, load = steps.arguments
    states = np.empty((len(load), *start.shape))
    state = start
    for i in range(len(load)):
        state = steps.law.step(state, increments[i], before[i], load[i], steps.elements)
        if not steps.closed[i].all():
            state = np.where(steps.closed[i][:, None], state, 0.0)
        states[i] = state
    return states


def _step_slopes(steps: _Steps, before: np.ndarray) -> Slopes:
    """Derivatives of all steps from the states (S, n, s) before them, arrays (S, n, ..): by the
    state, the whole increment and both loads; zero where a step ends open.
    """
    S, n, s = before.shape
    increments, loads_before, load = steps.arguments
    own = slopes_of(
        steps.law,
        before.reshape(S * n, s),
        increments.reshape(S * n, -1),
        loads_before.ravel(),
        load.ravel(),
        steps.repeated,
        np.tile(steps.sizes, S),
    )
    by_state = own.state.reshape(S, n, s, s)
    by_increment = own.increment.reshape(S, n, s, -1)
    along = np.einsum("Snst,Snt->Sns", by_increment, steps.increment)
    closed = steps.closed[:, :, None]
    closing = steps.closing[:, :, None]
    rise = steps.rise[:, :, None]
    part_by_before = np.where(closing, steps.load[:, :, None] / rise**2, 0.0)
    part_by_load = np.where(closing, -steps.before[:, :, None] / rise**2, 0.0)
    pressed = closed & (steps.before > 0)[:, :, None]
    return Slopes(
        np.where(closed[..., None], by_state, 0.0),
        np.where(closed[..., None], steps.part[:, :, None, None] * by_increment, 0.0),
        np.where(pressed, own.before.reshape(S, n, s), 0.0)
        + np.where(closed, along * part_by_before, 0.0),
        np.where(closed, own.load.reshape(S, n, s) + along * part_by_load, 0.0),
    )


def _periodic_state(
    period: _Steps,
    first: _Steps,
    limit: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State (n, s) at the start of the periodic period, states (S, n, s) at its samples, and
    periods marched (n,), negative where it is not periodic.
    """
    _, n, t = period.increment.shape
    s = period.law.variables or t
    start = _march_period(first, np.zeros((n, s)))[0]
    used = np.full(n, -limit)
    # the last state that marching alone led to, and the residual there
    safe = start
    last = np.full(n, np.inf)
    for cycle in range(1, limit + 1):
        states = _march_period(period, start)
        end = states[-1]
        residual = np.linalg.norm(end - start, axis=1)
        largest = np.maximum(abs(states).max(axis=(0, 2)), np.finfo(float).tiny)
        used[(residual <= PERIODIC_TOLERANCE * largest) & (used < 0)] = cycle
        if np.all(used > 0) or not np.all(np.isfinite(residual)) or cycle == limit:
            break
        # where Newton's step did not pay, marching goes on from before it
        better = (residual < last)[:, None]
        safe = np.where(better, end, safe)
        ahead = safe
        if cycle >= MARCHED_PERIODS:
            before = np.concatenate([start[None], states[:-1]])
            left = _inverse_of_change(_ordered_product(_step_slopes(period, before).state))
            newton = start + (left @ (end - start)[:, :, None])[:, :, 0]
            ahead = np.where(better, newton, safe)
        last = np.where(better[:, 0], residual, np.inf)
        # nodes that are periodic stay where they are
        start = np.where((used < 0)[:, None], ahead, start)
    return start, states, used


def _ordered_product(factors: np.ndarray) -> np.ndarray:
    """(n, s, s) product of (S, n, s, s), the last one on the left."""
    while len(factors) > 1:
        if len(factors) % 2:
            factors = np.concatenate([factors[:-2], factors[-1:] @ factors[-2:-1]])
        if len(factors) > 1:
            factors = factors[1::2] @ factors[::2]
    return factors[0]


def _inverse_of_change(phi: np.ndarray) -> np.ndarray:
    """(n, s, s) pseudo-inverse of I - Phi, zero in directions that keep their memory."""
    u, sizes, vh = np.linalg.svd(np.eye(phi.shape[1]) - phi)
    regular = sizes > MIN_SINGULAR_VALUE
    inverse = np.where(regular, 1 / np.where(regular, sizes, 1.0), 0.0)
    return np.swapaxes(vh, 1, 2) @ (inverse[:, :, None] * np.swapaxes(u, 1, 2))


def _state_shares(
    period: _Steps,
    before: np.ndarray,
    states: np.ndarray,
) -> np.ndarray:
    """(n, 3) share of the samples in stick, slip and separation."""
    S, n, s = states.shape
    slips = period.law.slipping(
        before.reshape(S * n, s),
        states.reshape(S * n, s),
        period.increment.reshape(S * n, -1),
        period.repeated,
    )
    shares = np.zeros((n, 3))
    shares[:, 1] = np.mean(period.closed & slips.reshape(S, n), axis=0)
    shares[:, 2] = 1 - np.mean(period.closed, axis=0)
    shares[:, 0] = 1 - shares[:, 1] - shares[:, 2]
    return shares


def _force_derivative(
    period: _Steps,
    first: _Steps,
    before: np.ndarray,
    states: np.ndarray,
    u: np.ndarray,
    tables: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """(n, d, K, d, K) derivative of the force coefficients.

    That of the state at a sample is P x0' + Q with x0' that of the start; P and Q are carried from
    sample to sample.
    """
    basis, weights = tables
    S, n, s = states.shape
    t = u.shape[2]
    K = basis.shape[1]
    kn = period.elements.kn
    slopes = _step_slopes(period, before)
    by_state, by_motion, by_load = _force_slopes(period, states, u)
    earlier = np.roll(basis, 1, axis=0)
    by_start = np.zeros((n, K, t * s))
    carried = np.zeros((n, K, t * (1 + t) * K))
    P = np.tile(np.eye(s), (n, 1, 1))
    Q = np.zeros((n, s, (1 + t) * K))
    for i in range(S):
        P = slopes.state[i] @ P
        Q = slopes.state[i] @ Q
        Q += _by_coefficients(slopes, i, kn, (earlier[i], basis[i]), basis[i] - earlier[i])
        by_start += weights[:, i, None] * (by_state[i] @ P).reshape(n, 1, t * s)
        carried += weights[:, i, None] * (by_state[i] @ Q).reshape(n, 1, -1)
    rest = np.zeros((1, n, s))
    last = (basis[-1], basis[-1])
    started = _by_coefficients(_step_slopes(first, rest), 0, kn, last, basis[-1])
    x0 = started + _inverse_of_change(P) @ (Q + P @ started - started)
    J = np.zeros((n, 1 + t, K, (1 + t) * K))
    pressed = weights[:, :, None] * (period.closed * kn)[None]
    J[:, 0, :, :K] = np.einsum("kSn,Sl->nkl", pressed, basis, optimize=True)
    J[:, 1:] = np.moveaxis(carried.reshape(n, K, t, -1), 1, 2)
    J[:, 1:] += np.moveaxis(by_start.reshape(n, K, t, s) @ x0[:, None], 1, 2)
    direct = np.einsum("kS,Sntc,Sl->ntkcl", weights, by_motion, basis, optimize=True)
    J[:, 1:, :, K:] += direct.reshape(n, t, K, t * K)
    J[:, 1:, :, :K] += np.einsum("kS,Snt,n,Sl->ntkl", weights, by_load, kn, basis, optimize=True)
    return J.reshape(n, 1 + t, K, 1 + t, K)


def _by_coefficients(
    slopes: Slopes,
    i: int,
    kn: np.ndarray,
    loads: tuple[np.ndarray, np.ndarray],
    change: np.ndarray,
) -> np.ndarray:
    """(n, s, d K) derivative of the state after step i by the coefficients, the state before it
    fixed.

    Args:
        loads: (K,) synthesis at the loads before and now.
        change: (K,) synthesis of the increment.
    """
    n, s, t = slopes.increment.shape[1:]
    K = len(change)
    out = np.empty((n, s, (1 + t) * K))
    pressed = slopes.before[i][:, :, None] * loads[0] + slopes.load[i][:, :, None] * loads[1]
    out[:, :, :K] = kn[:, None, None] * pressed
    out[:, :, K:] = (slopes.increment[i][:, :, :, None] * change).reshape(n, s, t * K)
    return out


def _force_slopes(
    period: _Steps,
    states: np.ndarray,
    u: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the force by state (S, n, t, s), motion (S, n, t, t) and load (S, n, t)."""
    S, n, s = states.shape
    t = u.shape[2]
    law = period.law
    closed = period.closed[:, :, None]
    if type(law).force is FrictionLaw.force:
        by_state = np.where(closed[..., None], np.eye(t, s), 0.0)
        return by_state, np.zeros((S, n, t, t)), np.zeros((S, n, t))
    load = period.arguments[2].ravel()
    args = (states.reshape(S * n, s), u.reshape(S * n, t), load)
    sizes = np.tile(period.sizes, S)
    push = np.maximum(abs(args[0]).max(axis=1), period.repeated.kt * sizes)
    push = np.where(push > 0, push, 1.0)

    def change(
        which: int,
        column: int | None,
        size: np.ndarray,
    ) -> np.ndarray:
        """(S, n, t) derivative with one column of the state, the motion or the load."""
        ends = []
        for sign in (DIFFERENCE_STEP, -DIFFERENCE_STEP):
            moved = [x.copy() for x in args]
            part = moved[which] if column is None else moved[which][:, column]
            part += sign * size
            ends.append(law.force(moved[0], moved[1], moved[2], period.repeated))
        slope = (ends[0] - ends[1]) / (2 * DIFFERENCE_STEP * size)[:, None]
        return np.where(closed, slope.reshape(S, n, t), 0.0)

    by_state = np.stack([change(0, column, push) for column in range(s)], axis=3)
    by_motion = np.stack([change(1, column, sizes) for column in range(t)], axis=3)
    return by_state, by_motion, change(2, None, load)
