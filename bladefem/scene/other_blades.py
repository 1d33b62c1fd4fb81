"""Blades of a wheel that have another shape, as scenes of their own: read from the texts of
mistuning.blades.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    from .tables import Scene

EXAMPLE = "'7: aerofoil.chord_tip = 41 mm; aerofoil.twist = 21 deg'"
# what an imported blade may have in place of the others' geometry
FILE = "imported.file"


def other_blades(scene: Scene, count: int) -> dict[int, Scene]:
    """Number of the blade from 0 to the scene of a wheel all of whose blades are like it.

    Blades with the same changes share one scene.

    Raises:
        InputError: an entry cannot be read, names no blade of the wheel or a field that moves more
            than the aerofoil, or the changed blade cannot be drawn.
    """
    from .toml import vary

    found: dict[int, Scene] = {}
    made: dict[tuple[str, ...], Scene] = {}
    for entry in scene.mistuning.blades or ():
        number, changes = _parts(entry)
        name = f"mistuning.blades '{entry}'"
        if not 1 <= number <= count:
            raise InputError(f"{name}: expected a blade from 1 to {count}")
        if number - 1 in found:
            raise InputError(f"{name}: blade {number} is given twice, expected each one once")
        for field, _ in changes:
            _check_field(name, field, scene.kind)
        key = tuple(sorted(f"{field} = {value}" for field, value in changes))
        if key not in made:
            alone = vary(scene, "mistuning.blades", None, "mistuning.pattern", None)
            flat = [word for change in changes for word in change]
            try:
                made[key] = vary(alone, *flat)
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
        found[number - 1] = made[key]
    return found


def whole_entry(entry: str, folder: Path) -> str:
    """An entry with the whole path of its file."""
    number, changes = _parts(entry)
    whole = [
        f"{field} = {(folder / value).resolve() if field == FILE else value}"
        for field, value in changes
    ]
    return f"{number}: {'; '.join(whole)}"


def _parts(entry: str) -> tuple[int, list[tuple[str, str]]]:
    number, colon, rest = entry.partition(":")
    changes = [part.partition("=") for part in rest.split(";")]
    complete = all(field.strip() and equals and value.strip() for field, equals, value in changes)
    if not colon or not number.strip().isdigit() or not complete:
        raise InputError(
            f"mistuning.blades '{entry}': expected the number of a blade and fields with their "
            f"values, such as {EXAMPLE}"
        )
    return int(number), [(field.strip(), value.strip()) for field, _, value in changes]


def _check_field(name: str, field: str, kind: str) -> None:
    """Only the aerofoil may differ: contacts, cut faces and disc are those of all blades."""
    if kind == "imported" and field != FILE:
        raise InputError(f"{name}: field '{field}', expected '{FILE}' of an imported blade")
    if kind != "imported" and not field.startswith("aerofoil."):
        raise InputError(
            f"{name}: field '{field}', expected one of [aerofoil]: platforms, dampers and disc are "
            "those of all blades"
        )
