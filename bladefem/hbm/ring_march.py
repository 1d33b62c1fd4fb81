"""Blades and dampers marched in time from a motion of the balance, all blades of a travelling wave
free to move as they like.

The steady motion without contact forces is known; what is marched is the motion that the contact
forces add to it. The bodies are integrated exactly for forces that are linear between two instants,
or constant where steps are too long for that (`bladefem.hbm.linearised_flow`); the forces at the
end of a step follow from the friction law (`bladefem.hbm.step_forces`). The steps themselves are in
`bladefem.hbm.ring_steps`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..friction.fourier import synthesis, to_complex, to_real
from .blade_forces import no_factors
from .envelope import PERIODS_OF_PART, first_amplitudes, leap_from_end, moved_envelope, scatter
from .linear.condensation import condense
from .linearised_flow import linear_steps, longest_linear_step
from .model import ReducedModel
from .ring_contacts import (
    forces_in_places,
    forces_of_nodes,
    in_places,
    places_of_directions,
    places_of_nodes,
    ring_contacts,
)
from .ring_readings import displacements, ring_readings
from .ring_steps import Ring, march_room, march_steps, step_terms
from .sector_modes import SectorModes, sector_modes
from .solution import Solution
from .solve import free_response
from .stiffening_layer import RingLayer, reached_springs, ring_layer

# of the instants of a period
INSTANTS_PER_PERIOD = 256
# periods after which a march may end
PERIODS_AT_ONCE = 25


@dataclass(frozen=True)
class Drive:
    """What excites the blades while they are marched."""

    # [rad/s]
    omega: float
    # excitation over that of the model
    size: float = 1.0


@dataclass(frozen=True)
class RingState:
    """Blades and dampers at the beginning of a period of a drive."""

    drive: Drive
    # (2M,) modal displacements and velocities that contact forces add to the steady motion
    # without them
    modal: np.ndarray
    # (r n, 3) contact forces, normal and two tangential ones [N]
    forces: np.ndarray


@dataclass(frozen=True)
class RingMarch:
    """Motion of the first probe of each blade."""

    # (periods, r, instants) [m], those that were marched since the last leap
    motion: np.ndarray
    # (periods,) of each of these, mean of the blades [J]
    friction_work: np.ndarray
    # that were marched in all
    periods: int
    # the forces of each step were found
    settled: bool
    # steps are short enough for forces that are linear in them, also where a layer was stiffest;
    # where they are not at rest forces are constant in them
    resolved: bool
    # operations that all periods would have taken, roughly
    operations: float
    # after the last period
    end: RingState


def march_operations(model: ReducedModel, periods: int) -> float:
    """Operations of a march of soft layers with INSTANTS_PER_PERIOD, roughly; one of stiff layers
    takes up to 20 times as many.

    Raises:
        InputError: the wave does not repeat within the harmonics that the model has bodies for.
    """
    m, M = _system(model).contact.shape
    return 2.0 * periods * INSTANTS_PER_PERIOD * (4 * M**2 + 4 * M * m + 5 * m**2)


def _operations_of_bodies(model: ReducedModel) -> float:
    """Of a step."""
    m, M = _system(model).contact.shape
    return 8.0 * M * (M + m)


def never_enough(motion: np.ndarray) -> bool:
    """No motion is enough."""
    return False


def march_ring(
    model: ReducedModel,
    start: RingState,
    periods: int,
    instants: int = INSTANTS_PER_PERIOD,
    enough: Callable[[np.ndarray], bool] = never_enough,
    most: float = np.inf,
    leaps: bool = False,
) -> RingMarch:
    """March under the drive of a state.

    Args:
        start: of ``state_of_solution``, or of an earlier march, perhaps ``driven_anew``.
        periods: of the excitation, at most.
        enough: whether the motion (periods, r, instants) so far will do; asked every
            PERIODS_AT_ONCE.
        most: operations; where the first period shows that all would take more, no more are
            marched.
        leaps: along the slow envelope (`bladefem.hbm.envelope`), where what the blades do on their
            way does not matter; ``enough`` sees what was marched since the last one.

    Raises:
        InputError: the wave does not repeat within the harmonics that the model has bodies for.
    """
    r = _system(model).blades
    # each blade is a share of a period ahead of the one before
    S = r * -(-instants // r)
    y, forces = start.modal.copy(), forces_in_places(start.forces, r)
    layer = ring_layer(model)
    ring, resolved = _ring(model, start, S)
    motion = np.empty((periods, S, r))
    friction_work = np.zeros(periods)
    work = np.zeros(1)
    operations = of_bodies = periods * S * _operations_of_bodies(model)
    settled, done, leapt = True, 0, 0
    envelope: list[complex] = []
    at_once = PERIODS_OF_PART if leaps else PERIODS_AT_ONCE
    while settled and done < periods:
        # the first period tells what the others take
        begin, done = done, min(done - done % at_once + at_once, periods) if done else 1
        part = slice(begin, done)
        settled = _marched(y, forces, (ring, layer), motion[part], friction_work[part], work)
        operations = of_bodies + work[0] * periods / done
        if operations > most:
            break
        whole = done % at_once == 0 or done == periods
        if whole and enough(motion[leapt:done].transpose(0, 2, 1)):
            break
        # what follows a leap has to tell where it led
        if whole and leaps and periods - done >= 3 * at_once:
            part_marched = motion[done - at_once : done].transpose(0, 2, 1)
            if _leapt(_system(model), start.drive.omega, envelope, part_marched, y, ring):
                leapt = done
    if resolved and layer is not None and settled:
        longest = _longest_step(model, reached_springs(model, layer))
        resolved = 2 * np.pi / start.drive.omega / S <= longest
    marched = motion[leapt:done].transpose(0, 2, 1)
    end = RingState(start.drive, y, forces_of_nodes(forces, len(start.forces) // r))
    spent = friction_work[leapt:done] / r
    return RingMarch(marched, spent, done, settled, resolved, operations, end)


def _marched(
    y: np.ndarray,
    forces: np.ndarray,
    marched: tuple[Ring, RingLayer | None],
    motion: np.ndarray,
    friction_work: np.ndarray,
    work: np.ndarray,
) -> bool:
    """Fill motion (periods, S, r) and friction_work (periods,), and move state and forces along;
    False where the forces of a step were not found, or are no numbers.
    """
    try:
        done = march_steps(y, forces, *marched, motion, friction_work, work)
    except np.linalg.LinAlgError:
        # of a Newton step that is not determined
        done = 0
    motion.reshape(-1, motion.shape[2])[done:] = np.nan
    return bool(np.isfinite(motion).all())


def _leapt(
    system: SectorModes,
    omega: float,
    envelope: list[complex],
    motion: np.ndarray,
    y: np.ndarray,
    ring: Ring,
) -> bool:
    """Leap along the envelope where it tells how far; whether it did.

    Args:
        envelope: amplitudes of the parts since the last leap; takes that of this part, and is
            emptied by a leap.
        motion: (periods, r, instants) of this part.
    """
    amplitudes = first_amplitudes(motion)
    envelope.append(amplitudes.mean())
    leap = leap_from_end(envelope, scatter(amplitudes))
    if not leap:
        return False
    _leap(system, omega, leap, y, ring)
    envelope.clear()
    return True


def _leap(system: SectorModes, omega: float, leap: complex, y: np.ndarray, ring: Ring) -> None:
    """Move the modal state y along the envelope, and the contacts with it, so that no step of
    theirs is a large one.
    """
    moved = moved_envelope(system, ring.probe, y, omega, leap)
    contacts = ring.displacements
    contacts += displacements(ring.readings, (moved - y)[: len(system.stiffness)])
    y[:] = moved


def state_of_solution(
    model: ReducedModel,
    point: Solution,
    disturbance: float = 0.0,
) -> RingState:
    """The state of a solution whose modal amplitudes are disturbed.

    Args:
        disturbance: relative, of another size and sign for each mode.

    Raises:
        InputError: normal loads are prescribed, a friction law is not Coulomb's, or the wave does
            not repeat within the harmonics that the model has bodies for.
    """
    if model.loads_prescribed:
        raise InputError("normal loads are prescribed, expected ones that follow the motion")
    if model.elements.law is not None:
        raise InputError("a friction law of its own, expected Coulomb's")
    system = _system(model)
    M = len(system.stiffness)
    forces = _blades_at_start(to_complex(point.f).reshape(-1, point.harmonics + 1).T, system.blades)
    q, velocity = _modal_start(model, system, point)
    noise = np.random.default_rng(0).standard_normal(M)
    y = np.concatenate([q * (1 + disturbance * noise), velocity])
    return RingState(Drive(point.omega), y, _three(forces, model.elements.tangents))


def driven_anew(model: ReducedModel, state: RingState, drive: Drive) -> RingState:
    """The state with its modal motion under another drive from now on; on a model of other contact
    points with forces that are found in its first steps.
    """
    before, after = (_free_modal_state(model, one) for one in (state.drive, drive))
    nodes = _system(model).blades * len(model.elements.kt)
    forces = state.forces if len(state.forces) == nodes else np.zeros((nodes, 3))
    return RingState(drive, state.modal + before - after, forces)


def steps_are_resolved(model: ReducedModel, omega: float, instants: int) -> bool:
    """Whether steps with so many instants a period are short enough for forces that are linear in
    them, with the stiffness of the contacts at rest.
    """
    longest = model.once("longest linear step", lambda: _longest_step(model, model.springs))
    return 2 * np.pi / omega / instants <= longest


def _longest_step(model: ReducedModel, springs: np.ndarray) -> float:
    """Longest step for forces that are linear in it [s] with springs (n, directions) [N/m]."""
    system = _system(model)
    bodies = (system.stiffness_matrix, system.contact.T, system.residual)
    own = springs[:, : model.directions]
    return longest_linear_step(*bodies, np.tile(own.ravel(), system.blades))


def _system(model: ReducedModel) -> SectorModes:
    return model.once("ring", lambda: sector_modes(model))


def _ring(model: ReducedModel, start: RingState, S: int) -> tuple[Ring, bool]:
    """The ring at S instants a period, and whether its steps are short enough for forces that are
    linear in them.
    """
    system = _system(model)
    r, M = system.blades, len(system.stiffness)
    omega, size = start.drive.omega, start.drive.size
    H = max((1, *model.excitation))
    steady = condense(model, omega, H).free.copy(), free_response(model, omega, H)[:, :1].copy()
    for amplitudes in steady:
        amplitudes[1:] *= size
    free, free_probe = (_of_blades(amplitudes, r, S) for amplitudes in steady)
    dt = 2 * np.pi / omega / S
    resolved = steps_are_resolved(model, omega, S)
    E, G0, G1 = linear_steps(system, dt, mean=not resolved)
    e = model.elements
    own = len(model.preload)
    extra = start.forces[:, : 1 + e.tangents].ravel() - np.tile(model.preload, r)
    w = free[0] + system.contact @ start.modal[:M] - system.residual @ extra
    F = system.residual[:, :own] + system.contact @ G1[:M] @ system.contact[:own].T
    places = places_of_directions(len(e.kt), model.directions)
    nodes = places_of_nodes(len(e.kt))
    probes = len(system.probe) // r
    readings = ring_readings(system, places)
    flexible = system.probe_residual[::probes].reshape(r, r, own)
    ring = Ring(
        displacements=in_places(w.reshape(r, own), places),
        flow=step_terms(E),
        before=step_terms(-G0),
        after=step_terms(-G1),
        readings=readings,
        contacts=ring_contacts(np.column_stack([e.kt, e.kn, e.mu]), F, model.preload),
        kept=no_factors(r, len(places)),
        # a place without a node is open
        load=in_places(_normal_loads(model, r, S).reshape(S, r, -1), nodes, -1.0),
        free=in_places(free.reshape(S, r, own), places),
        probe=np.ascontiguousarray(system.probe[::probes]),
        probe_flexibility=in_places(flexible, places).reshape(r, -1),
        probe_free=np.ascontiguousarray(free_probe),
        room=march_room(readings, r, len(nodes)),
    )
    return ring, resolved


def _of_blades(amplitudes: np.ndarray, r: int, S: int) -> np.ndarray:
    """(S, r rows) of all blades at the instants from complex amplitudes (H+1, rows) of one."""
    series = synthesis(len(amplitudes) - 1, S) @ to_real(amplitudes.T).T
    return np.concatenate([np.roll(series, -b * S // r, axis=0) for b in range(r)], axis=1)


def _normal_loads(model: ReducedModel, r: int, S: int) -> np.ndarray:
    """(S, r n) normal load at zero displacement [N]."""
    load = to_complex(model.normal_load(max((0, *model.normal)))[:, None])[:, 0]
    return _of_blades(load.T, r, S)


def _three(forces: np.ndarray, tangents: int) -> np.ndarray:
    """(r n, 3) normal force and two tangential ones, the second zero where there is none."""
    own = forces.reshape(-1, 1 + tangents)
    return np.pad(own, ((0, 0), (0, 2 - tangents)))


def _modal_start(
    model: ReducedModel,
    system: SectorModes,
    point: Solution,
) -> tuple[np.ndarray, np.ndarray]:
    """(M,) modal displacements and velocities by the contact forces at phase zero."""
    H, r = point.harmonics, system.blades
    f = to_complex(point.f).reshape(-1, H + 1).T.copy()
    f[0] -= model.preload
    force = _of_wave(f, r)
    push = -force @ system.contact
    q = _steady_modes(system, push, point.omega)
    still = system.stiffness <= 0
    held = system.stiffness_matrix[np.ix_(~still, ~still)]
    q[0, ~still] = np.linalg.solve(held, push[0, ~still])
    if still.any():
        # where the rigid motions rest is known from the contacts; where they walk it is anywhere
        mean = point.w[:, :, 0].ravel()
        if point.walk is not None:
            mean = mean - point.walk @ np.linalg.lstsq(point.walk, mean, rcond=None)[0]
        free = condense(model, point.omega, H).free[0].real
        flexible = system.contact @ q[0].real - system.residual @ force[0].real
        missing = np.tile(mean - free, r) - flexible
        q[0, still] = np.linalg.lstsq(system.contact[:, still], missing, rcond=1e-9)[0]
    return _at_start(q, point.omega)


def _free_modal_state(model: ReducedModel, drive: Drive) -> np.ndarray:
    """(2M,) modal displacements and velocities of the steady motion without contact forces, less
    the mean, at phase zero.
    """
    system = _system(model)
    H = max((1, *model.excitation))
    loads = len(system.load) // system.blades
    force = np.zeros((H + 1, loads), dtype=complex)
    for h, amplitude in model.excitation.items():
        force[h] = drive.size * amplitude
    push = _of_wave(force, system.blades) @ system.load
    return np.concatenate(_at_start(_steady_modes(system, push, drive.omega), drive.omega))


def _steady_modes(system: SectorModes, push: np.ndarray, omega: float) -> np.ndarray:
    """(H+1, M) complex modal amplitudes under modal forces (H+1, M); those of the mean are zero."""
    q = np.zeros_like(push)
    identity = np.eye(len(system.stiffness))
    for h in range(1, len(push)):
        w = h * omega
        impedance = system.stiffness_matrix - w**2 * identity + 1j * w * system.damping
        q[h] = np.linalg.solve(impedance, push[h])
    return q


def _at_start(q: np.ndarray, omega: float) -> tuple[np.ndarray, np.ndarray]:
    """(M,) displacements and velocities at phase zero from amplitudes (H+1, M)."""
    h = np.arange(len(q))[:, None]
    return q.sum(axis=0).real, (1j * omega * h * q).sum(axis=0).real


def _of_wave(amplitudes: np.ndarray, r: int) -> np.ndarray:
    """(H+1, r rows) of all blades from complex amplitudes (H+1, rows) of one."""
    h = np.arange(len(amplitudes))[:, None]
    turn = np.exp(2j * np.pi * h * np.arange(r) / r)
    return (turn[:, :, None] * amplitudes[:, None, :]).reshape(len(amplitudes), -1)


def _blades_at_start(amplitudes: np.ndarray, r: int) -> np.ndarray:
    """(r rows,) of all blades at phase zero from complex amplitudes (H+1, rows) of one."""
    return np.asarray(_of_wave(amplitudes, r).sum(axis=0).real)
