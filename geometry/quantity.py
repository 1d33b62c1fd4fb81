"""A dataclass field that knows its unit, its range and its meaning: what help texts, checks and
tables are made of.
"""

from __future__ import annotations

import dataclasses
from typing import Any


def quantity(
    default: Any = dataclasses.MISSING,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    help: str = "",
    choices: tuple[str, ...] = (),
) -> Any:
    """A dataclass field with physical meaning.

    Args:
        default: value in SI units; ``None`` for "chosen automatically"; left out for a field that
            must be given.
        unit: SI unit ("m", "Pa", "rad", "rad/s", "kg/m^3", "N", "Hz", "1" or "" for a plain
            number).
        low, high: closed range of accepted values, in SI.
        help: one line for ``--help``, the resolved table and the documentation.
        choices: accepted words of a text field.
    """
    meta = {"unit": unit, "low": low, "high": high, "help": help, "choices": choices}
    return dataclasses.field(default=default, metadata=meta)


def describe_fields(table: type) -> list[dict[str, Any]]:
    """One row a field of a dataclass: name, unit, default, range, help, choices (for tables and
    help texts).
    """
    return [{"name": f.name, "default": f.default, **f.metadata} for f in dataclasses.fields(table)]
