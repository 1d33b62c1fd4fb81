"""The resonance of a changed model, looked for where that of the model before it was: the change of
its height is an estimate of an error.
"""

from __future__ import annotations

from dataclasses import replace

from ...errors import NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.peak import Peak, find_peak
from ...hbm.solution import Solution
from ...hbm.solver.newton import Options
from .settings import Settings

# an estimate needs no more than this, and no way out that costs much
CHANGED_OPTIONS = Options(1e-6, frugal=True)


def changed_peak(
    model: ReducedModel,
    settings: Settings,
    near: Solution,
    omega: float,
    tolerance: float,
    fallbacks: bool = True,
) -> Peak | None:
    """The resonance of a model with the settings of another one; None where it was not solved.

    Args:
        near: motion at the other's resonance, on the contacts of this model.
        omega: where the search begins [rad/s].
        tolerance: relative, of the height.
        fallbacks: whether more is tried where Newton's method fails.
    """
    try:
        return find_peak(
            model,
            omega,
            settings.harmonics,
            settings.samples,
            near=near,
            tolerance=tolerance,
            options=replace(CHANGED_OPTIONS, fallbacks=fallbacks),
        )
    except NotSolvedError:
        return None
