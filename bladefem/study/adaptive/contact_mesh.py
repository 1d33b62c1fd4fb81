"""Is the contact mesh fine enough? Error indicators cannot tell: their finest patch is that mesh.

What can be told from one mesh is how much its nodes matter: the resonance with half as many. On the
shipped wedge, with 48, 73 and 105 nodes on a seat, amplitudes between stick and slip are 249, 253,
250 um at 80 N and 363, 483, 453 um at 320 N; with 24 of the 48 they change by 9 % at either load.
So a large change is a warning, not an estimate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...data import PressureMap
from ...errors import NotSolvedError
from ...hbm.peak import find_peak
from ...hbm.solution import Solution
from ...hbm.solver.newton import Options
from ...hbm.sweep import size
from .family import Family, carried, member
from .settings import Settings

__all__ = ["FEW", "coarse_sentence", "halved_change", "halved_sentence"]

# pressed nodes of a seat: 6 left an amplitude between stick and slip 37 % low, 11 19 %, 16 12 %, 21
# 5 %
FEW = 16


def coarse_sentence(maps: Iterable[PressureMap]) -> str:
    """A warning where fewer than FEW nodes of a plane seat are pressed, else "".

    Args:
        maps: of the seats of a plane scene, under any loads.
    """
    pressed, nodes = min(
        ((int(np.count_nonzero(m.force > 0)), len(m.force)) for m in maps), default=(FEW, FEW)
    )
    if pressed >= FEW:
        return ""
    return (
        f"contact mesh: only {pressed} of {nodes} nodes of a seat are pressed; with fewer than "
        f"{FEW} a resonance "
        "amplitude between stick and slip may be 10 to 40 % wrong, which the estimated errors do "
        "not contain; try "
        "a smaller mesh.contact_size"
    )


def halved_change(family: Family, settings: Settings, top: Solution) -> float:
    """Relative change of a resonance amplitude with half as many contact points on each seat.

    NaN where that was not solved, and where no more than half of the nodes are used: then they were
    compared with all.

    Args:
        settings, top: of the resonance, and its highest point.
    """
    own = member(family, settings)
    half = len(own.groups) // 4
    if (settings.points is not None and settings.points <= half) or half < 1:
        return np.nan
    other = member(family, replace(settings, points=half))
    start = replace(top, w=carried(top.w, own, other, settings.harmonics))
    try:
        peak = find_peak(
            other.model,
            top.omega,
            settings.harmonics,
            settings.samples,
            near=start,
            tolerance=1e-2,
            options=Options(1e-6, frugal=True),
        )
    except NotSolvedError:
        return np.nan
    return abs(peak.height / size(top) - 1)


def halved_sentence(loads: Iterable[float], changes: Iterable[float], accuracy: float) -> str:
    """A warning where half as many contact points change resonance amplitudes by more than the
    accuracy, else "".
    """
    worst, load = max(
        ((c, load) for load, c in zip(loads, changes, strict=True) if np.isfinite(c)),
        default=(0.0, 0.0),
    )
    if worst <= accuracy:
        return ""
    return (
        "contact mesh: half as many contact points change the resonance amplitude by up to "
        f"{100 * worst:.2g} % "
        f"({load:g} N); the estimated errors do not contain what the mesh itself is wrong, a "
        "smaller "
        "mesh.contact_size tells"
    )
