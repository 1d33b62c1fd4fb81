"""Materials of the named volumes of a user's mesh, from texts such as "disc: E=114 GPa; nu=0.34;
rho=4430 kg/m^3", and "disc at 600 degC: E=90 GPa" for a row over temperature.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from ..errors import InputError, suggestion
from .fields import convert_value, field_at
from .tables import Material, Scene


def part_materials(scene: Scene) -> dict[str, Material]:
    """Material of each volume that ``imported.materials`` names; what a text leaves out is as in
    [material.blade].

    Raises:
        InputError: not a name and values, an unknown property, one out of range, a volume named
            twice.
    """
    found: dict[str, Material] = {}
    rows: dict[str, list[str]] = {}
    for text in scene.imported.materials or ():
        head, colon, values = text.partition(":")
        volume, at, temperature = head.partition(" at ")
        name = "_".join(volume.lower().split())
        if not colon or not name or not values.strip() or (name in found and not at):
            raise InputError(
                f"imported.materials = {text!r}: expected one text for each volume, such as 'disc: "
                "E=114 GPa; nu=0.34; rho=4430 kg/m^3'"
            )
        if at:
            rows.setdefault(name, []).append(f"{temperature}:{values}")
            continue
        # rows of another material would overrule the constants given here
        found[name] = replace(
            scene.material.blade,
            table=None,
            **dict(_parse_property(item, text) for item in values.split(";")),
        )
    for name, texts in rows.items():
        material = found.get(name, scene.material.blade)
        found[name] = replace(material, table=tuple(texts))
    return found


def _parse_property(item: str, text: str) -> tuple[str, Any]:
    """One property."""
    name, _, value = (part.strip() for part in item.partition("="))
    known = [each.name for each in fields(Material) if each.name != "table"]
    if name not in known:
        raise InputError(
            f"imported.materials = {text!r}: '{name}' is no property{suggestion(name, known)}"
        )
    return name, convert_value(
        value, field_at(f"material.blade.{name}")._replace(name=f"imported.materials, {name}")
    )
