"""What of the material's endurance the drawn wheels use: the tuned wheel's utilisation times the
amplification of their highest blades.

The utilisation is proportional to the motion, since mean stresses are those of rotation. That the
highest blade moves in the tuned wheel's shape is an assumption: its neighbours move less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...wheel.statistics import WHEEL_SHARE, Amplification, Quantile
from ..pipeline.run_records import SolvedRun
from ..pipeline.utilisation import highest_use, run_utilisation


@dataclass(frozen=True)
class ScatteredUse:
    """Under one load whose tuned resonance has a known stress."""

    # [N]
    load: float
    # utilisation of the tuned wheel
    tuned: float
    # utilisation of the highest blade that WHEEL_SHARE of the wheels stay below, with the interval
    # that the number of wheels leaves, and what checked wheels are off the law of one damper
    share: Quantile
    # upper end of that interval with the upper ends of the errors of mesh and loading history
    # (contact tractions); infinite with too few wheels
    highest: float

    @property
    def margin(self) -> float:
        """Times that the alternating stress could grow until the limit; NaN with too few wheels."""
        if np.isinf(self.highest):
            return np.nan
        return 1 / self.highest if self.highest > 0 else np.inf


def scattered_use(run: SolvedRun, found: Amplification) -> list[ScatteredUse]:
    """The utilisation with scatter, one a load whose amplification is known; empty where the scene
    gives no diagram.

    Raises:
        InputError: the diagram does not reach a mean stress of the blade.
    """
    rows = []
    for number, used in run_utilisation(run).items():
        load = run.response.curves[number].load
        tuned = float(used.used[used.worst])
        # an amplification that is not known leaves that of the stress unknown too
        places = [i for i, one in enumerate(found.loads) if one == load and found.is_known[i]]
        for i in places:
            factor = found.quantile(i, WHEEL_SHARE)
            share = Quantile(*(tuned * one for one in (factor.value, factor.low, factor.high)))
            highest = highest_use(run, number, used) * factor.high
            rows.append(ScatteredUse(load, tuned, share, highest))
    return rows
