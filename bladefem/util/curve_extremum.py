"""Extrema of a curve from a few of its points: the parabola through three, the cubic through two
with their slopes, the tangents of two.

Places are measured from the point in the middle, or in shares of the way between two points.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

Numbers = TypeVar("Numbers", float, np.ndarray)


def parabola_at_middle(
    left: Numbers,
    right: Numbers,
    rise_left: Numbers,
    rise_right: Numbers,
) -> tuple[Numbers, Numbers]:
    """Slope and bend of the parabola  y = y_0 + slope x + bend x^2  through three points.

    Args:
        left, right: distances of the neighbours from the middle, positive.
        rise_left, rise_right: how much higher they are than the middle.
    """
    down = -rise_left / left
    up = rise_right / right
    width = left + right
    return (down * right + up * left) / width, (up - down) / width


def parabola_minimum(
    x: np.ndarray,
    y: np.ndarray,
) -> tuple[float, float] | None:
    """Place and height of the minimum of the parabola through three points (3,), x ascending; None
    where it has none.
    """
    slope, bend = parabola_at_middle(x[1] - x[0], x[2] - x[1], y[0] - y[1], y[2] - y[1])
    if not bend > 0:
        return None
    step = -slope / (2 * bend)
    return float(x[1] + step), float(y[1] + slope * step / 2)


def cubic_minimum(
    down: float,
    up: float,
    rise: float,
) -> tuple[float, float]:
    """Place in [0, 1] and height of the minimum of the cubic with slopes down < 0 <= up at the ends
    and this rise between them.
    """
    # down x + b x^2 + a x^3
    a = down + up - 2 * rise
    b = 3 * rise - 2 * down - up
    root = np.sqrt(max(b**2 - 3 * a * down, 0.0))
    share = float(np.clip(-down / (b + root), 0.0, 1.0)) if b + root > 0 else 0.5
    return share, share * (down + share * (b + share * a))


def tangents_meet(
    down: float,
    up: float,
    rise: float,
) -> tuple[float, float]:
    """Place and height at which the tangents with slopes down at 0 and up at 1 meet: a corner of
    the curve.
    """
    share = (rise - up) / (down - up)
    return share, share * down


def find_maxima(heights: np.ndarray) -> np.ndarray:
    """(.,) numbers of the points (p,) that are at least as high as both neighbours."""
    middle = heights[1:-1]
    return 1 + np.flatnonzero((middle >= heights[:-2]) & (middle >= heights[2:]))
