"""Is the contact mesh of a plane seat fine enough? Error indicators cannot tell: their finest patch is that mesh."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..data import PressureMap

__all__ = ["FEW", "coarse_sentence"]

FEW = 16    # pressed nodes of a seat: 6 left an amplitude between stick and slip 37 % low, 11 19 %, 16 12 %, 21 5 %


def coarse_sentence(maps: Iterable[PressureMap]) -> str:
    """A warning where fewer than FEW nodes of a plane seat are pressed, else "".

    Args:
        maps: of the seats of a plane scene, under any loads.
    """
    pressed, nodes = min(((int(np.count_nonzero(m.force > 0)), len(m.force)) for m in maps), default=(FEW, FEW))
    if pressed >= FEW:
        return ""
    return (f"contact mesh: only {pressed} of {nodes} nodes of a seat are pressed; with fewer than {FEW} a resonance "
            "amplitude between stick and slip may be 10 to 40 % wrong, which the estimated errors do not contain; try "
            "a smaller mesh.contact_size")
