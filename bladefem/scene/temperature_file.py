"""Temperatures from a CSV file with the columns x, y, z and T, in any order, or node and T with the
numbers of the user's own mesh; units stand in brackets, "x [mm]", "T [degC]", m and K without.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..errors import InputError, missing_file
from ..util.arrays import IntegerArray, RealArray
from ..util.csv_text import csv_lines
from .units import parse

PLACE_COLUMNS = {"x": "m", "y": "m", "z": "m", "T": "K"}
NODE_COLUMNS = {"node": "1", "T": "K"}
_HEAD = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")


@dataclass(frozen=True)
class GivenTemperatures:
    """What a file says."""

    # (k,) [K]
    values: RealArray
    # (k, 3) [m]; None where nodes are given
    places: RealArray | None
    # (k,) numbers of nodes in the user's mesh
    nodes: IntegerArray | None


def read_temperatures(file: str) -> GivenTemperatures:
    """Temperatures of places or nodes.

    Raises:
        InputError: no such file, a column is missing, a value that is no number, or a node that
            comes twice.
    """
    path = Path(file)
    if not path.is_file():
        raise InputError(f"temperature.file = {file!r}: {missing_file(path)}")
    # read again where it has changed
    return _read(file, path.stat().st_mtime)


@lru_cache(maxsize=4)
def _read(file: str, _: float) -> GivenTemperatures:
    lines = csv_lines(file, file)
    rows = [row for row in csv.reader(lines) if any(cell.strip() for cell in row)]
    if len(rows) < 2:
        raise InputError(
            f"{file}: it has no rows, expected the columns x, y, z, T (or node, T) and their values"
        )
    columns, places, units = _columns(file, rows[0])
    try:
        table = np.array([[float(row[place]) for place in places] for row in rows[1:]])
    except (ValueError, IndexError):
        many = "four" if len(columns) == len(PLACE_COLUMNS) else "two"
        raise InputError(
            f"{file}: row {_first_bad(rows, places)} is not {many} numbers, expected "
            f"{_listed(columns)}"
        ) from None
    if not np.isfinite(table).all():
        raise InputError(f"{file}: it has values that are not finite numbers")
    # degC starts elsewhere: a unit is a straight line
    zero = np.array([parse(f"0 {unit}".strip(), si, file) for unit, si in units])
    one = np.array([parse(f"1 {unit}".strip(), si, file) for unit, si in units])
    table = zero + table * (one - zero)
    values = table[:, -1]
    if values.min() < 0:
        raise InputError(f"{file}: a temperature is {values.min():g} K, expected at least 0 K")
    if columns is PLACE_COLUMNS:
        return GivenTemperatures(values, table[:, :3], None)
    return GivenTemperatures(values, None, _node_numbers(file, table[:, 0]))


def _node_numbers(file: str, numbers: RealArray) -> IntegerArray:
    wrong = np.flatnonzero((numbers != np.round(numbers)) | (numbers < 0))
    if len(wrong):
        raise InputError(
            f"{file}: a node is {numbers[wrong[0]]:g}, expected the whole numbers of the mesh file"
        )
    found, count = np.unique(numbers.astype(int), return_counts=True)
    if len(found) < len(numbers):
        raise InputError(
            f"{file}: node {found[count.argmax()]} comes {count.max()} times, expected each once"
        )
    return numbers.astype(int)


def _columns(file: str, head: list[str]) -> tuple[dict[str, str], list[int], list[tuple[str, str]]]:
    """The kind of columns, and place and (unit, SI unit) of each."""
    given = {}
    for place, cell in enumerate(head):
        match = _HEAD.fullmatch(cell)
        if match:
            given[match[1]] = (place, match[2])
    known = {*PLACE_COLUMNS, *NODE_COLUMNS}
    found = {(name if name in known else name.lower()): value for name, value in given.items()}
    if "t" in found:
        found.setdefault("T", found["t"])
    columns = NODE_COLUMNS if "node" in found and "x" not in found else PLACE_COLUMNS
    missing = [name for name in columns if name not in found]
    if missing:
        raise InputError(
            f"{file}: column '{missing[0]}' is missing in its first line, expected x, y, z, T (or "
            "node, T) with units in brackets, such as 'x [mm], y [mm], z [mm], T [degC]'"
        )
    places = [found[name][0] for name in columns]
    units = [
        (found[name][1] or ("" if unit == "1" else unit), unit) for name, unit in columns.items()
    ]
    return columns, places, units


def _listed(columns: dict[str, str]) -> str:
    *first, last = columns
    return f"{', '.join(first)} and {last}"


def _first_bad(rows: list[list[str]], places: list[int]) -> int:
    """Number of the first row that is not numbers, that of the head being 1."""
    for number, row in enumerate(rows[1:], 2):
        try:
            [float(row[place]) for place in places]
        except (ValueError, IndexError):
            return number
    return len(rows)
