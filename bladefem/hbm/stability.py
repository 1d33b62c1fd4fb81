"""Is a solution of the balance a motion that lasts? Its Floquet multipliers, for every kind of
model.

Where normal loads are prescribed and the bodies damped there is one periodic motion, and every
other one decays to it (the friction law is then monotone). Elsewhere the linearised motion is
carried through one period along the solution (`bladefem.hbm.flow_map`): the largest modulus of its
multipliers shows how much of a disturbance is left after a period. Nodes that stick throughout only
add constant multipliers of one, the mean force that stick leaves open, and are condensed into the
bodies (`bladefem.hbm.closed_contacts`). Travelling waves are judged against all disturbances that
repeat after the same number r of blades as they do. A disturbance that is carried through 1/r of a
period and handed on to the next blade meets the same wave again: r such steps make the period.

The named bifurcation is the one through which a motion with such multipliers lost its stability:
"fold" at +1 (where another motion may branch off as well), "period doubling" at -1, "torus" for a
complex pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..errors import InputError
from ..friction.fourier import synthesis
from ..util.arrays import IntegerArray, RealArray
from .closed_contacts import OpenContacts, coupled_groups, open_contacts
from .flow_map import NodeSteps, acting_forces, flow_map
from .linearised_flow import contact_steps
from .model import ReducedModel
from .sector_modes import SectorModes, sector_modes
from .solution import Solution

UNIQUE = "unique"
STABLE = "stable"
UNSTABLE = "unstable"
UNKNOWN = "unknown"
# growth of a disturbance over a period that counts as instability: less is lost in the error of
# sampled friction
UNSTABLE_GROWTH = 1e-3
# instants a period, and how many times as many where the verdict is close
INSTANTS_PER_PERIOD = 256
INSTANT_REFINEMENT = 4
# distance from one within which it is
NEAR_ONE = 0.003
# growth from which on more instants do not make it stable
DECIDED_GROWTH = 0.1
# distance from one below which a multiplier is that of a motion that nothing holds, such as a
# damper's walk: single precision and its power for all blades leave so much of it
NEUTRAL_DISTANCE = 1e-4
# operations of one verdict up to which many are made, some 0.03 s
AFFORDABLE_OPERATIONS = 1e9
# and above which none is made, some 1.5 s
MAX_OPERATIONS = 4e10
# operations of the eigenvalues of a matrix over the cube of its size
MULTIPLIER_OPERATIONS = 10.0
# angle of a multiplier to the real axis up to which it is real
REAL_MULTIPLIER_ANGLE = 1e-3


@dataclass(frozen=True)
class Verdict:
    """Verdict on one solution."""

    # UNIQUE, STABLE, UNSTABLE or UNKNOWN
    verdict: str
    # largest modulus of the Floquet multipliers, those of stuck nodes left out; NaN: not computed
    multiplier: float = float("nan")
    # "fold", "period doubling" or "torus" of an unstable motion
    bifurcation: str = ""
    # why nothing is known
    reason: str = ""


def stability_verdict(
    model: ReducedModel,
    solution: Solution,
    most: float = MAX_OPERATIONS,
) -> Verdict:
    """The verdict on a converged solution of the model.

    Args:
        most: operations above which it is not made, nor made again with more instants where it is
            close.
    """
    if not solution.converged:
        return Verdict(UNKNOWN, reason="not converged")
    if has_one_motion(model):
        return Verdict(UNIQUE)
    system = _system(model)
    if isinstance(system, InputError):
        return Verdict(UNKNOWN, reason=str(system))
    # what single precision leaves open is looked at closer
    leading = _leading(model, solution, system, INSTANTS_PER_PERIOD, most, single=True)
    if leading is not None and _needs_a_closer_look(leading):
        finer = _leading(model, solution, system, INSTANT_REFINEMENT * INSTANTS_PER_PERIOD, most)
        leading = leading if finer is None else finer
    if leading is None:
        return Verdict(
            UNKNOWN,
            reason="it takes longer than is spent on it; fewer contact.points or model.modes "
            "shorten it",
        )
    if abs(leading) <= 1 + UNSTABLE_GROWTH:
        return Verdict(STABLE, float(abs(leading)))
    return Verdict(UNSTABLE, float(abs(leading)), _bifurcation(leading))


def _needs_a_closer_look(leading: complex) -> bool:
    """The multiplier is so close to one that more instants may decide otherwise."""
    close = UNSTABLE_GROWTH - NEAR_ONE < abs(leading) - 1 < DECIDED_GROWTH
    return close and abs(leading - 1) > NEUTRAL_DISTANCE


def has_one_motion(model: ReducedModel) -> bool:
    """Normal loads are prescribed, and the bodies lose work by themselves in every motion."""
    prescribed = model.loads_prescribed
    return prescribed and model.damped and not model.circulatory


def verdict_operations(model: ReducedModel, solution: Solution) -> float:
    """Operations of a verdict with the fewest instants, roughly; 0 where none are needed, as in
    full stick, or it cannot be made.
    """
    if not solution.converged or has_one_motion(model) or _sticks(solution):
        return 0.0
    system = _system(model)
    if isinstance(system, InputError):
        return 0.0
    return _operations_from_states(model, solution, system, INSTANTS_PER_PERIOD)


def _system(model: ReducedModel) -> SectorModes | InputError:
    """The system in time, or why there is none: found once for a model."""
    if model.elements.law is not None:
        return InputError("a friction law of its own, expected Coulomb's")
    return model.once("sector modes", lambda: _outcome(model))


def _outcome(model: ReducedModel) -> SectorModes | InputError:
    try:
        return sector_modes(model)
    except InputError as error:
        return error


def _bifurcation(multiplier: complex) -> str:
    if abs(multiplier.imag) > REAL_MULTIPLIER_ANGLE * abs(multiplier):
        return "torus"
    return "fold" if multiplier.real > 0 else "period doubling"


def _leading(
    model: ReducedModel,
    solution: Solution,
    system: SectorModes,
    instants: int,
    most: float,
    single: bool = False,
) -> complex | None:
    """The multiplier of largest modulus, by a map in single precision or in double; None where it
    would take too many operations.
    """
    if _sticks(solution):
        rate = model.once("rate in full stick", lambda: _rate_in_full_stick(model, system))
        return complex(np.exp(rate * 2 * np.pi / solution.omega))
    S = max(instants, 16 * (solution.harmonics + 1))
    S = system.blades * -(-S // system.blades)
    if _operations_from_states(model, solution, system, S) > most:
        return None
    contacts, nodes = linearised_contacts(model, solution, system, S)
    forces = acting_forces(contacts, nodes)
    if map_operations(contacts, forces, system.blades) > most:
        return None
    nodes = begun_at(nodes, int(forces.argmin()))
    dt = 2 * np.pi / solution.omega / S
    part = flow_map(contacts, nodes, dt, S // system.blades, single=single)
    # open nodes have no force to be disturbed: their multipliers are zero
    moving = part.any(axis=0)
    handed = _handed_on(system, part)[np.ix_(moving, moving)]
    values = linalg.eigvals(handed, check_finite=False) ** system.blades
    return complex(values[np.argmax(abs(values))])


def _sticks(solution: Solution) -> bool:
    """No node ever slips or lifts off: disturbances are those of a linear system."""
    return not any(solution.states[state] for state in ("slip", "lift", "open"))


def _rate_in_full_stick(model: ReducedModel, system: SectorModes) -> complex:
    """The rate [1/s] at which disturbances decay slowest, or grow, where all nodes stick."""
    springs = np.tile(model.springs, (system.blades, 1))
    every = np.ones(len(springs), dtype=bool)
    stuck = open_contacts(system, every, every, springs)
    M = len(stuck.stiffness)
    zero, one = np.zeros((M, M)), np.eye(M)
    rates = linalg.eigvals(np.block([[zero, one], [-stuck.stiffness, -stuck.damping]]))
    return complex(rates[rates.real.argmax()])


def _handed_on(system: SectorModes, part: np.ndarray) -> np.ndarray:
    """The map of (q, v, f) through 1/r of a period, seen by the next blade."""
    if system.blades == 1:
        return part
    M = len(system.stiffness)
    forces = part[2 * M :]
    return np.concatenate(
        [
            system.turn @ part[:M],
            system.turn @ part[M : 2 * M],
            np.roll(forces, len(forces) // system.blades, axis=0),
        ]
    )


def map_operations(contacts: OpenContacts, forces: IntegerArray, blades: int) -> float:
    """Operations of carrying all disturbances through 1/r of a period, and of the multipliers.

    Args:
        forces: (S,) number of forces after each step, see `flow_map.acting_forces`.
    """
    rows, M = contacts.reading.shape
    read = forces * rows / max(contacts.push.shape[1], 1)
    return _operations(M, _coupled_operations(contacts.groups), forces.astype(float), read, blades)


def _operations_from_states(
    model: ReducedModel,
    solution: Solution,
    system: SectorModes,
    S: int,
) -> float:
    """Operations of a verdict with S instants, from which nodes are closed when and how many of
    them slip: about those of the map.
    """
    d = model.directions
    M = len(system.stiffness)
    r = system.blades
    S = r * -(-S // r)
    closed = _normal_loads(model, solution, S) > 0
    # nodes that lift off act while they are closed, others always
    lifting = np.count_nonzero(closed[~closed.all(axis=1)], axis=0)
    ring = sum((np.roll(lifting, -b * S // r) for b in range(r)), np.zeros(S))
    slip = r * solution.states["slip"]
    tangents = model.elements.tangents
    forces, rows = d * ring + tangents * slip, d * (ring + slip)
    # modes that only damping couples, or the springs of closed contacts as well
    coupled = model.once("coupled modes", lambda: _coupled_operations(_groups_of(system)))
    if slip or solution.states["stick"]:
        coupled = 4.0 * M**2 / max(r / 2, 1.0)
    return _operations(M, coupled, forces, rows, r)


def _groups_of(system: SectorModes) -> tuple[np.ndarray, ...]:
    """Numbers of the modes of each group that is coupled without contacts."""
    return coupled_groups(system.stiffness_matrix, system.damping)


def _coupled_operations(groups: Sequence[np.ndarray]) -> float:
    """Operations of a step of the bodies for each disturbance, over two."""
    return sum((2.0 * len(group)) ** 2 for group in groups)


def _operations(M: int, coupled: float, forces: RealArray, rows: RealArray, blades: int) -> float:
    """Operations of carrying all disturbances through 1/r of a period from the instant with the
    fewest forces on, and of the eigenvalues.

    Args:
        coupled: operations of a step of the bodies for each disturbance, over two.
        forces, rows: (S,) forces and displacements of the nodes that act after each step.
    """
    size = 2.0 * M + forces.min()
    products = coupled + rows * M + 2.0 * M * forces + forces**2 + rows * forces
    steps = 2 * size * products + 2.0 * forces**3
    return float(steps.sum() / blades + MULTIPLIER_OPERATIONS * size**3)


def linearised_contacts(
    model: ReducedModel,
    solution: Solution,
    system: SectorModes,
    S: int,
    copies: int = 1,
) -> tuple[OpenContacts, NodeSteps]:
    """Bodies with the springs of closed contacts of all blades, and the steps of the other nodes,
    at S instants a period.

    Args:
        copies: of all blades in the system; 2 for the real and imaginary parts of their motion.
    """
    r = system.blades
    *parts, stuck, pressed = _steps_of_nodes(model, solution, S)
    moving = np.flatnonzero(np.tile(~stuck, r * copies))
    springs = np.tile(model.springs, (r * copies, 1))
    closed = (np.tile(stuck, r * copies), np.tile(pressed, r * copies))
    contacts = open_contacts(system, *closed, springs)
    rings = (np.concatenate([_of_all_blades(part, r)] * copies, axis=1) for part in parts)
    return contacts, NodeSteps(*(ring[:, moving] for ring in rings))


def begun_at(nodes: NodeSteps, first: int) -> NodeSteps:
    """The steps of a period that begins at another instant: multipliers do not depend on it, and
    where most nodes are open there are fewer disturbances to carry.
    """
    return NodeSteps(*(np.roll(part, -first, axis=0) for part in nodes))


def _prescribed_normal(model: ReducedModel, S: int) -> tuple[np.ndarray, np.ndarray]:
    """The part (n, S) [N] of the normal loads that the motion does not make, at S instants, and its
    change in one step at their rate there.
    """
    load = model.normal_load(max((0, *model.normal)))[:, None]
    base = synthesis(load.shape[2] // 2, S).T
    return load[:, 0] @ base, _rates(load)[:, 0] @ base * (2 * np.pi / S)


def _normal_loads(model: ReducedModel, solution: Solution, S: int) -> RealArray:
    """(n, S) normal loads at S instants [N], negative where open."""
    loads, _ = _prescribed_normal(model, S)
    if model.directions == model.elements.tangents:
        return loads
    n, d, K = solution.w.shape
    normal = solution.w[:, 0] + 0.0
    normal[:, 0] += model.offset.reshape(n, d)[:, 0]
    return loads + model.elements.kn[:, None] * (normal @ synthesis(K // 2, S).T)


def _steps_of_nodes(
    model: ReducedModel,
    solution: Solution,
    S: int,
) -> tuple[np.ndarray, ...]:
    """The parts of `NodeSteps` for the nodes of one blade; which of them stick throughout, and
    which have a normal spring that never lifts off.
    """
    e = model.elements
    n, d, K = solution.w.shape
    t = e.tangents
    w = solution.w + 0.0
    w[:, :, 0] += model.offset.reshape(n, d)
    base = synthesis(K // 2, S).T
    motion = w @ base
    change = _rates(w) @ base * (2 * np.pi / S)
    N, dN = _prescribed_normal(model, S)
    if d > t:
        N = N + e.kn[:, None] * motion[:, 0]
        dN = dN + e.kn[:, None] * change[:, 0]
    before = np.zeros((S, n, t, t))
    now = np.zeros((S, n, t, t))
    by_load = np.zeros((S, n, t, 2))
    share = np.zeros((S, n))
    stuck = np.zeros(n, dtype=bool)
    tangential = np.ascontiguousarray(e.kt[:, None, None] * motion[:, d - t :])
    rate = np.ascontiguousarray(e.kt[:, None, None] * change[:, d - t :])
    contact_steps(tangential, rate, N, dN, e.mu, before, now, by_load, share, stuck)
    A = np.zeros((S, n, d, d))
    B1 = np.zeros((S, n, d, d))
    B0 = np.zeros((S, n, d, d))
    f = d - t
    A[:, :, f:, f:] = before
    B1[:, :, f:, f:] = now * e.kt[:, None, None]
    B0[:, :, f:, f:] = -now * e.kt[:, None, None]
    if f:
        B1[:, :, 0, 0] = (e.kn[:, None] * (N > 0)).T
        B1[:, :, f:, 0] = by_load[..., 1] * e.kn[:, None]
        B0[:, :, f:, 0] = by_load[..., 0] * e.kn[:, None]
    closed: np.ndarray = np.asarray(np.all(N > 0, axis=1))
    return A, B1, B0, share, stuck & closed, closed & bool(f)


def _of_all_blades(part: np.ndarray, blades: int) -> np.ndarray:
    """(S, blades n, ...) from the nodes (S, n, ...) of one: each next blade is a share of the
    period ahead.
    """
    ahead = len(part) // blades
    return np.concatenate([np.roll(part, -b * ahead, axis=0) for b in range(blades)], axis=1)


def _rates(w: np.ndarray) -> np.ndarray:
    """Coefficients (n, d, K) of the derivative by the phase."""
    rate = np.zeros_like(w)
    h = np.arange(1, w.shape[2] // 2 + 1)
    rate[:, :, 1::2] = h * w[:, :, 2::2]
    rate[:, :, 2::2] = -h * w[:, :, 1::2]
    return rate
