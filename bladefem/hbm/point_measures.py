"""What every solved point reports, compiled: motion of the probes, works, residuals, numbers of
states, and the load on the springs that choose the mean position of a damper on which every contact
slips.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..util.numba_options import INNER_KERNEL, KERNEL
from .linear.array_copy import copy_vector
from .linear.condensation_compiled import modal_motion

# share of a period below which a contact is not counted as closed, or as open
ROUNDING_SHARE = 1e-12
# numbers that `measure_point` gives: residuals, load on the regularisation, works
MEASURES = 7


@njit(**KERNEL)
def count_states(shares):
    """(4,) nodes that stick, slip, lift off, are open (`friction.states.NODE_STATES`), from the
    shares (n, 3) of stick, slip and separation.
    """
    counts = np.zeros(4, np.int64)
    for i in range(shares.shape[0]):
        if shares[i, 0] + shares[i, 1] <= ROUNDING_SHARE:
            counts[3] += 1
        elif shares[i, 2] > ROUNDING_SHARE:
            counts[2] += 1
        else:
            counts[1 if shares[i, 1] > 0.0 else 0] += 1
    return counts


@njit(**INNER_KERNEL)
def carried_load(B, g, load):
    """Load on the springs of the regularisation over what the contacts could carry, both on the
    motions without stiffness B (m, r) under the loads g (r,), for contact forces (m, K) [N]; 0
    without such motions.
    """
    held = 0.0
    carried = 0.0
    for a in range(B.shape[1]):
        push = -g[a]
        most = 0.0
        for i in range(B.shape[0]):
            push += B[i, a] * load[i, 0]
            total = 0.0
            for k in range(load.shape[1]):
                total += load[i, k] * load[i, k]
            most += abs(B[i, a]) * np.sqrt(total)
        held += push**2
        carried += most**2
    return np.sqrt(held) / max(np.sqrt(carried), 1e-300)


@njit(**KERNEL)
def measure_point(omega, bodies, springs, linear, w, normals, F, preload, residual, f, probe, out):
    """Fill f (n, d, K), the contact forces of the balance, probe (H+1, p), and out (7,): largest
    residual [m] and residual force [N], load on the springs of the regularisation [1], works of the
    excitation, in the bodies, of the balanced friction forces, dissipated in contacts [J].

    Args:
        linear: modal flexibilities and free displacements of `linear_part`.
        w: (m, K) displacements; residual (m, K).
        normals: normal directions in the balance, 0 or 1 a node.
        F: (n, a, K) contact forces, whose last directions are those of the balance.
        preload: (m,) their part in the preload state [N].
    """
    m, K = w.shape
    d = f.shape[1]
    first = F.shape[1] - d
    load = np.empty((m, K))
    out[:] = 0.0
    for i in range(m):
        for k in range(K):
            f[i // d, i % d, k] = F[i // d, first + i % d, k]
            load[i, k] = f[i // d, i % d, k] - (preload[i] if k == 0 else 0.0)
            out[0] = max(out[0], abs(residual[i, k]))
            out[1] = max(out[1], springs[i] * abs(residual[i, k]))
    out[2] = carried_load(bodies.B, bodies.g, load)
    modal = motion_under_load(bodies, linear, load, w, springs, probe)
    _period_works(omega, bodies, modal, load, w, d, normals, out[3:])


@njit(**INNER_KERNEL)
def motion_under_load(bodies, linear, load, w, springs, probe):
    """Modal amplitudes (H+1, M) under the excitation and the contact load (m, K); fills probe (H+1,
    p).
    """
    (D, full), free = linear
    contact = bodies.contact
    probes = bodies.probe
    across = bodies.across
    push = bodies.push
    straight = bodies.straight
    mean = bodies.mean_G
    still = bodies.still
    m = load.shape[0]
    H = D.shape[0] - 1
    M = D.shape[1]
    B = bodies.B
    r = bodies.B.shape[1]
    modal = np.empty((H + 1, M), np.complex128)
    forces = np.empty(M, np.complex128)
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
            forces[k] = push[h, k]
            for i in range(m):
                forces[k] -= contact[s, i, k].conjugate() * complex_amplitude(load, i, h)
        copy_vector(modal_motion(D, full, h, forces), modal[h])
        for a in range(probe.shape[1]):
            probe[h, a] = straight[h, a]
            for k in range(M):
                probe[h, a] += probes[min(h, probes.shape[0] - 1), a, k] * modal[h, k]
            for i in range(m):
                probe[h, a] -= across[min(h, across.shape[0] - 1), a, i] * complex_amplitude(
                    load, i, h
                )
    for a in range(probe.shape[1]):
        for k in range(rigid.size):
            probe[0, a] += probes[0, a, still[k]] * rigid[k]
    return modal


@njit(cache=True, error_model="numpy", inline="always")
def complex_amplitude(x, i, h):
    return complex(x[i, 2 * h - 1], -x[i, 2 * h]) if h else complex(x[i, 0], 0.0)


@njit(**INNER_KERNEL)
def _period_works(omega, bodies, modal, load, w, d, normals, out):
    """out (4,): work of the excitation, lost in the bodies, of the balanced contact forces,
    dissipated by their tangential part, over one period.
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
        if bodies.coupled.shape[0]:
            moved = np.dot(bodies.coupled[min(h, bodies.coupled.shape[0] - 1)], modal[h])
            for k in range(modal.shape[1]):
                out[1] += np.pi * h * h * omega * (modal[h, k].conjugate() * moved[k]).real
        for i in range(load.shape[0]):
            force = complex_amplitude(load, i, h)
            out[0] += np.pi * h * (direct[h, i].conjugate() * force).imag
            friction = np.pi * h * (force * complex_amplitude(w, i, h).conjugate()).imag
            out[2] += friction
            out[3] += friction if i % d >= normals else 0.0
