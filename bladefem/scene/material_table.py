"""Properties of a material over temperature, from texts such as "600 degC: E=180 GPa; nu=0.31".

Between two rows a property varies linearly. What no row gives is the constant of the material. The
thermal expansion is the mean (secant) coefficient from the reference temperature, at which the body
is free of stress: the thermal strain is expansion(T) (T - reference).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ..errors import InputError, suggestion
from ..util.arrays import RealArray
from .fields import Field, convert_value, field_at
from .tables import Material, Scene
from .temperature_file import read_temperatures
from .units import parse

# properties that a row may give
ROW_PROPERTIES = ("E", "nu", "rho", "G", "expansion", "expansion_axes", "orthotropic")
# in messages where the field of a table is not known
A_TABLE = "table of a material"
# of the range of a table: temperatures that much outside are rounding
ROUNDING = 1e-9


@dataclass(frozen=True)
class PropertyTable:
    """Rows of one material."""

    # (k,) [K], rising
    temperatures: RealArray
    # property to (k,) values, (k, 9) of "orthotropic" and (k, 3) of "expansion_axes" [SI]
    values: dict[str, RealArray]


def property_at(
    material: Material,
    name: str,
    temperature: RealArray | None,
    field: str = A_TABLE,
) -> RealArray:
    """A property at temperatures (...) [K]: (...) values, (..., 9) of "orthotropic" and (..., 3) of
    "expansion_axes"; the material's own constant without a temperature, or where its table has no
    such column.

    Args:
        field: of the table, for messages.

    Raises:
        InputError: a temperature outside the table.
    """
    own = getattr(material, name)
    if temperature is None or material.table is None:
        return np.asarray(own, float)
    table = property_table(material, field)
    if name not in table.values:
        return np.asarray(own, float)
    at = _inside(table, np.asarray(temperature, float), field)
    values = table.values[name]
    if values.ndim == 1:
        return np.asarray(np.interp(at, table.temperatures, values))
    columns = [np.interp(at, table.temperatures, column) for column in values.T]
    return np.stack(columns, axis=-1)


def material_at(material: Material, temperature: float, field: str = A_TABLE) -> Material:
    """The material of one temperature [K]: constants, without a table.

    Args:
        field: of the table, for messages.

    Raises:
        InputError: rows that are none, or a temperature outside the table.
    """
    if material.table is None:
        return material
    at = np.asarray(temperature)
    found: dict[str, Any] = {
        name: property_at(material, name, at, field).tolist()
        for name in property_table(material, field).values
    }
    for name in ("orthotropic", "expansion_axes"):
        if name in found:
            found[name] = tuple(found[name])
    return replace(material, table=None, **found)


def property_table(material: Material, field: str = A_TABLE) -> PropertyTable:
    """The rows of a material that has some.

    Args:
        field: of the table, for messages.

    Raises:
        InputError: a text that is no row, unknown or missing properties, temperatures that do not
            rise.
    """
    return _parsed(material.table or (), field)


@lru_cache(maxsize=64)
def _parsed(texts: tuple[str, ...], field: str) -> PropertyTable:
    rows = [_parse_row(text, field) for text in texts]
    temperatures = np.array([row[0] for row in rows])
    columns = list(rows[0][1])
    for text, (_, row) in zip(texts, rows, strict=True):
        if set(row) != set(columns):
            raise InputError(
                f"{field}, row {text!r}: it gives {', '.join(row)}, expected "
                f"{', '.join(columns)} as in the first row"
            )
    falls = np.flatnonzero(np.diff(temperatures) <= 0)
    if len(falls):
        raise InputError(
            f"{field}, row {texts[falls[0] + 1]!r}: its temperature is not above that of "
            "the row before, expected rows that rise in temperature"
        )
    values = {name: np.array([row[name] for _, row in rows], float) for name in columns}
    return PropertyTable(temperatures, values)


def _parse_row(text: str, field: str) -> tuple[float, dict[str, Any]]:
    """Temperature [K] and properties of one row."""
    head, colon, tail = text.partition(":")
    if not colon or not head.strip() or not tail.strip():
        raise InputError(
            f"{field}, row {text!r}: expected a temperature and its properties, such as "
            "'600 degC: E=180 GPa; nu=0.31; rho=8200 kg/m^3; expansion=1.4e-5 1/K'"
        )
    temperature = parse(head.strip(), "K", f"{field}, row {text!r}, temperature")
    if not temperature >= 0:
        raise InputError(f"{field}, row {text!r}: {temperature:g} K, expected at least 0 K")
    found: dict[str, Any] = {}
    for item in tail.split(";"):
        name, _, value = (part.strip() for part in item.partition("="))
        if name not in ROW_PROPERTIES:
            raise InputError(
                f"{field}, row {text!r}: '{name}' is no property of a "
                f"row{suggestion(name, ROW_PROPERTIES)}"
            )
        found[name] = convert_value(
            value, material_field(name)._replace(name=f"{field}, row {text!r}, {name}")
        )
    constants = found.get("orthotropic")
    if constants is not None and len(constants) != 9:
        raise InputError(
            f"{field}, row {text!r}: orthotropic has {len(constants)} values, expected 9"
        )
    return temperature, found


def material_field(name: str) -> Field:
    """The field of a material."""
    return field_at(f"material.blade.{name}")


def operating_temperature(scene: Scene) -> float:
    """The uniform temperature of the bodies [K], the mean of those of a file, or that of reference
    where none is given.
    """
    given = scene.temperature
    if given.file:
        return float(read_temperatures(given.file).values.mean())
    return given.reference if given.uniform is None else given.uniform


def operating_materials(scene: Scene) -> tuple[Material, Material]:
    """Blade and damper with the constants of their (mean) operating temperature."""
    temperature = operating_temperature(scene)
    blade = material_at(scene.material.blade, temperature)
    return blade, material_at(scene.material.damper, temperature)


def expands(material: Material) -> bool:
    """The thermal expansion of a material is known."""
    return (
        material.expansion is not None
        or expands_by_axes(material)
        or _has_row(material, "expansion")
    )


def expands_by_axes(material: Material) -> bool:
    """The thermal expansion of a material is that of its axes."""
    return material.expansion_axes is not None or _has_row(material, "expansion_axes")


def _has_row(material: Material, name: str) -> bool:
    return material.table is not None and name in property_table(material).values


def _inside(table: PropertyTable, temperature: RealArray, field: str) -> RealArray:
    low, high = table.temperatures[[0, -1]]
    slack = ROUNDING * high
    if temperature.size and (temperature.min() < low - slack or temperature.max() > high + slack):
        worst = temperature.min() if temperature.min() < low - slack else temperature.max()
        raise InputError(
            f"{field}: it has no properties at {worst:.6g} K, expected a temperature from "
            f"{low:.6g} to {high:.6g} K, as its rows have them"
        )
    return temperature
