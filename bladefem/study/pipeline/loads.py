"""Forced responses for a list of damper loads, one curve a load."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...hbm.model import ReducedModel
from ...hbm.parallel import share_work
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off, moving_contacts, size
from ...scene.tables import Scene
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress
from ..adaptive.check_points import peak_of
from ..adaptive.checked_curve import CheckedCurve, checked_points, estimated_errors
from ..adaptive.family import Family, family_member
from ..adaptive.followed_settings import too_large_to_follow
from ..adaptive.settings import Settings
from ..stability.error_in_time import Marches
from ..stability.judged_resonance import JudgedResonance, judged_in_time, judged_resonance
from ..stability.lower_motion import LowerMotion, lower_motion
from ..stability.resonance_in_time import ResonanceInTime, resonance_in_time
from .assemble_model import LoadCase
from .best_load import BestLoad, studied_load
from .best_load_search import holding_load
from .body_mesh import SofterBody
from .curve import Curve
from .load_interval import LoadInterval, load_interval
from .shared_accuracy import curve_with_room

# number of loads when none are given
DEFAULT_LOADS = 8


class Search(NamedTuple):
    """A search for the best load of one damper."""

    find: Callable[[], BestLoad]
    # the case of any load [N] of that damper
    case_at: Callable[[float], LoadCase]


class StudiedLoads(NamedTuple):
    """Load cases of each mass by ascending load, the curve of each, and the best loads searched."""

    cases: list[LoadCase]
    curves: list[Curve]
    best: list[BestLoad]


def study_loads(
    cases: list[LoadCase],
    curve_at: Callable[[LoadCase], Curve],
    comm: Communicator | None = None,
    progress: Progress = without_progress,
    best: float = 0.0,
    searches: Sequence[Search] = (),
) -> StudiedLoads:
    """One response curve a load case, and the results of searches for the best load, shared over
    the ranks; every rank returns all of them.

    What takes longest comes first, and the next one goes to the rank that is free. A best load that
    is not among the cases is studied like them: a search compares balances, and whether the blade
    keeps to one of them is not known before it is judged.

    Args:
        curve_at: the response of a load case.
        progress: wraps the numbers of this rank's cases, as tqdm does, under a label.
        best: load with the smallest resonance [N]; 0 where it is not known.
        searches: they take as long as the response of a load below the best one.
    """
    given = {(case.load, case.mass) for case in cases}
    order = longest_first([case.load for case in cases], best)

    def shown(numbers: Iterable[int]) -> Iterable[int]:
        return progress(numbers, "forced responses", total=len(tasks), delay=0.0)

    def searched(search: Search) -> tuple[BestLoad, tuple[LoadCase, Curve] | None]:
        found = search.find()
        if found.reason or (studied_load(found), found.mass) in given:
            return found, None
        case = search.case_at(studied_load(found))
        return found, (case, curve_at(case))

    tasks: list[Callable[[], Any]] = [
        *(partial(searched, search) for search in searches),
        *(partial(curve_at, cases[i]) for i in order),
    ]
    done: list[Any] = share_work(lambda task: task(), tasks, comm, shown, on_demand=True)
    found = done[: len(searches)]
    given_curves = dict(zip(order, done[len(searches) :], strict=True))
    studied = StudiedLoads(
        cases, [given_curves[i] for i in range(len(cases))], [one for one, _ in found]
    )
    return in_order(studied, [added for _, added in found if added is not None])


def in_order(studied: StudiedLoads, added: Sequence[tuple[LoadCase, Curve]] = ()) -> StudiedLoads:
    """Studied loads with further ones, of each mass by ascending load."""
    masses = [case.mass for case in studied.cases]
    pairs = [*zip(studied.cases, studied.curves, strict=True), *added]
    pairs.sort(key=lambda pair: (masses.index(pair[0].mass), pair[0].load))
    return studied._replace(cases=[case for case, _ in pairs], curves=[curve for _, curve in pairs])


def best_curve(curves: Sequence[Curve], best: Sequence[BestLoad]) -> int:
    """Number of the curve that the report begins with: at the best load found, of the damper with
    the lowest resonance there; the one with the lowest resonance where none was found, or another
    load keeps the blade lower.
    """
    found = {(studied_load(b), b.mass) for b in best if not b.reason}
    there = [
        k
        for k, c in enumerate(curves)
        if (c.load, c.mass) in found and lower_studied(c, curves) is None
    ]
    return min(there or range(len(curves)), key=lambda k: curves[k].peak_amplitude)


def lower_studied(there: Curve, curves: Sequence[Curve]) -> Curve | None:
    """The curve of the same damper whose resonance is the lowest, where that is below another one
    by more than twice its estimated error; else None.

    A search compares balances; under its load the blade may keep to a far higher motion, and under
    others not.
    """
    lowest = min((c for c in curves if c.mass == there.mass), key=lambda c: c.peak_amplitude)
    error = np.inf if lowest.error is None else lowest.error
    sure = (1 + 2 * error) * lowest.peak_amplitude
    return lowest if sure < there.peak_amplitude else None


def longest_first(loads: Sequence[float], best: float = 0.0) -> list[int]:
    """Numbers of the loads [N] in the order in which they are solved: those below the best one,
    whose contacts slip and lift most, from there down, then the others upwards.

    Of the shipped wedge 36 N, half of the best load, take 7 s of CPU, 18 and 9 N 12 and 6 s, all
    heavier ones together 17 s.
    """
    below = sorted((i for i, load in enumerate(loads) if load < best), key=lambda i: -loads[i])
    above = sorted((i for i, load in enumerate(loads) if load >= best), key=lambda i: loads[i])
    return below + above


def curve_of(
    scene: Scene,
    case: LoadCase,
    family: Callable[[LoadCase], Family],
    settings: Settings,
    softer: SofterBody | None = None,
) -> Curve:
    """Sweep a band with points where the curve needs them, with settings that hold at its peak and
    on its flanks.

    Raises:
        NotSolvedError: no point converged.
    """
    models = family(case)
    marches = Marches(models)
    curve, unseen, room = curve_with_room(scene, case, models, softer, settings, marches)
    model = family_member(models, curve.settings).model
    heights = np.array([size(p) for p in curve.points])
    sought = _sought_in_time(scene, case, models, curve)
    judged = judged_resonance(marches, curve, replace(scene, accuracy=room), sought is not None)
    marks, top = judged.marks, judged.point
    estimated, in_time = estimated_errors(curve), None
    if not judged.march_replaces_balance and sought is None:
        curve, estimated, in_time = judged_in_time(scene, marches, curve, judged)
    tolerated = scene.accuracy * size(top) / np.maximum(heights, 1e-6 * size(top))
    lifts = any(lifts_off(p) for p in curve.points if p.converged)
    return Curve(
        load=case.load,
        mass=case.mass,
        settings=curve.settings,
        **_columns(curve.points),
        estimated=estimated,
        tolerated=tolerated,
        checked=checked_points(curve),
        stability=marks.verdict,
        multiplier=marks.multiplier,
        peak=top,
        bifurcation=marks.bifurcation,
        unstable_peak=judged.unstable_peak(curve),
        march_at_peak=judged.march,
        march_replaces_balance=judged.march_replaces_balance,
        flank_rise=judged.flank_rise,
        flank_march_failure=judged.flank_march_failure,
        strong_drive_skipped=judged.strong_drive_skipped,
        lower=_lower_motion(scene, models, curve, judged, sought),
        error_march=in_time,
        resonance_by_march=sought,
        interval=_interval_of(scene, model, curve, top),
        folds_not_followed=lifts and too_large_to_follow(models, curve.settings),
        notes=curve.notes,
        halved=unseen.halved,
        body_mesh=unseen.body_mesh,
        # a march that seeks the resonance has the law itself
        layer_law=np.nan if sought is not None and sought.by_law else unseen.layer_law,
        layer_shift=unseen.layer_shift,
        layer_height=unseen.layer_height,
    )


def _lower_motion(
    scene: Scene,
    models: Family,
    curve: CheckedCurve,
    judged: JudgedResonance,
    sought: ResonanceInTime | None,
) -> LowerMotion | None:
    """A lower motion at the resonance that is given, where stability is asked for."""
    if not scene.study.stability:
        return None
    given = judged.amplitude if sought is None else sought.highest
    frequency = judged.point.frequency if sought is None else sought.frequency
    return lower_motion(models, curve.settings, judged.point, given, frequency)


def _interval_of(
    scene: Scene, model: ReducedModel, curve: CheckedCurve, top: Solution
) -> LoadInterval | None:
    """The amplitudes over all admissible friction forces, where the scene asks for them."""
    if not scene.study.interval:
        return None
    return load_interval(model, curve.settings, top, scene.accuracy, len(curve.points))


def _sought_in_time(
    scene: Scene, case: LoadCase, models: Family, curve: CheckedCurve
) -> ResonanceInTime | None:
    """The resonance by marches, where most contacts lift off and balances do not tell it to the
    accuracy.
    """
    top = peak_of(curve.points)
    error = curve.settings.error
    if not scene.study.stability or error is None or error <= scene.accuracy:
        return None
    if curve.settings.softened or not mostly_lifts_off(top):
        return None
    found = resonance_in_time(models, curve.settings, top, case.decay)
    # what the law changes is then given by the balances, if it is
    return found or resonance_in_time(models, curve.settings, top)


def _columns(points: Sequence[Solution]) -> dict[str, np.ndarray]:
    """Columns of a curve, one value a point."""
    rows = [_record(point) for point in points]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _record(p: Solution) -> dict[str, Any]:
    """The columns of a curve at one point."""
    return {
        "frequency": p.frequency,
        "amplitude": size(p),
        "first": p.probe[1, 0],
        "converged": p.converged,
        "method": p.method,
        "route": p.route,
        "residual": p.residual,
        "iterations": p.iterations,
        "slipping": moving_contacts(p),
        "drift": p.drift,
        "dissipated": p.work.dissipated,
        "imbalance": p.work.imbalance,
        "branch": p.branch,
    }


def default_loads(scene: Scene) -> tuple[float, ...]:
    """Loads when none are given: from that under which friction can hold the excitation, over two
    and a half decades.
    """
    least = holding_load(scene)
    return tuple(float(f"{x:.2g}") for x in np.geomspace(least, 300 * least, DEFAULT_LOADS))
