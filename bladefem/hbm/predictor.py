"""Where Newton starts along a sweep: on the curve through the points solved last."""

from __future__ import annotations

from numba import njit

from ..util.numba_options import INNER_KERNEL, KERNEL
from .linear.array_copy import copy_matrix

# points that a start is extrapolated from
PREDICTOR_POINTS = 3


@njit(**KERNEL)
def extrapolate_solution(omega, known, at, count, w):
    """Fill w (m, K), a start at omega, from the first `count` of the points known (3, m, K) at
    (3,), the last one last.

    It is the last one moved along the line through the last two, or the parabola through three; as
    it is where the step is more than twice the last one, or two of them are one.
    """
    last = count - 1
    copy_matrix(known[last], w)
    if (
        count == 1
        or abs(omega - at[last]) > 2.0 * abs(at[last] - at[last - 1])
        or at[0] == at[last]
    ):
        return
    w[:] = 0.0
    for a in range(count):
        share = 1.0
        for b in range(count):
            if b != a:
                share *= (omega - at[b]) / (at[a] - at[b])
        for i in range(w.shape[0]):
            for k in range(w.shape[1]):
                w[i, k] += share * known[a, i, k]


@njit(**INNER_KERNEL)
def append_solution(omega, w, known, at, count):
    """Put a point at the end of the known ones, in place of the first if they are full; their
    number then.
    """
    if count == at.size:
        for a in range(count - 1):
            copy_matrix(known[a + 1], known[a])
            at[a] = at[a + 1]
        count -= 1
    copy_matrix(w, known[count])
    at[count] = omega
    return count + 1
