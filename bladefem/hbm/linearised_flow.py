"""Disturbances of a periodic motion over one period, by the friction law's own steps.

The motion of the contacts is known from the balance; each node's state (stick, slip, open) at the
instants of a period, and how a step's force depends on the force before and on the displacements at
both ends, follow from the return map. The bodies are integrated exactly for forces that are linear
between two instants, and the contact forces implicitly. A motion of more than half a period of the
bodies on their contacts in one step gains energy by that; where steps are so long, forces are taken
constant at the mean of both instants, which no step is too long for (the average acceleration of
Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67, where the bodies are free). What is left is the error
of sampled friction, which falls with the square of the instants (`bladefem.hbm.flow_map` puts the
two together).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numba import njit
from scipy import linalg

from ..friction.time_step import step_2d
from ..util.numba_options import INNER_KERNEL, KERNEL
from .closed_contacts import coupled_groups
from .sector_modes import SectorModes

# periods marched until 2-D forces repeat
MAX_PERIODS = 60
# relative change of forces from one period to the next that counts as periodic
REPEAT_TOLERANCE = 1e-9


def longest_linear_step(
    stiffness: np.ndarray,
    push: np.ndarray,
    flexibility: np.ndarray,
    springs: np.ndarray,
) -> float:
    """Step [s] up to which contact forces may be linear in between: half the shortest period of the
    bodies with all contacts closed.

    Args:
        stiffness: (M, M) K of the modes [1/s^2]; push: (M, m) of the forces [kg^-1/2].
        flexibility: (m, m) of the bodies besides the modes [m/N]; springs: (m,) of the contacts
            [N/m], those of zero left out.
    """
    held = np.flatnonzero(springs > 0)
    joint = np.diag(1 / springs[held]) + flexibility[np.ix_(held, held)]
    closed = stiffness + push[:, held] @ np.linalg.solve(joint, push[:, held].T)
    highest = linalg.eigvalsh((closed + closed.T) / 2)[-1] if len(closed) else 0.0
    return float(np.pi / np.sqrt(highest)) if highest > 0 else np.inf


def linear_steps(
    system: SectorModes,
    dt: float,
    mean: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Exact step of the bodies without contact.

    Args:
        mean: forces are constant in between, the mean of those before and after.

    Returns:
        E (2M, 2M) from (q, v) before; G0 and G1 (2M, M) from the modal forces before and after,
        linear in between.
    """
    K = system.stiffness_matrix
    M = len(K)
    E = np.zeros((2 * M, 2 * M))
    G0 = np.zeros((2 * M, M))
    G1 = np.zeros((2 * M, M))
    for modes, step in group_steps(K, system.damping, coupled_groups(K, system.damping), dt, mean):
        rows = np.concatenate([modes, M + modes])
        for target, part in zip((E, G0, G1), step, strict=True):
            target[np.ix_(rows, rows if target is E else modes)] = part
    return E, G0, G1


def group_steps(
    K: np.ndarray,
    D: np.ndarray,
    groups: Sequence[np.ndarray],
    dt: float,
    mean: bool = False,
) -> Iterator[tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]]:
    """Modes of each group, and E (2b, 2b), G0 and G1 (2b, b) of its b modes, as `linear_steps`."""
    for b in sorted({len(group) for group in groups}):
        alike = [group for group in groups if len(group) == b]
        A = np.zeros((len(alike), 4 * b, 4 * b))
        # time in steps, so that the exponential has entries of like sizes
        A[:, :b, b : 2 * b] = np.eye(b)
        A[:, b : 2 * b, 2 * b : 3 * b] = np.eye(b)
        A[:, 2 * b : 3 * b, 3 * b :] = np.eye(b)
        for own, group in zip(A, alike, strict=True):
            own[b : 2 * b, :b] = -K[np.ix_(group, group)] * dt**2
            own[b : 2 * b, b : 2 * b] = -D[np.ix_(group, group)] * dt
        flow = linalg.expm(A)[:, : 2 * b]
        flow[:, :b, b : 2 * b] *= dt
        flow[:, b:, :b] /= dt
        flow[:, :b, 2 * b :] *= dt**2
        flow[:, b:, 2 * b :] *= dt
        for own, group in zip(flow, alike, strict=True):
            constant = own[:, 2 * b : 3 * b]
            rising = constant / 2 if mean else own[:, 3 * b :]
            yield group, (own[:, : 2 * b], constant - rising, rising)


