"""The length unit of a STEP file."""

from __future__ import annotations

import re

SI_PREFIXES = {
    "": 1.0,
    "MILLI": 1e-3,
    "CENTI": 1e-2,
    "DECI": 0.1,
    "MICRO": 1e-6,
    "KILO": 1e3,
}
# [m], where the file states none
USUAL_UNIT = 1e-3
_LENGTH_RECORD = re.compile(r"#(\d+)\s*=\s*\(([^;]*LENGTH_UNIT[^;]*)\)\s*;")
_METRES = re.compile(r"SI_UNIT\s*\(\s*(?:\$|\.(\w+)\.)\s*,\s*\.METRE\.")
_CONVERTED = re.compile(r"CONVERSION_BASED_UNIT\s*\([^,]*,\s*#(\d+)")
_CONTEXT = re.compile(r"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")


def file_unit(text: str) -> float:
    """Length unit [m] that a STEP file states for its shapes; millimetre when it states none.

    A unit such as the inch is so many of another, which is in the file as well.
    """
    units = dict(_LENGTH_RECORD.findall(text))
    assigned = [n for part in _CONTEXT.findall(text) for n in re.findall(r"#(\d+)", part)]
    own = next((n for n in assigned if n in units), next(iter(units), ""))
    record = units.get(own, "")
    converted = _CONVERTED.search(record)
    if converted is None:
        return _metres(record)
    measure = re.search(
        rf"#{converted[1]}\s*=[^;]*?LENGTH_MEASURE\s*\(\s*([-+.\dEe]+)\s*\)\s*,\s*#(\d+)", text
    )
    return USUAL_UNIT if measure is None else float(measure[1]) * _metres(units.get(measure[2], ""))


def _metres(record: str) -> float:
    """A unit of the SI [m]."""
    found = _METRES.search(record)
    return SI_PREFIXES.get(found[1] or "", USUAL_UNIT) if found else USUAL_UNIT
