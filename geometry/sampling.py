"""Random parameter tables: anywhere in the documented ranges, or round the defaults. For tests and
design studies.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Table = TypeVar("Table", bound="DataclassInstance")


def sample_in_range(table: type[Table], rng: np.random.Generator) -> Table:
    """Every number anywhere in its range (evenly in its logarithm where the range is positive),
    words at random.
    """
    return table(**{f.name: _draw_value(f, rng) for f in dataclasses.fields(table)})


def sample_around(
    table: Table,
    rng: np.random.Generator,
    spread: float,
) -> Table:
    """Every number within a factor exp(+-spread) of the table's own, inside its range.

    A number that is zero moves by the share ``spread`` of the way to a random place in its range,
    half of the time.
    """
    return dataclasses.replace(
        table,
        **{
            f.name: _draw_nearby(getattr(table, f.name), f, rng, spread)
            for f in dataclasses.fields(table)
        },
    )


def _draw_value(field: Any, rng: np.random.Generator) -> Any:
    low, high, words = (field.metadata[key] for key in ("low", "high", "choices"))
    if words:
        return words[rng.integers(len(words))]
    if low is None or field.default is None:
        return field.default
    value = low * (high / low) ** rng.random() if low > 0 else low + (high - low) * rng.random()
    return round(value) if isinstance(field.default, int) else float(value)


def _draw_nearby(
    value: Any,
    field: Any,
    rng: np.random.Generator,
    spread: float,
) -> Any:
    low, high, words = (field.metadata[key] for key in ("low", "high", "choices"))
    if words or value is None or low is None:
        return _draw_value(field, rng)
    if value == 0:
        return float(spread * _draw_value(field, rng)) if rng.random() < 0.5 else 0.0
    moved = min(max(value * np.exp(rng.uniform(-spread, spread)), low), high)
    return round(moved) if isinstance(value, int) else float(moved)