@njit(**KERNEL)
def contact_steps(u, du, N, dN, mu, before, now, load, share, stuck):
    """Derivatives of the steps of one period of given motions, with which forces repeat.

    A node that changes its state inside a step does so where the motion says, to second order: the
    force before acts for this share of the step, and the force after for the rest.

    Args:
        u, du: (n, t, S) kt w at the instants, and its change in a step at the rate there [N].
        N, dN: (n, S) the same of the normal load, negative where open [N].
        before, now: (S, n, t, t) derivative of the force after step k, which ends at instant k, by
            the force before, and by the change of kt w in it; load: (S, n, t, 2) by the loads
            before and after. Filled.
        share: (S, n) of the step for which the force before it acts, one half where nothing
            changes. Filled.
        stuck: (n,) whether the node never leaves its stick. Filled.
    """
    n, t, S = u.shape
    for i in range(n):
        x = u[i, 0, 0]
        y = u[i, 1, 0] if t > 1 else 0.0
        # a literal False would compile the step twice
        slips = bool(0)
        size = mu[i] * max(np.abs(N[i]).max(), 1e-300)
        for cycle in range(MAX_PERIODS):
            x0 = x
            y0 = y
            stuck[i] = True
            for k in range(1, S + 1):
                j = k % S
                loads = (N[i, k - 1], N[i, j], dN[i, k - 1], dN[i, j])
                tangents = (before[j, i], now[j, i], load[j, i])
                if t == 1:
                    motion = (u[i, 0, k - 1], u[i, 0, j], du[i, 0, k - 1], du[i, 0, j])
                    x, slips, share[j, i] = _step_1d(x, slips, motion, loads, mu[i], tangents)
                else:
                    dx = u[i, 0, j] - u[i, 0, k - 1]
                    dy = u[i, 1, j] - u[i, 1, k - 1]
                    x, y, share[j, i] = _step_2d(x, y, dx, dy, loads, mu[i], tangents)
                if before[j, i, 0, 0] != 1.0 or now[j, i, 0, 0] != 1.0:
                    stuck[i] = False
            if cycle > 0 and abs(x - x0) + abs(y - y0) <= REPEAT_TOLERANCE * size:
                break


@njit(cache=True, error_model="numpy", inline="always")
def _cubic(start, end, slope0, slope1, a):
    """Cubic with these values and slopes at 0 and 1."""
    rise = end - start
    return start + a * (
        slope0 + a * (3 * rise - 2 * slope0 - slope1 + a * (slope0 + slope1 - 2 * rise))
    )


@njit(**INNER_KERNEL)
def _step_1d(x, slips, motion, loads, mu, tangents):
    """One step of a node with one tangent from the force x: the new force, whether it slips then,
    and the share of the step for which the old state lasts; derivatives are filled.
    """
    u0, u1, du0, du1 = motion
    N0, N1, dN0, dN1 = loads
    before, now, load = tangents
    before[0, 0] = 0.0
    now[0, 0] = 0.0
    load[0, 0] = 0.0
    load[0, 1] = 0.0
    if N1 <= 0.0:
        return 0.0, False, N0 / (N0 - N1) if N0 > 0.0 else 0.5
    share = 0.5
    if N0 <= 0.0:
        # sticks or slips from where it closes
        share = N0 / (N0 - N1)
        rest = 1.0 - share
        start = _cubic(u0, u1, du0, du1, share)
        f = u1 - start
        if abs(f) < mu * N1:
            now[0, 0] = rest
            load[0, 0] = (u1 - u0) * rest / (N1 - N0)
            load[0, 1] = -(u1 - u0) * N0 / (N1 - N0) ** 2
            return f, False, share
        side = 1.0 if f > 0 else -1.0
        load[0, 1] = side * mu
        return side * mu * N1, True, share
    if slips:
        side = 1.0 if x > 0 else -1.0
        ahead0 = side * du0 - mu * dN0
        ahead1 = side * du1 - mu * dN1
        if ahead1 >= 0.0:
            load[0, 1] = side * mu
            return side * mu * N1, True, 0.5
        # the motion turns back inside the step: what it does after that sticks
        a = ahead0 / (ahead0 - ahead1) if ahead0 > 0.0 else 0.0
        f = side * mu * _cubic(N0, N1, dN0, dN1, a) + u1 - _cubic(u0, u1, du0, du1, a)
        now[0, 0] = 1.0 - a
        load[0, 0] = side * mu * (1.0 - a)
        load[0, 1] = side * mu * a
        if a == 0.0:
            before[0, 0] = 1.0
            load[0, 0] = 0.0
        return min(max(f, -mu * N1), mu * N1), False, 0.5
    f = x + u1 - u0
    if abs(f) < mu * N1:
        before[0, 0] = 1.0
        now[0, 0] = 1.0
        return f, False, share
    side = 1.0 if f > 0 else -1.0
    margin = max(mu * N0 - side * x, 0.0)
    over = side * f - mu * N1
    share = margin / (margin + over) if margin + over > 0.0 else 0.0
    load[0, 1] = side * mu
    return side * mu * N1, True, share


