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
from bladefem.friction.lane_kernels import TILE
from bladefem.friction.lanes import LANES

__all__ = ["Node", "Patterns", "Tables", "add_gram", "gram", "patterns", "tables", "values", "weighted"]


class Node(NamedTuple):
    """One element, as the kernels see it."""

    kt: float       # [N/m]
    kn: float       # [N/m]
    mu: float       # [1]
    n0: float       # [N]


class Tables(NamedTuple):
    """Read-only arrays for H harmonics and S samples; K = 2H+1, width and W as in lane_kernels.py."""

    at: np.ndarray          # (S, K) synthesis at the samples
    transposed: np.ndarray  # (K, S) the same, for synthesis that runs along time
    sums: np.ndarray        # (2S+1, 4H+1) running means of the basis up to 2H over two periods, for cyclic ranges
    knots: np.ndarray       # (S, K) synthesis at tau = 2 pi (i - 1/2) / S, harmonic h divided by cos(h pi / S)
    along: np.ndarray       # (K, width) the same, which runs along time and begins again after S
    analysis: np.ndarray    # (width, K) weights of a sample in the coefficients
    means: np.ndarray       # (width, 4H+1) weights of a sample in the basis means up to 2H
    fours: np.ndarray       # (., 4) samples i, S/2 - i, S/2 + i, S - i; S stands for none
    W: int                  # K filled up to a multiple of 8


class Patterns(NamedTuple):
    """Read-only arrays for the derivative of 2-D elements, in its precision."""

    at: np.ndarray          # (S, W) synthesis at the samples, zeros beyond K
    change: np.ndarray      # (S, W) its change from knot to knot
    weights: np.ndarray     # (., tile) of the samples i of the fours in the coefficients, zeros beyond K


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
    more, weights = _filled(samples) + LANES - samples, analysis(H, samples).T
    along, blank = knots[np.arange(samples + more) % samples].T, ((0, more), (0, 0))
    made = Tables(at, at.T.copy(), sums, knots, along.copy(), np.pad(weights, blank), np.pad(wide[:samples], blank),
                  _fours(samples), _filled(2 * H + 1))
    for array in made[:-1]:
        array.setflags(write=False)
    return made


@lru_cache(maxsize=8)
def patterns(H: int, samples: int, dtype: type) -> Patterns:
    """Patterns for H harmonics and S samples."""
    tab = tables(H, samples)
    columns = ((0, 0), (0, tab.W - 2 * H - 1))
    change = np.roll(tab.knots, -1, axis=0) - tab.knots
    weights = np.pad(tab.analysis[:samples // 2 + 1], ((0, 0), (0, _tiled(H) - 2 * H - 1)))
    made = Patterns(*(x.astype(dtype) for x in (np.pad(tab.at, columns), np.pad(change, columns), weights)))
    for array in made:
        array.setflags(write=False)
    return made


def _filled(size: int) -> int:
    """The next multiple of the lanes of a vector."""
    return -(-size // LANES) * LANES


def _tiled(H: int) -> int:
    """Number of coefficients that folded sums fill, at least 2H+1: harmonics by twos up to 8, then by eights."""
    return 4 * (H // 2) + 3 if H < TILE else 2 * TILE * (H // TILE + 1) - 1


def _fours(S: int) -> np.ndarray:
    """(., 4) samples that share the values of all harmonics but for signs; where S is odd only pairs do."""
    i = np.arange((S // 2 if S % 2 else S // 4) + 1)
    four = np.stack([i, S // 2 - i, S // 2 + i, S - i], axis=1)
    if S % 2:
        four[:, 1:3] = S
    four[0, 1] = four[0, 3] = S
    if S % 4 == 0:
        four[-1, 1:3] = S
    return four


@njit(_nrt=False, cache=True, error_model="numpy")
def gram(m, out):
    """out (K, K) = analysis of synthesis restricted to a set whose basis means up to 2H are m (4H+1); I on a circle."""
    out[:, :] = 0.0
    add_gram(1.0, m, out)


@njit(_nrt=False, cache=True, error_model="numpy")
def add_gram(factor, m, out):
    """out (K, K) += factor times the Gram matrix of means m (4H+1,)."""
    H = out.shape[0] // 2
    out[0, 0] += factor * m[0]
    for k in range(1, 2 * H + 1):
        out[0, k] += factor * m[k]
        out[k, 0] += 2.0 * factor * m[k]
    for a in range(1, H + 1):
        cos, sin, one = factor * m[4 * a - 1], factor * m[4 * a], factor * m[0]
        out[2 * a - 1, 2 * a - 1] += one + cos
        out[2 * a, 2 * a] += one - cos
        out[2 * a, 2 * a - 1] += sin
        out[2 * a - 1, 2 * a] += sin
        for b in range(1, a):
            cos, sin = factor * m[2 * (a + b) - 1], factor * m[2 * (a + b)]
            cos_apart, sin_apart = factor * m[2 * (a - b) - 1], factor * m[2 * (a - b)]
            out[2 * a - 1, 2 * b - 1] += cos_apart + cos
            out[2 * b - 1, 2 * a - 1] += cos_apart + cos
            out[2 * a, 2 * b] += cos_apart - cos
            out[2 * b, 2 * a] += cos_apart - cos
            out[2 * a, 2 * b - 1] += sin + sin_apart
            out[2 * b - 1, 2 * a] += sin + sin_apart
            out[2 * a - 1, 2 * b] += sin - sin_apart
            out[2 * b, 2 * a - 1] += sin - sin_apart


@njit(_nrt=False, cache=True, error_model="numpy")
def weighted(m, out):
    """out (K,) = coefficients of the indicator function of a set with basis means m."""
    out[0] = m[0]
    for k in range(1, out.size):
        out[k] = 2 * m[k]


@njit(_nrt=False, cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def values(transposed, c, factor, offset, out):
    """out (S,) = offset plus factor times the motion with coefficients c (K,); synthesis transposed (K, S)."""
    first = offset + factor * c[0]
    for i in range(out.size):
        out[i] = first
    for h in range(1, c.size, 2):
        cos, sin = factor * c[h], factor * c[h + 1]
        for i in range(out.size):
            out[i] += cos * transposed[h, i] + sin * transposed[h + 1, i]
