"""Which nodal diameter of a wheel an engine order excites."""

from __future__ import annotations

from typing import TypeVar

from .arrays import IntegerArray

Order = TypeVar("Order", int, IntegerArray)


def excited_diameter(order: Order, sectors: int) -> Order:
    """Nodal diameter 0..N/2 of a wheel of N sectors that an engine order excites: its distance from
    a multiple of N; or those of several.

    >>> [excited_diameter(order, 36) for order in (9, 18, 27, 40)], excited_diameter(3, 5)
    ([9, 18, 9, 4], 2)
    """
    half = sectors // 2
    return abs((order + half) % sectors - half)
