"""Places and temperatures from a CSV file with the columns x, y, z and T, in any order; units stand
in brackets, "x [mm]", "T [degC]", m and K without.
"""

from __future__ import annotations

import csv
import re
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..util.arrays import RealArray
from .units import parse

COLUMNS = {"x": "m", "y": "m", "z": "m", "T": "K"}
_HEAD = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")


def read_temperatures(file: str) -> tuple[RealArray, RealArray]:
    """Places (k, 3) [m] and temperatures (k,) [K].

    Raises:
        InputError: no such file, a column is missing, or a value that is no number.
    """
    path = Path(file)
    if not path.is_file():
        raise InputError(f"temperature.file = {file!r}: there is no such file")
    # read again where it has changed
    return _read(file, path.stat().st_mtime)


@lru_cache(maxsize=4)
def _read(file: str, _: float) -> tuple[RealArray, RealArray]:
    try:
        lines = Path(file).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read as a CSV file ({error})") from None
    rows = [row for row in csv.reader(lines) if any(cell.strip() for cell in row)]
    if len(rows) < 2:
        raise InputError(
            f"{file}: it has no rows, expected the columns x, y, z, T and their values"
        )
    places, units = _columns(file, rows[0])
    try:
        table = np.array([[float(row[place]) for place in places] for row in rows[1:]])
    except (ValueError, IndexError):
        raise InputError(
            f"{file}: row {_first_bad(rows, places)} is not four numbers, expected x, y, z and T"
        ) from None
    if not np.isfinite(table).all():
        raise InputError(f"{file}: it has values that are not finite numbers")
    # degC starts elsewhere: a unit is a straight line
    zero = np.array([parse(f"0 {unit}", si, file) for unit, si in units])
    one = np.array([parse(f"1 {unit}", si, file) for unit, si in units])
    table = zero + table * (one - zero)
    if table[:, 3].min() < 0:
        raise InputError(f"{file}: a temperature is {table[:, 3].min():g} K, expected at least 0 K")
    return table[:, :3], table[:, 3]


def _columns(file: str, head: list[str]) -> tuple[list[int], list[tuple[str, str]]]:
    """Place and (unit, SI unit) of each column."""
    found = {}
    for place, cell in enumerate(head):
        match = _HEAD.fullmatch(cell)
        if match:
            found[match[1]] = (place, match[2])
    found = {(name if name in COLUMNS else name.lower()): value for name, value in found.items()}
    if "t" in found:
        found.setdefault("T", found["t"])
    missing = [name for name in COLUMNS if name not in found]
    if missing:
        raise InputError(
            f"{file}: column '{missing[0]}' is missing in its first line, expected x, y, z, T with "
            "units in brackets, such as 'x [mm], y [mm], z [mm], T [degC]'"
        )
    places = [found[name][0] for name in COLUMNS]
    return places, [(found[name][1] or unit, unit) for name, unit in COLUMNS.items()]


def _first_bad(rows: list[list[str]], places: list[int]) -> int:
    """Number of the first row that is not numbers, that of the head being 1."""
    for number, row in enumerate(rows[1:], 2):
        try:
            [float(row[place]) for place in places]
        except (ValueError, IndexError):
            return number
    return len(rows)
