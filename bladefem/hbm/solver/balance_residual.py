"""The bodies at one frequency as compiled loops take them, and the residual of the balance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.contact_flexibility import apply_flexibility, apply_matrices, apply_modes

# of the preload's compression: smaller motions drown in its rounding,
SMALL_MOTION_RATIO = 1e-8
# and their residual is measured by this share of it
REST_MOTION_SHARE = 1e-4


class Condensed(NamedTuple):
    """The bodies at one frequency, seen from the m contact degrees of freedom."""

    # flexibility with contact springs, see `bladefem.hbm.linear.contact_flexibility`
    flex: tuple
    # the same without springs in the second form, but for the mean; with (0, 0, 0) in place of T in
    # the first
    bare: tuple
    # (H+1, m, m) the same in the first form; (1, 0, 0) in the second, and where `modal` tells it
    G: np.ndarray
    # (m, K) displacement in full stick [m]
    stuck: np.ndarray
    # (m,) [N/m]
    springs: np.ndarray
    # size of the linear motion, and the least size that a motion is measured by [m]
    scale: float
    least: float
    # (S, m, M), residual (S, m, m) and modal (H+1, M): these give G by `apply_modes`; or empty
    shapes: np.ndarray
    residual: np.ndarray
    modal: np.ndarray
    # (m, q) that the contacts have in common, see `bladefem.hbm.solver.deflation`
    motions: np.ndarray


@njit(**INNER_KERNEL)
def frobenius_norm(x):
    """Root of the sum of squares."""
    total = 0.0
    for i in range(x.shape[0]):
        for k in range(x.shape[1]):
            total += x[i, k] * x[i, k]
    return np.sqrt(total)


@njit(**KERNEL)
def motion_scale(free, stuck, compression):
    """`scale` and `least` of the `Condensed` bodies, from the motions without contact forces and in
    full stick (m, K), and the compression by the preload [m].
    """
    scale = max(max(frobenius_norm(free), frobenius_norm(stuck)), 1e-300)
    if scale < SMALL_MOTION_RATIO * compression:
        least = REST_MOTION_SHARE * compression
        return max(scale, least), least
    return scale, 1e-300


@njit(**KERNEL)
def balance_residual(w, linear, preload, F, p, r):
    """Fill p and the residual r (m, K) at w (m, K) from the forces F (n, a, K), whose last
    directions are those of the balance, under the preload (m,).

    Returns:
        the error: the larger of the residual with contact springs over the size of the motion, and
        the residual without them over that of the linear motion.
    """
    G = linear.G
    stuck = linear.stuck
    springs = linear.springs
    m, K = w.shape
    d = m // F.shape[0]
    first = F.shape[1] - d
    for i in range(m):
        for k in range(K):
            p[i, k] = (
                F[i // d, first + i % d, k] - springs[i] * w[i, k] - (preload[i] if k == 0 else 0.0)
            )
            r[i, k] = w[i, k] - stuck[i, k]
    apply_flexibility(linear.flex, p, r)
    sprung = np.empty(r.shape)
    bare = np.empty(r.shape)
    for i in range(m):
        for k in range(K):
            sprung[i, k] = springs[i] * r[i, k] if k else 0.0
            bare[i, k] = r[i, k]
    if linear.bare[4].shape[0]:
        apply_flexibility(linear.bare, sprung, bare)
    elif G.shape[1]:
        apply_matrices(G, sprung, bare)
    else:
        apply_modes(linear.shapes, linear.residual, linear.modal, sprung, bare)
    return max(
        frobenius_norm(r) / max(frobenius_norm(w), linear.least),
        frobenius_norm(bare) / linear.scale,
    )
