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
from bladefem.friction.harmonics import analysis, synthesis

__all__ = ["Node", "Sums", "Tables", "columns", "empty_sums", "gram", "tables", "values", "weighted"]


WAITING = 32        # samples summed at once by matrix product, few enough to stay in the cache


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
    analysis: np.ndarray    # (S, K) weights of a sample in the coefficients
    pattern: np.ndarray     # (S, 3, M) rows of a 2-D element: normal sample, change between knots of either tangent


class Sums(NamedTuple):
    """What a 2-D element collects in one period; M columns as in disc_rows.py."""

    J: np.ndarray           # (K, 2M) rows and forces, first and second tangent
    stick: np.ndarray       # (4H+1,) basis means of the samples in stick
    rows: np.ndarray        # (WAITING, 2M) of samples in slip that are not yet in J
    turns: np.ndarray       # (WAITING, 12) how the row of the angle turns along them
    product: np.ndarray     # (K, 2M) scratch
    row: np.ndarray         # (M,) row of the angle in slip
    middle: np.ndarray      # (M,) row of the angle at the sample
    mean: np.ndarray        # (4H+1,) scratch


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
    made = Tables(at, at.T.copy(), sums, knots, knots.T.copy(), analysis(H, samples).T.copy(), _pattern(at, knots))
    for array in made:
        array.setflags(write=False)
    return made


def columns(K: int) -> int:
    """M: 3K+3 columns filled up to a multiple of 4."""
    return (3 * K + 6) // 4 * 4


def _pattern(at: np.ndarray, knots: np.ndarray) -> np.ndarray:
    S, K = at.shape
    pattern = np.zeros((S, 3, columns(K)))
    pattern[:, 0, :K] = at
    pattern[:, 1, K:2 * K] = pattern[:, 2, 2 * K:3 * K] = np.roll(knots, -1, axis=0) - knots
    return pattern


def empty_sums(H: int) -> Sums:
    """Scratch for one 2-D element."""
    K, M, P = 2 * H + 1, columns(2 * H + 1), 4 * H + 1
    return Sums(*[np.empty(shape) for shape in ((K, 2 * M), P, (WAITING, 2 * M), (WAITING, 12), (K, 2 * M), M, M, P)])


@njit(cache=True, error_model="numpy")
def gram(m, out):
    """out (K, K) = analysis of synthesis restricted to a set whose basis means up to 2H are m (4H+1); I on a circle."""
    H = out.shape[0] // 2
    out[0, 0] = m[0]
    for a in range(1, H + 1):
        out[0, 2 * a - 1] = m[2 * a - 1]
        out[0, 2 * a] = m[2 * a]
        out[2 * a - 1, 0] = 2 * m[2 * a - 1]
        out[2 * a, 0] = 2 * m[2 * a]
        for b in range(1, a + 1):
            total, apart = 2 * (a + b), 2 * (a - b)
            cos_apart, sin_apart = (m[apart - 1], m[apart]) if a > b else (m[0], 0.0)
            cos, sin = m[total - 1], m[total]
            out[2 * a - 1, 2 * b - 1] = out[2 * b - 1, 2 * a - 1] = cos_apart + cos
            out[2 * a, 2 * b] = out[2 * b, 2 * a] = cos_apart - cos
            out[2 * a, 2 * b - 1] = out[2 * b - 1, 2 * a] = sin + sin_apart
            out[2 * a - 1, 2 * b] = out[2 * b, 2 * a - 1] = sin - sin_apart


@njit(cache=True, error_model="numpy")
def weighted(m, out):
    """out (K,) = coefficients of the indicator function of a set with basis means m."""
    out[0] = m[0]
    for k in range(1, out.size):
        out[k] = 2 * m[k]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def values(transposed, c, factor, offset, out):
    """out (S,) = offset plus factor times the motion with coefficients c (K,); synthesis transposed (K, S)."""
    first = offset + factor * c[0]
    for i in range(out.size):
        out[i] = first
    for h in range(1, c.size, 2):
        cos, sin = factor * c[h], factor * c[h + 1]
        for i in range(out.size):
            out[i] += cos * transposed[h, i] + sin * transposed[h + 1, i]
