"""Reader of Ansys .cdb archives (CDWRITE, blocked): nodes, solid elements, node and element
components.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from bladefem.errors import InputError

__all__ = ["read_cdb"]

# integers before the nodes of an element in EBLOCK, SOLID
HEADER = 11
WORDS = {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20"}


def read_cdb(file: Path) -> tuple[np.ndarray, list, dict, dict]:
    """Points (n, 3), blocks (cell type, nodes in Ansys' order = VTK's), element groups and node
    sets.

    Elements are told apart by their number of nodes: 4 and 10 tetrahedra, 8 and 20 hexahedra; the
    first also when written as a hexahedron with repeated nodes.

    Raises:
        InputError: no NBLOCK or EBLOCK of solids, or an element shape that is not supported.
    """
    lines = iter(file.read_text(errors="replace").splitlines())
    nodes = {}
    elements = {}
    components = {}
    for line in lines:
        key = line.split(",")[0].strip().upper()
        if key == "NBLOCK":
            nodes.update(_nblock(lines))
        elif key == "EBLOCK" and "SOLID" in line.upper():
            elements.update(_eblock(lines))
        elif key == "CMBLOCK":
            fields = [f.strip() for f in line.split("!")[0].split(",")]
            components[fields[1]] = (fields[2].upper()[:4], _cmblock(lines, int(fields[3])))
    if not nodes or not elements:
        raise InputError(
            f"imported.file = '{file}': no blocked nodes and solid elements, expected CDWRITE's "
            ".cdb with "
            "NBLOCK and EBLOCK,...,SOLID"
        )
    return _arrays(nodes, elements, components)


def _widths(line: str) -> list[int]:
    """Column widths of a Fortran format such as (3i9,6e21.13e3)."""
    return [
        int(width)
        for count, width in re.findall(r"(\d*)[iIeEfFgG](\d+)", line)
        for _ in range(int(count or 1))
    ]


def _cut(line: str, widths: list[int]) -> list[str]:
    ends = np.cumsum(widths)
    return [
        line[end - width : end]
        for end, width in zip(ends, widths, strict=True)
        if line[end - width : end].strip()
    ]


def _nblock(lines: Iterator[str]) -> Iterator[tuple[int, list[float]]]:
    widths = _widths(next(lines))
    integers = 3 if len(widths) > 7 else len(widths) - 6
    for line in lines:
        if line.strip().startswith(("N,", "-1")):
            return
        ends = np.cumsum(widths)[integers - 1 : integers + 3]
        values = [line[a:b].strip() for a, b in pairwise(ends)]
        yield int(line[: widths[0]]), [float(v or 0.0) for v in values]


def _eblock(lines: Iterator[str]) -> Iterator[tuple[int, list[int]]]:
    widths = _widths(next(lines))
    for line in lines:
        if line.strip().startswith("-1"):
            return
        values = [int(v) for v in _cut(line, widths)]
        count = values[8]
        while len(values) < HEADER + count:
            values += [int(v) for v in _cut(next(lines), widths)]
        yield values[10], values[HEADER : HEADER + count]


def _cmblock(lines: Iterator[str], count: int) -> list[int]:
    """Members; a negative number closes a range that the number before it opened."""
    widths = _widths(next(lines))
    values = []
    while len(values) < count:
        values += [int(v) for v in _cut(next(lines), widths)]
    members: list[int] = []
    for value in values:
        members.extend([value] if value > 0 else range(members[-1] + 1, -value + 1))
    return members


def _arrays(
    nodes: dict[int, list[float]],
    elements: dict[int, list[int]],
    components: dict[str, tuple[str, list[int]]],
) -> tuple[np.ndarray, list, dict, dict]:
    number = {tag: i for i, tag in enumerate(nodes)}
    kinds: dict[str, list[list[int]]] = {}
    where: dict[int, tuple[str, int]] = {}
    for tag, connectivity in elements.items():
        cell = _shape([number[n] for n in connectivity], tag)
        rows = kinds.setdefault(WORDS[len(cell)], [])
        where[tag] = (WORDS[len(cell)], len(rows))
        rows.append(cell)
    blocks = [(word, np.array(rows)) for word, rows in kinds.items()]
    groups = {}
    sets = {}
    for name, (kind, members) in components.items():
        if kind == "NODE":
            sets[name] = np.array([number[n] for n in members if n in number], dtype=int)
            continue
        rows = [where[e] for e in members if e in where]
        groups[name] = [
            (b, np.array([i for w, i in rows if w == word], dtype=int))
            for b, (word, _) in enumerate(blocks)
        ]
    return np.array(list(nodes.values())), blocks, groups, sets


def _shape(cell: list[int], tag: int) -> list[int]:
    """The nodes without repetition where the element is a tetrahedron in disguise.

    Raises:
        InputError: a prism, pyramid or other shape.
    """
    if len(cell) == 8 and cell[2] == cell[3] and len(set(cell[4:])) == 1:
        return [cell[0], cell[1], cell[2], cell[4]]
    if len(cell) == 20 and cell[2] == cell[3] and len(set(cell[4:8])) == 1:
        return [cell[i] for i in (0, 1, 2, 4, 8, 9, 11, 16, 17, 18)]
    if len(cell) not in WORDS or len(set(cell)) != len(cell):
        raise InputError(
            f"imported.file: element {tag} has {len(set(cell))} nodes, expected tetrahedra (4 or "
            "10) "
            "or hexahedra (8 or 20 nodes)"
        )
    return cell
