"""Trigonometric tables that the kernels share, made once for each (harmonics, samples), and the
Gram matrix of a set.

A node's force is linear in its coefficients on each stretch of stick, slip or separation. Integrals
over such a set need only sums of cos p tau and sin p tau, p <= 2H, over the set: products of two
harmonics reduce to them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from bladefem.errors import InputError
from bladefem.friction.fourier import analysis, synthesis
from bladefem.friction.simd.codegen import BYTES_PER_BLOCK, LANES_PER_VECTOR
from bladefem.friction.simd.row_kernels import HARMONICS_PER_TILE, fill_gram
from bladefem.util.numba_options import INNER_KERNEL, KERNEL


class Node(NamedTuple):
    """One element, as the kernels see it."""

    # [N/m]
    kt: float
    # [N/m]
    kn: float
    # [1]
    mu: float
    # [N]
    n0: float


class Tables(NamedTuple):
    """Read-only arrays for H harmonics and S samples; K = 2H+1, width as in time_kernels.py, W as
    in row_kernels.py.
    """

    # (S, K) synthesis at the samples
    at: np.ndarray
    # (K, S) the same, for synthesis that runs along time
    transposed: np.ndarray
    # (2S+1, 4H+1) running means of the basis up to 2H over two periods, for cyclic ranges
    sums: np.ndarray
    # (S, K) synthesis at tau = 2 pi (i - 1/2) / S, harmonic h divided by cos(h pi / S)
    knots: np.ndarray
    # (K, width) the same, which runs along time and begins again after S
    along: np.ndarray
    # (width, K) weights of a sample in the coefficients
    analysis: np.ndarray
    # (., 4) samples i, S/2 - i, S/2 + i, S - i; S is no sample
    fours: np.ndarray
    # K filled up to a multiple of 8
    W: int


class Patterns(NamedTuple):
    """Read-only arrays for the derivative of 2-D elements, in its precision."""

    # (S + 1, W) synthesis at the samples, zeros beyond K and at last
    at: np.ndarray
    # (S, W) synthesis at the knots as in Tables, always in double precision
    knots: np.ndarray
    # (S, W) its change from knot to knot
    change: np.ndarray
    # (., tile) of the samples i of the fours in the coefficients, zeros beyond K
    weights: np.ndarray


@lru_cache(maxsize=8)
def trigonometric_tables(H: int, samples: int) -> Tables:
    """Tables for H harmonics; at least 4H+4 samples, below which the force harmonics are
    meaningless.
    """
    if samples < 4 * H + 4:
        raise InputError(
            f"samples: {samples} a period are too few for {H} harmonics, expected at least "
            f"{4 * H + 4}"
        )
    at = synthesis(H, samples)
    wide = np.concatenate([synthesis(2 * H, samples)] * 2) / samples
    sums = np.concatenate([np.zeros((1, 4 * H + 1)), np.cumsum(wide, axis=0)])
    knots = synthesis(H, samples, -0.5)
    knots[:, 1:] /= np.repeat(np.cos(np.pi / samples * np.arange(1, H + 1)), 2)
    more = _filled_size(samples) + LANES_PER_VECTOR - samples
    weights = analysis(H, samples).T
    along = knots[np.arange(samples + more) % samples].T
    blank = ((0, more), (0, 0))
    arrays = at, at.T, sums, knots, along, np.pad(weights, blank), _sample_fours(samples)
    made = Tables._make([*map(_aligned_copy, arrays), _filled_size(2 * H + 1)])
    for array in made[:-1]:
        array.setflags(write=False)
    return made


@lru_cache(maxsize=8)
def derivative_patterns(
    H: int,
    samples: int,
    dtype: type,
) -> Patterns:
    """Patterns for H harmonics and S samples."""
    tab = trigonometric_tables(H, samples)

    def pad(x, rows=0):
        return np.pad(x, ((0, rows), (0, tab.W - 2 * H - 1)))

    change = np.roll(tab.knots, -1, axis=0) - tab.knots
    weights = np.pad(tab.analysis[: samples // 2 + 1], ((0, 0), (0, _tiled_size(H) - 2 * H - 1)))
    at, change, weights = (
        _aligned_copy(x.astype(dtype)) for x in (pad(tab.at, 1), pad(change), weights)
    )
    made = Patterns(at, pad(tab.knots), change, weights)
    for array in made:
        array.setflags(write=False)
    return made


def _aligned_copy(array: np.ndarray) -> np.ndarray:
    """A copy that begins as lanes.zeros does."""
    room = np.empty(array.nbytes + BYTES_PER_BLOCK, np.uint8)
    first = -room.ctypes.data % BYTES_PER_BLOCK
    copy = room[first : first + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[:] = array
    return copy


def _filled_size(size: int) -> int:
    """The next multiple of the lanes of a vector."""
    return -(-size // LANES_PER_VECTOR) * LANES_PER_VECTOR


def _tiled_size(H: int) -> int:
    """Number of coefficients that folded sums fill, at least 2H+1: harmonics by twos up to 8, then
    by eights.
    """
    return (
        4 * (H // 2) + 3
        if H < HARMONICS_PER_TILE
        else 2 * HARMONICS_PER_TILE * (H // HARMONICS_PER_TILE + 1) - 1
    )


def _sample_fours(S: int) -> np.ndarray:
    """(., 4) samples that share the values of all harmonics but for signs; where S is odd only
    pairs do.
    """
    i = np.arange((S // 2 if S % 2 else S // 4) + 1)
    four = np.stack([i, S // 2 - i, S // 2 + i, S - i], axis=1)
    if S % 2:
        four[:, 1:3] = S
    four[0, 1] = four[0, 3] = S
    if S % 4 == 0:
        four[-1, 1:3] = S
    return four


@njit(**KERNEL)
def empty_gram(H):
    """Scratch for gram."""
    return np.zeros((2, 6 * H + 2 + 2 * LANES_PER_VECTOR))


@njit(_nrt=False, **KERNEL)
def gram_matrix(m, around, out):
    """Analysis of synthesis restricted to a set whose basis means up to 2H are m (4H+1); I on a
    circle.

    It goes to the first K columns of out (K, ..); around as empty_gram makes it.
    """
    K = out.shape[0]
    H = out.shape[0] // 2
    for q in range(-H, 2 * H + 1):
        cos, sin = (m[2 * abs(q) - 1], m[2 * q] if q > 0 else -m[-2 * q]) if q else (m[0], 0.0)
        around[0, 2 * (q + H)] = cos
        around[0, 2 * (q + H) + 1] = sin
        around[1, 2 * (q + H)], around[1, 2 * (q + H) + 1] = sin, -cos
    fill_gram(around, around.shape[1], H, K, out.shape[1], out)
    out[0, 0] = m[0]
    for k in range(1, K):
        out[0, k], out[k, 0] = m[k], 2.0 * m[k]


@njit(_nrt=False, **KERNEL)
def indicator_coefficients(m, out):
    """out (K,) = coefficients of the indicator function of a set with basis means m."""
    out[0] = m[0]
    for k in range(1, out.size):
        out[k] = 2 * m[k]


@njit(_nrt=False, **INNER_KERNEL, fastmath={"contract", "reassoc", "nsz"})
def motion_values(transposed, c, factor, offset, out):
    """out (S,) = offset plus factor times the motion with coefficients c (K,); synthesis transposed
    (K, S).
    """
    first = offset + factor * c[0]
    h = 1
    for i in range(out.size):
        out[i] = first
    # two harmonics at once
    while h + 2 < c.size:
        a = factor * c[h]
        b = factor * c[h + 1]
        d = factor * c[h + 2]
        e = factor * c[h + 3]
        for i in range(out.size):
            out[i] += (
                a * transposed[h, i]
                + b * transposed[h + 1, i]
                + (d * transposed[h + 2, i] + e * transposed[h + 3, i])
            )
        h += 4
    if h < c.size:
        a = factor * c[h]
        b = factor * c[h + 1]
        for i in range(out.size):
            out[i] += a * transposed[h, i] + b * transposed[h + 1, i]
