"""Shares as text."""

from __future__ import annotations

from decimal import Decimal
from math import isfinite


def percent(share: float) -> str:
    """A share in percent, with two digits that are known and no power of ten.

    >>> percent(0.0345), percent(0.996), percent(1.63), percent(3.5e-7)
    ('3.5 %', '100 %', '160 %', '0.000035 %')
    """
    digits = f"{100 * share:.2g}"
    return f"{Decimal(digits):f} %" if isfinite(share) else f"{digits} %"
