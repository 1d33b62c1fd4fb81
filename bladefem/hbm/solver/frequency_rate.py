"""Derivatives of a small balance with the frequency, compiled: along a path, and at a solved point.

The same by `bladefem.hbm.parameter_derivatives` takes some forty calls of NumPy, which were two
thirds of the time of a path and a quarter of that of a sweep with few contacts.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.condensation_compiled import modal_motion
from ..linear.contact_flexibility import apply_flexibility
from ..point_measures import complex_amplitude, motion_under_load


@njit(**INNER_KERNEL)
def probe_rate(bodies, unexcited, modal, free, J, springs, rates, slope, d):
    """(H+1, p) derivatives of the amplitudes at the probes with the frequency.

    Args:
        unexcited: the bodies that nothing but contact forces moves.
        J: (n, a, K, a, K) derivative of the forces, whose last d directions are those of the
            balance.
        rates: (H+1, M) derivatives of the modal amplitudes under constant contact forces.
        slope: (m, K) derivative of the displacements.
    """
    change = _force_change(J, slope, d)
    out = np.empty(bodies.straight.shape, np.complex128)
    # the mean motion without contact forces does not change with the frequency
    motion_under_load(unexcited, (modal, np.zeros_like(free)), change, slope, springs, out)
    for h in range(1, out.shape[0]):
        shapes = bodies.probe[min(h, bodies.probe.shape[0] - 1)]
        for a in range(out.shape[1]):
            for k in range(rates.shape[1]):
                out[h, a] += shapes[a, k] * rates[h, k]
    return out


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
