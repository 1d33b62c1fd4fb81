"""One accuracy for all that an amplitude is wrong by: what balances do not show of it, such as the
mesh, leaves the rest to them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import NotSolvedError
from ...hbm.solution import Solution, mostly_lifts_off
from ...scene.tables import Scene
from ..adaptive.check_points import peak_of
from ..adaptive.checked_curve import CheckedCurve
from ..adaptive.contact_mesh import halved_change
from ..adaptive.family import Family, family_member
from ..adaptive.layer_change import layer_change
from ..adaptive.peak_errors import MANY_HARMONICS
from ..adaptive.resonance_curve import resonance_curve
from ..adaptive.settings import Settings, restarted_settings
from ..adaptive.stiff_layer import stiff_layer_change
from ..stability.error_in_time import Marches
from .assemble_model import LoadCase
from .body_mesh import SofterBody, softened_change
from .liftoff import naming_the_load

# of the accuracy: less is not left to a balance, since what else is wrong then is what counts. A
# STEP blade under 50 N, whose mesh takes 4.8 of 5 %, went to 31 harmonics for the rest, in 20 s
LEAST_ROOM = 0.25


@dataclass(frozen=True)
class UnseenErrors:
    """Relative changes of a resonance amplitude that richer balances do not show; NaN: not
    estimated.
    """

    # with half of the seats' nodes as contact points
    halved: float = np.nan
    # by the estimated error of the body's mesh
    body_mesh: float = np.nan
    # with the layer's law in place of its tangent, or a stiff layer in place of a softer one
    layer_law: float = np.nan
    # of the frequency, with a stiff layer in place of a softer one, and of the amplitude where the
    # stiff one was reached
    layer_shift: float = np.nan
    layer_height: float = np.nan

    @property
    def total(self) -> float:
        """Sum of the errors of the amplitude that are known."""
        return float(np.nansum([self.halved, self.body_mesh, self.layer_law]))


def curve_with_room(
    scene: Scene,
    case: LoadCase,
    models: Family,
    softer: SofterBody | None,
    settings: Settings,
    marches: Marches,
) -> tuple[CheckedCurve, UnseenErrors, float]:
    """The curve of a load case, what balances do not show of its error, and the accuracy that this
    leaves to them.

    Where the curve's own error is beyond what is left, it is made again with that: harmonics,
    contact points and meshes keep the accuracy together. The error of a STEP blade under its best
    load is 4.7 % so, where 6.5 % were left, 3.4 % of them by the mesh. It has MANY_HARMONICS then,
    or as many as before, at most: on a flat top that more of them tilt, 31 took 94 s of CPU for
    4.3 % of error (shipped wedge, 69.73 N) where 15 take 10 s under 69.7 N.

    Args:
        softer: the body less the error of its stiffness.
        settings: modes and damper model to keep.

    Raises:
        NotSolvedError: no point converged.
    """

    def solved(accuracy: float, most: int) -> tuple[CheckedCurve, UnseenErrors]:
        march = marches if scene.study.stability else None
        start = replace(restarted_settings(settings), most=min(settings.most, most))
        mode = scene.excitation.mode
        # the modes were chosen with the reduction
        curve = resonance_curve(
            models, start, scene.study.band, mode, accuracy, march, fixed=("modes",)
        )
        curve = replace(curve, settings=replace(curve.settings, most=settings.most))
        # at a maximum: from a point beside it other models find the maximum
        top = peak_of(curve.points)
        return curve, unseen_errors(scene, case, models, softer, curve.settings, top)

    model = family_member(models, settings).model
    excited = scene.excitation
    with naming_the_load(case, model, excited.mode, excited.force, scene.study.band):
        curve, unseen = solved(scene.accuracy, settings.most)
    room = room_of_balance(scene.accuracy, unseen, peak_of(curve.points))
    if room < (curve.settings.error or 0.0) <= scene.accuracy:
        try:
            curve, unseen = solved(room, max(MANY_HARMONICS, curve.settings.harmonics))
        except NotSolvedError:
            # richer models of the peak are not solved: its error is reported
            pass
    return curve, unseen, room


def room_of_balance(accuracy: float, unseen: UnseenErrors, top: Solution) -> float:
    """The accuracy less what balances do not show of the error; all of it where that is not known,
    or leaves less than LEAST_ROOM of it, and where most contacts lift off, since no balance is that
    accurate there.

    Args:
        top: the resonance.
    """
    left = accuracy - unseen.total
    return accuracy if mostly_lifts_off(top) or not left >= LEAST_ROOM * accuracy else left


def unseen_errors(
    scene: Scene,
    case: LoadCase,
    models: Family,
    softer: SofterBody | None,
    settings: Settings,
    top: Solution,
) -> UnseenErrors:
    """What richer balances do not show of the error of a resonance.

    Args:
        settings, top: of the resonance, and its highest point.
    """
    # Nothing is gained by parts of an error that is unknown as a whole. A march may tell it later,
    # but with the tangent of the layer: where the balance is not followed to more harmonics it is
    # not followed to the law either (ground faces, 36 N: 233 um, which a march with the law leaves)
    if settings.error is not None and not np.isfinite(settings.error):
        stiffens = case.decay is not None and bool(np.isfinite(case.decay).any())
        return UnseenErrors(layer_law=np.inf if stiffens else np.nan)
    if settings.softened:
        change = stiff_layer_change(models, settings, top, scene.accuracy)
        layer, shift, height = change.error, change.frequency, change.height
    else:
        layer, shift, height = layer_change(models, settings, top, case.decay), np.nan, np.nan
    return UnseenErrors(
        np.nan if scene.contact.points else halved_change(models, settings, top),
        np.nan
        if softer is None
        else softened_change(softer, models, case, settings, top, scene.excitation.mode),
        layer,
        shift,
        height,
    )
