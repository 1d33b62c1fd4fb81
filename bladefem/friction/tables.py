"""Trigonometric tables that the kernels share, made once for each (harmonics, samples), and the Gram matrix of a set.

A node's force is linear in its coefficients on each stretch of stick, slip or separation. Integrals over such a set
need only sums of cos p tau and sin p tau, p <= 2H, over the set: products of two harmonics reduce to them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from bladefem.errors import InputError
from bladefem.friction.harmonics import synthesis

__all__ = ["Node", "Tables", "gram", "tables", "values", "weighted"]


class Node(NamedTuple):
    """One element, as the kernels see it."""

    kt: float       # [N/m]
    kn: float       # [N/m]
    mu: float       # [1]
    n0: float       # [N]


class Tables(NamedTuple):
    """Read-only arrays for H harmonics and S samples; K = 2H+1."""

    at: np.ndarray          # (S, K) synthesis at the samples
    transposed: np.ndarray  # (K, S) the same, for synthesis that runs along time
    sums: np.ndarray        # (2S+1, 4H+1) running means of the basis up to 2H over two periods, for cyclic ranges
    knots: np.ndarray       # (S, K) synthesis at tau = 2 pi (i - 1/2) / S, harmonic h divided by cos(h pi / S)
    knots_transposed: np.ndarray    # (K, S)


@lru_cache(maxsize=8)
def tables(H: int, samples: int) -> Tables:
    """Tables for H harmonics; at least 4H+4 samples, below which the force harmonics are meaningless."""
    if samples < 4 * H + 4:
        raise InputError(f"samples: {samples} a period are too few for {H} harmonics, expected at least {4 * H + 4}")
    at = synthesis(H, samples)
    wide = np.concatenate([synthesis(2 * H, samples)] * 2) / samples
    sums = np.concatenate([np.zeros((1, 4 * H + 1)), np.cumsum(wide, axis=0)])
    knots = synthesis(H, samples, -0.5)
    knots[:, 1:] /= np.repeat(np.cos(np.pi / samples * np.arange(1, H + 1)), 2)
    made = Tables(at, at.T.copy(), sums, knots, knots.T.copy())
    for array in made:
        array.setflags(write=False)
    return made


@njit(cache=True, inline="always")
def _cos(m, p):
    return m[0] if p == 0 else m[2 * abs(p) - 1]


@njit(cache=True, inline="always")
def _sin(m, p):
    if p == 0:
        return 0.0
    return m[2 * p] if p > 0 else -m[-2 * p]


@njit(cache=True)
def gram(m, out):
    """out (K, K) = analysis of synthesis restricted to a set whose basis means up to 2H are m (4H+1); I on a circle."""
    H = out.shape[0] // 2
    out[0, 0] = m[0]
    for a in range(1, H + 1):
        out[0, 2 * a - 1] = m[2 * a - 1]
        out[0, 2 * a] = m[2 * a]
        out[2 * a - 1, 0] = 2 * m[2 * a - 1]
        out[2 * a, 0] = 2 * m[2 * a]
        for b in range(1, H + 1):
            out[2 * a - 1, 2 * b - 1] = _cos(m, a - b) + _cos(m, a + b)
            out[2 * a, 2 * b] = _cos(m, a - b) - _cos(m, a + b)
            out[2 * a - 1, 2 * b] = _sin(m, a + b) + _sin(m, b - a)
            out[2 * a, 2 * b - 1] = _sin(m, a + b) + _sin(m, a - b)


@njit(cache=True)
def weighted(m, out):
    """out (K,) = coefficients of the indicator function of a set with basis means m."""
    out[0] = m[0]
    for k in range(1, out.size):
        out[k] = 2 * m[k]


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def values(transposed, c, factor, out):
    """out (S,) = factor times the motion with coefficients c (K,)."""
    out[:] = factor * c[0]
    for k in range(1, c.size):
        scaled = factor * c[k]
        for i in range(out.size):
            out[i] += scaled * transposed[k, i]
