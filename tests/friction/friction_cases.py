"""Random elements and periodic motions, finite differences, and slow independent twins of the
kernels.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from bladefem.data import Elements


def decay(H: int) -> np.ndarray:
    """Weights of the coefficients, so that high harmonics stay smaller."""
    return 1 / np.r_[1, np.repeat(np.arange(1, H + 1), 2)]


def random_case(
    seed: int, n: int, H: int, tangents: int, kn: float = 1.0
) -> tuple[Elements, np.ndarray]:
    """n elements with stick, slip, lift-off and initial gaps among them."""
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(n, 1 + tangents, 2 * H + 1)) * decay(H)
    elements = Elements(
        kt=rng.uniform(0.5, 3, n),
        kn=kn * rng.uniform(0.5, 2, n),
        mu=rng.uniform(0.1, 0.8, n),
        n0=rng.uniform(-1, 4, n),
        tangents=tangents,
    )
    return elements, w


def single(
    kt: float = 1.0, kn: float = 0.0, mu: float = 1.0, n0: float = 1.0, tangents: int = 1
) -> Elements:
    """One element."""
    return Elements(*(np.array([float(x)]) for x in (kt, kn, mu, n0)), tangents=tangents)


def numeric_jacobian(force, w: np.ndarray, step: float) -> np.ndarray:
    """Central differences (n, d, K, d, K) of force(w) (n, d, K): elements do not see each other."""
    n, d, K = w.shape
    J = np.empty((n, d, K, d, K))
    for a in range(d):
        for k in range(K):
            e = np.zeros_like(w)
            e[:, a, k] = step
            J[..., a, k] = (force(w + e) - force(w - e)) / (2 * step)
    return J


def motion(c: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Values at tau of the motion with coefficients c (K,), summed term by term."""
    q = np.full_like(np.asarray(tau, dtype=float), c[0])
    for h in range(1, len(c) // 2 + 1):
        q = q + c[2 * h - 1] * np.cos(h * tau) + c[2 * h] * np.sin(h * tau)
    return q


def coefficients(f: np.ndarray, H: int) -> np.ndarray:
    """(..., 2H+1) harmonics of samples (..., S) by the fast transform."""
    F = np.fft.rfft(f) / f.shape[-1]
    c = np.empty((*f.shape[:-1], 2 * H + 1))
    c[..., 0], c[..., 1::2], c[..., 2::2] = (
        F[..., 0].real,
        2 * F[..., 1 : H + 1].real,
        -2 * F[..., 1 : H + 1].imag,
    )
    return c


def plain_jenkins(kt, kn, mu, n0, w: np.ndarray, samples: int, periods: int = 3) -> np.ndarray:
    """(2, K) twin of the sampled 1-D element: the return map, sample after sample, for several
    periods.
    """
    tau = 2 * np.pi * np.arange(samples) / samples
    g, N = kt * motion(w[1], tau), n0 + kn * motion(w[0], tau)
    clamp = lambda x, limit: min(max(x, -limit), limit)
    f = clamp(g[-1], mu * max(N[-1], 0))
    out = np.empty(samples)
    for _ in range(periods):
        for i in range(samples):
            part = N[i] / (N[i] - N[i - 1]) if N[i - 1] <= 0 < N[i] else 1.0
            f = clamp(f + part * (g[i] - g[i - 1]), mu * N[i]) if N[i] > 0 else 0.0
            out[i] = f
    return coefficients(np.stack([np.maximum(N, 0), out]), len(w[0]) // 2)


def radial_return(kt, mu, N: np.ndarray, w: np.ndarray, periods: int = 3) -> np.ndarray:
    """Force (2, S) of the last period by plain radial return, w (2, S) [m], N (S,) [N]: first order
    in the step.
    """
    S = w.shape[1]
    f, out = (
        kt * w[:, -1] * min(1, mu * N[-1] / max(np.hypot(*(kt * w[:, -1])), 1e-300)),
        np.empty((2, S)),
    )
    dw = kt * (w - np.roll(w, 1, axis=1))
    fx, fy = f
    for _ in range(periods):
        for i in range(S):
            fx, fy = fx + dw[0, i], fy + dw[1, i]
            size, limit = (fx * fx + fy * fy) ** 0.5, mu * max(N[i], 0.0)
            if size > limit:
                fx, fy = fx * limit / size, fy * limit / size
            out[0, i], out[1, i] = fx, fy
    return out


def event_driven(kt, kn, mu, n0, w: np.ndarray) -> np.ndarray:
    """(2, K) harmonics of a 1-D element by events bracketed on a fine grid, Brent's roots and Gauss
    quadrature.
    """
    H = len(w[0]) // 2
    g, N = (lambda t: kt * motion(w[1], t)), (lambda t: n0 + kn * motion(w[0], t))
    ramp = _derivative(w[1]) * kt, _derivative(w[0]) * kn
    dg, dN = (lambda t: motion(ramp[0], t)), (lambda t: motion(ramp[1], t))
    grid = np.linspace(0, 2 * np.pi, 4001)
    state, offset = ("gap", 0.0) if N(0.0) <= 0 else ("stick", 0.0)
    if state == "stick" and abs(g(0.0)) > mu * N(0.0):
        s = np.sign(g(0.0))
        state, offset = (
            ("slip", s) if s * dg(0.0) > mu * dN(0.0) else ("stick", g(0.0) - s * mu * N(0.0))
        )
    for _ in range(2):
        pieces, a = [], 0.0
        while a < 2 * np.pi:
            exits = _exits(state, offset, g, N, dg, dN, mu)
            b, hit = min(
                ((_first(e, a, grid), i) for i, e in enumerate(exits)), default=(np.inf, 0)
            )
            pieces.append((a, min(b, 2 * np.pi), state, offset))
            if b >= 2 * np.pi:
                break
            state, offset = _enter(state, offset, hit, b, g, N, dg, dN, mu)
            a = b
    points, weights = np.polynomial.legendre.leggauss(40)
    out = np.zeros((2, 2 * H + 1))
    for a, b, kind, x in pieces:
        if kind == "gap":
            continue
        for u, v in zip(np.linspace(a, b, 5)[:-1], np.linspace(a, b, 5)[1:], strict=True):
            t = 0.5 * (u + v) + 0.5 * (v - u) * points
            f = g(t) - x if kind == "stick" else x * mu * N(t)
            for k in range(2 * H + 1):
                h = (k + 1) // 2
                basis = (
                    np.full_like(t, 0.5) if k == 0 else np.cos(h * t) if k % 2 else np.sin(h * t)
                )
                out[0, k] += 0.5 * (v - u) / np.pi * (weights * N(t) * basis).sum()
                out[1, k] += 0.5 * (v - u) / np.pi * (weights * f * basis).sum()
    return out


def _derivative(c: np.ndarray) -> np.ndarray:
    h = np.arange(1, len(c) // 2 + 1)
    d = np.zeros(len(c))
    d[1::2], d[2::2] = h * c[2::2], -h * c[1::2]
    return d


def _exits(state, x, g, N, dg, dN, mu):
    """Functions that rise through zero where the state ends; the first is always separation, save
    in a gap.
    """
    if state == "gap":
        return [N]
    if state == "slip":
        return [lambda t: -N(t), lambda t: mu * dN(t) - x * dg(t)]
    return [lambda t: -N(t), lambda t: g(t) - x - mu * N(t), lambda t: x - g(t) - mu * N(t)]


def _enter(state, x, hit, t, g, N, dg, dN, mu):
    if state != "gap" and hit == 0:
        return "gap", 0.0
    if state == "slip":
        return "stick", g(t) - x * mu * N(t)
    if state == "stick":
        return "slip", 1.0 if hit == 1 else -1.0
    if abs(dg(t)) > mu * dN(t):
        return "slip", float(np.sign(dg(t)))
    return "stick", g(t)


def _first(function, a: float, grid: np.ndarray) -> float:
    """First rise of the function through zero after a, to rounding."""
    t = np.r_[a + 1e-9, grid[grid > a + 1e-9]]
    values = function(t)
    rises = np.nonzero((values[:-1] <= 0) & (values[1:] > 0))[0]
    if values[0] > 1e-12:
        return a + 1e-9
    return brentq(function, t[rises[0]], t[rises[0] + 1], xtol=1e-15) if len(rises) else np.inf