@njit(**INNER_KERNEL)
def _step_2d(x, y, dx, dy, loads, mu, tangents):
    """One step of a node with two tangents: new force, and the share of the step for which the old
    state lasts; derivatives are filled.
    """
    before, now, load = tangents
    force, share, across, by = slopes_2d(x, y, dx, dy, loads[0], loads[1], mu)
    by_force, by_motion, by_load0, by_load1 = by
    for a in range(2):
        for b in range(2):
            before[a, b] = by_force * across[a + b]
            now[a, b] = by_motion * across[a + b]
        load[a, 0] = by_load0[a]
        load[a, 1] = by_load1[a]
    return force[0], force[1], share


@njit(**INNER_KERNEL)
def slopes_2d(x, y, dx, dy, N0, N1, mu):
    """One step of a node with two tangents, in numbers alone: most of a march is spent here.

    Returns:
        the new force; the share of the step for which the old state lasts; three entries xx, xy,
        yy of a symmetric matrix A, and the derivatives of the new force by the old one and by the
        motion over A, and by both loads.
    """
    fx, fy, slips = step_2d(x, y, dx, dy, N0, N1, mu)
    nothing = (0.0, 0.0)
    whole = (1.0, 0.0, 1.0)
    if slips == 0.0 and N0 > 0.0 and mu * N1 > 0.0:
        return (fx, fy), 0.5, whole, (1.0, 1.0, nothing, nothing)
    share = 0.5
    if (N0 > 0.0) != (N1 > 0.0):
        share = N0 / (N0 - N1)
    elif slips != 0.0:
        margin = max(mu * N0 - np.sqrt(x * x + y * y), 0.0)
        over = max(np.sqrt((x + dx) ** 2 + (y + dy) ** 2) - mu * N1, 0.0)
        # a node that slipped before goes on
        if margin > 1e-9 * mu * N0:
            share = margin / (margin + over)
    if mu * N1 <= 0.0:
        return (fx, fy), share, whole, (0.0, 0.0, nothing, nothing)
    # of the step, in contact
    part = 1.0 if N0 > 0.0 else N1 / (N1 - N0)
    if slips == 0.0:
        rise = (N1 - N0) ** 2
        by_load0 = (dx * part / (N1 - N0), dy * part / (N1 - N0))
        by_load1 = (-dx * N0 / rise, -dy * N0 / rise)
        return (fx, fy), share, whole, (0.0, part, by_load0, by_load1)
    # across the force the direction of the motion is approached over a length of limit over
    # stiffness; along it the force is the limit
    sliding = 1.0 - share if N0 > 0.0 and share != 0.5 else 1.0
    path = sliding * part * np.sqrt(dx * dx + dy * dy) / (mu * N1)
    kept = np.exp(-path)
    # of short paths by its series, exact to rounding
    gained = (1.0 - kept) / path if path > 1e-5 else 1.0 - 0.5 * path
    nx = fx / (mu * N1)
    ny = fy / (mu * N1)
    across = (1.0 - nx * nx, -nx * ny, 1.0 - ny * ny)
    by_force = kept if N0 > 0.0 else 0.0
    return (fx, fy), share, across, (by_force, part * gained, nothing, (mu * nx, mu * ny))
