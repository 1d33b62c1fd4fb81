"""A whole step of a path in the frequency in one compiled call, for small models: Newton back to
the path on the plane across its direction, the direction beyond, works and states. The slope of a
solved point is a step of no length.

The plain way of `bladefem.hbm.solver.arclength` is taken where dampers walk, and wherever a step
does not end well for another reason than its length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from ...util.newton import Outcome, outcome_reason
from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.condensation import circling_frequencies
from ..linear.condensation_compiled import linear_part
from ..linear.contact_flexibility import form_matrices
from ..linear.packed_bodies import Bodies
from ..model import ReducedModel
from ..point_measures import MEASURES, count_states, measure_point
from ..policy import COMPILED_ITERATION_UNKNOWNS, DETERMINANT_UNKNOWNS, uses_compiled_slope
from ..solution import Solution
from .balance_residual import frobenius_norm
from .frequency_rate import probe_rate, residual_rate
from .law_evaluation import empty_room, evaluate
from .newton_compiled import (
    BY_ITERATIONS,
    BY_LU,
    CONVERGED,
    SEARCHING,
    SINGULAR,
    dense_jacobian,
    linearise_nodes,
    newton_step,
    no_factors,
    stop_code,
)
from .point_compiled import point_solution
from .residual import STEP_ACCURACY, STICKING_FORCE_SHARE
from .small_balance import SmallBalance, small_balance
from .walking import CARRIED_SHARE, rest_fault

# relative accuracy of the slope of a point where it is solved for by iterations
SLOPE_ACCURACY = 1e-9
# name of the way in a record
PATH_FOLLOWING = "path following"


@dataclass(frozen=True)
class CompiledPath:
    """What does not change along a path in the circular frequency of a small model."""

    model: ReducedModel
    balance: SmallBalance
    # the bodies that nothing but contact forces moves
    unexcited: Bodies
    # nodes, directions, real coefficients
    shape: tuple[int, int, int]
    samples: int


@dataclass(frozen=True)
class CompiledEnd:
    """Where a step came back to the path."""

    point: Solution
    # (n, d, K) derivative of the displacements with the frequency [m s]
    slope: np.ndarray
    # sign of the determinant of the balance's derivative; 0 where it was not asked for
    orientation: float


def compiled_path(model: ReducedModel, H: int, samples: int) -> CompiledPath | None:
    """Steps of this model are compiled; None where they are not."""
    # `condense` takes other bodies next to a frequency at which a damper circles
    if not uses_compiled_slope(model, H) or len(circling_frequencies(model)):
        return None
    balance = small_balance(model, H, samples)
    bodies = balance.bodies
    unexcited = bodies._replace(
        push=np.zeros_like(bodies.push), straight=np.zeros_like(bodies.straight)
    )
    return CompiledPath(model, balance, unexcited, (*model.springs.shape, 2 * H + 1), samples)


def correct_step(
    path: CompiledPath,
    guess: tuple[float, np.ndarray],
    direction: tuple[np.ndarray, float],
    scales: tuple[float, float],
    mean_weight: float,
    tolerance: float,
    corrections: int,
    signed: bool,
) -> CompiledEnd | str | None:
    """Newton from a guess on the plane across a direction.

    Args:
        guess: circular frequency [rad/s] and displacements (n, d, K) [m].
        direction: in displacements over their scale (n, d, K), and in the frequency over its own.
        scales: of displacements [m] and of the frequency [rad/s].
        mean_weight: of mean displacements in lengths and angles.
        corrections: the largest number of steps.
        signed: the sign of the determinant is asked for.

    Returns:
        the end; why there is none; or None where the plain way has to tell.
    """
    n, d, K = path.shape
    across = np.array(direction[0], dtype=float).reshape(n * d, K)
    across[:, 0] *= mean_weight
    w = np.array(guess[1], dtype=float).reshape(n * d, K)
    plane = across, direction[1], *scales
    limits = tolerance, STEP_ACCURACY, corrections
    try:
        end, slope, _, shares, record = _called(path, guess[0], w, plane, limits, signed)
    except np.linalg.LinAlgError:
        return outcome_reason(Outcome.SINGULAR, np.nan, corrections)
    # a resonance without damping
    except ZeroDivisionError:
        return None
    x, code, steps, error, solver, sign, periodic = end
    f, probe, measures = record
    if code != CONVERGED:
        return outcome_reason(Outcome(code), error, steps)
    if not periodic:
        return None
    carried = measures[2]
    if carried > CARRIED_SHARE and (fault := rest_fault(path.model, shares, carried)):
        return fault
    point = point_solution(
        K // 2,
        path.samples,
        (
            x,
            w.reshape(path.shape),
            f,
            probe,
            (steps, error, solver),
            count_states(shares).tolist(),
            measures.tolist(),
        ),
        PATH_FOLLOWING,
    )
    return CompiledEnd(point, slope.reshape(path.shape), sign)


def frequency_slope(model: ReducedModel, point: Solution) -> tuple[np.ndarray, np.ndarray] | None:
    """Derivatives of a solved point with the circular frequency: (n, d, K) of the displacements [m
    s], and (H+1, probes) of the complex amplitudes at the probes [m s]; None if steps are not
    compiled, where a damper walks, or where the derivative is singular.
    """
    path = compiled_path(model, point.harmonics, point.samples) if point.walk is None else None
    if path is None:
        return None
    n, d, K = path.shape
    w = np.array(point.w, dtype=float).reshape(n * d, K)
    plane = np.zeros(w.shape), 1.0, 1.0, 1.0
    # whatever the residual
    limits = np.inf, SLOPE_ACCURACY, 0
    try:
        end, slope, probe, _, _ = _called(path, point.omega, w, plane, limits, signed=False)
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return None
    return (slope.reshape(path.shape), probe) if end[1] == CONVERGED else None


def _called(
    path: CompiledPath,
    x: float,
    w: np.ndarray,
    plane: tuple[np.ndarray, float, float, float],
    limits: tuple[float, float, int],
    signed: bool,
) -> tuple[Any, ...]:
    """`_correct_step` from x and w (m, K), which is changed.

    Args:
        plane: direction in displacements (m, K) and frequency, scales of both.
        limits: tolerance, accuracy of linear systems, steps.

    Raises:
        ZeroDivisionError: a resonance without damping.
        numpy.linalg.LinAlgError: a singular matrix.
    """
    d = path.shape[1]
    across, *numbers = plane
    tolerance, accuracy, corrections = limits
    # whole numbers would be compiled for anew
    return _correct_step(
        float(x),
        w,
        across,
        *(float(number) for number in numbers),
        *path.balance,
        path.unexcited,
        d,
        d - path.model.elements.tangents,
        float(tolerance),
        float(accuracy),
        corrections,
        signed,
    )


@njit(**INNER_KERNEL)
def _determinant_sign(few, C):
    """Sign of the determinant of the balance's derivative, from dp/dw at the nodes that move and
    the flexibility among them; 0 where there are too many unknowns to ask.
    """
    unknowns = C.shape[0] * C.shape[1]
    # everything sticks: the derivative is the identity
    if unknowns == 0:
        return 1.0
    if unknowns > DETERMINANT_UNKNOWNS:
        return 0.0
    return np.linalg.slogdet(dense_jacobian(form_matrices(few), C))[0]


@njit(**INNER_KERNEL)
def _change_in_plane(w, first, back, along, across, size, dx, ahead, width):
    """Change of the frequency by which Newton's step ends in the plane through a guess.

    Args:
        w, first: (m, K) displacements now and at the guess.
        back, along: (m, K) inverse derivative times the residual and its rate with the frequency.
        ahead: distance from the guess in the frequency, over `width`.
    """
    off = dx * ahead
    by_residual = 0.0
    by_rate = 0.0
    for i in range(w.shape[0]):
        for k in range(w.shape[1]):
            weight = across[i, k] / size
            off += weight * (w[i, k] - first[i, k])
            by_residual += weight * back[i, k]
            by_rate += weight * along[i, k]
    return (by_residual - off) / (dx / width - by_rate)


@njit(**INNER_KERNEL)
def _move(w, back, change, along):
    """Take a step from w (m, K), which is changed."""
    for i in range(w.shape[0]):
        for k in range(w.shape[1]):
            w[i, k] -= back[i, k] + change * along[i, k]


@njit(**INNER_KERNEL)
def _measure(x, bodies, springs, modal, free, w, normals, room, preload, record):
    """Fill forces (n, d, K), probes (H+1, p) and measures of a solved point."""
    f, probe, measures = record
    linear = modal, free
    residual = room.residual
    measure_point(
        x, bodies, springs, linear, w, normals, room.F, preload, residual, f, probe, measures
    )


@njit(**KERNEL)
def _correct_step(
    x,
    w,
    across,
    dx,
    size,
    width,
    bodies,
    springs,
    contact,
    patterns,
    unexcited,
    d,
    normals,
    tolerance,
    accuracy,
    corrections,
    signed,
):
    """Bring the frequency x and w (m, K), which is changed, back to the path.

    Args:
        across: (m, K) direction in displacements over `size`, times the weight of each.
        unexcited: the bodies that nothing but contact forces moves.
        normals: normal directions in the balance, 0 or 1 a node.
        accuracy: of linear systems that are solved by iterations.

    Returns:
        x, how the loop ended, steps, error, how steps were solved for as `compiled_newton` tells
        it, sign of the determinant, whether the forces are periodic; derivatives with the frequency
        of the displacements (m, K) and probes (H+1, p); shares (n, 3) of stick, slip and
        separation; forces, probes and works as `measure_point` gives them. Those of a point that
        did not converge mean nothing.
    """
    m, K = w.shape
    first = w.copy()
    begun = x
    room = empty_room(m, d, K, patterns)
    back = np.empty((m, K))
    along = np.empty((m, K))
    probe = np.empty(bodies.straight.shape, np.complex128)
    rate_of_probe = np.empty(bodies.straight.shape, np.complex128)
    record = np.empty((m // d, d, K)), probe, np.zeros(MEASURES)
    sign = 0.0
    solver = 0
    steps = 0
    while True:
        modal, linear, free, _ = linear_part(x, bodies, springs, K // 2)
        error = evaluate(w, d, linear, contact, patterns, room)
        code = stop_code(error, tolerance, steps, corrections)
        if code != SEARCHING and code != CONVERGED:
            break
        nodes, C, few, level = linearise_nodes(room.J, linear, d, STICKING_FORCE_SHARE)
        rates, rate = residual_rate(x, bodies, modal, linear, contact[5], room.F)
        factors = newton_step(
            rate, accuracy, d, nodes, C, linear.flex, few, no_factors(), level, along
        )
        if accuracy and C.shape[0] * C.shape[1] > COMPILED_ITERATION_UNKNOWNS:
            solver |= BY_ITERATIONS
            # where iterations did not converge once they mostly do not
            accuracy = 0.0 if factors[1].size else accuracy
        if factors[1].size:
            solver |= BY_LU
        if code == CONVERGED:
            along *= -1.0
            if signed:
                sign = _determinant_sign(few, C)
            rate_of_probe = probe_rate(
                bodies, unexcited, modal, free, room.J, springs, rates, along, d
            )
            _measure(x, bodies, springs, modal, free, w, normals, room, contact[5], record)
            break
        newton_step(room.residual, accuracy, d, nodes, C, linear.flex, few, factors, level, back)
        change = _change_in_plane(
            w, first, back, along, across, size, dx, (x - begun) / width, width
        )
        x += change
        _move(w, back, change, along)
        steps += 1
    periodic = room.cycles.min() >= 0
    # the derivative may be singular at the very end
    if code == CONVERGED and not np.isfinite(frobenius_norm(along)):
        code = SINGULAR
    end = x, code, steps, error, solver, sign, periodic
    return end, along, rate_of_probe, room.shares, record
