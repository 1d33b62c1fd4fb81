"""One step of friction for time integration: the return maps of one node, and the limit of explicit
integration.

A node that closes within the step, from the load N0 <= 0, is stretched from the contact on, with
the load taken as linear in the step.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numba import njit

from bladefem.errors import InputError

# relative excess of a force over its limit that still sticks: slip leaves it on the limit
ROUNDING = 1e-14


@njit(cache=True)
def step_1d(trial, N0, N1, mu):
    """New force [N] from the trial force f + kt dw, loads N0 before and N1 now (negative: open),
    and mu.

    Exact where force and load are linear in the step and the motion does not turn back.
    """
    if N1 <= 0.0:
        return 0.0
    if N0 <= 0.0:
        trial *= N1 / (N1 - N0)
    return min(max(trial, -mu * N1), mu * N1)


@njit(cache=True)
def step_2d(px, py, dx, dy, N0, N1, mu):
    """New force x, y [N] and whether it slipped (1.0), from (px, py) and the elastic increment (dx,
    dy), loads N0, N1.

    Sticks as long as it can, then slips: the angle psi between force and motion obeys
    psi' = -k |w'| sin(psi) / limit, solved exactly for a straight step (Krieg and Krieg, J.
    Pressure Vessel Tech. 99 (1977) 510, for plasticity); the plain radial return lags by half a
    step on curved paths.
    """
    if mu * N1 <= 0.0:
        return 0.0, 0.0, 0.0
    if N0 <= 0.0:
        dx = dx * N1 / (N1 - N0)
        dy = dy * N1 / (N1 - N0)
    before = mu * max(N0, 0.0)
    after = mu * N1
    tx = px + dx
    ty = py + dy
    if tx * tx + ty * ty <= (1.0 + ROUNDING) * after * after:
        return tx, ty, 0.0
    path = np.sqrt(dx * dx + dy * dy)
    grow = after - before
    stick = _stick_share(
        path * path - grow * grow,
        px * dx + py * dy - before * grow,
        px * px + py * py - before * before,
    )
    px = px + stick * dx
    py = py + stick * dy
    size = np.sqrt(px * px + py * py)
    if size == 0.0 or path == 0.0:
        scale = after / np.sqrt(tx * tx + ty * ty)
        return tx * scale, ty * scale, 1.0
    mean = 0.5 * (before + stick * grow + after)
    cosine = (px * dx + py * dy) / (size * path)
    sine = (dx * py - dy * px) / (size * path)
    # tan(psi / 2) falls exponentially; a fraction, since there is none where they are opposite
    rise, run = (sine, 1.0 + cosine) if cosine > 0.0 else (1.0 - cosine, sine)
    rise *= np.exp(-(1.0 - stick) * path / mean)
    scale = after / (path * (run * run + rise * rise))
    along = scale * (run * run - rise * rise)
    across = scale * 2.0 * run * rise
    return along * dx - across * dy, along * dy + across * dx, 1.0


@njit(cache=True)
def _stick_share(a, b, c):
    """Share s of the step in stick: the first root in [0, 1] of a s^2 + 2 b s + c = 0, where the
    force meets its limit; 0 if it starts there and leaves it. c <= 0 but for rounding.
    """
    c = min(c, 0.0)
    root = np.sqrt(max(b * b - a * c, 0.0))
    if b > 0.0:
        return min(-c / (b + root), 1.0)
    return min(max((root - b) / a, 0.0), 1.0) if a > 0.0 else 0.0


@njit(cache=True)
def second_period(g, N, mu, f):
    """Fill f (n, tangents, S), friction forces at S instants of the second period from rest, which
    is nearly periodic.

    g (n, tangents, S) is kt w, N (n, S) the normal load, negative where open, all [N]; mu (n,).
    """
    n, tangents, S = g.shape
    for e in range(n):
        x = y = 0.0
        for i in range(2 * S):
            j = i % S
            dx = g[e, 0, j] - g[e, 0, j - 1]
            before = N[e, j - 1]
            now = N[e, j]
            if tangents == 1:
                x = step_1d(x + dx, before, now, mu[e])
            else:
                x, y, _ = step_2d(x, y, dx, g[e, 1, j] - g[e, 1, j - 1], before, now, mu[e])
                f[e, 1, j] = y
            f[e, 0, j] = x


def stable_step(fastest: float) -> float:
    """Longest stable step [s] of explicit central differences, 2 / omega, by the highest stuck
    frequency [rad/s].

    Beyond it friction saturates: the run stays finite and silently wrong, so that an integrator
    must refuse the step.
    """
    if not fastest >= 0:
        raise InputError(
            f"highest circular frequency = {fastest} rad/s, expected a number that is not negative"
        )
    return 2.0 / fastest if fastest > 0 else inf
