"""Direct time integration of the complete coupled system by Newmark's rule of average acceleration,
for verification.

A step is a small contact problem: w = w_free - G f with the friction law on w, G positive. It is
solved by a Newton that starts from the stick predictor; started from slip, plain Newton on the
displacements can jump between the two slip directions for ever (2-cycle at k h^2 / 4 m > 1). Where
Newton repeats a set of states, Gauss-Seidel sweeps, which converge for every positive G with
prescribed normal loads, take over. Second order in the step; for the error-free reference use the
exact flow in ``events``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.errors import InputError, NotSolvedError

from ..time.event_integrator import State, state_at_rest
from ..time.system import System
from .explicit import Cycle, March, check_steps, explicit_march, march_to_periodic, sample_fourier


def direct(
    system: System,
    omega: float,
    steps: int = 512,
    start: State | None = None,
    most: int = 2000,
    tolerance: float = 1e-6,
    explicit: bool = False,
) -> Cycle:
    """Integrate the coupled system until motion and friction forces repeat over one period.

    Args:
        steps: time steps a period.
        most: largest number of periods.
        tolerance: accepted relative change over a period.
        explicit: leapfrog instead of Newmark.

    Raises:
        InputError: an explicit step beyond the stability limit.
        NotSolvedError: a time step has no solution (possible only where the normal load follows the
            motion).
    """
    if explicit:
        check_steps(system, omega, steps)
    march = (explicit_march if explicit else newmark_march)(system, omega, steps)
    return march_to_periodic(march, start or state_at_rest(system), most, tolerance)


def newmark_march(
    system: System,
    omega: float,
    steps: int,
) -> March:
    """A function that marches one period from t = 0, as ``explicit_march`` does.

    Raises:
        InputError: normal forces react on the motion; only the exact flow and the explicit march do
            that.
        NotSolvedError: by the function, when a time step has no solution.
    """
    if np.any(system.R):
        raise InputError(
            "System.R: expected zeros for Newmark's rule; use the exact flow or the explicit march"
        )
    d = len(system.stiffness)
    h = 2 * np.pi / omega / steps
    S = np.linalg.inv(np.eye(d) + h / 2 * system.damping + h**2 / 4 * np.diag(system.stiffness))
    lag = h**2 / 4 * S @ system.W.T
    arrays = (
        system.stiffness,
        system.damping,
        system.W,
        system.V,
        np.ascontiguousarray(system.W.T),
        system.kt,
        system.mu,
        S,
        system.W @ lag,
        system.V @ lag,
    )
    inputs = tuple(sample_fourier(a, steps) for a in (system.force, system.drive, system.normal))

    def march(state: State) -> tuple[State, np.ndarray, np.ndarray, np.ndarray]:
        y = np.concatenate([state.q, state.v, state.z])
        q, w, force, code = _newmark_step(arrays, y, inputs, h)
        if code:
            raise NotSolvedError(
                f"Newmark step {code - 1} of {steps}: neither Newton nor Gauss-Seidel found the "
                "contact forces"
            )
        return State(y[:d].copy(), y[d : 2 * d].copy(), y[2 * d :].copy()), q, w, force

    return march


@njit(cache=True)
def _friction_law(elastic, bound):
    return min(max(elastic, -bound), bound)


@njit(cache=True)
def contact_step(trial, load, kG, H, mu, f):
    """Forces f (n,) with f = clip(trial - kG f, mu (load - H f)), written into ``f``; True when
    found.

    Args:
        trial, load: (n,) elastic and normal forces that the step would give without contact forces
            [N].
        kG, H: (n, n) how contact forces lower them [1].
    """
    n = len(trial)
    slip = np.zeros(n)
    largest = 0.0
    limit = 0.0
    for i in range(n):
        largest = max(largest, abs(trial[i]))
        limit = max(limit, abs(mu[i] * load[i]))
    size = largest + limit + 1e-300
    A = np.empty((n, n))
    b = np.empty(n)
    for _ in range(30):
        for i in range(n):
            share = slip[i] * mu[i] if abs(slip[i]) == 1.0 else 0.0
            for k in range(n):
                A[i, k] = kG[i, k] if slip[i] == 0.0 else share * H[i, k]
            A[i, i] += 1.0
            b[i] = trial[i] if slip[i] == 0.0 else share * load[i]
        found = np.linalg.solve(A, b)
        for i in range(n):
            f[i] = found[i]
        changed = False
        for i in range(n):
            N = load[i]
            e = trial[i]
            for k in range(n):
                N -= H[i, k] * f[k]
                e -= kG[i, k] * f[k]
            now = 2.0 if N <= 0 else (0.0 if abs(e) <= mu[i] * N + 1e-14 * size else np.sign(e))
            changed = changed or now != slip[i]
            slip[i] = now
        if not changed:
            return True
    for _ in range(20000):
        worst = 0.0
        for i in range(n):
            N = load[i]
            e = trial[i]
            for k in range(n):
                if k != i:
                    N -= H[i, k] * f[k]
                    e -= kG[i, k] * f[k]
            new = _friction_law(e / (1 + kG[i, i]), mu[i] * max(N - H[i, i] * f[i], 0.0))
            worst = max(worst, abs(new - f[i]))
            f[i] = new
        if worst <= 1e-13 * size:
            return True
    return False


# in loops: expressions of small arrays take five times as long to compile
@njit(cache=True)
def _add_product(total, sign, A, x):
    """total (m,) plus a factor times A (m, k) x (k,)."""
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            total[i] += sign * A[i, k] * x[k]


@njit(cache=True)
def _scaled_rows(scale, A):
    """(n, n) rows of A (n, n) times factors (n,)."""
    found = np.empty(A.shape)
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            found[i, k] = scale[i] * A[i, k]
    return found


@njit(cache=True)
def _newmark_step(arrays, y, inputs, h):
    p, g, n0 = inputs
    L, D, W, V, Wt, kt, mu, S, G, H = arrays
    n, d = W.shape
    steps = p.shape[0] - 1
    Q = np.empty((steps, d))
    R = np.empty((steps, n))
    F = np.empty((steps, n))
    q, v, z = y[:d], y[d : 2 * d], y[2 * d :]
    kG = _scaled_rows(kt, G)
    w, N, f, trial = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    # accelerations, those without contact forces, and motion ahead by half of the old ones
    a, free, q0, v0, rate = np.empty(d), np.empty(d), np.empty(d), np.empty(d), np.empty(d)
    for m in range(steps + 1):
        for k in range(d):
            q0[k] = q[k] + h * v[k] + h * h / 4 * a[k] if m > 0 else q[k]
            v0[k] = v[k] + h / 2 * a[k] if m > 0 else v[k]
            rate[k] = p[m, k] - L[k] * q0[k]
            free[k] = 0.0
        _add_product(rate, -1.0, D, v0)
        if m > 0:
            _add_product(free, 1.0, S, rate)
            for k in range(d):
                q[k] = q0[k] + h * h / 4 * free[k]
        for i in range(n):
            w[i] = g[m, i]
            N[i] = n0[m, i]
        _add_product(w, 1.0, W, q)
        _add_product(N, 1.0, V, q)
        for i in range(n):
            trial[i] = kt[i] * (w[i] - z[i])
        if m == 0:
            for i in range(n):
                f[i] = _friction_law(trial[i], mu[i] * max(N[i], 0.0))
        elif not contact_step(trial, N, kG, H, mu, f):
            return Q, R, F, m + 1
        if m == 0:
            # the first acceleration holds the equation of motion itself
            _add_product(rate, -1.0, Wt, f)
            for k in range(d):
                a[k] = rate[k]
        else:
            for k in range(d):
                rate[k] = 0.0
                a[k] = free[k]
            _add_product(rate, 1.0, Wt, f)
            _add_product(a, -1.0, S, rate)
            for i in range(n):
                w[i] = g[m, i]
            for k in range(d):
                q[k] = q0[k] + h * h / 4 * a[k]
                v[k] = v0[k] + h / 2 * a[k]
                Q[m % steps, k] = q[k]
            _add_product(w, 1.0, W, q)
        for i in range(n):
            z[i] = w[i] - f[i] / kt[i]
            if m > 0:
                R[m % steps, i] = w[i]
                F[m % steps, i] = f[i]
    return Q, R, F, 0
