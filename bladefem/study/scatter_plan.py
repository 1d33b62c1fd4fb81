"""Scatter of inputs: which values to run, spread evenly over given ranges by a Halton sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..scene.fields import convert_value, field_at, split_values
from ..scene.units import show_exactly

MOST_SAMPLES = 1000


@dataclass(frozen=True)
class Range:
    """A field and the ends between which it scatters, SI."""

    name: str
    low: float
    high: float
    unit: str


def read_ranges(texts: Sequence[str]) -> list[Range]:
    """Ranges from texts such as "contact.mu=0.2, 0.4" or "operation.damping=0.05, 0.2 %".

    Raises:
        InputError: no such field, not a single number, or not two ascending ends.
    """
    return [_read_range(text) for text in texts]


def _read_range(text: str) -> Range:
    name, equals, ends = (part.strip() for part in text.partition("="))
    values = split_values(ends)
    if not equals or len(values) != 2:
        raise InputError(f"--scatter {text}: expected key=low, high, such as contact.mu='0.2, 0.4'")
    field = field_at(name)
    low, high = (convert_value(value, field) for value in values)
    numbers = all(isinstance(end, float) for end in (low, high))
    if not numbers:
        raise InputError(f"--scatter {text}: {name} is not a single real number, expected one")
    if not low < high:
        raise InputError(f"--scatter {text}: expected the lower end first")
    return Range(name, low, high, field.meta.get("unit") or "1")


def halton_values(ranges: Sequence[Range], count: int) -> list[tuple[str, ...]]:
    """Texts of the values of each sample, uniform in each range.

    Args:
        ranges: fields and their ends.
        count: number of samples.

    Raises:
        InputError: too few or too many samples.

    >>> halton_values([Range("contact.mu", 0.2, 0.4, "1")], 2)
    [('0.3',), ('0.25',)]
    """
    from scipy.stats import qmc

    if not 2 <= count <= MOST_SAMPLES:
        raise InputError(f"--samples {count}: expected 2 to {MOST_SAMPLES}")
    low = np.array([one.low for one in ranges])
    high = np.array([one.high for one in ranges])
    # not scrambled: the same samples each time, and those of fewer are the first of more
    halton = qmc.Halton(len(ranges), scramble=False)
    # the first point is the corner of all lower ends
    halton.fast_forward(1)
    drawn = halton.random(count)
    values = low + drawn * (high - low)
    return [
        tuple(_rounded(value, one) for value, one in zip(row, ranges, strict=True))
        for row in values
    ]


def _rounded(value: float, one: Range) -> str:
    """Six digits: names of folders are made from it."""
    return show_exactly(float(f"{value:.6g}"), one.unit)
