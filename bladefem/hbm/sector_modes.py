"""Blades and dampers as one real system of modes in time, for one blade or for those of a
travelling wave.

A model in a travelling wave has one body for each harmonic, in the nodal diameters that the engine
order gives. Where these repeat after r harmonics, the wave repeats after r blades, and the bodies
of harmonics 0..r-1 are all nodal diameters of a ring of r blades: their real and imaginary parts
are its modes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce

import numpy as np
from scipy import linalg

from ..data import PortModel
from ..errors import InputError
from .linear.bodies import Stack
from .linear.woodbury import bodies_of
from .model import ReducedModel

# relative difference up to which two bodies are the same
SAME_BODY = 1e-9


@dataclass(frozen=True)
class SectorModes:
    """r blades with their dampers: q'' + D q' + L q = -U^T f,  w = U q - R f; M modes, m = r n d
    contact degrees of freedom, blade by blade.
    """

    blades: int
    # (M,) L [1/s^2]
    stiffness: np.ndarray
    # (M, M) D [1/s]; structural damping as the viscous one of the same loss at the mode's frequency
    damping: np.ndarray
    # (m, M) U [kg^-1/2]
    contact: np.ndarray
    # (m, m) R [m/N]
    residual: np.ndarray
    # (M, M) modal coordinates of a motion that every blade has handed on to the next one
    turn: np.ndarray
    # (r p, M) and (r p, m) the same as U and R for the p probes of each blade
    probe: np.ndarray
    probe_residual: np.ndarray
    # (M, M) forces of the displacements that have no energy [1/s^2]; None where there are none
    circulatory: np.ndarray | None = None
    # (r l, M) the same as U for the l loads on each blade; empty where nothing is asked of them
    load: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def stiffness_matrix(self) -> np.ndarray:
        """(M, M) L with the forces that have no energy [1/s^2]."""
        matrix = np.diag(self.stiffness)
        return matrix if self.circulatory is None else matrix + self.circulatory


def sector_modes(model: ReducedModel) -> SectorModes:
    """The model without excitation, in time.

    Raises:
        InputError: the wave does not repeat after the harmonics that the model has bodies for.
    """
    r = blades_of_wave(model)
    parts = [_ring(body, r, sign) for body, sign in wave_bodies(model, r)]
    return SectorModes(
        r,
        np.concatenate([part.stiffness for part in parts]),
        linalg.block_diag(*[part.damping for part in parts]),
        np.hstack([part.contact for part in parts]),
        reduce(np.add, [part.residual for part in parts]),
        linalg.block_diag(*[part.turn for part in parts]),
        np.hstack([_readings(part, part.probe, len(parts[0].probe)) for part in parts]),
        parts[0].probe_residual,
        _joined_circulation(parts) if model.circulatory else None,
        np.hstack([_readings(part, part.load, len(parts[0].load)) for part in parts]),
    )


def _joined_circulation(parts: Sequence[SectorModes]) -> np.ndarray:
    """(M, M) of the modes of several bodies one after the other."""
    return linalg.block_diag(*[part.stiffness_matrix - np.diag(part.stiffness) for part in parts])


def _readings(part: SectorModes, rows: np.ndarray, count: int) -> np.ndarray:
    """(count, M) readings at probes or loads, none of which is on a damper."""
    return rows if len(rows) else np.zeros((count, len(part.stiffness)))


def blades_of_wave(model: ReducedModel) -> int:
    """Blades after which the motion repeats; 1 where all move in phase.

    Raises:
        InputError: they are more than the harmonics that the model has bodies for.
    """
    found = [_period(bodies) for bodies in (model.sides, _damper_bodies(model)) if bodies]
    if 0 in found:
        raise InputError(
            f"the travelling wave does not repeat within {len(model.sides)} harmonics, expected "
            "more of them (model.harmonics), or an engine order that shares a larger divisor with "
            "the number of blades"
        )
    if len({r for r in found if r > 1}) > 1:
        raise InputError("blades and dampers repeat after different numbers of harmonics")
    return max(found)


def _damper_bodies(model: ReducedModel) -> tuple[PortModel, ...]:
    return model.damper if isinstance(model.damper, tuple) else ()


def _period(bodies: tuple[PortModel, ...]) -> int:
    """Harmonics after which the bodies repeat, mirrored in the middle; 0 where they do not."""
    if len(bodies) == 1:
        return int(abs(np.imag(bodies[0].shapes)).max(initial=0.0) == 0.0)
    for r in range(1, len(bodies)):
        repeats = all(_same(bodies[h], bodies[h - r]) for h in range(r, len(bodies)))
        if repeats and all(_same(bodies[h], bodies[r - h], mirrored=True) for h in range(r + 1)):
            return r
    return 0


def _same(
    one: PortModel,
    other: PortModel,
    mirrored: bool = False,
) -> bool:
    if one.omega.shape != other.omega.shape:
        return False
    turn = np.conj if mirrored else np.asarray
    return (one is other and not mirrored) or all(
        np.allclose(
            a, turn(b), rtol=SAME_BODY, atol=SAME_BODY * max(abs(a).max(initial=0.0), 1e-300)
        )
        for a, b in (
            (one.omega, other.omega),
            (one.shapes, other.shapes),
            (one.residual, other.residual),
            (_circulation(one), _circulation(other)),
        )
    )


def _circulation(body: PortModel) -> np.ndarray:
    """(m, m), or empty where there is none."""
    return np.zeros((0, 0)) if body.circulatory is None else body.circulatory


def wave_bodies(model: ReducedModel, r: int) -> list[tuple[Stack, float]]:
    """Each body's stack of harmonics 0..r-1 at least, and the sign of its motion."""
    stacks = bodies_of(model, max(r - 1, 0))
    return list(zip(stacks, (1.0, -1.0), strict=False))


