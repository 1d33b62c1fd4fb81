"""How a small balance changes with the frequency, compiled: along a path, and at a
solved point.

The same by `bladefem.hbm.parameter_derivatives` takes some forty calls of NumPy, which were two
thirds of the time of a path and a quarter of that of a sweep with few contacts.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.condensation_compiled import linear_part, modal_motion
from ..linear.contact_flexibility import apply_flexibility
from ..linear.packed_bodies import Bodies
from ..model import ReducedModel
from ..point_measures import complex_amplitude, motion_under_load
from ..policy import uses_compiled_slope
from ..solution import Solution
from .law_evaluation import empty_room, evaluate
from .newton_compiled import linearise_nodes, newton_step, no_factors
from .residual import STICKING_FORCE_SHARE
from .small_balance import small_balance

# relative accuracy of derivatives where they are solved for by iterations
SLOPE_ACCURACY = 1e-9


def frequency_slope(model: ReducedModel, point: Solution) -> tuple[np.ndarray, np.ndarray] | None:
    """Derivatives of a solved point with the circular frequency: (n, d, K) of the displacements [m
    s], and (H+1, probes) of the complex amplitudes at the probes [m s]; None if compiled points do
    not apply, or the derivative is singular.
    """
    if point.walk is not None or not uses_compiled_slope(model, point.harmonics):
        return None
    small = small_balance(model, point.harmonics, point.samples)
    n, d, K = point.w.shape
    w = np.ascontiguousarray(point.w, dtype=float).reshape(n * d, K)
    try:
        slope, probe = _slope_at(point.omega, w, *small, _without_excitation(small.bodies), d)
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return None
    return slope.reshape(n, d, K), probe


def _without_excitation(bodies: Bodies) -> Bodies:
    """The bodies that nothing but contact forces moves."""
    return bodies._replace(push=np.zeros_like(bodies.push), straight=np.zeros_like(bodies.straight))


@njit(**KERNEL)
def _slope_at(omega, w, bodies, springs, contact, patterns, unexcited, d):
    """Derivatives with the frequency of the displacements (m, K) and probes (H+1, p) at a solved
    point.

    Args:
        unexcited: the bodies without excitation.
    """
    m, K = w.shape
    modal, linear, free, _ = linear_part(omega, bodies, springs, K // 2)
    room = empty_room(m, d, K, patterns)
    evaluate(w, d, linear, contact, patterns, room)
    nodes, C, few, level = linearise_nodes(room.J, linear, d, STICKING_FORCE_SHARE)
    rates, rate = residual_rate(omega, bodies, modal, linear, contact[5], room.F)
    slope = np.empty((m, K))
    newton_step(rate, SLOPE_ACCURACY, d, nodes, C, linear.flex, few, no_factors(), level, slope)
    slope *= -1.0
    change = _force_change(room.J, slope, d)
    probe = np.empty(bodies.straight.shape, np.complex128)
    # the mean motion without contact forces does not change with the frequency
    motion_under_load(unexcited, (modal, np.zeros_like(free)), change, slope, springs, probe)
    for h in range(1, probe.shape[0]):
        shapes = bodies.probe[min(h, bodies.probe.shape[0] - 1)]
        for a in range(probe.shape[1]):
            for k in range(rates.shape[1]):
                probe[h, a] += shapes[a, k] * rates[h, k]
    return slope, probe


@njit(**INNER_KERNEL)
def _force_change(J, change, d):
    """(m, K) change of the contact forces by that of the displacements (m, K), from df/dw (n, a, K,
    a, K), whose last d directions are those of the balance.
    """
    m, K = change.shape
    first = J.shape[1] - d
    out = np.zeros((m, K))
    for i in range(m):
        for b in range(d):
            row = J[i // d, first + i % d, :, first + b]
            for k in range(K):
                for l in range(K):
                    out[i, k] += row[k, l] * change[i // d * d + b, l]
    return out


@njit(**KERNEL)
def residual_rate(omega, bodies, modal, linear, preload, F):
    """Derivatives with the frequency at constant displacements: (H+1, M) of the modal amplitudes
    under constant contact forces F (n, a, K), and (m, K) of the residual.

    Args:
        modal: modal flexibilities of `linear_part`, as `linear`.
    """
    D, full = modal
    springs = linear.springs
    m, K = linear.stuck.shape
    M = D.shape[1]
    d = m // F.shape[0]
    first = F.shape[1] - d
    load = np.empty((m, K))
    for i in range(m):
        for k in range(K):
            load[i, k] = F[i // d, first + i % d, k] - (preload[i] if k == 0 else 0.0)
    rates = np.zeros((D.shape[0], M), np.complex128)
    moved = np.zeros((m, K))
    forces = np.empty(M, np.complex128)
    for h in range(1, D.shape[0]):
        shapes = bodies.contact[min(h, bodies.contact.shape[0] - 1)]
        for k in range(M):
            forces[k] = bodies.push[h, k]
            for i in range(m):
                forces[k] -= shapes[i, k].conjugate() * complex_amplitude(load, i, h)
        q = modal_motion(D, full, h, forces)
        _impedance_rate(h, omega, bodies, q, forces)
        pushed = modal_motion(D, full, h, forces)
        for k in range(M):
            rates[h, k] = -pushed[k]
            for i in range(m):
                part = shapes[i, k] * rates[h, k]
                moved[i, 2 * h - 1] += part.real
                moved[i, 2 * h] -= part.imag
    sprung = np.empty((m, K))
    out = np.empty((m, K))
    for i in range(m):
        for k in range(K):
            sprung[i, k] = springs[i] * moved[i, k]
            out[i, k] = -moved[i, k]
    apply_flexibility(linear.flex, sprung, out)
    return rates, out


@njit(**INNER_KERNEL)
def _impedance_rate(h, omega, bodies, q, out):
    """Fill out (M,): the derivative of the modal impedances of harmonic h with the frequency, times
    modal amplitudes q (M,).
    """
    viscous = bodies.viscous[min(h, bodies.viscous.shape[0] - 1)]
    for k in range(q.size):
        out[k] = h * complex(-2.0 * h * omega, viscous[k]) * q[k]
    if bodies.coupled.shape[0]:
        coupled = np.dot(bodies.coupled[min(h, bodies.coupled.shape[0] - 1)], q)
        for k in range(q.size):
            out[k] += complex(0.0, h) * coupled[k]
