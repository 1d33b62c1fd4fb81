"""A whole step of a path in the frequency in one compiled call, for small models: Newton back to
the path on the plane across its direction, the direction beyond, works and states.

The plain way of `bladefem.hbm.solver.arclength` is taken where dampers walk, and wherever a step
does not end well for another reason than its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ...util.newton import Outcome, outcome_reason
from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.condensation_compiled import linear_part
from ..linear.contact_flexibility import form_matrices
from ..model import ReducedModel
from ..point_measures import MEASURES, count_states, measure_point
from ..policy import DETERMINANT_UNKNOWNS, uses_compiled_slope
from ..solution import Solution
from .frequency_slope import residual_rate
from .law_evaluation import empty_room, evaluate
from .newton_compiled import (
    BY_LU,
    CONVERGED,
    SEARCHING,
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

# name of the way in a record
PATH_FOLLOWING = "path following"


@dataclass(frozen=True)
class CompiledPath:
    """What does not change along a path in the circular frequency of a small model."""

    model: ReducedModel
    balance: SmallBalance
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
    if not uses_compiled_slope(model, H):
        return None
    shape = (*model.springs.shape, 2 * H + 1)
    return CompiledPath(model, small_balance(model, H, samples), shape, samples)


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
        x, code, steps, error, slope, sign, f, probe, shares, measures, periodic = _correct_step(
            guess[0],
            w,
            across,
            direction[1],
            *scales,
            *path.balance,
            d,
            d - path.model.elements.tangents,
            tolerance,
            corrections,
            signed,
        )
    except np.linalg.LinAlgError:
        return outcome_reason(Outcome.SINGULAR, np.nan, corrections)
    except ZeroDivisionError:
        # a resonance without damping
        return None
    if code != CONVERGED:
        return outcome_reason(Outcome(code), error, steps)
    if not periodic:
        return None
    bodies = path.balance.bodies
    carried = measures[2]
    fault = rest_fault(path.model, bodies.B, shares, carried) if carried > CARRIED_SHARE else ""
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
            (steps, error, BY_LU),
            count_states(shares).tolist(),
            measures.tolist(),
        ),
        PATH_FOLLOWING,
    )
    return CompiledEnd(point, slope.reshape(path.shape), sign)


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
    d,
    normals,
    tolerance,
    corrections,
    signed,
):
    """Bring the frequency x and w (m, K), which is changed, back to the path.

    Args:
        across: (m, K) direction in displacements over `size`, times the weight of each.
        normals: normal directions in the balance, 0 or 1 a node.

    Returns:
        x, how the loop ended, steps, error, slope (m, K), sign of the determinant, forces,
        probes, shares (n, 3) of stick, slip and separation, what `measure_point` gives, and
        whether the forces are periodic.
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
    measures = np.zeros(MEASURES)
    sign = 0.0
    steps = 0
    accuracy = STEP_ACCURACY
    while True:
        modal, linear, free, _ = linear_part(x, bodies, springs, K // 2)
        error = evaluate(w, d, linear, contact, patterns, room)
        code = stop_code(error, tolerance, steps, corrections)
        if code != SEARCHING and code != CONVERGED:
            break
        nodes, C, few, level = linearise_nodes(room.J, linear, d, STICKING_FORCE_SHARE)
        _, rate = residual_rate(x, bodies, modal, linear, contact[5], room.F)
        factors = newton_step(
            rate, accuracy, d, nodes, C, linear.flex, few, no_factors(), level, along
        )
        # where iterations did not converge once they mostly do not
        accuracy = 0.0 if factors[1].size else accuracy
        if code == CONVERGED:
            if signed:
                sign = _determinant_sign(few, C)
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
    along *= -1.0
    periodic = room.cycles.min() >= 0
    return x, code, steps, error, along, sign, f, probe, room.shares, measures, periodic
