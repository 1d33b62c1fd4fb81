"""A table of quasi-static contact states with interpolation, and whether quasi-static is right at
all.

The paper solves "a few independent contact states" beforehand and interpolates between them during
the motion. Here the direct solve costs milliseconds too; the table says how far it is from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..data import Patch
from ..errors import InputError
from ..scene.tables import Material
from ..scene.units import plain_number

# what "much larger" means in T >> D / c
MUCH_LARGER_RATIO = 10.0


@dataclass(frozen=True)
class StateTable:
    """Contact forces over a grid of states (load, relative positions, ...)."""

    # k ascending coordinates
    axes: tuple[np.ndarray, ...]
    # (len(axes[0]), ..., n) [N]
    force: np.ndarray
    # (k, len(axes[0]), ..., n) second differences |f''| h^2 along each axis [N]
    bend: np.ndarray


def state_table(solve: Callable[..., np.ndarray], axes: Sequence[np.ndarray]) -> StateTable:
    """Solve every state of a grid.

    Args:
        solve: from k coordinates to the (n,) forces, for instance the concatenated maps of
            ``seat.solve``.
        axes: k coordinate lists, at least three ascending values each.

    Raises:
        InputError: an axis is too short or not ascending; whatever `solve` raises.
    """
    axes = tuple(np.asarray(a, dtype=float) for a in axes)
    for k, a in enumerate(axes):
        if len(a) < 3 or not (np.diff(a) > 0).all():
            raise InputError(
                f"axis {k} of the state table is {a.tolist()}, expected at least 3 ascending values"
            )
    force = np.array([solve(*point) for point in product(*axes)])
    force = force.reshape(*(len(a) for a in axes), -1)
    return StateTable(
        axes, force, np.stack([_second_difference(force, a, k) for k, a in enumerate(axes)])
    )


def interpolate_states(table: StateTable, point: Sequence[float]) -> tuple[np.ndarray, float]:
    """Forces (n,) by multilinear interpolation, and an error indicator relative to the table's
    largest force.

    The indicator adds, over the axes, b c / (b + c) from the second differences b and c at the two
    ends of the cell, times 4 s (1 - s): 0 on a table point. For a force with one kink in the cell,
    as where a node opens or closes, that is the largest interpolation error; for a smooth one, b =
    c = h^2 f'', it is four times as large as that.

    Raises:
        InputError: the point is outside the table.
    """
    force = table.force
    where = []
    indicator = 0.0
    for k, (a, x) in enumerate(zip(table.axes, point, strict=True)):
        if not a[0] <= x <= a[-1]:
            raise InputError(
                f"coordinate {k} is {x:g}, expected it inside the table, {a[0]:g} to {a[-1]:g}"
            )
        i = min(int(np.searchsorted(a, x, side="right")) - 1, len(a) - 2)
        where.append((i, (x - a[i]) / (a[i + 1] - a[i])))
    cell = tuple(slice(i, i + 2) for i, _ in where)
    for k, (i, s) in enumerate(where):
        force = (1 - s) * force[i] + s * force[i + 1]
        b, c = np.moveaxis(table.bend[k][cell], k, 0)
        indicator += 4 * s * (1 - s) * float((b * c / np.maximum(b + c, 1e-300)).max())
    # all states may be open
    return force, indicator / (float(np.abs(table.force).max()) or 1.0)


def _second_difference(
    force: np.ndarray,
    a: np.ndarray,
    k: int,
) -> np.ndarray:
    """h^2 |f''| with the wider neighbouring step h, at each table point along axis k; at the ends
    that next to them.
    """
    f = np.moveaxis(force, k, 0)
    h = np.diff(a).reshape(-1, *[1] * (f.ndim - 1))
    slope = np.diff(f, axis=0) / h
    bend = np.abs(2 * np.diff(slope, axis=0) / (h[1:] + h[:-1]) * np.maximum(h[1:], h[:-1]) ** 2)
    return np.moveaxis(np.concatenate([bend[:1], bend, bend[-1:]]), 0, k)


@dataclass(frozen=True)
class QuasiStatic:
    """Whether contact may be computed as a sequence of static states: T >> D / c."""

    # shortest period of the motion [s]
    period: float
    # D / c, elastic waves across the patch [s]
    transit: float
    # period >= 10 transits
    holds: bool
    # frequency up to which it holds [Hz]
    limit: float

    @property
    def sentence(self) -> str:
        """For the report."""
        return (
            f"quasi-static contact {'holds' if self.holds else 'does NOT hold'}: the period "
            f"{self.period:.3g} s is {self.period / self.transit:.3g} wave transits of the patch "
            f"(at least {MUCH_LARGER_RATIO:g} wanted; up to {plain_number(self.limit, 3)} Hz)"
        )


def quasi_static(
    patch: Patch,
    material: Material,
    frequency: float,
) -> QuasiStatic:
    """Compare the period with D / c, D the patch's largest extent and c = sqrt(E / rho) (the
    paper's Eq. 26).

    Args:
        frequency: highest frequency of the motion that matters [Hz]: the last harmonic kept.
    """
    if not frequency > 0:
        raise InputError(f"frequency is {frequency} Hz, expected a positive one")
    extent = float(np.linalg.norm(np.ptp(patch.points @ patch.frame[0].T, axis=0)))
    transit = extent / np.sqrt(material.E / material.rho)
    return QuasiStatic(
        1 / frequency,
        transit,
        bool(1 / frequency >= MUCH_LARGER_RATIO * transit),
        1 / (MUCH_LARGER_RATIO * transit),
    )
