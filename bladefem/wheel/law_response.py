"""Many wheels at once by the law of one damper: first harmonic of all blades of a family.

    (z_d / |y_d|^2) a_d + (E a + g(a))_d = F_d,    z_d = omega_d^2 - Omega^2 + i Omega c_d,

diagonal in nodal diameters d but for the deviations E of the blades and the forces g of the
dampers, which are local. N complex unknowns a wheel, and Newton with dense matrices, all wheels of
a batch together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..util.arrays import RealArray
from ..util.curve_extremum import parabola_at_middle
from .damper_law import DamperLaw
from .family import ModeFamily
from .model import Pattern
from .resonance import SAME_POINT
from .statistics import Amplification, no_checks

# wheels solved together: matrices of 72 x 72 numbers
WHEELS_PER_BATCH = 200
MAX_NEWTON_STEPS = 30
RESIDUAL_TOLERANCE = 1e-7
MAX_HALVINGS = 6
# frequencies of the first look, and times that the highest point is closed in on
FIRST_LOOK_POINTS = 61
PEAK_ROUNDS = 4


@dataclass(frozen=True)
class ScatteredLaw:
    """The law of a damper and how it changes with its parameters."""

    nominal: DamperLaw
    # parameter to the laws with more and with less of it, and by which share
    changed: Mapping[str, tuple[DamperLaw, DamperLaw, float]]

    def forces(
        self,
        before: np.ndarray,
        after: np.ndarray,
        factors: Mapping[str, np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Forces of dampers whose parameters have factors (k,), and their derivatives, as
        `DamperLaw.forces` gives them.

        Loads scale exactly: a contact under a share of the load does that share at that share of
        the motion. Other parameters count to first order.
        """
        load = factors.get("load", 1.0)
        force, derivative = self.nominal.forces(before / load, after / load)
        for name, (more, less, share) in self.changed.items():
            if name not in factors:
                continue
            weight = (factors[name] - 1) / (2 * share)
            upper = more.forces(before / load, after / load)
            lower = less.forces(before / load, after / load)
            force = force + weight * (upper[0] - lower[0])
            derivative = derivative + weight[:, None, None] * (upper[1] - lower[1])
        return force * load, derivative


@dataclass(frozen=True)
class LawWheels:
    """A batch of wheels; B wheels of N blades."""

    family: ModeFamily
    law: ScatteredLaw
    # (B, N) dynamic stiffness of each blade's deviation in the family's reading at the frequency
    # `ModeFamily.at` [1/s^2]
    deviation: RealArray
    # parameter to factors (B, N) of each damper
    factors: Mapping[str, RealArray]
    # (B, N) mass of each blade's deviation in that reading [1]; none when None
    mass: RealArray | None = None

    def stiffness(self, omega: np.ndarray) -> np.ndarray:
        """(B, N) dynamic stiffness of the deviations at circular frequencies (B,)."""
        if self.mass is None:
            return self.deviation
        return self.deviation + (self.family.at**2 - omega[:, None] ** 2) * self.mass

    def part(self, chosen: slice) -> LawWheels:
        """Some of the wheels."""
        factors = {name: value[chosen] for name, value in self.factors.items()}
        mass = None if self.mass is None else self.mass[chosen]
        return LawWheels(self.family, self.law, self.deviation[chosen], factors, mass)


def pattern_deviations(
    patterns: Sequence[Pattern], family: ModeFamily, count: int
) -> tuple[np.ndarray, np.ndarray | None]:
    """(B, N) dynamic stiffness of the deviations in the family's reading at the frequency
    `ModeFamily.at`, to whose forces all other modes of the blade give way, and their mass there;
    None where no mass deviates.
    """
    y = family.readings
    found = np.zeros((len(patterns), count))
    mass = np.zeros((len(patterns), count))
    for own, own_mass, pattern in zip(found, mass, patterns, strict=True):
        if pattern.tuned:
            continue
        change = pattern.change(family.at, len(y), np.zeros((0, 0)))
        # (1 + D A)^-1 D y: the forces of the deviation
        forces = np.linalg.solve(
            np.eye(len(y)) + change @ family.reading_flexibility, change @ y[:, None]
        )
        own[:] = (y.conj() @ forces[..., 0].T).real
        if pattern.mass is not None:
            own_mass[:] = (y.conj() @ pattern.mass @ y).real
    return found, mass if mass.any() else None


