"""A whole step of a path in the frequency in one compiled call, for small models: Newton back to
the path on the plane across its direction, the direction beyond, works and states. The slope of a
solved point is a step of no length.

The plain way of `bladefem.hbm.solver.arclength` is taken where dampers walk, and wherever a step
does not end well for another reason than its length.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    try:
        end, slope, _, record = _correct_step(
            # numbers of another type would be compiled for anew
            float(guess[0]),
            w,
            across,
            float(direction[1]),
            float(scales[0]),
            float(scales[1]),
            *path.balance,
            path.unexcited,
            d,
            d - path.model.elements.tangents,
            float(tolerance),
            STEP_ACCURACY,
            corrections,
            signed,
        )
    except np.linalg.LinAlgError:
        return outcome_reason(Outcome.SINGULAR, np.nan, corrections)
    except ZeroDivisionError:
        # a resonance without damping
        return None
    x, code, steps, error, solver, sign, periodic = end
    f, probe, shares, measures = record
    if code != CONVERGED:
        return outcome_reason(Outcome(code), error, steps)
    if not periodic:
        return None
    carried = measures[2]
    fault = rest_fault(path.model, shares, carried) if carried > CARRIED_SHARE else ""
    if fault:
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
    try:
        end, slope, probe, _ = _correct_step(
            float(point.omega),
            w,
            np.zeros(w.shape),
            1.0,
            1.0,
            1.0,
            *path.balance,
            path.unexcited,
            d,
            d - model.elements.tangents,
            # whatever the residual
            np.inf,
            SLOPE_ACCURACY,
            0,
            False,
        )
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return None
    return (slope.reshape(path.shape), probe) if end[1] == CONVERGED else None


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
def _product(one, other):
    """Sum of the products of two arrays (m, K)."""
    total = 0.0
    for i in range(one.shape[0]):
        for k in range(one.shape[1]):
            total += one[i, k] * other[i, k]
    return total


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
        of the displacements (m, K) and probes (H+1, p); forces, probes, shares (n, 3) of stick,
        slip and separation, and what `measure_point` gives. Those of a point that did not converge
        mean nothing.
    """
    m, K = w.shape
    first = w.copy()
    begun = x
    room = empty_room(m, d, K, patterns)
    back = np.empty((m, K))
    along = np.empty((m, K))
    moved = np.empty((m, K))
    f = np.empty((m // d, d, K))
    probe = np.empty(bodies.straight.shape, np.complex128)
    rate_of_probe = np.empty(bodies.straight.shape, np.complex128)
    measures = np.zeros(MEASURES)
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
            measure_point(
                x,
                bodies,
                springs,
                (modal, free),
                w,
                normals,
                room.F,
                contact[5],
                room.residual,
                f,
                probe,
                measures,
            )
            break
        newton_step(room.residual, accuracy, d, nodes, C, linear.flex, few, factors, level, back)
        for i in range(m):
            for k in range(K):
                moved[i, k] = w[i, k] - first[i, k]
        off = _product(across, moved) / size + dx * (x - begun) / width
        change = (_product(across, back) / size - off) / (
            dx / width - _product(across, along) / size
        )
        x += change
        for i in range(m):
            for k in range(K):
                w[i, k] -= back[i, k] + change * along[i, k]
        steps += 1
    periodic = room.cycles.min() >= 0
    # the derivative may be singular at the very end
    if code == CONVERGED and not np.isfinite(frobenius_norm(along)):
        code = SINGULAR
    end = x, code, steps, error, solver, sign, periodic
    return end, along, rate_of_probe, (f, probe, room.shares, measures)
