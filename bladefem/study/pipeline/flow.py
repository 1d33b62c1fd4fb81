"""The flow round a scene's blades: damping and frequency shift of one family of modes in every wave
of the wheel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...data import ModeSet, PortModel
from ...reduction.assemble import folded_diameter
from ...scene.aerodynamics import has_flow, wave_influence
from ...scene.tables import Scene
from ...util.arrays import ComplexArray
from ...wheel.aerodynamics import with_flow
from .ports import Ports

# by which the modes of a family are reported
PORTS = ("contact", "load", "probe")


@dataclass(frozen=True)
class Flow:
    """Aerodynamic influence on one family of modes."""

    # (N,) relative frequency shift + i damping of waves of 0..N-1 nodal diameters
    influence: ComplexArray
    # nodal diameter of the engine order, and number of its mode that is the family's, from 0
    own: int
    mode: int

    def stiffness(self, omega: np.ndarray, diameter: int, number: int) -> np.ndarray:
        """(m,) complex aerodynamic stiffness of the modes of a wave, on one of them [1/s^2]."""
        count = len(self.influence)
        found = np.zeros(len(omega), dtype=complex)
        found[number] = 2 * omega[number] ** 2 * self.influence[diameter % count]
        return found


def scene_flow(scene: Scene, count: int) -> Flow | None:
    """The flow of a scene's wheel of N sectors; None without one.

    Raises:
        InputError: it does not fit the wheel.
    """
    if count == 0 or not has_flow(scene):
        return None
    own, _ = folded_diameter(1, scene.excitation.engine_order, count)
    return Flow(wave_influence(scene, count), own, scene.excitation.mode - 1)


def family_numbers(shapes: Mapping[int, np.ndarray], flow: Flow) -> dict[int, int]:
    """Number of the family's mode in each nodal diameter: the one that moves the ports most alike.

    Args:
        shapes: nodal diameter to (ports, modes), see `port_shapes`.
    """
    wanted = shapes[flow.own][:, flow.mode]

    def alike(one: np.ndarray) -> np.ndarray:
        size = np.maximum(np.linalg.norm(one, axis=0), np.finfo(float).tiny)
        return abs(wanted.conj() @ one) / size

    return {n: int(np.argmax(alike(one))) for n, one in shapes.items()}


def port_shapes(body: PortModel) -> np.ndarray:
    """(ports, modes) of a sector at contact, load and probe."""
    rows = np.arange(len(body.residual))
    places = np.concatenate([rows[body.ports[name]] for name in PORTS])
    return np.asarray(body.shapes[places])


def flowing_sides(
    flow: Flow | None,
    sector: Mapping[int, PortModel],
    sides: Sequence[PortModel],
    order: int,
) -> tuple[PortModel, ...]:
    """Blade sides of harmonics 0, 1, ... of an engine order in the flow; the mean feels none.

    Args:
        sector: nodal diameter 0..N/2 to the sector that the sides are made from.
    """
    if flow is None:
        return tuple(sides)
    count = len(flow.influence)
    numbers = family_numbers({n: port_shapes(body) for n, body in sector.items()}, flow)
    made = [sides[0]]
    for h, side in enumerate(sides[1:], 1):
        n, _ = folded_diameter(h, order, count)
        made.append(with_flow(side, flow.stiffness(side.omega, h * order, numbers[n])))
    return tuple(made)


def wheel_influence(flow: Flow | None, sector: Mapping[int, PortModel]) -> ComplexArray | None:
    """(N, modes) `wheel.model.Wheel.influence` from the sector in nodal diameters 0..N/2."""
    if flow is None:
        return None
    count = len(flow.influence)
    numbers = family_numbers({n: port_shapes(body) for n, body in sector.items()}, flow)
    rows = []
    for d in range(count):
        n, _ = folded_diameter(1, d, count)
        rows.append(flow.stiffness(sector[n].omega, d, numbers[n]))
    return np.array(rows)


def flowing_modes(
    flow: Flow | None,
    modes: ModeSet,
    damping: np.ndarray,
    ratio: float,
    diameter: int,
    number: int,
) -> tuple[ModeSet, np.ndarray]:
    """Modes of a wave with their frequencies in the flow, and their viscous damping [1/s].

    Args:
        damping: (m,) or (m, m) without the flow [1/s].
        ratio: share of critical damping that is in it.
        diameter: of the wave; those that run with the rotation negative or beyond N/2.
        number: of the family's mode among them.
    """
    if flow is None:
        return modes, damping
    omega = 2 * np.pi * modes.frequencies
    c = flow.stiffness(omega, diameter, number)
    shifted = np.sqrt(omega**2 + c.real)
    rate = 2 * ratio * (shifted - omega)
    rate = rate + np.divide(c.imag, omega, out=np.zeros_like(omega), where=omega > 0)
    moved = replace(modes, frequencies=shifted / (2 * np.pi))
    return moved, damping + (rate if damping.ndim == 1 else np.diag(rate))


def family_modes(ports: Ports, modes: Sequence[ModeSet], flow: Flow | None) -> dict[int, int]:
    """Nodal diameter to the number of the family's mode among those of the finite elements; empty
    without a flow.
    """
    if flow is None:
        return {}
    every = np.arange(ports.matrix.shape[1])
    places = np.concatenate([every[ports.names[name]] for name in PORTS])
    read = ports.matrix[:, places].T
    shapes = {}
    for one in modes:
        dim = ports.matrix.shape[0] // one.shapes.shape[1]
        flat = one.shapes[:, :, :dim].reshape(len(one.frequencies), -1)
        shapes[one.nodal_diameter or 0] = read @ flat.T
    return family_numbers(shapes, flow)