def solve_law_wheels(
    wheels: LawWheels,
    omega: np.ndarray,
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes (B, N) of the family's reading, and whether each wheel was solved.

    Args:
        omega: (B,) circular frequency of each wheel [rad/s].
        start: (B, N) amplitudes to start from.
    """
    found = start.copy()
    solved = np.zeros(len(start), dtype=bool)
    for low in range(0, len(start), WHEELS_PER_BATCH):
        part = slice(low, low + WHEELS_PER_BATCH)
        found[part], solved[part] = _solve_batch(wheels.part(part), omega[part], start[part])
    return found, solved


def _solve_batch(
    wheels: LawWheels,
    omega: np.ndarray,
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Newton for one batch; wheels that are solved stay where they are."""
    z = _impedance(wheels.family, omega)
    deviation = wheels.stiffness(omega)
    linear = _linear_matrix(z, deviation)
    a = start
    r, derivative = _residual(wheels, z, deviation, a)
    for _ in range(MAX_NEWTON_STEPS):
        error = _error(z, r, a)
        if error.max() <= RESIDUAL_TOLERANCE:
            break
        active = error > RESIDUAL_TOLERANCE
        J = linear + _contact_matrix(derivative, a.shape)
        right = np.stack([r.real, r.imag], axis=2).reshape(len(a), -1, 1)
        step = np.linalg.solve(J, right).reshape(*a.shape, 2) @ np.array([1.0, 1.0j])
        share = active.astype(float)
        for _ in range(MAX_HALVINGS):
            trial = a - share[:, None] * step
            r, derivative = _residual(wheels, z, deviation, trial)
            worse = active & (_error(z, r, trial) > error)
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        a = trial
    return a, _error(z, r, a) <= RESIDUAL_TOLERANCE


def _impedance(family: ModeFamily, omega: np.ndarray) -> np.ndarray:
    """(B, N) of the nodal diameters, over the squared readings."""
    w = omega[:, None]
    z = family.omega**2 - w**2 + 1j * (w * family.viscous + family.hysteretic)
    return z / family.reading**2


def _residual(
    wheels: LawWheels,
    z: np.ndarray,
    deviation: np.ndarray,
    a: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Residual (B, N) and derivatives (B, N, 4, 4) of the dampers' forces."""
    following = np.roll(a, -1, axis=1)
    factors = {name: value.ravel() for name, value in wheels.factors.items()}
    (own, other), derivative = wheels.law.forces(a.ravel(), following.ravel(), factors)
    g = own.reshape(a.shape) + np.roll(other.reshape(a.shape), 1, axis=1)
    linear = np.fft.ifft(z * np.fft.fft(a, axis=1) - wheels.family.force, axis=1)
    return linear + deviation * a + g, derivative.reshape(*a.shape, 4, 4)


def _error(z: np.ndarray, r: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(B,) residuals as motions of the free wheel away from its resonances, over the motion."""
    stiff = np.maximum(abs(z), np.median(abs(z), axis=1)[:, None])
    return np.linalg.norm(np.fft.fft(r, axis=1) / stiff, axis=1) / np.sqrt(
        (abs(a) ** 2).sum(axis=1) * a.shape[1] + 1e-300
    )


def _linear_matrix(z: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """(B, 2N, 2N) real matrices of z and the deviations; real and imaginary part of each blade."""
    total, count = z.shape
    sectors = np.arange(count)
    circulant = np.fft.ifft(z, axis=1)[:, (sectors[:, None] - sectors) % count]
    circulant[:, sectors, sectors] += deviation
    out = np.empty((total, count, 2, count, 2))
    out[:, :, 0, :, 0] = out[:, :, 1, :, 1] = circulant.real
    out[:, :, 1, :, 0] = circulant.imag
    out[:, :, 0, :, 1] = -circulant.imag
    return out.reshape(total, 2 * count, 2 * count)


def _contact_matrix(derivative: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(B, 2N, 2N) real matrices of the dampers' derivatives."""
    total, count = shape
    out = np.zeros((total, count, 2, count, 2))
    here = np.arange(count)
    after = (here + 1) % count
    # indexed axes first: (N, B, 2, 2)
    blocks = derivative.swapaxes(0, 1)
    for row, rows in ((0, here), (2, after)):
        for column, columns in ((0, here), (2, after)):
            part = blocks[:, :, row : row + 2, column : column + 2]
            out[:, rows, :, columns, :] += part
    return out.reshape(total, 2 * count, 2 * count)


def law_statistics(
    wheels: LawWheels,
    load: float,
    band: tuple[float, float],
) -> Amplification:
    """Peaks of all wheels and of the tuned one under one load.

    Args:
        band: ends of the frequencies [rad/s].
    """
    count = wheels.deviation.shape[1]
    none = np.zeros((1, count))
    tuned = _find_peaks(LawWheels(wheels.family, wheels.law, none, {}), band)
    found = _find_peaks(wheels, band)
    rows = [np.array([value]) for value in found]
    return Amplification(
        np.array([load]),
        tuned[0],
        tuned[2],
        rows[0],
        rows[1].astype(int),
        rows[2],
        rows[3].astype(int),
        rows[4].astype(int),
        *no_checks(1),
        law_harmonics=np.array([len(wheels.family.flexibility)]),
    )


def _find_peaks(
    wheels: LawWheels,
    band: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(B,) height [m] of the highest blade of each wheel, its number, where [rad/s], points not
    solved and points; by even steps, then by parabolas of 1 / height^2 at the highest point.
    """
    total, count = wheels.deviation.shape
    omega = np.repeat(np.linspace(*band, FIRST_LOOK_POINTS)[None], total, axis=0)
    a = np.zeros((total, FIRST_LOOK_POINTS, count), dtype=complex)
    solved = np.zeros((total, FIRST_LOOK_POINTS), dtype=bool)
    last = np.zeros((total, count), dtype=complex)
    for k in range(FIRST_LOOK_POINTS):
        # far from resonance first: from the top of the band down, where dampers stick
        i = FIRST_LOOK_POINTS - 1 - k
        a[:, i], solved[:, i] = solve_law_wheels(wheels, omega[:, i], last)
        last = np.where(solved[:, i, None], a[:, i], last)
    for _ in range(PEAK_ROUNDS):
        omega, a, solved = _closed_in(wheels, omega, a, solved)
    size = np.where(solved[:, :, None], _sizes(wheels.family, a), 0.0)
    highest = size.reshape(total, -1).argmax(axis=1)
    point, blade = np.unravel_index(highest, size.shape[1:])
    each = np.arange(total)
    points = np.full(total, omega.shape[1])
    return (
        size[each, point, blade],
        blade,
        omega[each, point],
        (~solved).sum(axis=1),
        points,
    )


def _sizes(family: ModeFamily, a: np.ndarray) -> np.ndarray:
    """(..., N) amplitudes at the probes of the blades [m]."""
    return abs(np.fft.ifft(np.fft.fft(a, axis=-1) * family.probe, axis=-1))


def _closed_in(
    wheels: LawWheels,
    omega: np.ndarray,
    a: np.ndarray,
    solved: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One more point of each wheel, where its highest blade is predicted to be highest."""
    total = len(omega)
    each = np.arange(total)
    size = np.where(solved[:, :, None], _sizes(wheels.family, a), 0.0)
    best = np.clip(size.max(axis=2).argmax(axis=1), 1, omega.shape[1] - 2)
    blade = size[each, best].argmax(axis=1)
    near = best[:, None] + np.array([-1, 0, 1])
    w = omega[each[:, None], near]
    y = 1 / np.maximum(size[each[:, None], near, blade[:, None]], np.finfo(float).tiny) ** 2
    left, right = w[:, 1] - w[:, 0], w[:, 2] - w[:, 1]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        slope, bend = parabola_at_middle(left, right, y[:, 0] - y[:, 1], y[:, 2] - y[:, 1])
        step = np.where(bend > 0, -slope / (2 * bend), 0.0)
    step = np.clip(np.nan_to_num(step), -0.5 * left, 0.5 * right)
    # a point that is there already: look into the wider gap
    still = abs(step) < SAME_POINT * w[:, 1]
    step = np.where(still, np.where(left > right, -0.5 * left, 0.5 * right), step)
    target = w[:, 1] + step
    found, good = solve_law_wheels(wheels, target, a[each, best])
    order = np.argsort(np.column_stack([omega, target]), axis=1)
    rows = each[:, None]
    omega = np.column_stack([omega, target])[rows, order]
    a = np.concatenate([a, found[:, None]], axis=1)[rows, order]
    return omega, a, np.column_stack([solved, good])[rows, order]
