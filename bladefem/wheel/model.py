"""What the balance of a whole wheel knows: one sector in every nodal diameter, the damper between
neighbours, the forces on all blades, and what differs from blade to blade.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..data import Elements, PortModel, RigidBody
from ..errors import InputError
from ..friction.law_table import select_elements
from ..hbm.linear.bodies import Damping
from ..hbm.linear.mean_motion import REGULARISATION
from ..hbm.parameters import scale_density, scale_inertia
from ..reduction.assemble import pair_model
from ..util.arrays import RealArray, RealOrComplex
from ..util.communicator import Communicator
from .aerodynamics import with_flow
from .partition import Partition


@dataclass(frozen=True)
class Pattern:
    """What differs from blade to blade; everything left out is tuned. N sectors, q blade readings.

    The readings y are the port "blade" of the sectors: coordinates of the blade-alone modes, or any
    others. A deviation adds the forces -(stiffness - (h omega)^2 mass) y to the same port
    (component-mode mistuning, Lim et al. 2007, doi:10.2514/1.13172).
    """

    # (N, q, q) symmetric [1/s^2 for modal coordinates of mass 1, N/m for displacements]
    stiffness: RealArray | None = None
    # (N, q, q) symmetric [1 for modal coordinates of mass 1, kg for displacements]
    mass: RealArray | None = None
    # friction elements of all dampers, sector by sector, N times as many as the wheel has
    elements: Elements | None = None
    # (N,) relative deviations of the dampers' inertia; the normal loads are in the elements
    damper_mass: RealArray | None = None
    # (N n, tangents) friction forces from which the law starts; those of the wheel when None [N]
    start: RealArray | None = None

    @property
    def tuned(self) -> bool:
        """No blade deviates, and no damper in its inertia; contacts may."""
        parts = (self.stiffness, self.mass, self.damper_mass)
        return not any(x is not None and np.any(x) for x in parts)

    @property
    def heavier_dampers(self) -> bool:
        """The inertia of some damper deviates."""
        return self.damper_mass is not None and bool(np.any(self.damper_mass))

    def change(
        self,
        w: float,
        readings: int,
        damper: np.ndarray,
    ) -> np.ndarray:
        """(N, q + k, q + k) dynamic stiffness of the deviations at circular frequency w, on the
        readings of the blades and on the modes of the dampers, whose mass is 1.

        Args:
            readings: q, of a blade.
            damper: (k, k) gyroscopic coupling of the modes of a damper [1/s]; k = 0 where none
                deviates.
        """
        given = (self.stiffness, self.mass, self.damper_mass)
        count = next(len(x) for x in given if x is not None)
        modes = len(damper)
        kind = complex if damper.any() else float
        total = np.zeros((count, readings + modes, readings + modes), kind)
        if self.stiffness is not None:
            total[:, :readings, :readings] += self.stiffness
        if self.mass is not None:
            total[:, :readings, :readings] -= w**2 * self.mass
        if modes and self.damper_mass is not None:
            own = -(w**2) * np.eye(modes) + (1j * w * damper if damper.any() else 0.0)
            total[:, readings:, readings:] = self.damper_mass[:, None, None] * own
        return total


# all blades and dampers alike
TUNED_PATTERN = Pattern()


@dataclass(frozen=True)
class Wheel:
    """A tuned wheel of N sectors with a damper between each sector and the next.

    Contact rows of the sector's ports are pair coordinates (`reduction.assemble.pair_model`):
    damper s touches blade s and blade s + 1. Harmonic 0 is counted from the preload state, as in
    `hbm.model.ReducedModel`.

    Raises:
        InputError: sectors, elements and forces do not fit each other.
    """

    count: int
    # nodal diameter 0..N/2 to the sector's model, contact rows in pair coordinates
    sectors: Mapping[int, PortModel]
    # of one damper (n), or of all, sector by sector (N n)
    elements: Elements
    # harmonic to complex amplitudes on the load ports of all sectors (N, loads) [N]
    excitation: Mapping[int, np.ndarray]
    damping: Damping = field(default_factory=Damping)
    # None: the elements join the rows of the contact port to the ground, or are relative already
    damper: RigidBody | PortModel | None = None
    damper_damping: Damping = field(default_factory=Damping)
    # (N, modes) complex aerodynamic stiffness of each nodal diameter and mode [1/s^2], for a
    # motion e^{j 2 pi d s / N}; d > N/2 are waves that run backwards
    influence: RealOrComplex | None = None
    # see `hbm.model.ReducedModel`
    hold: float = REGULARISATION
    coupled: bool = True
    # (n, tangents) friction force of one damper from which the law starts; elements.t0 when None
    # [N]
    start: RealArray | None = None
    # (n, 1 + tangents) compliance of the contacts' layer that the elements leave to the sectors
    # [m/N], see `hbm.model.ReducedModel`; None where they leave none
    series: RealArray | None = None
    # ranks that share each point of the wheel, collectively; None: one rank has all
    comm: Communicator | None = None

    def __post_init__(self) -> None:
        _check_wheel(self)

    @cached_property
    def partition(self) -> Partition:
        """The part of this rank."""
        return Partition(self.count, self.comm)

    @cached_property
    def nodes(self) -> int:
        """Friction elements of one damper."""
        return self.contact_size // self.port_directions

    @cached_property
    def contact_size(self) -> int:
        """Rows of the contact port."""
        return _size(self.sectors[0], "contact")

    @cached_property
    def port_directions(self) -> int:
        """Displacements of a node in the contact port."""
        total = len(self.elements.kt)
        tangents = self.elements.tangents
        return tangents if total in _counts(self, tangents) else tangents + 1

    @cached_property
    def directions(self) -> int:
        """Displacements of a node in the balance; the normal one enters where some kn > 0."""
        return self.elements.tangents + bool(np.any(self.elements.kn > 0))

    @cached_property
    def rows(self) -> np.ndarray:
        """(nodes directions,) rows of the contact port that enter the balance."""
        rows = np.arange(self.contact_size).reshape(self.nodes, self.port_directions)
        return rows[:, self.port_directions - self.directions :].ravel()

    @cached_property
    def all_elements(self) -> Elements:
        """The elements of all dampers, sector by sector."""
        return _spread(self.elements, self.nodes, self.count)

    def scaled_stiffness(self, name: str, factor: np.ndarray | float) -> np.ndarray:
        """(elements,) stiffness "kt" or "kn" of `all_elements` with a factor on the stiffness of
        the whole layer: what is in series stays as it is [N/m].
        """
        stiffness = getattr(self.all_elements, name)
        if self.series is None:
            return factor * stiffness
        series = np.tile(self.series[:, 0 if name == "kn" else 1], self.count)
        return stiffness / (1.0 + (1.0 / factor - 1.0) * (1.0 + stiffness * series))

    @cached_property
    def springs(self) -> np.ndarray:
        """(nodes, directions) contact stiffness in full stick, the mean over the dampers [N/m]."""
        e = self.all_elements
        kt = e.kt.reshape(self.count, -1).mean(axis=0)
        kn = e.kn.reshape(self.count, -1).mean(axis=0)
        tangents = np.repeat(kt[:, None], e.tangents, axis=1)
        return np.column_stack([kn, tangents]) if self.directions > e.tangents else tangents

    def preload(self, elements: Elements) -> np.ndarray:
        """(N, n, d) contact forces of the preload state [N]."""
        force = np.zeros((len(elements.kt), self.directions))
        first = self.directions - elements.tangents
        if first:
            force[:, 0] = np.maximum(elements.n0, 0.0)
        force[:, first:] = elements.traction
        return force.reshape(self.count, self.nodes, self.directions)

    def first_forces(self, pattern: Pattern, elements: Elements) -> np.ndarray:
        """(N n, tangents) friction forces of all dampers from which the law starts [N]."""
        if pattern.start is not None:
            return pattern.start
        return elements.traction if self.start is None else np.tile(self.start, (self.count, 1))

    def offset(self, elements: Elements, start: np.ndarray) -> np.ndarray:
        """(N, n, d) mean displacement that makes the friction law start from forces (N n,
        tangents), see `hbm.model.ReducedModel.offset` [m].
        """
        kt = elements.kt[:, None]
        moved = np.zeros((len(kt), self.directions))
        tangential = moved[:, self.directions - elements.tangents :]
        tangential[:] = np.divide(start, kt, out=np.zeros_like(start), where=kt > 0)
        return moved.reshape(self.count, self.nodes, self.directions)

    def wave(self, diameter: int) -> tuple[PortModel, bool]:
        """The sector in a wave of 0..N-1 nodal diameters, with the flow's forces on it, and whether
        the conjugate of its shapes is meant: beyond N/2 waves run backwards.
        """
        mirrored = 2 * diameter > self.count
        body = self.sectors[self.count - diameter if mirrored else diameter]
        if self.influence is None:
            return body, mirrored
        return with_flow(body, np.asarray(self.influence[diameter], dtype=complex)), mirrored

    @cached_property
    def kept(self) -> dict[Any, Any]:
        """Parts that do not depend on the frequency, made once."""
        return {}


def tuned_wheel(
    count: int,
    sectors: Mapping[int, PortModel],
    following: slice | np.ndarray,
    elements: Elements,
    excitation: Mapping[int, np.ndarray],
    **others: Any,
) -> Wheel:
    """A wheel from models of one sector in its own coordinates.

    Args:
        following: rows of the contact port on the patch of the next blade.
    """
    missing = [d for d in range(count // 2 + 1) if d not in sectors]
    if missing:
        raise InputError(
            f"sectors: nodal diameter {missing[0]} is missing, expected all from 0 to {count // 2}"
        )
    pairs = {
        d: pair_model(sectors[d], following, 2 * np.pi * d / count) for d in range(count // 2 + 1)
    }
    return Wheel(count, pairs, elements, excitation, **others)


def engine_order(
    count: int,
    order: int,
    force: np.ndarray,
    phase: float = 0.0,
) -> np.ndarray:
    """(N, loads) complex amplitudes of a force pattern with `order` waves round the wheel [N].

    Args:
        force: (loads,) amplitude on blade 0.
        phase: of the force on blade 0 [rad].

    Raises:
        InputError: the order is not a whole number.
    """
    if int(order) != order:
        raise InputError(f"engine order {order}: expected a whole number")
    turn = np.exp(1j * (2 * np.pi * int(order) * np.arange(count) / count + phase))
    return turn[:, None] * np.atleast_1d(force)


def frequency_pattern(omega: np.ndarray, deviation: np.ndarray) -> Pattern:
    """Relative deviations of blade-alone frequencies as a pattern in blade-alone modes of mass 1.

    Args:
        omega: (q,) circular frequencies of the blade-alone modes [rad/s].
        deviation: (N, q) relative deviation of each blade and family; (N,) is for all families.

    Raises:
        InputError: a deviation makes a blade unstable, or the shapes do not fit.
    """
    omega = np.atleast_1d(np.asarray(omega, dtype=float))
    deviation = np.asarray(deviation, dtype=float)
    if deviation.ndim == 1:
        deviation = np.repeat(deviation[:, None], len(omega), axis=1)
    if deviation.ndim != 2 or deviation.shape[1] != len(omega) or not np.isfinite(deviation).all():
        raise InputError(
            f"pattern of shape {deviation.shape}: expected finite numbers, one row a blade and "
            f"{len(omega)} columns, one a family"
        )
    if deviation.min(initial=0.0) <= -1:
        blade = int(np.argmin(deviation.min(axis=1)))
        raise InputError(
            f"pattern: deviation {deviation.min():.4g} of blade {blade} leaves it no stiffness, "
            "expected relative deviations of frequency above -1"
        )
    change = omega**2 * ((1 + deviation) ** 2 - 1)
    return Pattern(stiffness=change[:, :, None] * np.eye(len(omega)))


def pattern_elements(wheel: Wheel, pattern: Pattern) -> Elements:
    """The friction elements of all dampers.

    Raises:
        InputError: the pattern's elements do not fit the wheel.
    """
    if pattern.elements is None:
        return wheel.all_elements
    if pattern.elements.tangents != wheel.elements.tangents:
        raise InputError("pattern.elements: expected as many tangents as the wheel's elements have")
    return _spread(pattern.elements, wheel.nodes, wheel.count)


def heavier_damper(
    damper: RigidBody | PortModel | None,
    factor: float,
) -> RigidBody | PortModel | None:
    """A damper of another density: all its inertia times a factor, its stiffness and its viscous
    damping as they are.
    """
    if damper is None:
        return None
    if isinstance(damper, RigidBody):
        return scale_inertia(damper, factor)
    return scale_density(damper, factor)


def _spread(
    e: Elements,
    nodes: int,
    count: int,
) -> Elements:
    total = len(e.kt)
    if total == nodes * count:
        return e
    if total != nodes:
        raise InputError(
            f"elements: {total} given, expected {nodes} for one damper or {nodes * count} for all"
        )
    return select_elements(e, np.tile(np.arange(nodes), count))


def _size(body: PortModel, name: str) -> int:
    return len(range(*body.ports.get(name, slice(0, 0)).indices(len(body.residual))))


def _counts(wheel: Wheel, directions: int) -> tuple[float, float]:
    """Numbers of elements that fit the contact port: of one damper, of all."""
    nodes = wheel.contact_size / directions
    return nodes, nodes * wheel.count


def _check_wheel(wheel: Wheel) -> None:
    if wheel.count < 1:
        raise InputError(f"count {wheel.count}: expected at least one sector")
    wanted = set(range(wheel.count // 2 + 1))
    if set(wheel.sectors) != wanted:
        raise InputError(
            f"sectors: nodal diameters {sorted(wheel.sectors)}, expected 0 to {wheel.count // 2}"
        )
    if any(body.circulatory is not None for body in wheel.sectors.values()):
        raise InputError("sectors: unsymmetric stiffness, expected a symmetric one in a wheel")
    loads = _size(wheel.sectors[0], "load")
    for name in ("contact", "load", "probe"):
        sizes = {_size(body, name) for body in wheel.sectors.values()}
        if sizes == {0} or len(sizes) > 1:
            raise InputError(f"sectors: port '{name}' of {sorted(sizes)} rows, expected one size")
    t = wheel.elements.tangents
    if len(wheel.elements.kt) not in (*_counts(wheel, t), *_counts(wheel, t + 1)):
        raise InputError(
            f"elements: {len(wheel.elements.kt)} for a contact port of {wheel.contact_size} rows "
            f"and {t} tangents, expected one element a node, of one damper or of all"
        )
    for h, amplitudes in wheel.excitation.items():
        if h < 0 or int(h) != h or np.shape(amplitudes) != (wheel.count, loads):
            raise InputError(
                f"excitation of harmonic {h} of shape {np.shape(amplitudes)}: expected "
                f"({wheel.count}, {loads}) amplitudes of a harmonic 0, 1, 2, ..."
            )
    if wheel.series is not None and np.shape(wheel.series) != (wheel.nodes, 1 + t):
        raise InputError(
            f"series of shape {np.shape(wheel.series)}: expected ({wheel.nodes}, {1 + t}), "
            "compliances of each element of one damper"
        )
    modes = {len(body.omega) for body in wheel.sectors.values()}
    if wheel.influence is not None:
        expected = (wheel.count, *modes) if len(modes) == 1 else None
        if wheel.influence.shape != expected:
            raise InputError(
                f"influence of shape {wheel.influence.shape}: expected {expected}, the same number "
                "of modes in all nodal diameters"
            )
    if not 0 < wheel.hold <= 1:
        raise InputError(f"hold {wheel.hold}: expected a share of the contact stiffness, 0 to 1")
