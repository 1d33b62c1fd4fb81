"""The balance at many harmonics against references that know nothing of harmonics.

    python benchmarks/hbm_accuracy.py [names of problems]

1-D elements: shooting on the exact flow between located events, residual of the period 1e-10. The
3-D patch: modes advanced exactly over a step, contact forces linear in it, the 2-D slip law
integrated along each step by its closed form, marched from the balance's own state for a number of
periods and extrapolated in the step. Errors are those of the first harmonic at the probe, relative,
the worst of the frequencies.

Measured (exact: transitions located; the patch has 2048 samples at H 31, 1024 at 15, 256 at 5):

    H                          5/7       15        31        63
    single mass            1.6e-04   1.2e-05   4.7e-07   2.7e-08
    beam, 20 elements      1.8e-05   2.5e-06   8.3e-08   9.6e-10
    chain with lift-off    5.1e-05   3.4e-06   7.3e-08   7.4e-09
    3-D patch, 100 nodes   6.2e-04   3.5e-06   8.3e-07

Two contacts of the chain stick all the time and could carry any mean force: left to the shooting it
moves by 8e-6, and with it the reference by 6e-8, which is more than the error of the balance with
63 harmonics.

The marched patch differs by 1.3e-6 between 1024 and 2048 steps before it is extrapolated, so that
8e-7 is the limit of the reference as much as of the balance.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hbm_models import PROBLEMS, Problem
from numba import njit
from scipy import linalg

from bladefem.hbm.solution import Solution
from bladefem.hbm.solve import solve
from bladefem.hbm.time_model import time_system
from bladefem.time.event_integrator import State
from bladefem.time.shooting import periodic_solution, probe_harmonics

FREQUENCIES = {
    "single mass": (0.8, 1.1, 1.4),
    "beam": (7800.0, 8300.0),
    "chain with lift-off": (0.9, 1.1),
    "3-D patch": (0.8,),
}
LEVELS = {"3-D patch": ((5, 256), (15, 1024), (31, 2048))}
EXACT = ((7, 0), (15, 0), (31, 0), (63, 0))  # harmonics, samples


def shooting(problem: Problem, omega: float, near: Solution) -> complex:
    """First harmonic at the probe by shooting from the balance's state at t = 0.

    A contact that sticks all the time may carry any mean force, and Newton's steps move it a
    little: it is set to that of the balance until both agree.
    """
    system = time_system(problem.model, 1)
    lam, V = linalg.eigh(problem.K, problem.M)
    state = _modal_state(
        problem,
        near,
        lam,
        np.einsum("ik,ij,jk->k", V, problem.C, V),
        problem.contact @ V,
        V[problem.load],
        omega,
    )
    side = problem.model.side(1)  # the same modes up to their signs
    signs = np.sign(np.sum(side.shapes[side.ports["contact"]] * (problem.contact @ V), axis=0))
    w, f = (_complex(x).sum(axis=2).real[:, -1] for x in (near.w, near.f))
    start = State(signs * state[:, 0], signs * state[:, 1], w - f / problem.elements.kt)
    for _ in range(8):
        found = periodic_solution(system, omega, start, samples=8192)
        if not found.converged:
            raise RuntimeError(found.reason)
        path, kt = found.trajectory, problem.elements.kt
        moved = abs(path.w - path.force / kt - found.start.z).max(axis=0) > 1e-9 * abs(path.w).max()
        off = np.where(moved, 0.0, path.force.mean(axis=0) - near.f[:, -1, 0])
        if abs(off).max() < 1e-10 * abs(path.force).max():
            break
        start = replace(found.start, z=found.start.z + off / kt)
    return probe_harmonics(found, system, 1)[0, 1]


def marching(problem: Problem, omega: float, near: Solution, periods: int = 30) -> complex:
    """First harmonic at the probe by time integration from the balance's state, with 1024 and 2048
    steps a period.
    """
    coarse, fine = (_march(problem, omega, near, steps, periods) for steps in (1024, 2048))
    print(f"    steps 1024 and 2048 differ by {abs(fine - coarse) / abs(fine):.1e}", flush=True)
    return fine + (fine - coarse) / 3


def _march(problem: Problem, omega: float, near: Solution, steps: int, periods: int) -> complex:
    e = problem.elements
    lam, V = linalg.eigh(problem.K, problem.M)
    D = np.einsum("ik,ij,jk->k", V, problem.C, V)
    C, load = problem.contact @ V, V[problem.load]
    h = 2 * np.pi / omega / steps
    E, g0, g1 = _propagators(lam, D, h)
    state = _modal_state(problem, near, lam, D, C, load, omega)
    excitation = problem.force * np.cos(omega * h * np.arange(steps + 1))
    f = np.real(_complex(near.f).sum(axis=2)).reshape(len(e.kt), 3)
    table = np.column_stack([e.kt, e.kn, e.mu, e.n0])
    S = np.ascontiguousarray((C * g1[:, 0]) @ C.T)
    trace = np.zeros(steps)
    _run(
        state,
        np.ascontiguousarray(C),
        load,
        (E, g0, g1),
        S,
        excitation,
        f.copy(),
        table,
        periods,
        trace,
        load.copy(),
    )
    return 2 * np.mean(trace * np.exp(-2j * np.pi * np.arange(steps) / steps))


def _complex(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x[..., :1].astype(complex), x[..., 1::2] - 1j * x[..., 2::2]], axis=-1)


def _modal_state(
    problem: Problem,
    near: Solution,
    lam: np.ndarray,
    D: np.ndarray,
    C: np.ndarray,
    load: np.ndarray,
    omega: float,
) -> np.ndarray:
    """(modes, 2) displacement and velocity at t = 0 of the balance's solution."""
    force = _complex(near.f).reshape(-1, near.harmonics + 1)
    if problem.model.directions > problem.elements.tangents:
        force[:: problem.model.directions, 0] -= problem.elements.n0
    state = np.zeros((len(lam), 2))
    for k in range(near.harmonics + 1):
        push = -C.T @ force[:, k] + (problem.force * load if k == 1 else 0.0)
        q = push / (lam - (k * omega) ** 2 + 1j * k * omega * D)
        state += np.column_stack([q.real, (1j * k * omega * q).real])
    return state


