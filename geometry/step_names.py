"""Names of solids and faces in the text of a STEP file, and which solid of the drawing library each
of them is.

A STEP file (ISO 10303-21) numbers its records as it likes, and the library reads solids in an order
of its own: they are given by their corners. Faces of a solid are read in the order of its shells.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from bladefem.errors import InputError

# a text, in which a quotation mark is written twice
_TEXT = r"'((?:[^']|'')*)'"
_SOLID = re.compile(rf"(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS)\s*\(\s*{_TEXT}\s*,\s*(.*)", re.S)
_HAS_SOLID = re.compile(r"MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS")
_RECORD = re.compile(r"#(\d+)\s*=\s*(.*?);\s*(?=#|ENDSEC)", re.S)
# coordinates of a CARTESIAN_POINT
_PLACE = re.compile(r"\(\s*([^()]*)\)\s*\)")
_NUMBER = re.compile(r"#(\d+)")
# letters beyond ASCII: \X2\00FC\X0\, \X4\0001F600\X0\, \X\FC, \S\|
_LETTERS = re.compile(
    r"\\X2\\((?:[0-9A-Fa-f]{4})*)\\X0\\|\\X4\\((?:[0-9A-Fa-f]{8})*)\\X0\\"
    r"|\\X\\([0-9A-Fa-f]{2})|\\S\\(.)|(\\\\)|('')",
    re.S,
)
# difference of two solids with another number of corners, over their sizes
OTHER_CORNERS = 0.1
# difference by a place in the order, which decides between solids alike
OUT_OF_ORDER = 1e-6


@dataclass(frozen=True)
class WrittenSolid:
    """A solid as the file writes it; "" for what has no name."""

    name: str
    # of its faces, in the order of its shells
    faces: tuple[str, ...]
    # (n, 3) corners, in the file's unit where the solid is drawn, before an assembly places it
    corners: np.ndarray


def written_solids(text: str) -> list[WrittenSolid]:
    """The solids in the order in which the file has them.

    Raises:
        InputError: one that is written otherwise.
    """
    records = {int(number): body for number, body in _RECORD.findall(text)}
    solids = []
    for number, body in records.items():
        if not _HAS_SOLID.match(body):
            continue
        head = _SOLID.match(body)
        if head is None:
            raise InputError(
                f"imported.file: solid '{body[:60]}', expected MANIFOLD_SOLID_BREP('name', #shell)"
            )
        shells = [_shell(records, int(n)) for n in _NUMBER.findall(head[2])]
        faces = [int(n) for shell in shells for n in _NUMBER.findall(shell)]
        names = tuple(_name_of(records.get(face, "")) for face in faces)
        solids.append(WrittenSolid(plain_name(head[1]), names, _corners(records, number)))
    return solids


def solids_of_volumes(
    solids: Sequence[WrittenSolid], volumes: Sequence[tuple[int, np.ndarray]]
) -> list[WrittenSolid | None]:
    """The written solid that each volume is; None for all where their numbers differ.

    Args:
        volumes: of each the number of its faces, and its corners (n, 3), in any unit.
    """
    if len(solids) != len(volumes):
        return [None] * len(volumes)
    written = [(len(solid.faces), solid.corners) for solid in solids]
    sizes = [_shapes(written), _shapes(volumes)]
    cost = np.array([[_difference(ours, theirs) for theirs in sizes[0]] for ours in sizes[1]])
    order = np.arange(len(solids))
    cost += OUT_OF_ORDER * abs(order[:, None] - order)
    return [solids[column] for column in linear_sum_assignment(cost)[1]]


def plain_name(name: str) -> str:
    """A name worth using, with its letters decoded; CAD systems write NONE and the like.

    >>> plain_name(r"Fl\\X2\\00FC\\X0\\gel"), plain_name("NONE"), plain_name("7'' disc")
    ('Flügel', '', "7' disc")
    """
    name = _LETTERS.sub(_letters, name).strip()
    return "" if name.upper() in ("", "NONE", "$") else name


def _letters(found: re.Match[str]) -> str:
    two, four, one, shifted, backslash, _ = found.groups()
    if two is not None:
        return bytes.fromhex(two).decode("utf-16-be", "replace")
    if four is not None:
        return bytes.fromhex(four).decode("utf-32-be", "replace")
    if one is not None:
        return chr(int(one, 16))
    if shifted is not None:
        return chr(ord(shifted) + 128)
    return "\\" if backslash else "'"


def _shell(records: dict[int, str], number: int) -> str:
    """The record with the faces of a shell, which those of cavities have turned round."""
    body = records.get(number, "")
    turned = re.match(r"ORIENTED_CLOSED_SHELL\b.*?#(\d+)", body, re.S)
    return body if turned is None else records.get(int(turned[1]), "")


def _name_of(record: str) -> str:
    found = re.match(rf"\w+\s*\(\s*{_TEXT}", record, re.S)
    return plain_name(found[1]) if found else ""


def _corners(records: dict[int, str], start: int) -> np.ndarray:
    """(n, 3) places of the vertices that a record leads to."""
    seen = {start}
    ahead = [start]
    places = []
    while ahead:
        body = records.get(ahead.pop(), "")
        numbers = [int(n) for n in _NUMBER.findall(body)]
        if body.startswith("VERTEX_POINT"):
            point = _PLACE.search(records.get(numbers[-1], "")) if numbers else None
            if point is not None:
                places.append([float(x) for x in point[1].split(",")])
            continue
        new = [n for n in numbers if n not in seen]
        seen.update(new)
        ahead.extend(new)
    return np.array(places, dtype=float).reshape(-1, 3)


def _shapes(solids: Sequence[tuple[int, np.ndarray]]) -> list[tuple[int, np.ndarray]]:
    """Number of faces, and sorted distances (n,) of the corners from their middle, over the largest
    of all solids: whatever their unit and wherever they are placed.
    """
    distances = [
        np.sort(np.linalg.norm(corners - corners.mean(axis=0), axis=1))
        if len(corners)
        else np.zeros(0)
        for _, corners in solids
    ]
    largest = max((float(d[-1]) for d in distances if len(d)), default=0.0) or 1.0
    return [(faces, d / largest) for (faces, _), d in zip(solids, distances, strict=True)]


def _difference(one: tuple[int, np.ndarray], other: tuple[int, np.ndarray]) -> float:
    """Between two solids as `_shapes` has them, over the size of the larger."""
    faces = OTHER_CORNERS * (one[0] != other[0])
    sizes = [float(d[-1]) if len(d) else 0.0 for _, d in (one, other)]
    largest = max(sizes) or 1.0
    if len(one[1]) != len(other[1]):
        return faces + OTHER_CORNERS + abs(sizes[0] - sizes[1]) / largest
    if not len(one[1]):
        return faces
    return faces + float(abs(one[1] - other[1]).max()) / largest
