"""A whole point of a small model of 1-D elements in one compiled call: flexibilities, Newton, works
and states.

The plain way through `bladefem.hbm.linear.condensation`, `newton` and `api` does the same in fifty
NumPy calls, which is most of its time where there are few contacts. A point that does not end well
is left to the fallback chain; a test holds the two ways together.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from typing import Any

import numpy as np
from numba import njit

from ...friction.states import NODE_STATES
from ..linear.condensation_compiled import linear_part
from ..linear.packed_bodies import prepared_bodies
from ..model import ReducedModel
from ..point_measures import carried_load, count_states
from ..policy import COMPILED_POINT
from ..predictor import PREDICTOR_POINTS, append_solution, extrapolate_solution
from ..solution import Solution, Work
from .newton import SHORTEST_STEP_SHARE, Options, route_of, solvers_of
from .newton_compiled import CONVERGED, compiled_newton
from .residual import STICKING_FORCE_SHARE, contact_table
from .walking import CARRIED_SHARE


def solve_small(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: np.ndarray | None,
    options: Options,
) -> Solution | None:
    """The converged solution from displacements (n, d, *), else from full stick; None if compiled
    points do not apply.
    """
    for known in ([] if start is None else [(omega, start)], []):
        found = _solve_points(model, np.array([omega]), H, samples, known, options)
        if found or start is None:
            return found[0] if found else None
    return None


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
    prepared = _prepared_arguments(model, H, samples)
    if prepared is None:
        return []
    bodies, springs, contact = prepared
    (n, d), K = model.springs.shape, 2 * H + 1
    at = np.zeros(PREDICTOR_POINTS)
    begin = np.zeros((PREDICTOR_POINTS, n * d, K))
    for i, (omega, w) in enumerate(known):
        kept = min(K, w.shape[2])
        at[i], begin[i, :, :kept] = omega, w[:, :, :kept].reshape(n * d, kept)
    try:
        w, ends, f, probe, counts, measures = _compiled_points(
            omegas,
            bodies,
            springs,
            contact,
            d,
            H,
            begin,
            at,
            len(known),
            chained,
            options.tolerance,
            options.iterations,
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
    return [_point_solution(H, samples, point) for point in accepted]


def _point_solution(
    H: int,
    samples: int,
    point: tuple[Any, ...],
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
        method="newton",
        iterations=int(steps),
        residual=error,
        residual_displacement=moved,
        residual_force=pushed,
        drift=0.0,
        states=dict(zip(NODE_STATES, states, strict=True)),
        work=Work(*works),
        route=route_of(COMPILED_POINT, solvers_of(int(solver))),
    )


@njit(cache=True, error_model="numpy")
def _compiled_points(
    omegas, bodies, springs, contact, d, H, known, at, count, chained, tolerance, iterations
):
    """Displacements (p, m, K), steps, error and solver (p, 3), and what `_measure_point` gives, of
    the first frequencies.

    They start from the curve through `count` of known (3, m, K) at the frequencies at (3,), which
    are changed here; from full stick where count is 0. Ends before the first that does not
    converge. If chained is 0 all have the same start; else the known are those solved last, and
    none where all contacts stick; 2 ends with such a point.
    """
    p = omegas.size
    m = springs.size
    K = 2 * H + 1
    w = np.empty((p, m, K))
    f = np.empty((p, m // d, d, K))
    ends = np.empty((p, 3))
    counts = np.empty((p, 4), np.int64)
    measures = np.empty((p, 7))
    probe = np.empty((p, *bodies.straight.shape), np.complex128)
    done = 0
    for i in range(p):
        flexible, linear, free = linear_part(omegas[i], bodies, springs, H)
        if count:
            extrapolate_solution(omegas[i], known, at, count, w[i])
        else:
            w[i] = linear.stuck
        steps, code, error, F, _, shares, residual, _, solver = compiled_newton(
            w[i],
            d,
            linear,
            contact,
            STICKING_FORCE_SHARE,
            tolerance,
            iterations,
            SHORTEST_STEP_SHARE,
        )
        if code != CONVERGED:
            break
        done = i + 1
        ends[i, 0] = steps
        ends[i, 1] = error
        ends[i, 2] = solver
        f[i], probe[i], counts[i], measures[i] = _measure_point(
            omegas[i], bodies, springs, (flexible, free), w[i], d, F, contact[5], residual, shares
        )
        if chained:
            sticks = counts[i, 0] == m // d
            count = 0 if sticks else append_solution(omegas[i], w[i], known, at, count)
            if chained == 2 and sticks:
                break
    return w[:done], ends[:done], f[:done], probe[:done], counts[:done], measures[:done]


def compiles_points(model: ReducedModel, H: int) -> bool:
    """True if points of the model are compiled as a whole."""
    return prepared_bodies(model, H) is not None


def _prepared_arguments(
    model: ReducedModel,
    H: int,
    samples: int,
) -> tuple | None:
    """What a point needs beside its frequency; made once."""
    bodies = prepared_bodies(model, H)
    return (
        None
        if bodies is None
        else (bodies, model.springs.ravel(), contact_table(model, H, samples))
    )


@njit(cache=True, error_model="numpy")
def _measure_point(omega, bodies, springs, linear, w, d, F, preload, residual, shares):
    """Forces (n, d, K), probe (H+1, p), numbers of states (4,); residuals, load on the springs of
    the regularisation and works (7,).
    """
    m, K = w.shape
    f = np.empty((m // d, d, K))
    load = np.empty((m, K))
    out = np.zeros(7)
    for i in range(m):
        for k in range(K):
            f[i // d, i % d, k] = F[i // d, 2 - d + i % d, k]
            load[i, k] = f[i // d, i % d, k] - (preload[i] if k == 0 else 0.0)
            out[0] = max(out[0], abs(residual[i, k]))
            out[1] = max(out[1], springs[i] * abs(residual[i, k]))
    out[2] = carried_load(bodies.B, bodies.g, load)
    modal, probe = _blade_motion(bodies, linear, load, w, springs)
    _period_works(omega, bodies, modal, load, w, d, out[3:])
    return f, probe, count_states(shares), out


@njit(cache=True, error_model="numpy")
def _blade_motion(bodies, linear, load, w, springs):
    """Modal amplitudes (H+1, M) and probes (H+1, p) under the excitation and the contact load (m,
    K).
    """
    flexible, free = linear
    contact = bodies.contact
    probes = bodies.probe
    across = bodies.across
    push = bodies.push
    straight = bodies.straight
    mean = bodies.mean_G
    still = bodies.still
    m = load.shape[0]
    H = flexible.shape[0] - 1
    M = flexible.shape[1]
    B = bodies.B
    r = bodies.B.shape[1]
    modal = np.empty((H + 1, M), np.complex128)
    probe = np.empty(straight.shape, np.complex128)
    rigid = np.zeros(still.size)
    for a in range(r):
        along = 0.0
        for i in range(m):
            gap = w[i, 0] - free[0, i].real
            for j in range(m):
                gap += mean[i, j] * load[j, 0]
            along += B[i, a] * springs[i] * gap
        for k in range(rigid.size):
            rigid[k] += bodies.rigid[k, a] * along
    for h in range(H + 1):
        s = min(h, contact.shape[0] - 1)
        for k in range(M):
            modal[h, k] = push[h, k]
            for i in range(m):
                modal[h, k] -= contact[s, i, k].conjugate() * _complex_amplitude(load, i, h)
            modal[h, k] *= flexible[h, k]
        for a in range(probe.shape[1]):
            probe[h, a] = straight[h, a]
            for k in range(M):
                probe[h, a] += probes[min(h, probes.shape[0] - 1), a, k] * modal[h, k]
            for i in range(m):
                probe[h, a] -= across[min(h, across.shape[0] - 1), a, i] * _complex_amplitude(
                    load, i, h
                )
    for a in range(probe.shape[1]):
        for k in range(rigid.size):
            probe[0, a] += probes[0, a, still[k]] * rigid[k]
    return modal, probe


@njit(cache=True, error_model="numpy", inline="always")
def _complex_amplitude(x, i, h):
    return complex(x[i, 2 * h - 1], -x[i, 2 * h]) if h else complex(x[i, 0], 0.0)


@njit(cache=True, error_model="numpy")
def _period_works(omega, bodies, modal, load, w, d, out):
    """out (4,): work of the excitation, lost in the bodies, of the balanced friction forces,
    dissipated in contacts.
    """
    own = bodies.own
    viscous = bodies.viscous
    hysteretic = bodies.hysteretic
    push = bodies.push
    direct = bodies.direct
    for h in range(1, modal.shape[0]):
        s = min(h, own.shape[0] - 1)
        for k in range(modal.shape[1]):
            q = modal[h, k]
            out[0] -= np.pi * h * (push[h, k].conjugate() * q).imag
            loss = h * omega * viscous[s, k] + hysteretic[s, k]
            out[1] += np.pi * h * loss * (q.real**2 + q.imag**2)
        for i in range(load.shape[0]):
            force = _complex_amplitude(load, i, h)
            out[0] += np.pi * h * (direct[h, i].conjugate() * force).imag
            friction = np.pi * h * (force * _complex_amplitude(w, i, h).conjugate()).imag
            out[2] += friction
            out[3] += friction if i % d == d - 1 else 0.0