def _propagators(
    lam: np.ndarray, D: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(modes, 2, 2) free motion over a step, (modes, 2) effects of the forces at its begin and
    end.
    """
    E, g0, g1 = np.empty((len(lam), 2, 2)), np.empty((len(lam), 2)), np.empty((len(lam), 2))
    for k in range(len(lam)):
        A = np.zeros((4, 4))  # q, v, force, its slope
        A[0, 1], A[1, 0], A[1, 1], A[1, 2], A[2, 3] = 1.0, -lam[k], -D[k], 1.0, 1.0
        X = linalg.expm(A * h)
        E[k], g1[k] = X[:2, :2], X[:2, 3] / h
        g0[k] = X[:2, 2] - g1[k]
    return E, g0, g1


@njit(cache=True)
def _slide(fx, fy, dx, dy, R0, R1):
    """Tangential force after the springs' ends moved by (dx, dy) [N] while the limit went from R0
    to R1.
    """
    if R1 <= 0.0:
        return 0.0, 0.0
    ex, ey = fx + dx, fy + dy
    if ex * ex + ey * ey <= R1 * R1:
        return ex, ey
    # where the straight path meets the circle, whose radius changes in proportion
    dR = R1 - R0
    a, b, c = dx * dx + dy * dy - dR * dR, fx * dx + fy * dy - R0 * dR, fx * fx + fy * fy - R0 * R0
    share = 0.0
    if c < 0.0:
        root = np.sqrt(max(b * b - a * c, 0.0))
        share = min(max(-c / (b + root) if b + root > 0.0 else 0.0, 0.0), 1.0)
    R = 0.5 * (R0 + share * dR + R1)
    length = np.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        size = np.sqrt(ex * ex + ey * ey)
        return ex * R1 / size, ey * R1 / size
    ux, uy = dx / length, dy / length
    px, py = fx + share * dx, fy + share * dy
    angle = np.arctan2(ux * py - uy * px, ux * px + uy * py)
    angle = 2.0 * np.arctan(np.tan(0.5 * angle) * np.exp(-(1.0 - share) * length / R))
    c, s = np.cos(angle), np.sin(angle)
    return R1 * (c * ux - s * uy), R1 * (s * ux + c * uy)


@njit(cache=True)
def _contact(w, last, f, table, out):
    """Forces out (n, 3) at w (n, 3), after f (n, 3) at the displacements last (n, 3)."""
    for i in range(len(table)):
        kt, kn, mu, n0 = table[i]
        out[i, 0] = max(n0 + kn * w[i, 0], 0.0)
        dx, dy, R0, R1 = (
            kt * (w[i, 1] - last[i, 1]),
            kt * (w[i, 2] - last[i, 2]),
            mu * f[i, 0],
            mu * out[i, 0],
        )
        if R0 == 0.0 and R1 > 0.0:  # closes within the step: the spring begins where it closed
            before = n0 + kn * last[i, 0]
            share = out[i, 0] / (out[i, 0] - before)
            dx, dy = share * dx, share * dy
        out[i, 1], out[i, 2] = _slide(f[i, 1], f[i, 2], dx, dy, R0, R1)


@njit(cache=True)
def _run(state, C, load, propagators, S, excitation, f, table, periods, trace, probe):
    E, g0, g1 = propagators
    n, steps = len(table), len(trace)
    last = (C @ np.ascontiguousarray(state[:, 0])).reshape(n, 3)
    new, beyond = f.copy(), np.empty(3 * n)
    for _ in range(periods):
        for step in range(steps):
            trace[step] = np.sum(probe * state[:, 0])
            for i in range(3 * n):
                beyond[i] = f[i // 3, i % 3] - (table[i // 3, 3] if i % 3 == 0 else 0.0)
            push = load * excitation[step] - C.T @ beyond
            q = (
                E[:, 0, 0] * state[:, 0]
                + E[:, 0, 1] * state[:, 1]
                + g0[:, 0] * push
                + g1[:, 0] * load * excitation[step + 1]
            )
            v = (
                E[:, 1, 0] * state[:, 0]
                + E[:, 1, 1] * state[:, 1]
                + g0[:, 1] * push
                + g1[:, 1] * load * excitation[step + 1]
            )
            free = C @ q
            for _again in range(4):
                for i in range(3 * n):
                    beyond[i] = new[i // 3, i % 3] - (table[i // 3, 3] if i % 3 == 0 else 0.0)
                w = (free - S @ beyond).reshape(n, 3)
                _contact(w, last, f, table, new)
            for i in range(3 * n):
                beyond[i] = new[i // 3, i % 3] - (table[i // 3, 3] if i % 3 == 0 else 0.0)
            push = C.T @ beyond
            state[:, 0], state[:, 1] = q - g1[:, 0] * push, v - g1[:, 1] * push
            f[:] = new
            last[:] = w


def main(*names: str) -> None:
    print(f"{'problem':22s} {'H':>3s} {'samples':>7s} {'error':>8s} {'s':>6s}")
    for name in names or FREQUENCIES:
        problem, levels = PROBLEMS[name](), LEVELS.get(name, EXACT)
        reference: Callable = marching if name == "3-D patch" else shooting
        solved, spent = {}, {}
        for omega in FREQUENCIES[name]:
            start = None
            for level in levels:
                begin = time.process_time()
                start = solve(problem.model, omega, *level, start=start)
                spent[level] = time.process_time() - begin
                solved[omega, level] = start
        exact = {
            omega: reference(problem, omega, solved[omega, levels[-1]])
            for omega in FREQUENCIES[name]
        }
        for level in levels:
            errors = [
                abs(solved[w, level].probe[1, 0] - exact[w]) / abs(exact[w])
                for w in FREQUENCIES[name]
            ]
            good = all(solved[w, level].converged for w in FREQUENCIES[name])
            print(
                f"{name:22s} {level[0]:3d} {level[1] or 'exact':>7} {max(errors):8.1e} "
                f"{spent[level]:6.1f}{'' if good else '  not converged'}",
                flush=True,
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
