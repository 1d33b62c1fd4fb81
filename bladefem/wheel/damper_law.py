"""What one damper does to its two blades, as a table: the cheap level of statistics.

Where one family of blade modes vibrates, the motion of a damper's contacts is a sum of its two
blades' amplitudes, w = alpha a_s + beta a_{s+1}, less what all other modes, the residual
flexibility and the damper give way to the contact forces. This balance of the damper is solved once
for all pairs of amplitudes; since a shift of time changes nothing, these are three numbers: the
size of both, their ratio and the phase between them. Shapes and flexibility are those of the tuned
wheel in the nodal diameters of the engine order and of its harmonics, so that the tuned wheel comes
out again.

The blades' amplitudes are those of the first harmonic; the damper answers with higher ones too.
Where contacts lift off these count: on the wheel of scenes/mistuned.toml under 40 N the law of one
harmonic gives amplifications 7 to 10 % below those of whole wheels with three.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..data import Elements
from ..errors import InputError, NotSolvedError
from ..friction.law_table import select_elements
from ..util.arrays import ComplexArray, RealArray
from .damper_balance import DamperMotion, solve_damper, stuck_displacements
from .family import ModeFamily
from .law_kernel import GHOST_POINTS, evaluate_law
from .model import Wheel

# of the table: sizes, ratios and phases of the two amplitudes
TABLE_SIZES, TABLE_RATIOS, TABLE_PHASES = 32, 13, 20
# share of the pairs that may stay unsolved
MAX_UNSOLVED_SHARE = 0.02
# real unknowns of the damper's balance: eight nodes with ten harmonics, or eighty with one
MOST_UNKNOWNS = 480


@dataclass(frozen=True)
class DamperLaw:
    """Forces on the two blades for their amplitudes, as splines over log size, ratio and phase."""

    # (4, TABLE_SIZES, TABLE_RATIOS + 2 GHOST_POINTS, TABLE_PHASES) coefficients: force on the blade
    # before the damper, real and imaginary, then on the one after, over the size
    coefficients: RealArray
    # logarithm of the smallest size, and of one step
    first: float
    step: float

    def forces(self, before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (2, k) complex on both blades, and their derivatives (k, 4, 4) by the real and
        imaginary parts of both amplitudes (k,).
        """
        out = np.empty((len(before), 4))
        derivative = np.empty((len(before), 4, 4))
        evaluate_law(self.coefficients, self.first, self.step, before, after, out, derivative)
        return (out[:, 0::2] + 1j * out[:, 1::2]).T, derivative


def damper_law(
    wheel: Wheel,
    family: ModeFamily,
    sizes: tuple[float, float],
    samples: int,
    elements: Elements | None = None,
) -> DamperLaw:
    """The table of one damper.

    Args:
        family: with as many harmonics as the damper's balance has.
        sizes: smallest and largest root of the sum of squares of the two amplitudes.
        elements: of the damper; those of the wheel when left out.

    Raises:
        InputError: too many contact nodes.
        NotSolvedError: the damper's balance has no solution somewhere.
    """
    unknowns = 2 * len(family.before) * len(family.flexibility)
    if unknowns > MOST_UNKNOWNS:
        raise InputError(
            f"damper law: {unknowns} unknowns, expected at most {MOST_UNKNOWNS}: fewer contact "
            "points (contact.points)"
        )
    e = select_elements(elements or wheel.elements, np.arange(wheel.nodes))
    log_size = np.log(np.geomspace(sizes[0], sizes[1], TABLE_SIZES))
    imposed = pairs_of_motions(family)
    table = np.empty((4, TABLE_SIZES, TABLE_RATIOS, TABLE_PHASES))
    stuck = stuck_displacements(wheel, family, imposed)
    # over the size
    last = stuck
    for i, size in enumerate(np.exp(log_size)):
        starts = size * last, size * stuck
        found = _one_size(wheel, e, family, size * imposed, starts, samples)
        last = found.displacement / size
        before, after = forces_on_blades(family, found) / size
        parts = np.array([before.real, before.imag, after.real, after.imag])
        table[:, i] = parts.reshape(4, TABLE_RATIOS, TABLE_PHASES)
    return DamperLaw(_spline(table), float(log_size[0]), float(log_size[1] - log_size[0]))


