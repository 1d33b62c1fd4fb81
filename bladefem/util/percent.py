"""Shares as text."""

from __future__ import annotations


def percent(share: float) -> str:
    """A share in percent, with two digits that are known and no power of ten.

    >>> percent(0.0345), percent(0.996), percent(1.63)
    ('3.5 %', '100 %', '160 %')
    """
    digits = f"{100 * share:.2g}"
    return f"{float(digits):.0f} %" if abs(float(digits)) >= 100 else f"{digits} %"
