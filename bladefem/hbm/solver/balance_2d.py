"""The balance of 2-D Coulomb elements in one compiled call: motion in time, contact law, harmonics,
residual and its size, and the halvings of a line search on the residual.

A trial of a line search then costs what its kernels do; only the one that is accepted reaches
Python. The law is `bladefem.friction.simd.kernel_2d`, the residual that of
`bladefem.hbm.solver.balance_residual`; `bladefem.hbm.solver.residual` evaluates other elements by
the same two kernels, one after the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...friction.simd.kernel_2d import disc_batch
from ...friction.trigonometric_tables import Patterns
from ...util.numba_options import INNER_KERNEL, KERNEL
from .balance_residual import Condensed, balance_residual, frobenius_norm
from .law_evaluation import PERIODS


class Evaluation(NamedTuple):
    """What one call leaves: n nodes, m of their degrees of freedom in the balance, K coefficients.

    Forces have all three directions (normal, t1, t2), whether or not the normal one is in the
    balance.
    """

    # (m, K) displacements at which it was made [m]
    w: np.ndarray
    # (n, 3, K) forces [N]
    F: np.ndarray
    # (n, 3, K, 3K) their derivative [N/m]
    J: np.ndarray
    # (n, 3) shares of the period in stick, slip and separation [1]
    shares: np.ndarray
    # (n,) periods marched, below zero where the force was not periodic
    cycles: np.ndarray
    # (n,) work of the tangential forces a period [J]
    dissipated: np.ndarray
    # (m, K) forces beyond preload and springs [N]
    p: np.ndarray
    # (m, K) [m]
    residual: np.ndarray
    # of both forms over the size of the motion [1]
    error: float
    # all forces are periodic and finite
    periodic: bool


@njit(**INNER_KERNEL)
def _law_motion(w, offset, n):
    """(n, 3, K) the motion that the law is given, from the displacements w (m, K) of the balance
    and the offset (m,) of their mean; directions left out of the balance rest.
    """
    d = w.shape[0] // n
    full = np.zeros((n, 3, w.shape[1]))
    for i in range(w.shape[0]):
        for k in range(w.shape[1]):
            full[i // d, 3 - d + i % d, k] = w[i, k]
        full[i // d, 3 - d + i % d, 0] += offset[i]
    return full


@njit(**INNER_KERNEL)
def _walk_steps(w, walk, springs):
    """(z,) steps a period along the motions walk (m, z), from the mean of w (m, K)."""
    steps = np.zeros(walk.shape[1])
    for i in range(walk.shape[0]):
        for z in range(walk.shape[1]):
            steps[z] += walk[i, z] * springs[i] * w[i, 0]
    return steps


@njit(**INNER_KERNEL)
def _ramp_of(steps, walk, n):
    """(n, 2) by which the tangential motion goes on in each period [m]."""
    d = walk.shape[0] // n
    ramp = np.zeros((n, 2))
    for i in range(walk.shape[0]):
        tangent = i % d - (d - 2)
        if tangent >= 0:
            for z in range(walk.shape[1]):
                ramp[i // d, tangent] += walk[i, z] * steps[z]
    return ramp


@njit(**INNER_KERNEL)
def _works(F, full, ramp):
    """(n,) work of the tangential forces F (n, 3, K) on the motion (n, 3, K) and on its ramp (n, 2)
    in one period, exact for these harmonics.
    """
    out = np.zeros(F.shape[0])
    for e in range(F.shape[0]):
        for c in range(1, 3):
            total = 0.0
            for h in range(1, F.shape[2] // 2 + 1):
                cos = 2 * h - 1
                sin = 2 * h
                total += h * (F[e, c, cos] * full[e, c, sin] - F[e, c, sin] * full[e, c, cos])
            out[e] += np.pi * total + F[e, c, 0] * ramp[e, c - 1]
    return out


@njit(**INNER_KERNEL)
def _all_periodic(F, cycles):
    """Every element was periodic, and every force is finite."""
    total = 0.0
    for e in range(F.shape[0]):
        for c in range(F.shape[1]):
            for k in range(F.shape[2]):
                # not a number as soon as one of them is not finite
                total += 0.0 * F[e, c, k]
        if cycles[e] < 0:
            return False
    return total == 0.0


@njit(cache=True, error_model="numpy", inline="always")
def _evaluate(w, walk, linear, contact, patterns):
    """The `Evaluation` at w (m, K), which becomes part of it; arguments as `search_residual` takes
    them.
    """
    load, _, nodes, tab, _, preload, offset = contact
    n = nodes.shape[0]
    K = w.shape[1]
    full = _law_motion(w, offset, n)
    ramp = _ramp_of(_walk_steps(w, walk, linear.springs), walk, n)
    F = np.empty((n, 3, K))
    J = np.empty((n, 3, K, 3 * K))
    shares = np.empty((n, 3))
    cycles = np.empty(n, np.int64)
    disc_batch(full, ramp, load, nodes, tab, patterns, PERIODS, F, J, shares, cycles)
    p = np.empty(w.shape)
    r = np.empty(w.shape)
    error = balance_residual(w, linear, preload, F, p, r)
    works = _works(F, full, ramp)
    return Evaluation(w, F, J, shares, cycles, works, p, r, error, _all_periodic(F, cycles))


@njit(**INNER_KERNEL)
def _residual_size(w, walk, linear, contact, patterns):
    """Size of the residual at w (m, K) [m], without the derivative, which takes two thirds of an
    `Evaluation`.
    """
    load, _, nodes, tab, _, preload, offset = contact
    n = nodes.shape[0]
    full = _law_motion(w, offset, n)
    ramp = _ramp_of(_walk_steps(w, walk, linear.springs), walk, n)
    F = np.empty(full.shape)
    none = np.empty((n, 0, 0, 0))
    cycles = np.empty(n, np.int64)
    disc_batch(full, ramp, load, nodes, tab, patterns, PERIODS, F, none, np.empty((n, 3)), cycles)
    p = np.empty(w.shape)
    r = np.empty(w.shape)
    balance_residual(w, linear, preload, F, p, r)
    return frobenius_norm(r)


@njit(**INNER_KERNEL)
def _after_step(w, share, step):
    """(m, K) a share of the step from w (m, K)."""
    trial = np.empty(step.shape)
    for i in range(step.shape[0]):
        for k in range(step.shape[1]):
            trial[i, k] = w[i, k] - share * step[i, k]
    return trial


@njit(**KERNEL)
def search_residual(w, step, before, decrease, shortest, walk, linear, contact, patterns):
    """The first halving of a step (m, K) from w (m, K) that lowers the residual enough.

    The derivative is made after the whole step, which two in five accept, and where forces alone
    say that a shorter one is accepted.

    Args:
        before: size of the residual at w [m]; the whole step is accepted where it is infinite.
        decrease: share of the residual by which a whole step has to lower it.
        shortest: share of the step below which it is given up.
        walk: (m, z) motions along which the damper walks; (m, 0) where it rests in the mean.
        linear: the `Condensed` bodies.
        contact: as `bladefem.hbm.solver.residual.contact_table` makes it.
        patterns: of the derivative, in its precision.

    Returns:
        whether one was found, and the last `Evaluation` made.
    """
    share = 1.0
    while True:
        trial = _after_step(w, share, step)
        found = _evaluate(trial, walk, linear, contact, patterns)
        if frobenius_norm(found.residual) <= (1.0 - decrease * share) * before:
            return True, found
        while True:
            share /= 2.0
            if share < shortest:
                return False, found
            trial = _after_step(w, share, step)
            left = _residual_size(trial, walk, linear, contact, patterns)
            if left <= (1.0 - decrease * share) * before:
                break


def evaluate_2d(
    w: np.ndarray, walk: np.ndarray, linear: Condensed, contact: tuple, patterns: Patterns
) -> Evaluation:
    """The `Evaluation` at w (m, K): a search without a step, as a kernel of its own would take
    several seconds more to compile.
    """
    whole = np.zeros(w.shape)
    _, found = search_residual(w, whole, np.inf, 0.0, 1.0, walk, linear, contact, patterns)
    return found


@njit(**KERNEL)
def force_rates(w, F, change, walk, linear, contact, patterns):
    """(z, n, 3, K) derivatives of the forces F (n, 3, K) at w (m, K) with the steps of the walk
    [N/m], by differences of `change` over the largest displacement of each motion.
    """
    load, _, nodes, tab, _, _, offset = contact
    n = nodes.shape[0]
    full = _law_motion(w, offset, n)
    steps = _walk_steps(w, walk, linear.springs)
    rates = np.empty((walk.shape[1], *F.shape))
    none = np.empty((n, 0, 0, 0))
    shares = np.empty((n, 3))
    cycles = np.empty(n, np.int64)
    for z in range(walk.shape[1]):
        largest = 0.0
        for i in range(walk.shape[0]):
            largest = max(largest, abs(walk[i, z]))
        # away from a walk of zero, where the law has a corner
        by = np.copysign(change / largest, steps[z])
        moved = steps.copy()
        moved[z] += by
        ramp = _ramp_of(moved, walk, n)
        disc_batch(full, ramp, load, nodes, tab, patterns, PERIODS, rates[z], none, shares, cycles)
        for e in range(n):
            for c in range(3):
                for k in range(F.shape[2]):
                    rates[z, e, c, k] = (rates[z, e, c, k] - F[e, c, k]) / by
    return rates
