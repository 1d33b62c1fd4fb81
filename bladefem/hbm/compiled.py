"""Newton on small balances of 1-D elements, compiled: the loop of `bladefem.hbm.newton` without its overhead.

It takes the same steps, with the line search on the step, and ends for the same reasons; a test holds the two together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..friction.events import _batch as exact_batch
from ..friction.jenkins import jenkins_batch

__all__ = ["CONVERGED", "EXHAUSTED", "INFINITE", "SINGULAR", "STALLED", "apply", "back_substitute", "compiled_newton",
           "factorise", "factorise_large", "norm"]

CONVERGED, EXHAUSTED, STALLED, SINGULAR, INFINITE, SEARCHING = 0, 1, 2, 3, 4, 5
BLOCK, LARGE = 32, 64       # columns of a block; unknowns from which blocks pay


@njit(cache=True, error_model="numpy")
def apply(A, x, out):
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
def norm(x):
    """Root of the sum of squares."""
    total = 0.0
    for i in range(x.shape[0]):
        for k in range(x.shape[1]):
            total += x[i, k] * x[i, k]
    return np.sqrt(total)


@njit(cache=True, error_model="numpy")
def _copy(source, target):
    flat, to = source.reshape(source.size), target.reshape(target.size)
    for i in range(flat.size):
        to[i] = flat[i]


@njit(cache=True, error_model="numpy")
def _move(w, share, step, out):
    """out becomes  w - share step."""
    for i in range(w.shape[0]):
        for k in range(w.shape[1]):
            out[i, k] = w[i, k] - share * step[i, k] if share else w[i, k]


@njit(cache=True, error_model="numpy")
def _evaluate(w, d, linear, contact, work):
    """Forces and residual at w (m, K); fills work and returns the error of `bladefem.hbm.residual`."""
    A, G, stuck, springs, scale = linear
    load, base, nodes, tab, brackets, preload = contact
    full, F, J, shares, p, r = work
    n, K = nodes.shape[0], w.shape[1]
    for i in range(w.shape[0]):
        for k in range(K):
            full[i // d, 2 - d + i % d, k] = w[i, k]
    if brackets:
        F[:], J[:] = 0.0, 0.0
        counts = np.empty(n, np.int64)
        exact_batch(full, base, nodes, brackets, F, J, shares, counts)
    else:
        jenkins_batch(full, load, nodes, tab, F, J, shares)
    for i in range(w.shape[0]):
        for k in range(K):
            p[i, k] = F[i // d, 2 - d + i % d, k] - springs[i] * w[i, k] - (preload[i] if k == 0 else 0.0)
            r[i, k] = w[i, k] - stuck[i, k]
    apply(A, p, r)
    sprung, bare = np.empty(r.shape), np.empty(r.shape)
    for i in range(w.shape[0]):
        for k in range(K):
            sprung[i, k] = springs[i] * r[i, k] if k else 0.0
            bare[i, k] = r[i, k]
    apply(G, sprung, bare)
    return max(norm(r) / max(norm(w), 1e-300), norm(bare) / scale)


@njit(cache=True, error_model="numpy")
def _jacobian(A, J, springs, d, active, out):
    """out (a K, a K) = 1 + A dp/dw over the active nodes."""
    K = J.shape[2]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 if i == j else 0.0
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


@njit(cache=True, error_model="numpy")
def factorise(M, pivots):
    """LU factors in place with partial pivoting; False where a pivot is zero."""
    return eliminated(M, pivots, 0, M.shape[0])


@njit(cache=True, error_model="numpy")
def eliminated(M, pivots, low, high):
    """Columns low to high of such factors, rows exchanged as a whole; False where a pivot is zero."""
    size = M.shape[0]
    for k in range(low, high):
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
                for j in range(k + 1, high):
                    M[i, j] -= factor * M[k, j]
    return True


@njit(cache=True, error_model="numpy")
def factorise_large(M, pivots):
    """The same for a contiguous real matrix, in blocks of columns: most of the work is one matrix product a block."""
    size = M.shape[0]
    for low in range(0, size, BLOCK):
        high = min(low + BLOCK, size)
        if not eliminated(M, pivots, low, high):
            return False
        for k in range(low, high if high < size else low):
            for i in range(k + 1, high):
                factor = M[i, k]
                for j in range(high, size):
                    M[i, j] -= factor * M[k, j]
        if high < size:
            left, right = np.ascontiguousarray(M[high:, low:high]), np.ascontiguousarray(M[low:high, high:])
            M[high:, high:] -= np.dot(left, right)
    return True


@njit(cache=True, error_model="numpy")
def back_substitute(M, pivots, x):
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
    x, slips = np.empty(a * K), np.zeros(m // d, np.bool_)
    for y in range(a):
        slips[active[y // d]] = True
        for k in range(K):
            x[y * K + k] = r[active[y // d] * d + y % d, k]
    back_substitute(M, pivots, x)
    p, shift = np.zeros((m, K)), np.zeros((m, K))
    for y in range(a):
        node, i = active[y // d], active[y // d] * d + y % d
        for k in range(K):
            step[i, k] = x[y * K + k]
            if a == m:
                continue
            p[i, k] = -springs[i] * x[y * K + k]
            for e in range(d):
                for l in range(K):
                    p[i, k] += J[node, 2 - d + y % d, k, 2 - d + e, l] * x[(y - y % d + e) * K + l]
    if 0 < a < m:
        apply(A, p, shift)
    for i in range(m):
        for k in range(K):
            if not slips[i // d]:
                step[i, k] = r[i, k] - shift[i, k]


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
        contact: prescribed loads (n, S) or (n, 0), their coefficients (n, K), nodes (n, 4), tables, brackets
            (0: sampled), preload (m,).

    Returns:
        steps taken, how it ended, error at w; of the last evaluation, which is at w if converged: forces (n, 2, K),
        their derivative, shares (n, 3), residual (m, K), p (m, K).
    """
    m, K = w.shape
    n = m // d
    work = (np.zeros((n, 2, K)), np.zeros((n, 2, K)), np.zeros((n, 2, K, 2, K)), np.zeros((n, 3)), np.zeros((m, K)),
            np.zeros((m, K)))
    A, springs, J, r = linear[0], linear[3], work[2], work[5]
    step, after, trial, old = np.empty((m, K)), np.empty((m, K)), w.copy(), np.empty(J.shape)
    pivots, active, M = np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 0))
    code, steps, share, before, error = SEARCHING, -1, 1.0, np.inf, np.inf
    while code == SEARCHING:
        fresh = _evaluate(trial, d, linear, contact, work)
        if steps >= 0:
            _solve(r, M, pivots, d, active, old, A, springs, after)
            if not norm(after) <= (1 - 0.25 * share) * before:
                share /= 2
                if share < shortest:
                    code = STALLED
                _move(w, share, step, trial)
                continue
        error, steps = fresh, steps + 1
        _move(trial, 0.0, step, w)
        if error <= tolerance or not np.isfinite(error) or steps == iterations:
            code = CONVERGED if error <= tolerance else (EXHAUSTED if np.isfinite(error) else INFINITE)
            break
        active = _active(J, springs, d, sticks)
        M, pivots = np.empty((active.size * d * K, active.size * d * K)), np.empty(active.size * d * K, np.int64)
        _jacobian(A, J, springs, d, active, M)
        if not (factorise_large(M, pivots) if pivots.size > LARGE else factorise(M, pivots)):
            code = SINGULAR
            break
        _copy(J, old)
        _solve(r, M, pivots, d, active, old, A, springs, step)
        before, share = norm(step), 1.0
        _move(w, share, step, trial)
    return steps, code, error, work[1], J, work[3], r, work[4]
