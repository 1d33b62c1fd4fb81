"""The kinds of scenes: one file and one record for each. A new kind is added to the list below."""

from __future__ import annotations

from ...errors import InputError, suggestion
from . import hertz, imported, plane_blades, punch, wedge_sector, z_mass
from .record import Kind, load_function

__all__ = ["KINDS", "Kind", "kind_named", "load_function"]

KINDS: dict[str, Kind] = {
    module.KIND.name: module.KIND
    for module in (wedge_sector, plane_blades, z_mass, hertz, punch, imported)
}


def kind_named(name: str) -> Kind:
    """The record of a kind.

    Raises:
        InputError: there is none of that name; the sentence has the nearest one.
    """
    if name in KINDS:
        return KINDS[name]
    near = suggestion(str(name), KINDS)
    near = near if "did you mean" in near else ""
    raise InputError(f"kind = {name!r}: expected one of {', '.join(KINDS)}{near}")
