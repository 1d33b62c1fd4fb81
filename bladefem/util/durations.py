"""Estimated durations in words."""

from __future__ import annotations


def core_time(seconds: float) -> str:
    """About how long one core takes, in whole units: estimates know no more.

    >>> core_time(0.04), core_time(4.2), core_time(170), core_time(9000)
    ('less than 1 s', 'about 4 s', 'about 3 min', 'about 2 h')
    """
    if seconds < 0.95:
        return "less than 1 s"
    units = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))
    size, unit = next((one for one in units if seconds >= one[0]), units[-1])
    return f"about {round(seconds / size)} {unit}"
