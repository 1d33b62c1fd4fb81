"""Is the contact mesh fine enough? The indicators of the balance cannot tell: their finest patch is
that mesh.

What one mesh shows is how much its nodes matter: the resonance with half as many. With
one interface law that change is an estimate of the mesh's own error and counts in the reported one,
also of balances with few of the nodes as contact points, as far as these are not judged by more:
on the shipped wedge half the points change amplitudes by 0.2 to 0.7 %, and grids of 4 x 6, 8 x 6
and 12 x 8 elements give 164.0, 163.4 and 162.0 um at 80 N. Between rigid faces it is not enough,
since few nodes press: hence ``coarse_sentence``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...data import PressureMap
from ...hbm.solution import Solution, size
from .changed_peak import changed_peak
from .family import Family, carried_displacements, family_member
from .peak_errors import MORE_POINTS
from .settings import Settings

# pressed nodes of a seat: 6 left an amplitude between stick and slip 37 % low, 11 19 %, 16 12 %, 21
# 5 %
MIN_NODES = 16
# relative, of the height with half as many points
PEAK_TOLERANCE = 1e-2


def coarse_sentence(maps: Iterable[PressureMap]) -> str:
    """A warning where fewer than MIN_NODES nodes of a plane seat, and not all, are pressed, else
    "".

    Args:
        maps: of the seats of a plane scene, under any loads.
    """
    pressed, nodes = min(
        ((int(np.count_nonzero(m.force > 0)), len(m.force)) for m in maps),
        default=(MIN_NODES, MIN_NODES),
    )
    # a seat that presses everywhere has no narrow contact to resolve
    if pressed >= MIN_NODES or pressed == nodes:
        return ""
    return (
        f"contact mesh: only {pressed} of {nodes} nodes of a seat are pressed; with fewer than "
        f"{MIN_NODES} a resonance amplitude between stick and slip may be 10 to 40 % wrong, which "
        "the "
        "estimated errors do not contain; try a smaller mesh.contact_size"
    )


def halved_change(
    family: Family,
    settings: Settings,
    top: Solution,
) -> float:
    """Relative change of a resonance amplitude with half of the nodes of each seat.

    Where no more than half of the nodes are contact points, that with half of these, in proportion
    to the size of a node's part of the seat: with C / n for n of them, all N leave C / N, and of p
    points half change C / p. NaN where that was not solved, and where MORE_POINTS times the points
    are no more than the nodes: these judge the points then, and what all nodes leave is small
    beside that.

    Args:
        settings, top: of the resonance, and its highest point.
    """
    own = family_member(family, settings)
    # two seats
    nodes = len(own.groups) // 2
    used = nodes if settings.points is None else min(settings.points, nodes)
    few = used <= nodes // 2
    half = (used if few else nodes) // 2
    if half < 1 or (few and MORE_POINTS * used <= nodes):
        return np.nan
    other = family_member(family, replace(settings, points=half))
    start = replace(top, w=carried_displacements(top.w, own, other, settings.harmonics))
    peak = changed_peak(other.model, settings, start, top.omega, PEAK_TOLERANCE)
    if peak is None:
        return np.nan
    share = used / nodes if few else 1.0
    return share * abs(peak.height / size(top) - 1)
