"""Deviations of the blades of a wheel, and the file that lists them by blade and family."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError, close_word, missing_file
from ..util.arrays import RealArray
from ..util.csv_text import csv_lines

# what a column deviates in, by a word of its name; the first where none is said
FREQUENCY = "frequency"
STIFFNESS = "stiffness"
MASS = "mass"
QUANTITIES = (FREQUENCY, STIFFNESS, MASS)
# words of the name of a first column that numbers the blades
NUMBERING = ({"blade"}, {"blade", "no"}, {"blade", "nr"}, {"blade", "number"})
PERCENT = 0.01


@dataclass(frozen=True)
class BladeDeviations:
    """Relative deviations of N blades in q families of blade-alone modes.

    A family of stiffness 1 + k and mass 1 + m has sqrt((1 + k) / (1 + m)) times its frequency. A
    frequency is a stiffness alone, (1 + deviation)^2 - 1.
    """

    # (N, q) each [1]
    frequency: RealArray
    stiffness: RealArray
    mass: RealArray
    # whether the stiffness and the mass are one number a blade: its modulus and its density, of
    # which its higher families and the motions of its root have the same
    one_stiffness: bool = False
    one_mass: bool = False

    @property
    def of_material(self) -> bool:
        """Stiffness or mass is given, not the frequency alone."""
        return bool(np.any(self.stiffness) or np.any(self.mass))

    @property
    def blade_alone(self) -> np.ndarray:
        """(N, q) relative deviations of the blade-alone frequencies."""
        return (1 + self.frequency) * np.sqrt((1 + self.stiffness) / (1 + self.mass)) - 1


def frequency_deviations(values: np.ndarray) -> BladeDeviations:
    """Deviations of the blade-alone frequencies (N, q) [1], with nominal stiffness and mass."""
    return BladeDeviations(values, np.zeros_like(values), np.zeros_like(values))


def read_deviations(path: str | Path, count: int, families: int) -> BladeDeviations:
    """The deviations in a CSV file; see `read_pattern` for its rows.

    A column is a family's frequency, or its stiffness or its mass where its name has that word:
    "1F", "1F stiffness", "mass". Each quantity has one column for all families, or one a family.

    Raises:
        InputError: the file does not fit, or a blade would have no stiffness or no mass.
    """
    names, values = read_pattern(path, count)
    quantities = [_quantity(path, name) for name in names]
    found = {}
    single = {}
    for quantity in QUANTITIES:
        columns = values[:, [own == quantity for own in quantities]]
        single[quantity] = columns.shape[1] == 1
        if columns.shape[1] not in (0, 1, families):
            of = "" if quantity == FREQUENCY else f" with a {quantity}"
            raise InputError(
                f"{_field(path)}: {columns.shape[1]} families{of}, expected 1 for all or "
                f"mistuning.families = {families}"
            )
        _refuse_nothing_left(path, columns, quantity)
        if columns.shape[1] == 0:
            columns = np.zeros((count, 1))
        found[quantity] = np.broadcast_to(columns, (count, families)).copy()
    if FREQUENCY in quantities and set(quantities) != {FREQUENCY}:
        raise InputError(
            f"{_field(path)}: columns of frequency next to columns of stiffness or "
            "mass, expected frequencies alone, or stiffnesses and masses"
        )
    return BladeDeviations(
        found[FREQUENCY], found[STIFFNESS], found[MASS], single[STIFFNESS], single[MASS]
    )


def read_pattern(path: str | Path, count: int) -> tuple[list[str], np.ndarray]:
    """Names and relative deviations (N, columns) of a CSV file.

    The first row names the columns, those in per cent with "%" in the name; each further row is a
    blade; a first column "blade" or "blade no." numbers them. "#" starts a comment.

    Raises:
        InputError: the file is missing, not numbers, or has another number of blades or unit.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{_field(path)}: {missing_file(path)}")
    rows = csv_lines(path, _field(path))
    cells = [[cell.strip() for cell in row.split(",")] for row in rows if row]
    if len(cells) < 2:
        raise InputError(f"{_field(path)}: expected a row of names and {count} blades")
    names = cells[0]
    values = _read_numbers(path, cells[1:], len(names))
    if set(re.findall("[a-z]+", names[0].lower())) in NUMBERING:
        _check_order(path, values[:, 0])
        names = names[1:]
        values = values[:, 1:]
    if len(values) != count:
        raise InputError(f"{_field(path)}: {len(values)} blades, expected {count}, one a sector")
    if not names:
        raise InputError(f"{_field(path)}: expected a column of deviations")
    return names, values * [_unit(path, name) for name in names]


def _field(path: str | Path) -> str:
    """The field of a scene that names the file, and its value, for messages."""
    return f"mistuning.pattern = '{path}'"


def _unit(path: Path, name: str) -> float:
    """What the numbers of a column count by its name: "1F [%]" hundredths; 1 without a unit.

    Raises:
        InputError: a relative deviation has no such unit.
    """
    if "%" in name:
        return PERCENT
    found = re.search(r"\[(.*?)\]", name)
    if found is not None and found[1].strip() not in ("", "1"):
        raise InputError(
            f"{_field(path)}: column '{name}', expected relative deviations, without a unit or in %"
        )
    return 1.0


def _quantity(path: str | Path, name: str) -> str:
    """The quantity that deviates in a column: a word of its name, be it followed by a unit.

    Raises:
        InputError: a word is nearly stiffness or mass; as a frequency it would be another wheel.
    """
    words = re.findall("[a-z]+", name.lower())
    for word in words:
        if word in QUANTITIES:
            return word
    for word in words:
        close = close_word(word, QUANTITIES)
        if close and close != FREQUENCY:
            raise InputError(
                f"{_field(path)}: column '{name}': expected the name of a family, alone or with "
                f"one of {', '.join(QUANTITIES)}; did you mean '{close}'?"
            )
    return FREQUENCY


def _refuse_nothing_left(path: str | Path, columns: np.ndarray, quantity: str) -> None:
    if columns.min(initial=0.0) > -1:
        return
    blade = int(np.argmin(columns.min(axis=1)))
    left = MASS if quantity == MASS else STIFFNESS
    raise InputError(
        f"{_field(path)}: deviation {columns.min():.4g} of blade {blade + 1} leaves it no "
        f"{left}, expected relative deviations of {quantity} above -1"
    )


def _read_numbers(
    path: Path,
    rows: Sequence[Sequence[str]],
    columns: int,
) -> np.ndarray:
    for i, row in enumerate(rows):
        if len(row) != columns:
            raise InputError(
                f"{_field(path)}: {len(row)} columns in blade {i + 1}, expected {columns}"
            )
    try:
        values = np.array(rows, dtype=float)
    except ValueError as error:
        raise InputError(f"{_field(path)}: {error}, expected numbers") from None
    if not np.isfinite(values).all():
        raise InputError(f"{_field(path)}: expected finite numbers")
    return values


def _check_order(path: Path, numbers: np.ndarray) -> None:
    expected = np.arange(len(numbers)) + numbers[0]
    if numbers[0] not in (0, 1) or not np.array_equal(numbers, expected):
        raise InputError(f"{_field(path)}: expected blades in order, numbered from 0 or from 1")