def law_harmonics(displacements: int, wanted: int) -> int:
    """Harmonics of a damper's balance, of those wanted, that its table can afford.

    Args:
        displacements: of its contacts.
    """
    return max(1, min(wanted, MOST_UNKNOWNS // (2 * displacements)))


def pairs_of_motions(family: ModeFamily) -> ComplexArray:
    """(B, m) displacements of the contacts by all pairs of amplitudes of size 1 in the table."""
    ratio = np.linspace(0, np.pi / 2, TABLE_RATIOS)
    phase = 2 * np.pi * np.arange(TABLE_PHASES) / TABLE_PHASES
    first, second = np.meshgrid(ratio, phase, indexing="ij")
    before = np.cos(first).ravel().astype(complex)
    after = (np.sin(first) * np.exp(1j * second)).ravel()
    return np.asarray(np.outer(before, family.before) + np.outer(after, family.after))


def forces_on_blades(family: ModeFamily, found: DamperMotion) -> ComplexArray:
    """(2, B) first harmonics of the modal forces on the blade before the damper and after it."""
    force = found.force[:, :, 0]
    return np.array([force @ family.before, force @ family.after])


def _one_size(
    wheel: Wheel,
    e: Elements,
    family: ModeFamily,
    imposed: np.ndarray,
    starts: tuple[np.ndarray, np.ndarray],
    samples: int,
) -> DamperMotion:
    """Balances for all pairs of amplitudes of one size: from the two starts, then from the
    neighbours' displacements in phase; the few that stay unsolved take the mean of these.

    Raises:
        NotSolvedError: more than a few have no solution.
    """
    found = solve_damper(wheel, e, family, imposed, starts[0], samples)
    for attempt in range(3):
        lost = np.flatnonzero(~found.solved)
        if not len(lost):
            return found
        start = starts[1]
        if attempt > 0:
            start = _next_in_phase(found.displacement, (1, -1)[attempt - 1])
        again = solve_damper(wheel, e, family, imposed[lost], start[lost], samples)
        found = found.improved(lost[again.solved], again.part(again.solved))
    lost = np.flatnonzero(~found.solved)
    if len(lost) > MAX_UNSOLVED_SHARE * len(imposed):
        raise NotSolvedError(
            f"damper law: no solution for {len(lost)} of {len(imposed)} pairs of amplitudes, the "
            f"best with residual {found.residual[lost].min():.1e}"
        )
    return DamperMotion(
        _with_means(found.displacement, lost),
        _with_means(found.force, lost),
        found.residual,
    )


def _with_means(values: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """(B, ...) values, some of them the mean of both neighbours in phase."""
    out = values.copy()
    out[lost] = 0.5 * (_next_in_phase(values, 1) + _next_in_phase(values, -1))[lost]
    return out


def _next_in_phase(values: np.ndarray, shift: int) -> np.ndarray:
    """(B, ...) values of the neighbour in phase."""
    whole = values.reshape(TABLE_RATIOS, TABLE_PHASES, -1)
    return np.roll(whole, shift, axis=1).reshape(values.shape)


def _spline(table: np.ndarray) -> np.ndarray:
    """Coefficients of cubic splines; ratios continue beyond their ends by symmetry.

    A negative ratio is the second amplitude with the opposite sign; beyond a right angle the first
    one has it, which is both forces and the phase turned by half a period.
    """
    half = np.roll(table, TABLE_PHASES // 2, axis=3)
    low = half[:, :, GHOST_POINTS:0:-1]
    high = -half[:, :, -2 : -2 - GHOST_POINTS : -1]
    whole = np.concatenate([low, table, high], axis=2)
    whole = ndimage.spline_filter1d(whole, 3, axis=1, mode="mirror")
    whole = ndimage.spline_filter1d(whole, 3, axis=2, mode="mirror")
    return np.ascontiguousarray(ndimage.spline_filter1d(whole, 3, axis=3, mode="grid-wrap"))


def scaled_elements(wheel: Wheel, name: str, factor: float) -> Elements:
    """Elements of one damper with another friction coefficient, stiffness or normal load."""
    e = wheel.elements
    if name == "friction":
        return replace(e, mu=factor * e.mu)
    if name == "stiffness":
        kt, kn = (wheel.scaled_stiffness(name, factor)[: len(e.kt)] for name in ("kt", "kn"))
        return replace(e, kt=kt, kn=kn)
    return replace(e, n0=factor * e.n0, t0=None if e.t0 is None else factor * e.t0)