def _ring(
    stack: Stack,
    r: int,
    sign: float,
) -> SectorModes:
    """One body in all diameters of a ring of r blades."""
    stiffness: list[np.ndarray] = []
    contact: list[np.ndarray] = []
    probe: list[np.ndarray] = []
    load: list[np.ndarray] = []
    loss: list[np.ndarray] = []
    turning: list[np.ndarray] = []
    turned: list[np.ndarray] = []
    blade = np.arange(r)
    for j in range(r):
        row = min(j, len(stack.omega) - 1)
        if 2 * j > r:
            continue
        own = stack.omega[row]
        viscous = damping_in_time(stack, j)
        moved = circulation_of(stack, j)
        double = 0 < 2 * j < r
        size = sign * np.sqrt((2 if double else 1) / r)
        phase = np.exp(2j * np.pi * j * blade / r)[:, None, None]
        for rows, found in ((stack.contact, contact), (stack.probe, probe), (stack.load, load)):
            shapes = size * (phase * stack.shapes[row, rows]).reshape(-1, len(own))
            found.extend([shapes.real] + [shapes.imag] * double)
        stiffness.extend([own**2] * (1 + double))
        loss.append(real_form(viscous) if double else viscous.real)
        turning.append(real_form(moved) if double else moved.real)
        handed_on = np.exp(-2j * np.pi * j / r) * np.eye(len(own))
        turned.append(real_form(handed_on) if double else handed_on.real)
    return SectorModes(
        r,
        np.concatenate(stiffness),
        linalg.block_diag(*loss),
        np.hstack(contact),
        _ring_residual(stack, r, stack.contact),
        linalg.block_diag(*turned),
        np.hstack(probe),
        _ring_residual(stack, r, stack.probe),
        None if stack.circulatory is None else linalg.block_diag(*turning),
        np.hstack(load),
    )


def damping_in_time(stack: Stack, harmonic: int) -> np.ndarray:
    """(M, M) viscous damping of the body of a harmonic; structural damping as the viscous one of
    the same loss at the mode's frequency.
    """
    row = min(harmonic, len(stack.omega) - 1)
    own = stack.omega[row]
    losses = np.divide(stack.hysteretic[row], own, out=np.zeros_like(own), where=own > 0)
    matrix = np.diag(stack.viscous[row] + losses)
    if stack.coupled is None:
        return matrix
    return matrix + stack.coupled[min(harmonic, len(stack.coupled) - 1)]


def circulation_of(stack: Stack, harmonic: int) -> np.ndarray:
    """(M, M) forces of the displacements that have no energy, of the body of a harmonic."""
    if stack.circulatory is None:
        return np.zeros((stack.omega.shape[1],) * 2)
    return stack.circulatory[min(harmonic, len(stack.circulatory) - 1)]


def _ring_residual(stack: Stack, r: int, rows: slice) -> np.ndarray:
    """(r rows, m) residual flexibility between ports of all blades and their contacts."""
    blade = np.arange(r)
    shape = stack.residual[0, rows, stack.contact].shape
    found = np.zeros((r, r, *shape))
    for j in range(r):
        flexible = stack.residual[min(j, len(stack.residual) - 1), rows, stack.contact]
        turn = np.exp(2j * np.pi * j * (blade[:, None] - blade) / r)
        found += (turn[:, :, None, None] * flexible).real / r
    return found.transpose(0, 2, 1, 3).reshape(r * shape[0], r * shape[1])


def real_form(matrix: np.ndarray) -> np.ndarray:
    """A complex matrix on amplitudes x - i y as a real one on (x, y)."""
    return np.block([[matrix.real, matrix.imag], [-matrix.imag, matrix.real]])
