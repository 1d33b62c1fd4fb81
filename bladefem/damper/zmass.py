"""A rigid mass on a vibrating foundation, held by friction alone (the paper's Sect. 4, Fig. 7-11,
Table 1).

Three degrees of freedom (x, y, theta) of the mass, one friction element at each contact node. The
force on the mass at node i is the radial return of f + k_t dw onto the circle |f| <= mu N_i(t), w =
foundation minus mass (Eq. 28 corrected: the printed per-axis limits of Eq. 29 are not Coulomb
friction). The nodes turn with the mass by the full rotation, so theta need not stay small; N_i
follows the load in proportion (Eq. 27, receding contact).

The march is the leapfrog scheme with the return map of ``friction.time_step``, which finds the
start of slip within the step and turns the force exactly: second order, on curved paths too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from bladefem.errors import InputError

from ..friction.time_step import stable_step, step_2d


@dataclass(frozen=True)
class Footprint:
    """Where the mass touches the foundation, and how the load is shared out."""

    # (n, 2) from the centre of mass, in the axes of the mass [m]
    points: np.ndarray
    # (n,) part of the load that each node carries, sum 1 [1]
    share: np.ndarray
    # (n,) part of k_t of each node, sum 1 [1]; None: as the load (Eq. 23)
    stiffness: np.ndarray | None = None


@dataclass(frozen=True)
class MassOnFoundation:
    """The mass, its friction and its footprint; the defaults are the paper's Table 1 with k_t
    chosen here.
    """

    # [kg]
    mass: float = 0.035
    # about the normal through the centre of mass [kg m^2]
    inertia: float = 14.68e-6
    # friction coefficient [1]
    mu: float = 0.3
    # tangential stiffness of the whole footprint [N/m]
    kt: float = 1e6
    footprint: Footprint = field(default_factory=lambda: z_footprint())


@dataclass(frozen=True)
class Motion:
    """A march over equal steps; row i is the state at the end of step i."""

    # step [s]
    dt: float
    # (s, 3) x, y [m] and theta [rad] of the mass
    position: np.ndarray
    # (s, 3) [m/s, m/s, rad/s]
    velocity: np.ndarray
    # (s, 3) friction force on the mass [N] and its moment [N m]
    force: np.ndarray
    # (s, 2) distance slipped in the step, mean weighted by the friction limits [m]
    slip: np.ndarray
    # (n, 2) force of each node at the end, in fixed axes [N]
    springs: np.ndarray


def z_footprint() -> Footprint:
    """Forty nodes on a Z of 60 x 60 mm: two bars of 2 x 7 nodes along x, 16 mm high, and a diagonal
    of 2 x 6 between them; point-symmetric.

    Equal shares replace the pressure map of a finite element solution, which any caller may
    pass instead.
    """
    width, height, bar = 0.06, 0.06, 0.016
    across = np.array([-bar / 4, bar / 4])
    along = width * (np.arange(7) + 0.5) / 7 - width / 2
    top = np.array([[x, (height - bar) / 2 + y] for x in along for y in across])
    reach = height / 2 - bar
    slope = (width / 2 - bar / 2) / reach
    diagonal = np.array(
        [[slope * y + x, y] for y in reach * (np.arange(6) - 2.5) / 3 for x in across]
    )
    points = np.vstack([top, -top, diagonal])
    return Footprint(points, np.full(len(points), 1 / len(points)))


def pulsating_load(
    mean: float,
    amplitude: float,
    frequency: float,
    time: np.ndarray,
) -> np.ndarray:
    """P(t) = P0 + P1 sin(2 pi fp t) of Eq. 30, at ``time`` (s,) [s]; (s,) [N]."""
    return mean + amplitude * np.sin(2 * np.pi * frequency * time)


def ellipse(
    amplitude: tuple[float, float],
    phase: float,
    frequency: float,
    time: np.ndarray,
) -> np.ndarray:
    """Foundation motion x0 sin(wt), y0 sin(wt + phase), at ``time`` (s,) [s]; (s, 2) [m]. y0 = 0 is
    Eq. 30.
    """
    angle = 2 * np.pi * frequency * time
    return np.column_stack([amplitude[0] * np.sin(angle), amplitude[1] * np.sin(angle + phase)])


def march(
    body: MassOnFoundation,
    base: np.ndarray,
    load: np.ndarray,
    dt: float,
    start: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    pull: tuple[float, float] = (0.0, 0.0),
) -> Motion:
    """The motion of the mass under a sampled foundation motion and load.

    Args:
        base: (s + 1, 2) foundation displacement, the first row at the start [m].
        load: (s + 1,) total normal load [N]; below zero means lifted off.
        dt: step between samples [s].
        start: (3,) position, (3,) velocity, (n, 2) spring forces; at rest and unloaded when left
            out.
        pull: steady force through the centre of mass along x and y [N]. (A steady speed of the
            foundation needs none: only the drift changes, by that speed.)

    Raises:
        InputError: the step is beyond the stability limit of the explicit march (2 over the highest
            stuck frequency).
    """
    limit = longest_step(body)
    if not 0 < dt < limit:
        raise InputError(
            f"dt = {dt:.3g} s, expected a positive step below {limit:.3g} s, the stability limit "
            "of the explicit march"
        )
    n = len(body.footprint.share)
    position, velocity, springs = start or (np.zeros(3), np.zeros(3), np.zeros((n, 2)))
    nodes = np.column_stack(
        [body.footprint.points, _node_springs(body), body.mu * body.footprint.share]
    )
    springs = np.array(springs, float)
    history = _leapfrog_march(
        np.r_[position, velocity],
        springs,
        nodes,
        np.array([body.mass, body.inertia, *pull]),
        np.ascontiguousarray(base, float),
        np.ascontiguousarray(load, float),
        dt,
    )
    return Motion(dt, history[:, :3], history[:, 3:6], history[:, 6:9], history[:, 9:], springs)


def longest_step(body: MassOnFoundation) -> float:
    """Stability limit [s] of the steps of :func:`march`."""
    return stable_step(_highest_frequency(body))


def _highest_frequency(body: MassOnFoundation) -> float:
    """Highest circular frequency of the fully stuck mass [rad/s]."""
    k = _node_springs(body)
    points = body.footprint.points
    offset = np.linalg.norm(k @ points)
    stiffness = np.array([[body.kt, offset], [offset, k @ (points**2).sum(axis=1)]])
    scale = 1 / np.sqrt([body.mass, body.inertia])
    return float(np.sqrt(np.linalg.eigvalsh(stiffness * np.outer(scale, scale)).max()))


def _node_springs(body: MassOnFoundation) -> np.ndarray:
    """(n,) tangential stiffness of the nodes [N/m]; those without load still get a spring, however
    soft.
    """
    share = body.footprint.share if body.footprint.stiffness is None else body.footprint.stiffness
    return body.kt * np.maximum(share, 1e-9)


@njit(cache=True)
def _friction_step(springs, nodes, turn, step, loads, out):
    """Friction of all nodes over one step; ``out``: force x, y, moment, slip x, y. ``loads``: total
    before, after.
    """
    before, after = turn
    c0 = np.cos(before)
    s0 = np.sin(before)
    c1 = np.cos(after)
    s1 = np.sin(after)
    out[:] = 0.0
    weight = 0.0
    for i in range(nodes.shape[0]):
        x, y, k, share = nodes[i]
        rx = c1 * x - s1 * y
        ry = s1 * x + c1 * y
        dx = step[0] - (rx - (c0 * x - s0 * y))
        dy = step[1] - (ry - (s0 * x + c0 * y))
        px = springs[i, 0]
        py = springs[i, 1]
        fx, fy, slips = step_2d(px, py, k * dx, k * dy, loads[0], loads[1], share)
        weight += share
        out[3] += slips * share * (dx - (fx - px) / k)
        out[4] += slips * share * (dy - (fy - py) / k)
        springs[i, 0] = fx
        springs[i, 1] = fy
        out[0] += fx
        out[1] += fy
        out[2] += rx * fy - ry * fx
    if weight > 0:
        out[3:] /= weight


@njit(cache=True)
def _leapfrog_march(state, springs, nodes, inertia, base, load, dt):
    """Leapfrog with the return map; (s, 11): position 3, velocity 3, force and moment 3, slip 2.

    ``inertia``: mass, moment of inertia, steady force along x and y.
    """
    steps = base.shape[0] - 1
    history = np.empty((steps, 11))
    mass = np.array([inertia[0], inertia[0], inertia[1]])
    q = state[:3].copy()
    v = state[3:].copy()
    out = np.zeros(5)
    step = np.zeros(2)
    _friction_step(springs, nodes, (q[2], q[2]), step, (load[0], load[0]), out)
    still = np.array([inertia[2], inertia[3], 0.0]) / mass
    a = out[:3] / mass + still
    for n in range(steps):
        v += 0.5 * dt * a
        turned = q[2] + dt * v[2]
        step[0] = base[n + 1, 0] - base[n, 0] - dt * v[0]
        step[1] = base[n + 1, 1] - base[n, 1] - dt * v[1]
        _friction_step(springs, nodes, (q[2], turned), step, (load[n], load[n + 1]), out)
        q += dt * v
        a = out[:3] / mass + still
        v += 0.5 * dt * a
        history[n, :3] = q
        history[n, 3:6] = v
        history[n, 6:] = out
    return history
