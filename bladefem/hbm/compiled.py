"""Newton on small balances of 1-D elements, compiled: the loop of `bladefem.hbm.newton` without its overhead.

It takes the same steps, with the line search on the step, and ends for the same reasons; a test holds the two together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..friction.events import _batch as exact_batch
from ..friction.jenkins import jenkins_batch

__all__ = ["CONVERGED", "EXHAUSTED", "INFINITE", "SINGULAR", "STALLED", "compiled_newton"]

CONVERGED, EXHAUSTED, STALLED, SINGULAR, INFINITE = 0, 1, 2, 3, 4


@njit(cache=True, error_model="numpy")
def _apply(A, x, out):
    """out (m, K) += A (H+1, m, m) times x (m, K), both as real coefficients."""
    m = x.shape[0]
    for i in range(m):
        for j in range(m):
            out[i, 0] += A[0, i, j].real * x[j, 0]
    for h in range(1, A.shape[0]):
        c, s = 2 * h - 1, 2 * h
        for i in range(m):
            for j in range(m):
                re, im = A[h, i, j].real, A[h, i, j].imag
                out[i, c] += re * x[j, c] + im * x[j, s]
                out[i, s] += re * x[j, s] - im * x[j, c]


@njit(cache=True, error_model="numpy")
def _size(x):
    total = 0.0
    for value in x.ravel():
        total += value * value
    return np.sqrt(total)


@njit(cache=True, error_model="numpy")
def _evaluate(w, d, linear, contact, work):
    """Forces and residual at w (m, K); fills work and returns the error of `bladefem.hbm.residual`."""
    A, G, stuck, springs, scale = linear
    load, nodes, tab, brackets, preload = contact
    full, F, J, shares, p, r = work
    n, K = nodes.shape[0], w.shape[1]
    full[:, 2 - d:] = w.reshape(n, d, K)
    if brackets:
        F[:], J[:] = 0.0, 0.0
        base = np.zeros((n, K))
        base[:, 0] = nodes[:, 3]
        counts = np.empty(n, np.int64)
        exact_batch(full, base, nodes, brackets, F, J, shares, counts)
    else:
        jenkins_batch(full, load, nodes, tab, F, J, shares)
    for i in range(w.shape[0]):
        for k in range(K):
            p[i, k] = F[i // d, 2 - d + i % d, k] - springs[i] * w[i, k]
        p[i, 0] -= preload[i]
    r[:] = w - stuck
    _apply(A, p, r)
    sprung = r * springs.reshape(-1, 1)
    sprung[:, 0] = 0.0
    bare = r.copy()
    _apply(G, sprung, bare)
    return max(_size(r) / max(_size(w), 1e-300), _size(bare) / scale)


@njit(cache=True, error_model="numpy")
def _jacobian(A, J, springs, d, active, out):
    """out (a K, a K) = 1 + A dp/dw over the active nodes."""
    K = J.shape[2]
    out[:] = 0.0
    row = np.empty(2)
    for x in range(active.size):
        for y in range(active.size):
            for b in range(d):
                j = active[y] * d + b
                for e in range(d):
                    for l in range(K):
                        column = (y * d + e) * K + l
                        for h in range(A.shape[0]):
                            c = max(2 * h - 1, 0)
                            row[0] = J[active[y], 2 - d + b, c, 2 - d + e, l]
                            row[1] = J[active[y], 2 - d + b, 2 * h, 2 - d + e, l] if h else 0.0
                            if b == e and l == c:
                                row[0] -= springs[j]
                            elif b == e and l == 2 * h:
                                row[1] -= springs[j]
                            for a in range(d):
                                value = A[h, active[x] * d + a, j]
                                i = (x * d + a) * K
                                out[i + c, column] += value.real * row[0] + value.imag * row[1]
                                if h:
                                    out[i + 2 * h, column] += value.real * row[1] - value.imag * row[0]
    for i in range(out.shape[0]):
        out[i, i] += 1.0


@njit(cache=True, error_model="numpy")
def _factorise(M, pivots):
    """LU factors in place with partial pivoting; False where a pivot is zero."""
    size = M.shape[0]
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(M[i, k]) > abs(M[best, k]):
                best = i
        pivots[k] = best
        if not abs(M[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(size):
                M[k, j], M[best, j] = M[best, j], M[k, j]
        for i in range(k + 1, size):
            factor = M[i, k] / M[k, k]
            M[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, size):
                    M[i, j] -= factor * M[k, j]
    return True


@njit(cache=True, error_model="numpy")
def _back(M, pivots, x):
    """x becomes M^-1 x."""
    size = M.shape[0]
    for k in range(size):
        if pivots[k] != k:
            x[k], x[pivots[k]] = x[pivots[k]], x[k]
    for i in range(size):
        for j in range(i):
            x[i] -= M[i, j] * x[j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= M[i, j] * x[j]
        x[i] /= M[i, i]


@njit(cache=True, error_model="numpy")
def _solve(r, M, pivots, d, active, J, A, springs, step):
    """step (m, K) = inverse derivative times r: active nodes by the factors, the others from their forces."""
    m, K = r.shape
    a = active.size * d
    step[:] = r
    if a == 0:
        return
    x = np.empty(a * K)
    for y in range(active.size):
        x[y * d * K:(y + 1) * d * K] = r[active[y] * d:(active[y] + 1) * d].copy().ravel()
    _back(M, pivots, x)
    moved = x.reshape(a, K)
    for y in range(active.size):
        step[active[y] * d:(active[y] + 1) * d] = moved[y * d:(y + 1) * d]
    if a == m:
        return
    p = np.zeros((m, K))
    for node in active:
        for b in range(d):
            i = node * d + b
            for k in range(K):
                value = -springs[i] * step[i, k]
                for e in range(d):
                    for l in range(K):
                        value += J[node, 2 - d + b, k, 2 - d + e, l] * step[node * d + e, l]
                p[i, k] = value
    shift = np.zeros((m, K))
    _apply(A, p, shift)
    slips = np.zeros(m // d, np.bool_)
    slips[active] = True
    for i in range(m):
        if not slips[i // d]:
            step[i] -= shift[i]


@njit(cache=True, error_model="numpy")
def _active(J, springs, d, sticks):
    """Numbers of the nodes whose forces do not follow the springs of full stick."""
    n, K = J.shape[0], J.shape[2]
    found = np.zeros(n, np.bool_)
    for node in range(n):
        stiffest = 0.0
        for b in range(d):
            stiffest = max(stiffest, springs[node * d + b])
        for b in range(d):
            for k in range(K):
                for e in range(d):
                    for l in range(K):
                        value = J[node, 2 - d + b, k, 2 - d + e, l]
                        if b == e and k == l:
                            value -= springs[node * d + b]
                        if abs(value) > sticks * stiffest:
                            found[node] = True
    return np.flatnonzero(found)


@njit(cache=True, error_model="numpy")
def compiled_newton(w, d, linear, contact, sticks, tolerance, iterations, shortest):
    """Newton from w (m, K), changed in place to the end.

    Args:
        d: directions a node, 1 (tangent) or 2 (normal, tangent).
        linear: A, G with its harmonic 0 left out (H+1, m, m), stuck (m, K), springs (m,), size of the linear motion.
        contact: prescribed loads (n, 0), nodes (n, 4), tables, brackets (0: sampled), preload (m,).

    Returns:
        steps taken, how it ended, error, forces (n, 2, K), their derivative, shares (n, 3), residual (m, K), p (m, K).
    """
    m, K = w.shape
    n = m // d
    work = (np.zeros((n, 2, K)), np.zeros((n, 2, K)), np.zeros((n, 2, K, 2, K)), np.zeros((n, 3)), np.zeros((m, K)),
            np.zeros((m, K)))
    A, springs, J, r = linear[0], linear[3], work[2], work[5]
    step, after, trial = np.empty((m, K)), np.empty((m, K)), np.empty((m, K))
    error = _evaluate(w, d, linear, contact, work)
    for iteration in range(iterations + 1):
        if error <= tolerance:
            return iteration, CONVERGED, error, work[1], J, work[3], r, work[4]
        if not np.isfinite(error):
            return iteration, INFINITE, error, work[1], J, work[3], r, work[4]
        if iteration == iterations:
            break
        active = _active(J, springs, d, sticks)
        M = np.empty((active.size * d * K, active.size * d * K))
        pivots = np.empty(M.shape[0], np.int64)
        _jacobian(A, J, springs, d, active, M)
        if not _factorise(M, pivots):
            return iteration, SINGULAR, error, work[1], J, work[3], r, work[4]
        old = J.copy()
        _solve(r, M, pivots, d, active, old, A, springs, step)
        before, share, better = _size(step), 1.0, False
        while share >= shortest:
            trial[:] = w - share * step
            fresh = _evaluate(trial, d, linear, contact, work)
            _solve(r, M, pivots, d, active, old, A, springs, after)
            if _size(after) <= (1 - 0.25 * share) * before:
                better = True
                break
            share /= 2
        if not better:
            _evaluate(w, d, linear, contact, work)
            return iteration + 1, STALLED, error, work[1], J, work[3], r, work[4]
        w[:] = trial
        error = fresh
    return iterations, EXHAUSTED, error, work[1], J, work[3], r, work[4]
