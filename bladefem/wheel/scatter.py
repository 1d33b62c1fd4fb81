"""Wheels drawn at random: deviations of blades and dampers by a scrambled Sobol sequence, the same
for every load and on every rank.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import norm, qmc

from ..data import Elements
from ..errors import InputError
from .model import Pattern, Wheel

# standard deviations beyond which nothing is drawn: parts outside are sorted out
MAX_DEVIATIONS = 3.0


@dataclass(frozen=True)
class Scatter:
    """Relative standard deviations of normal distributions, cut at three of them.

    Raises:
        InputError: a deviation is negative, or so large that a part could lose its sign.
    """

    # of the blades, in the unit of the pattern that is made from them: frequency or stiffness
    blades: float = 0.02
    # of the friction coefficient, contact stiffness and normal load of each damper
    friction: float = 0.0
    stiffness: float = 0.0
    load: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("blades", "friction", "stiffness", "load"):
            value = getattr(self, name)
            if not 0 <= value * MAX_DEVIATIONS < 1:
                raise InputError(
                    f"scatter.{name} {value}: expected a relative standard deviation from 0 to "
                    f"{1 / MAX_DEVIATIONS:.2f}"
                )


def drawn_deviations(count: int, scatter: Scatter, wheels: int) -> np.ndarray:
    """(wheels, 4, count) deviations of each sector in standard deviations: of the blade, then of
    friction, stiffness and load of its damper.
    """
    return _normal_sample(wheels, 4 * count, scatter.seed).reshape(wheels, 4, count)


def drawn_patterns(
    wheel: Wheel,
    scatter: Scatter,
    wheels: int,
    blade_pattern: Callable[[np.ndarray], Pattern],
) -> list[Pattern]:
    """Patterns of some wheels; element deviations are relative, see `element_factors`.

    Args:
        blade_pattern: a pattern from relative deviations (N,) of the blades.
    """
    values = drawn_deviations(wheel.count, scatter, wheels)
    dampers = np.array([scatter.friction, scatter.stiffness, scatter.load])
    patterns = []
    for draw in values:
        pattern = blade_pattern(scatter.blades * draw[0])
        if np.any(dampers):
            factors = 1 + dampers[:, None] * draw[1:]
            pattern = replace(pattern, elements=element_factors(wheel, factors))
        patterns.append(pattern)
    return patterns


def element_factors(wheel: Wheel, factors: np.ndarray) -> Elements:
    """The elements of all dampers with mu, stiffnesses and normal loads times factors (3, N)."""
    friction, stiffness, load = np.repeat(factors, wheel.nodes, axis=1)
    e = wheel.all_elements
    return replace(e, mu=friction * e.mu, kt=stiffness * e.kt, kn=stiffness * e.kn, n0=load * e.n0)


def read_pattern(path: str | Path, count: int) -> tuple[list[str], np.ndarray]:
    """Family names and relative frequency deviations (N, families) of a CSV file.

    The first row names the families, each further row is a blade; a first column "blade" numbers
    them. "#" starts a comment.

    Raises:
        InputError: the file is missing, not numbers, or has another number of blades.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"pattern file {path}: not found")
    text = path.read_text(encoding="utf-8").splitlines()
    rows = [line.split("#")[0].strip() for line in text]
    cells = [[cell.strip() for cell in row.split(",")] for row in rows if row]
    if len(cells) < 2:
        raise InputError(f"pattern file {path.name}: expected a row of names and {count} blades")
    names = cells[0]
    values = _read_numbers(path, cells[1:], len(names))
    if names[0].lower() == "blade":
        _check_order(path, values[:, 0])
        names = names[1:]
        values = values[:, 1:]
    if len(values) != count:
        raise InputError(
            f"pattern file {path.name}: {len(values)} blades, expected {count}, one a sector"
        )
    if not names:
        raise InputError(f"pattern file {path.name}: expected a column of deviations")
    return names, values


def _read_numbers(
    path: Path,
    rows: Sequence[Sequence[str]],
    columns: int,
) -> np.ndarray:
    for i, row in enumerate(rows):
        if len(row) != columns:
            raise InputError(
                f"pattern file {path.name}: {len(row)} columns in blade {i + 1}, expected {columns}"
            )
    try:
        values = np.array(rows, dtype=float)
    except ValueError as error:
        raise InputError(f"pattern file {path.name}: {error}, expected numbers") from None
    if not np.isfinite(values).all():
        raise InputError(f"pattern file {path.name}: expected finite numbers")
    return values


def _check_order(path: Path, numbers: np.ndarray) -> None:
    expected = np.arange(len(numbers)) + numbers[0]
    if numbers[0] not in (0, 1) or not np.array_equal(numbers, expected):
        raise InputError(
            f"pattern file {path.name}: expected blades in order, numbered from 0 or from 1"
        )


def _normal_sample(
    wheels: int,
    columns: int,
    seed: int,
) -> np.ndarray:
    """(wheels, columns) of the normal distribution, cut off."""
    sequence = qmc.Sobol(columns, scramble=True, seed=seed)
    power = int(np.ceil(np.log2(max(wheels, 2))))
    uniform = sequence.random_base2(power)[:wheels]
    low = norm.cdf(-MAX_DEVIATIONS)
    return norm.ppf(low + (1 - 2 * low) * uniform)
