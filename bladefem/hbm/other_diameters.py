"""Is a travelling wave stable against disturbances in the other nodal diameters of the wheel?

A wave of engine order EO on N blades repeats after r = N / gcd(EO, N) of them. Its linearisation
stays what it is when all blades hand on to their neighbour and time advances by the wave's share of
a period, so that disturbances fall into classes: x_b(t) = exp(i b angle) p(t + b T / r), whose
harmonic h runs round the wheel with h times the wave's phase between blades plus the angle of the
class, in diameters h EO + d. `bladefem.hbm.stability` looks at the class d = 0. Each other one is a
ring of r blades with complex motions, whose ends meet with the phase of r angles: the same contacts
on other bodies. Classes d and -d are conjugate; d and d + EO are the same, so that
d = 1 .. gcd(EO, N) / 2 are all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from .flow_map import acting_forces, flow_map
from .model import ReducedModel
from .sector_modes import (
    SectorModes,
    blades_of_wave,
    circulation_of,
    damping_in_time,
    wave_bodies,
)
from .solution import Solution
from .stability import (
    INSTANTS_PER_PERIOD,
    MAX_OPERATIONS,
    linearised_contacts,
    map_operations,
)

# relative distance from the leading multiplier at which its disturbance is solved for
SHIFT = 1e-7
# solutions after which the disturbance is known
ITERATIONS = 3


@dataclass(frozen=True)
class Growth:
    """Growth of the disturbance of a class that grows most."""

    # modulus of its Floquet multiplier; NaN where it would take too many operations
    multiplier: float = float("nan")
    # of the blade modes that have most of its energy [rad/s]; NaN likewise
    omega: float = float("nan")


def class_diameters(d: int, engine_order: int, sectors: int) -> tuple[int, ...]:
    """Nodal diameters 0..N/2 in which the disturbances of a class move, sorted."""
    waves = {(h * engine_order + d) % sectors for h in range(sectors)}
    return tuple(sorted({min(n, sectors - n) for n in waves}))


def class_angle(d: int, engine_order: int, sectors: int) -> float:
    """Angle of a class of disturbances between two blades that are a share of a period apart."""
    common = np.gcd(engine_order, sectors)
    blades = sectors // common
    # steps round the wheel between these two
    apart = pow(int(engine_order // common), -1, int(blades)) if blades > 1 else 1
    return 2 * np.pi * d * apart / sectors


def class_growth(
    model: ReducedModel,
    solution: Solution,
    bodies: ReducedModel,
    angle: float,
    instants: int = INSTANTS_PER_PERIOD,
    most: float = MAX_OPERATIONS,
) -> Growth:
    """What grows most, or decays least, of a class of disturbances.

    Args:
        solution: a motion of the model, in the wave.
        bodies: the model with the bodies of the class: that of harmonic h = 0 .. r-1 moves with the
            phase 2 pi h / r plus the angle between two blades that are T / r apart.
        angle: `class_angle` of the class.
        most: operations above which it is not looked for.

    Raises:
        InputError: the wave does not repeat within the harmonics that the model has bodies for.
    """
    r = blades_of_wave(model)
    S = r * -(-max(instants, 16 * (solution.harmonics + 1)) // r)
    ring = _class_ring(bodies, r, angle)
    contacts, nodes = linearised_contacts(model, solution, ring, S, copies=2)
    if map_operations(contacts, acting_forces(contacts, nodes), r) > most:
        return Growth()
    part = flow_map(contacts, nodes, 2 * np.pi / solution.omega / S, S // r)
    handed = _handed_on(ring, part, angle)
    values = linalg.eigvals(handed, check_finite=False)
    leading = values[np.argmax(abs(values))]
    return Growth(float(abs(leading) ** r), _moving_mode(ring, handed, leading))


def _moving_mode(ring: SectorModes, handed: np.ndarray, leading: complex) -> float:
    """Frequency of the modes that have most of the energy of a disturbance [rad/s], by inverse
    iteration; rigid dampers have none.
    """
    M = len(ring.stiffness)
    factors = linalg.lu_factor(handed - (1 + SHIFT) * leading * np.eye(len(handed)))
    x = np.random.default_rng(0).standard_normal(len(handed)).astype(complex)
    for _ in range(ITERATIONS):
        x = linalg.lu_solve(factors, x)
        x /= np.linalg.norm(x)
    energy = ring.stiffness * abs(x[:M]) ** 2 + abs(x[M : 2 * M]) ** 2
    return float(np.sqrt(ring.stiffness[np.argmax(energy * (ring.stiffness > 0))]))


def _class_ring(bodies: ReducedModel, r: int, angle: float) -> SectorModes:
    """r blades with complex motions, as their real parts and then their imaginary ones."""
    omega: list[np.ndarray] = []
    losses: list[np.ndarray] = []
    moved: list[np.ndarray] = []
    shapes: list[np.ndarray] = []
    turns: list[np.ndarray] = []
    residual: list[np.ndarray] = []
    blade = np.arange(r)
    for stack, sign in wave_bodies(bodies, r):
        for j in range(r):
            phase = 2 * np.pi * j / r + angle
            row = min(j, len(stack.omega) - 1)
            own = stack.omega[row]
            omega.append(own)
            losses.append(damping_in_time(stack, j))
            moved.append(circulation_of(stack, j))
            turns.append(np.full(len(own), np.exp(-1j * phase)))
            waves = np.exp(1j * phase * blade)[:, None, None] * stack.shapes[row, stack.contact]
            shapes.append(sign * waves.reshape(-1, len(own)) / np.sqrt(r))
            flexible = stack.residual[min(j, len(stack.residual) - 1), stack.contact, stack.contact]
            apart = np.exp(1j * phase * (blade[:, None] - blade))
            residual.append(np.kron(apart, flexible) / r)
    circulatory = linalg.block_diag(*moved)
    contact = _real_form(np.hstack(shapes))
    return SectorModes(
        r,
        np.tile(np.concatenate(omega) ** 2, 2),
        _real_form(linalg.block_diag(*losses)),
        contact,
        _real_form(np.sum(residual, axis=0)),
        _real_form(np.diag(np.concatenate(turns))),
        np.zeros((0, contact.shape[1])),
        np.zeros((0, len(contact))),
        _real_form(circulatory) if np.any(circulatory) else None,
    )


def _handed_on(ring: SectorModes, part: np.ndarray, angle: float) -> np.ndarray:
    """The map of (q, v, f) through 1/r of a period, seen by the next blade."""
    M = len(ring.stiffness)
    r = ring.blades
    real, imaginary = np.split(part[2 * M :], 2)
    forces = np.roll(real + 1j * imaginary, len(real) // r, axis=0)
    forces[: len(real) // r] *= np.exp(-1j * r * angle)
    moved = (ring.turn @ part[:M], ring.turn @ part[M : 2 * M], forces.real, forces.imag)
    return np.concatenate(moved)


def _real_form(matrix: np.ndarray) -> np.ndarray:
    """A complex matrix on x + i y as a real one on (x, y)."""
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
