"""Values against their limits, and the words of a message for those beyond: the number that is
named is rounded to the accepted side, so that a user who types it is not refused again.
"""

from __future__ import annotations

from .units import LIMIT_TOLERANCE, show_least, show_most


def unless_at_most(
    value: float,
    limit: float,
    unit: str = "m",
    digits: int = 6,
    tolerance: float = LIMIT_TOLERANCE,
) -> str:
    """What is expected of a value above its limit; empty where it keeps to it.

    Args:
        value: in SI units; NaN is above every limit.
        limit: in SI units.
        unit: SI unit of both.
        digits: of the number named.
        tolerance: share of the limit by which a value at it may pass it.

    >>> unless_at_most(0.022, 0.0213754), unless_at_most(0.0213754, 0.0213754)
    ('at most 21.3754 mm', '')
    """
    if value <= limit + tolerance * abs(limit):
        return ""
    return f"at most {show_most(limit, unit, digits)}"


def unless_at_least(
    value: float,
    limit: float,
    unit: str = "m",
    digits: int = 6,
    tolerance: float = LIMIT_TOLERANCE,
) -> str:
    """As :func:`unless_at_most`, of a value below its limit.

    >>> unless_at_least(0.001, 0.0012344321, digits=3)
    'at least 1.24 mm'
    """
    if value >= limit - tolerance * abs(limit):
        return ""
    return f"at least {show_least(limit, unit, digits)}"
