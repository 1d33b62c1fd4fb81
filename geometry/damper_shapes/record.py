"""What a damper shape is made of: the outline of its cross-section between two plane flanks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# (flanks, base) -> corners. Flanks (2, 2, 2) [m]: this blade's and the next one's, their inner and
# outer end, as (radial, across), across = 0 midway between the blades and negative on this one's
# side. The corners (n, 2) [m] in the same axes start on this blade's side and go outwards; each
# flank has to be one of the outline's sides. ``base`` is the field damper.base [m].
Outline = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class DamperShape:
    """One shape of damper, a prism along the engine axis."""

    # as scenes write it
    name: str
    outline: Outline
