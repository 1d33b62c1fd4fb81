"""Where the search for the lowest peak looks next: inside a bracket of the minimum."""

from __future__ import annotations

import numpy as np

from ..util.curve_extremum import cubic_minimum, tangents_meet
from .peak import Peak
from .peak_levels import PeakSearch

# ratio of the heights at the ends of a bracket beyond which it is halved: a cubic between 1649 um
# and 171 um, from one branch of a design chart to the other, hides a minimum or makes one up
MAX_HEIGHT_RATIO = 6.0


def bracket_minimum(tried: list[Peak]) -> tuple[Peak | None, Peak | None]:
    """The lowest height tried and its neighbour downhill, which is no lower: a minimum lies
    between; None at an end.
    """
    best = min(tried, key=lambda peak: peak.height)
    if best.slope < 0:
        return best, min(
            (p for p in tried if p.value > best.value), key=lambda p: p.value, default=None
        )
    return max(
        (p for p in tried if p.value < best.value), key=lambda p: p.value, default=None
    ), best


def next_value(
    search: PeakSearch,
    low: Peak,
    high: Peak,
    tangents: bool,
) -> tuple[float, float]:
    """The next value inside a bracket, and the most that could still be gained, relative to its
    lower end.

    The cubic sees smooth minima, the tangents corners, where two peaks exchange their order; of two
    minima in a bracket neither can be trusted, nor either curve between very different heights, nor
    where the tangents do not meet inside, since the height then bends down between the ends: the
    bracket is halved then.
    """
    width = search.width(low.value, high.value)
    down = low.slope * width
    up = high.slope * width
    rise = high.height - low.height
    unlike = max(low.height, high.height) > MAX_HEIGHT_RATIO * min(low.height, high.height)
    if unlike or not down < 0 <= up:
        return search.moved(low.value, width / 2), np.inf
    meet, corner = tangents_meet(down, up, rise)
    if not 0 < meet < 1:
        # most that the slope at the lower end can gain
        fall = -down if rise >= 0 else up
        return search.moved(low.value, width / 2), fall / min(low.height, high.height)
    smooth, bottom = cubic_minimum(down, up, rise)
    floor = low.height + min(bottom, corner)
    share = meet if tangents else smooth
    return (
        search.moved(low.value, float(np.clip(share, 0.05, 0.95)) * width),
        float(1 - floor / min(low.height, high.height)),
    )
