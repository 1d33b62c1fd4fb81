"""A whole point of a small model in one compiled call: flexibilities, Newton, works and states.

The same kernels one after the other, with NumPy between them, take fifty calls, which is most of
the time where there are few contacts. A point that does not end well is left to the fallback chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from typing import Any

import numpy as np
from numba import njit

from ...friction.states import NODE_STATES
from ...util.numba_options import KERNEL
from ..linear.array_copy import copy_matrix, copy_vector
from ..linear.condensation_compiled import linear_part
from ..model import ReducedModel
from ..point_measures import MEASURES, count_states, measure_point
from ..policy import COMPILED_POINT, uses_compiled_point
from ..predictor import PREDICTOR_POINTS, append_solution, extrapolate_solution
from ..solution import Solution, Work
from .newton import SHORTEST_STEP_SHARE, Options, route_of, solvers_of
from .newton_compiled import CONVERGED, compiled_newton
from .residual import STICKING_FORCE_SHARE
from .small_balance import small_balance
from .walking import CARRIED_SHARE, may_walk

# steps of Newton with two tangents, after which the fallback chain begins, with the same start
MOST_STEPS_2D = 12


def solve_small(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: np.ndarray | None,
    options: Options,
    from_stick: bool = True,
) -> Solution | None:
    """The converged solution from displacements (n, d, *), else from full stick; None if compiled
    points do not apply.

    Args:
        from_stick: also where the displacements do not lead to it and no fallbacks are wanted.
    """
    starts = [] if start is None else [[(omega, start)]]
    if start is None or from_stick or options.fallbacks:
        starts.append([])
    found = (
        _solve_points(model, np.array([omega]), H, samples, known, options) for known in starts
    )
    return next((points[0] for points in found if points), None)


def solve_started(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: np.ndarray,
    options: Options,
) -> Solution | None:
    """The converged solution from displacements (n, d, *) alone; None if there is none, or if
    compiled points do not apply.
    """
    at = np.array([omega])
    found = _solve_points(model, at, H, samples, [(omega, start)], options)
    return found[0] if found else None


def solve_each(
    model: ReducedModel,
    omegas: np.ndarray,
    H: int,
    samples: int,
    options: Options,
) -> list[Solution]:
    """The first frequencies from full stick, as long as they converge; none if compiled points do
    not apply.
    """
    return _solve_points(model, omegas, H, samples, [], options)


def solve_along(
    model: ReducedModel,
    omegas: np.ndarray,
    H: int,
    samples: int,
    last: Sequence[Solution],
    options: Options,
) -> list[Solution]:
    """The first frequencies, each from the curve through the last ones, as long as they converge;
    see `ahead`.

    None if compiled points do not apply.

    Args:
        last: solved points before them; full stick where there is none, or where the last one
            sticks.
        options: frugal ones end with the first at which all contacts stick.
    """
    stuck = not last or last[-1].states["stick"] == len(last[-1].w)
    known = [(p.omega, p.w) for p in ([] if stuck else last[-PREDICTOR_POINTS:])]
    return _solve_points(model, omegas, H, samples, known, options, 2 if options.frugal else 1)


def _solve_points(
    model: ReducedModel,
    omegas: np.ndarray,
    H: int,
    samples: int,
    known: Sequence[tuple[float, np.ndarray]],
    options: Options,
    chained: int = 0,
) -> list[Solution]:
    """The first frequencies, as long as they converge; `known` and `chained` as `_compiled_points`
    takes them.
    """
    if not compiles_points(model, H):
        return []
    one_tangent = model.elements.tangents == 1
    small = small_balance(model, H, samples)
    (n, d), K = model.springs.shape, 2 * H + 1
    at = np.zeros(PREDICTOR_POINTS)
    begin = np.zeros((PREDICTOR_POINTS, n * d, K))
    for i, (omega, w) in enumerate(known):
        kept = min(K, w.shape[2])
        at[i], begin[i, :, :kept] = omega, w[:, :, :kept].reshape(n * d, kept)
    try:
        w, ends, f, probe, counts, measures = _compiled_points(
            # numbers of another type would be compiled for anew
            np.asarray(omegas, dtype=float),
            *small,
            d,
            d - model.elements.tangents,
            H,
            begin,
            at,
            len(known),
            chained,
            options.tolerance,
            options.iterations if one_tangent else min(options.iterations, MOST_STEPS_2D),
        )
    except (ZeroDivisionError, np.linalg.LinAlgError):
        # a resonance without damping: the plain way tells which
        return []
    parts = zip(
        omegas.tolist(),
        w.reshape(len(w), n, d, K),
        f,
        probe,
        ends.tolist(),
        counts.tolist(),
        measures.tolist(),
        strict=False,
    )
    # a damper that walks is left to the plain way
    accepted = takewhile(lambda point: point[-1][2] <= CARRIED_SHARE, parts)
    return [point_solution(H, samples, point) for point in accepted]


def point_solution(
    H: int,
    samples: int,
    point: tuple[Any, ...],
    method: str = "newton",
) -> Solution:
    """A converged point as `_compiled_points` hands it out."""
    omega, w, f, probe, end, states, measures = point
    steps, error, solver = end
    moved, pushed, _, *works = measures
    return Solution(
        omega=omega,
        harmonics=H,
        samples=samples,
        w=w,
        f=f,
        probe=probe,
        converged=True,
        reason="residual within tolerance",
        method=method,
        iterations=int(steps),
        residual=error,
        residual_displacement=moved,
        residual_force=pushed,
        drift=0.0,
        states=dict(zip(NODE_STATES, states, strict=True)),
        work=Work(*works),
        route=route_of(COMPILED_POINT, solvers_of(int(solver))),
    )


@njit(cache=True, error_model="numpy", inline="always")
def _empty_points(p, n, d, K):
    """Room for p points: displacements (p, n d, K), forces (p, n, d, K), ends (p, 3), counts (p,
    4), measures (p, MEASURES).
    """
    return (
        np.empty((p, n * d, K)),
        np.empty((p, n, d, K)),
        np.empty((p, 3)),
        np.empty((p, 4), np.int64),
        np.empty((p, MEASURES)),
    )


@njit(**KERNEL)
def _compiled_points(
    omegas,
    bodies,
    springs,
    contact,
    patterns,
    d,
    normals,
    H,
    known,
    at,
    count,
    chained,
    tolerance,
    iterations,
):
    """Displacements (p, m, K), steps, error and solver (p, 3), and what `measure_point` gives, of
    the first frequencies.

    They start from the curve through `count` of known (3, m, K) at the frequencies at (3,), which
    are changed here; from full stick where count is 0. Ends before the first that does not
    converge. If chained is 0 all have the same start; else the known are those solved last, and
    none where all contacts stick; 2 ends with such a point.
    """
    nodes = springs.size // d
    w, f, ends, counts, measures = _empty_points(omegas.size, nodes, d, 2 * H + 1)
    probe = np.empty((omegas.size, *bodies.straight.shape), np.complex128)
    done = 0
    for i in range(omegas.size):
        modal, linear, free, _ = linear_part(omegas[i], bodies, springs, H)
        if count:
            extrapolate_solution(omegas[i], known, at, count, w[i])
        else:
            copy_matrix(linear.stuck, w[i])
        steps, code, error, room, solver = compiled_newton(
            w[i],
            d,
            linear,
            contact,
            patterns,
            STICKING_FORCE_SHARE,
            tolerance,
            iterations,
            SHORTEST_STEP_SHARE,
        )
        if code != CONVERGED or room.cycles.min() < 0:
            break
        done = i + 1
        ends[i, 0] = steps
        ends[i, 1] = error
        ends[i, 2] = solver
        measure_point(
            omegas[i],
            bodies,
            springs,
            (modal, free),
            w[i],
            normals,
            room.F,
            contact[5],
            room.residual,
            f[i],
            probe[i],
            measures[i],
        )
        copy_vector(count_states(room.shares), counts[i])
        if chained:
            sticks = counts[i, 0] == nodes
            count = 0 if sticks else append_solution(omegas[i], w[i], known, at, count)
            if chained == 2 and sticks:
                break
    return w[:done], ends[:done], f[:done], probe[:done], counts[:done], measures[:done]


def compiles_points(model: ReducedModel, H: int) -> bool:
    """True if points of the model are compiled as a whole; with two tangents not where its damper
    may walk, since all steps would be for nothing where it does.
    """
    return uses_compiled_point(model, H) and (model.elements.tangents == 1 or not may_walk(model))
