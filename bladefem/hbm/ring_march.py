"""Blades and dampers marched in time from a motion of the balance, all blades of a travelling wave
free to move as they like.

The steady motion without contact forces is known; what is marched is the motion that the contact
forces add to it. The bodies are integrated exactly for forces that are linear between two instants
(`bladefem.hbm.linearised_flow`); the forces at the end of a step follow from the friction law node
by node: a Newton step of each in turn, until none changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ..errors import InputError
from ..friction.fourier import synthesis, to_complex, to_real
from ..util.numba_options import INNER_KERNEL, KERNEL
from .linear.condensation import condense
from .linearised_flow import _step_2d, linear_steps
from .model import ReducedModel
from .sector_modes import SectorModes, sector_modes
from .solution import Solution
from .solve import free_response

# of the instants of a period
INSTANTS = 256
# most sweeps over the nodes in a step
SWEEPS = 60
# change of a force in a sweep that counts as none, over the largest force
SETTLED = 1e-7


@dataclass(frozen=True)
class RingMarch:
    """Motion of the first probe of each blade."""

    # (periods, r, instants) [m]
    motion: np.ndarray
    # the forces of each step were found
    settled: bool


def march_operations(model: ReducedModel, periods: int, instants: int = INSTANTS) -> float:
    """Of a march, roughly.

    Raises:
        InputError: the wave does not repeat within the harmonics that the model has bodies for.
    """
    system = model.once("ring", lambda: sector_modes(model))
    m, M = system.contact.shape
    return 2.0 * periods * instants * (4 * M**2 + 4 * M * m + 5 * m**2)


def march_ring(
    model: ReducedModel,
    point: Solution,
    disturbance: float,
    periods: int,
    instants: int = INSTANTS,
) -> RingMarch:
    """March from a solution whose modal amplitudes are disturbed.

    Args:
        disturbance: relative, of another size and sign for each mode.
        periods: of the excitation.

    Raises:
        InputError: normal loads are prescribed, a friction law is not Coulomb's, or the wave does
            not repeat within the harmonics that the model has bodies for.
    """
    if model.directions == model.elements.tangents:
        raise InputError("normal loads are prescribed, expected ones that follow the motion")
    if model.elements.law is not None:
        raise InputError("a friction law of its own, expected Coulomb's")
    system = model.once("ring", lambda: sector_modes(model))
    r, M = system.blades, len(system.stiffness)
    # each blade is a share of a period ahead of the one before
    S = r * -(-instants // r)
    H = point.harmonics
    free = _of_blades(condense(model, point.omega, H).free, r, S)
    free_probe = _of_blades(free_response(model, point.omega, H)[:, :1], r, S)
    preload = np.tile(model.preload, r)
    forces = _of_blades(to_complex(point.f).reshape(-1, H + 1).T, r, S)[0]
    q = _modal_start(model, system, point)
    noise = np.random.default_rng(0).standard_normal(M)
    y = np.concatenate([q[0] * (1 + disturbance * noise), q[1]])
    E, G0, G1 = linear_steps(system, 2 * np.pi / point.omega / S)
    before, after = -G0 @ system.contact.T, -G1 @ system.contact.T
    e = model.elements
    w = free[0] + system.contact @ y[:M] - system.residual @ (forces - preload)
    probes = len(system.probe) // r
    motion = np.empty((periods, S, r))
    settled = _march(
        y,
        _three(forces, e.tangents),
        w,
        tuple(map(np.ascontiguousarray, (E, before, after, system.contact))),
        system.residual - system.contact @ after[:M],
        np.tile(np.column_stack([e.kt, e.kn, e.mu]), (r, 1)),
        _normal_loads(model, r, S),
        preload,
        free,
        tuple(
            map(
                np.ascontiguousarray,
                (system.probe[::probes], system.probe_residual[::probes], free_probe),
            )
        ),
        motion,
    )
    return RingMarch(motion.transpose(0, 2, 1), bool(settled))


def _of_blades(amplitudes: np.ndarray, r: int, S: int) -> np.ndarray:
    """(S, r rows) of all blades at the instants from complex amplitudes (H+1, rows) of one."""
    series = synthesis(len(amplitudes) - 1, S) @ to_real(amplitudes.T).T
    return np.concatenate([np.roll(series, -b * S // r, axis=0) for b in range(r)], axis=1)


def _normal_loads(model: ReducedModel, r: int, S: int) -> np.ndarray:
    """(S, r n) normal load at zero displacement [N]."""
    load = to_complex(model.normal_load(max((0, *model.normal)))[:, None])[:, 0]
    return _of_blades(load.T, r, S)


def _three(forces: np.ndarray, tangents: int) -> np.ndarray:
    """(r n, 3) normal force and two tangential ones, the second zero where there is none."""
    own = forces.reshape(-1, 1 + tangents)
    return np.pad(own, ((0, 0), (0, 2 - tangents)))


def _modal_start(
    model: ReducedModel,
    system: SectorModes,
    point: Solution,
) -> tuple[np.ndarray, np.ndarray]:
    """(M,) modal displacements and velocities by the contact forces at phase zero."""
    H, r = point.harmonics, system.blades
    f = to_complex(point.f).reshape(-1, H + 1).T.copy()
    f[0] -= model.preload
    h = np.arange(H + 1)
    turn = np.exp(2j * np.pi * h[:, None] * np.arange(r) / r)
    force = (turn[:, :, None] * f[:, None, :]).reshape(H + 1, -1)
    push = -force @ system.contact
    q = np.zeros_like(push)
    for n in range(1, H + 1):
        w = n * point.omega
        q[n] = np.linalg.solve(np.diag(system.stiffness - w**2) + 1j * w * system.damping, push[n])
    still = system.stiffness <= 0
    q[0, ~still] = push[0, ~still] / system.stiffness[~still]
    if still.any():
        # where the rigid motions rest is known from the contacts; where they walk it is anywhere
        mean = point.w[:, :, 0].ravel()
        if point.walk is not None:
            mean = mean - point.walk @ np.linalg.lstsq(point.walk, mean, rcond=None)[0]
        free = condense(model, point.omega, H).free[0].real
        flexible = system.contact @ q[0].real - system.residual @ force[0].real
        missing = np.tile(mean - free, r) - flexible
        q[0, still] = np.linalg.lstsq(system.contact[:, still], missing, rcond=1e-9)[0]
    velocity = (1j * point.omega * h[:, None] * q).sum(axis=0).real
    return q.sum(axis=0).real, velocity


@njit(**KERNEL)
def _march(y, f, w, bodies, F, table, load, preload, free, probe, motion):
    """Fill motion (periods, S, r); False where the forces of a step were not found.

    Args:
        y: (2M,) modal displacements and velocities, changed; f: (n, 3) contact forces, changed.
        w: (m,) relative displacements, changed.
        bodies: E (2M, 2M), maps (2M, m) of the forces before and after a step, U (m, M).
        F: (m, m) flexibility for the forces after a step.
        table: (n, 3) kt, kn, mu; load: (S, n) normal load at zero displacement.
        preload: (m,) forces under which nothing moves; free: (S, m) motion without contact forces.
        probe: readings (r, M), flexibility (r, m) and free motion (S, r).
    """
    E, before, after, U = bodies
    reading, flexible, steady = probe
    periods, S, _ = motion.shape
    n = len(f)
    m, M = U.shape
    d = m // n
    extra = np.empty(m)
    for i in range(n):
        for a in range(d):
            extra[i * d + a] = f[i, a] - preload[i * d + a]
    settled = True
    for k in range(periods * S):
        motion[k // S, k % S] = steady[k % S] + np.dot(reading, y[:M]) - np.dot(flexible, extra)
        j = (k + 1) % S
        y = np.dot(E, y) + np.dot(before, extra)
        c = free[j] + np.dot(U, y[:M])
        settled &= _contact_forces(c, F, w, f, extra, table, load[k % S], load[j], preload)
        y = y + np.dot(after, extra)
    return settled


@njit(**INNER_KERNEL)
def _contact_forces(c, F, w, f, extra, table, load0, load1, preload):
    """Forces at the end of a step, of w = c - F extra: f, extra and w are those before, and then
    those after. False where they were not found.
    """
    n = len(f)
    m = len(c)
    d = m // n
    old_f = f.copy()
    old_w = w.copy()
    work = (np.empty((d, d)), np.zeros((d, d)), np.empty(d))
    tangents = (np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    largest = 0.0
    for row in range(m):
        largest = max(largest, abs(extra[row] + preload[row]), abs(preload[row]))
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(n):
            first = i * d
            for a in range(first, first + d):
                w[a] = c[a] - _product(F[a], extra)
            node = (table[i], load0[i] + table[i, 1] * old_w[first], load1[i])
            step = _node_force(w, F, first, d, old_w, old_f[i], f[i], node, work, tangents)
            for a in range(d):
                extra[first + a] = f[i, a] - preload[first + a]
            change = max(change, step)
        if change <= SETTLED * largest:
            return True
    return False


# the order of the sum is free, so that it is vectorised
@njit(fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def _product(a, b):
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@njit(**INNER_KERNEL)
def _node_force(w, F, first, d, old_w, old_f, f, node, work, tangents):
    """One Newton step of the forces f of a node at its displacements w; returns the largest
    change.
    """
    parameters, N0, load = node
    kt, kn, mu = parameters
    J, B, gap = work
    _, now, by_load = tangents
    N1 = load + kn * w[first]
    dx = kt * (w[first + 1] - old_w[first + 1])
    dy = kt * (w[first + 2] - old_w[first + 2]) if d > 2 else 0.0
    x, y, _ = _step_2d(old_f[1], old_f[2], dx, dy, (N0, N1, 0.0, 0.0), mu, tangents)
    gap[0] = max(N1, 0.0) - f[0]
    gap[1] = x - f[1]
    if d > 2:
        gap[2] = y - f[2]
    B[0, 0] = kn if N1 > 0.0 else 0.0
    for a in range(1, d):
        B[a, 0] = by_load[a - 1, 1] * kn
        for b in range(1, d):
            B[a, b] = now[a - 1, b - 1] * kt
    for a in range(d):
        for b in range(d):
            J[a, b] = 1.0 if a == b else 0.0
            for k in range(d):
                J[a, b] += B[a, k] * F[first + k, first + b]
    _solve_small(J, gap)
    change = 0.0
    for a in range(d):
        f[a] += gap[a]
        change = max(change, abs(gap[a]))
    return change


@njit(**INNER_KERNEL)
def _solve_small(A, b):
    """Solve A x = b by elimination with pivots, in place."""
    n = len(b)
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if p != k:
            for j in range(n):
                A[k, j], A[p, j] = A[p, j], A[k, j]
            b[k], b[p] = b[p], b[k]
        for i in range(k + 1, n):
            share = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= share * A[k, j]
            b[i] -= share * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
