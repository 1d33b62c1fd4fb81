"""Springs and single directions of [support], from texts such as "root: normal=1e12 N/m^3"."""

from __future__ import annotations

from collections.abc import Iterator

from ..errors import InputError, suggestion
from .tables import Support
from .units import parse

# fixed axes, then radial, tangential and axial about the z axis
DIRECTION_LETTERS = ("x", "y", "z", "r", "t", "a")
SPRING_DIRECTIONS = ("normal", "tangential")


def area_springs(support: Support) -> Iterator[tuple[str, float, float]]:
    """Face, normal and tangential stiffness per unit area [N/m^3] of each text.

    Raises:
        InputError: a text that is not "face: normal=...; tangential=...".
    """
    for text in support.springs or ():
        face, colon, values = (part.strip() for part in text.partition(":"))
        if not colon or not face or not values:
            raise InputError(
                f"support.springs = {text!r}: expected one text for each face, such as 'root: "
                "normal=1e12 N/m^3; tangential=5e11 N/m^3'"
            )
        found = dict(_parse_stiffness(item, text) for item in values.split(";"))
        yield face, found.get("normal", 0.0), found.get("tangential", 0.0)


def held_letters(support: Support) -> list[tuple[str, str]]:
    """Face or node set, and the letters of the displacements held on it.

    Raises:
        InputError: a text that is not "face: x", "face: xy", "face: ra", ...
    """
    found = []
    for text in support.directions or ():
        face, colon, letters = (part.strip() for part in text.partition(":"))
        letters = letters.replace(",", "").replace(" ", "").lower()
        if not colon or not face or not letters or set(letters) - set(DIRECTION_LETTERS):
            raise InputError(
                f"support.directions = {text!r}: expected one text for each face, such as "
                "'rim: z', 'foot: xy' or 'bore: ra' (r radial, t tangential, a axial)"
            )
        found.append((face, letters))
    return found


def _parse_stiffness(item: str, text: str) -> tuple[str, float]:
    name, _, value = (part.strip() for part in item.partition("="))
    if name not in SPRING_DIRECTIONS:
        raise InputError(
            f"support.springs = {text!r}: '{name}' is no stiffness"
            f"{suggestion(name, SPRING_DIRECTIONS)}"
        )
    number = parse(value, "N/m^3", f"support.springs, {name}")
    if not number >= 0:
        raise InputError(f"support.springs = {text!r}: {name} is {number:g}, expected at least 0")
    return name, number
