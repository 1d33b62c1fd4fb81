"""Plain slow twins: the friction march by the textbook, sample after sample, with its derivative
carried along.
"""

from dataclasses import dataclass

import numpy as np


@dataclass
class PlainForces:
    f: np.ndarray
    dfdw: np.ndarray
    dissipated: np.ndarray


def waves(H, samples):
    t = 2 * np.pi * np.arange(samples) / samples
    return np.column_stack(
        [np.ones(samples)] + [g(h * t) for h in range(1, H + 1) for g in (np.cos, np.sin)]
    )


def plain_forces(elements, w, samples, jacobian=True, laps=200):
    """Forces (n, d, 2H+1) of the elements for relative displacements w (n, d, 2H+1), d = [normal +]
    tangents.
    """
    n, d, K = w.shape
    f, J, work = np.zeros((n, d, K)), np.zeros((n, d, K, d, K)), np.zeros(n)
    T = waves(K // 2, samples)
    P = 2 * T.T / samples
    P[0] /= 2
    for i in range(n):
        kt, kn, mu, n0 = (getattr(elements, name)[i] for name in ("kt", "kn", "mu", "n0"))
        motion, basis = w[i] @ T.T, np.zeros((d, samples, d, K))
        for a in range(d):
            basis[a, :, a] = T
        if d == elements.tangents:
            N, dN, tangent, dtangent = (
                np.full(samples, n0),
                np.zeros((samples, d, K)),
                motion,
                basis,
            )
        else:
            N, dN, tangent, dtangent = n0 + kn * motion[0], kn * basis[0], motion[1:], basis[1:]
        N, dN = np.maximum(N, 0), np.where((N > 0)[:, None, None], dN, 0)
        force, dforce, last = kt * tangent[:, 0], kt * dtangent[:, 0], None
        for _ in range(laps):
            fs, dfs, work[i] = (
                np.zeros((len(tangent), samples)),
                np.zeros((len(tangent), samples, d, K)),
                0,
            )
            for s in range(samples):
                step = tangent[:, s] - tangent[:, s - 1]
                trial, dtrial = (
                    force + kt * step,
                    dforce + kt * (dtangent[:, s] - dtangent[:, s - 1]),
                )
                size, limit = np.linalg.norm(trial), mu * N[s]
                if size > limit:
                    along = trial / size
                    dsize = np.einsum("a,abk->bk", along, dtrial)
                    new = limit * along
                    dnew = mu * along[:, None, None] * dN[s] + limit / size * (
                        dtrial - along[:, None, None] * dsize
                    )
                else:
                    new, dnew = trial, dtrial
                work[i] += (new + force) / 2 @ step
                force, dforce = new, dnew
                fs[:, s], dfs[:, s] = force, dforce
            if last is not None and abs(fs - last).max() <= 1e-13 * abs(fs).max():
                break
            last = fs
        f[i, d - len(fs) :] = fs @ P.T
        J[i, d - len(fs) :] = np.einsum("asbk,cs->acbk", dfs, P)
        if d > elements.tangents:
            f[i, 0], J[i, 0] = P @ N, np.einsum("sbk,cs->cbk", dN, P)
    return PlainForces(f, J, work)


def marched_wedge(model, omega, periods, ramp, steps=800, damping=200.0):
    """Plain explicit integration of the wedge between two masses, from the preload state at rest
    with a force that grows over some periods: displacement of the first mass (steps,), mean forces
    (2, 2) normal and tangential of the last period, and whether each contact slipped in it.
    """
    a = np.radians(40.0)
    first = np.array([[0.0, -np.sin(a), np.cos(a)], [0.0, np.cos(a), np.sin(a)]])
    W = np.zeros((4, 4))
    # coordinates: masses along y, wedge along x, y; relative displacement mass minus wedge
    W[:2, 0] = [np.cos(a), np.sin(a)]
    W[:2, 2:] = -first[:, 1:]
    W[2:, 1] = [-np.cos(a), -np.sin(a)]
    W[2:, 2:] = [[np.sin(a), np.cos(a)], [-np.cos(a), np.sin(a)]]
    mass = np.array([10.0, 10.0, 0.1, 0.1])
    K = np.diag([1e6, 4e5, 1e6, 1e6])
    K[0, 1] = K[1, 0] = -1e5
    C = damping * np.eye(4)
    e = model.elements
    t0 = e.traction[:, 0]
    static = np.column_stack([e.n0, t0]).ravel()
    dt = 2 * np.pi / omega / steps
    q, v = np.zeros(4), np.zeros(4)
    friction, before = (t0 if model.start is None else model.start[:, 0]).copy(), np.zeros(2)
    force = np.zeros(4)
    moved, carried, slips = np.empty(steps), np.zeros((2, 2)), np.zeros(2, dtype=bool)
    for step in range(periods * steps):
        w = W @ q
        normal = np.maximum(e.n0 + e.kn * w[::2], 0.0)
        trial = friction + e.kt * (w[1::2] - before)
        limit = e.mu * normal
        friction = np.clip(trial, -limit, limit)
        before = w[1::2]
        force[::2], force[1::2] = normal, friction
        push = -W.T @ (force - static) - K @ q - C @ v
        grown = min(1.0, step / (ramp * steps))
        push[0] += grown * model.excitation[1][0] * np.cos(omega * step * dt)
        v = v + dt * push / mass
        q = q + dt * v
        if step >= (periods - 1) * steps:
            moved[step % steps] = q[0]
            carried += np.column_stack([normal, friction]) / steps
            slips |= np.abs(trial) > limit
    return moved, carried, slips
