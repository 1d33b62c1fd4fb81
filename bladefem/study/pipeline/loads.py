"""Forced responses for a list of damper loads, and the design curve: resonance amplitude against
load.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ...hbm.history_interval import POINT
from ...hbm.model import ReducedModel
from ...hbm.parallel import share_work
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off, moving_contacts, size
from ...scene.tables import Scene
from ...util.arrays import BooleanArray, ComplexArray, IntegerArray, RealArray
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress
from ..adaptive.check_points import peak_of
from ..adaptive.choice import Checked, checked_points, estimated_errors
from ..adaptive.family import Family, family_member
from ..adaptive.resonance_curve import too_large_to_follow
from ..adaptive.settings import Settings
from .assemble_model import LoadCase
from .best_load import BestLoad, holding_load, studied_load
from .body_mesh import SofterBody
from .error_in_time import Marches
from .judged_resonance import judged_in_time, judged_resonance
from .kept_band import KeptBand
from .linear_limits import Limit
from .load_interval import LoadInterval, load_interval
from .resonance_in_time import ResonanceInTime, resonance_in_time
from .shared_accuracy import curve_with_room

Keep: TypeAlias = "Callable[[LoadCase, Callable[[], Curve]], Curve]"
# a best load, and the case of any load [N] of that damper
Search: TypeAlias = "Callable[[], tuple[BestLoad, Callable[[float], LoadCase]]]"
# of how far a march with fewer contact points leads from a balance: what it may have too much. On
# the shipped wedge with ground faces, 1100 N, 536 um with 16 points a seat, they keep 517 um, eight
# keep some 460 and four some 480 of it
DOUBT_OF_FEWER_POINTS = 0.5
# number of loads when none are given
DEFAULT_LOADS = 8
# friction work over that of the excitation below which it is rounding
ROUNDED_WORK = 1e-9


def compute_without_keeping(case: LoadCase, compute: Callable[[], Curve]) -> Curve:
    """The keeper that keeps nothing."""
    return compute()


@dataclass(frozen=True)
class Curve:
    """A frequency response; points in ascending frequency, unconverged ones included and marked."""

    # [N]
    load: float
    # of the damper [kg]; as meshed when None
    mass: float | None
    # with the estimated error at the resonance
    settings: Settings
    # (k,) [Hz]
    frequency: RealArray
    # (k,) root of the sum of squares of the harmonics at the probe [m]
    amplitude: RealArray
    # (k,) complex first harmonic at the probe [m]
    first: ComplexArray
    # (k,) bool
    converged: BooleanArray
    # (k,) text
    method: np.ndarray
    # (k,) text: the way of `bladefem.hbm.policy` that ran
    route: np.ndarray
    # (k,) relative residual of the balance
    residual: RealArray
    # (k,)
    iterations: IntegerArray
    # (k,) number of elements that slip or lift off in a period
    slipping: IntegerArray
    # (k,) how fast the damper walks where friction alone does not hold it [m/s]
    drift: RealArray
    # (k,) friction work a period [J]
    dissipated: RealArray
    # (k,) |work put in - work lost| over work put in
    imbalance: RealArray
    # (k,) number of the monotone piece of the response; 0 where one motion was looked for
    branch: IntegerArray
    # (k,) estimated relative error of the first harmonic
    estimated: RealArray
    # (k,) the same as wanted: the scene's accuracy times peak over amplitude
    tolerated: RealArray
    # (k,) bool: estimated at this very point; else between its neighbours
    checked: BooleanArray
    # (k,) "unique", "stable", "unstable", "unknown", or "" where it was not asked for
    stability: np.ndarray
    # (k,) largest modulus of the Floquet multipliers; NaN where not computed
    multiplier: RealArray
    # relative change of the peak's height with half as many contact points; NaN: unknown
    halved: float
    # the highest converged point that is not unstable, or that is left for a motion whose amplitude
    # is its own within the accuracy, or for one that is not known
    peak: Solution
    # (k,) "fold", "period doubling" or "torus" of unstable points, else ""
    bifurcation: np.ndarray
    # the highest converged point where that one is unstable, else None
    unstable_peak: Solution | None = None
    # what the blade does in time at that one, or at the resonance where that is another unstable
    # point, or one whose verdict is in doubt; None where both are stable
    kept: KeptBand | None = None
    # the resonance given is unstable, and a march from it keeps to amplitudes farther off than the
    # accuracy, or higher than at the resonance: the highest of these is given in place of that of
    # the balance
    marched_instead: bool = False
    # relative rise above the resonance by marches from unstable motions beside it
    beside: float = 0.0
    # why not all of these marches are known; else ""
    unmarched: str = ""
    # contacts lift off, and marches after a strong drive take too long: a higher motion may exist
    undriven: bool = False
    # a march from the resonance that its estimated error was taken from; None where richer balances
    # tell it
    in_time: KeptBand | None = None
    # the resonance that marches from frequency to frequency found where balances do not tell it:
    # its highest amplitude is given
    sought: ResonanceInTime | None = None
    # range of the resonance over loading histories; None where it was not asked for
    interval: LoadInterval | None = None
    # contacts lift off and the balance is too large for following its motions round folds: a
    # higher motion may exist
    unfollowed: bool = False
    # what the sweep could not do, in sentences
    notes: tuple[str, ...] = ()
    # relative change of the peak's height by the estimated error of the body's mesh; NaN: not
    # estimated
    body_mesh: float = np.nan
    # relative change of the peak's height with the layer's law in place of its tangent, or what is
    # not known of that from a softer layer to the stiff one that it stands for; NaN: not estimated
    layer_law: float = np.nan
    # relative change of the peak's frequency from that softer layer to the stiff one; NaN: none
    # stands for another, or it is not known
    layer_shift: float = np.nan
    # the same of its height, where the stiff one was reached: the resonance given is then that of
    # the stiff layer
    layer_height: float = np.nan

    @property
    def error(self) -> float | None:
        """Estimated relative error of the resonance amplitude: that of the balance, what half as
        many contact points change (the contact mesh), the body's mesh, and the tangent of a layer
        that stiffens; None where it was not asked for.

        A march from an unstable resonance tells the error of its balance as well; one that ends
        above a resonance elsewhere adds to it, and so does the width of one that is given itself,
        and one beside the resonance that rises above it.
        A resonance sought in time has an error of its own in place of the balance's.
        """
        if self.settings.error is None:
            return None
        balance = self.settings.error
        same = self.is_marched_from and not self.marched_instead
        balance = max(balance, self.marched) if same else balance + self.marched
        contact_mesh = self.halved if np.isfinite(self.halved) else 0.0
        if self.sought is not None:
            balance, contact_mesh = self.sought.error, 0.0
        body_mesh = 0.0 if np.isnan(self.body_mesh) else self.body_mesh
        layer_law = 0.0 if np.isnan(self.layer_law) else self.layer_law
        return balance + self.beside + contact_mesh + body_mesh + layer_law

    @property
    def marched(self) -> float:
        """How far from the resonance given the blade was marched where the highest motion is
        unstable or in doubt, relative to that resonance: to either side of it where it is that
        motion, above it where it is another. Nothing where a march from there is its error anyway;
        the relative width of the band where its upper end is given, and a share of how far it is
        from the balance where the march had fewer contact points. Without a known march from an
        unstable resonance, infinite.
        """
        if self.kept is None:
            return 0.0
        if self.kept.reason:
            return np.inf if self.keeps_unstable and self.in_time is None else 0.0
        if self.marched_instead:
            return 1 - self.kept.lowest / self.kept.highest + _doubt_of_march(self, self.kept)
        if self.is_marched_from:
            ends = (self.kept.lowest, self.kept.highest)
            beside = max(abs(end / self.curve_amplitude - 1) for end in ends)
            return 0.0 if self.in_time is not None else beside
        return max(0.0, self.kept.highest / self.curve_amplitude - 1)

    @property
    def is_marched_from(self) -> bool:
        """The march, if there is one, begins at the resonance given, unstable or in doubt."""
        return self.keeps_unstable or self.unstable_peak is None

    @property
    def keeps_unstable(self) -> bool:
        """The highest motion is unstable, and given as the resonance all the same.

        Compared by value: a curve that was read from the run folder has copies.
        """
        top = self.unstable_peak
        return top is not None and (top.omega, size(top)) == (self.peak.omega, size(self.peak))

    @property
    def peak_frequency(self) -> float:
        """[Hz]"""
        if self.reaches_layer:
            return (1 + self.layer_shift) * self.peak.frequency
        return self.peak.frequency if self.sought is None else self.sought.frequency

    @property
    def peak_amplitude(self) -> float:
        """That of the curve, or that of the stiff layer that its softer one stands for [m]."""
        return self.layer_factor * self.curve_amplitude

    @property
    def layer_factor(self) -> float:
        """The resonance amplitude of the stiff layer over that of the softer one of the curve; 1
        where the curve is that of the layer itself.
        """
        return 1 + self.layer_height if self.reaches_layer else 1.0

    @property
    def reaches_layer(self) -> bool:
        """The curve is that of a softer layer, and the resonance given that of the stiff one."""
        return bool(np.isfinite(self.layer_height))

    @property
    def governing_march(self) -> ResonanceInTime | KeptBand | None:
        """The march whose highest amplitude is given as the resonance; None where a balance is."""
        if self.sought is not None:
            return self.sought
        return self.kept if self.marched_instead else None

    @property
    def curve_amplitude(self) -> float:
        """That of the balance, or the highest that a march keeps to where it contradicts it [m]."""
        march = self.governing_march
        return self.balance_amplitude if march is None else march.highest

    @property
    def balance_amplitude(self) -> float:
        """Of the periodic motion at the resonance [m]."""
        return size(self.peak)

    @property
    def over_balance(self) -> float:
        """The amplitude given over that of the balance: what else follows from the balance's motion
        is told in proportion.
        """
        return self.peak_amplitude / self.balance_amplitude

    @property
    def is_march(self) -> bool:
        """The resonance given is what a march in time keeps to, not a periodic motion."""
        return self.governing_march is not None

    @property
    def friction_work(self) -> float:
        """Of the motion that is given as the resonance, a period and blade [J]; zero where rounding
        alone leaves some.
        """
        work = self.peak.work.dissipated
        if abs(work) < ROUNDED_WORK * abs(self.peak.work.input):
            work = 0.0
        march = self.governing_march
        return self.layer_factor * float(work if march is None else march.friction_work)

    @property
    def work_over_balance(self) -> float:
        """Friction work at the resonance given over that of its balance; 1 where either is none."""
        ratio = self.friction_work / (self.peak.work.dissipated or np.nan)
        return float(ratio) if np.isfinite(ratio) else 1.0

    @property
    def input_work(self) -> float:
        """Of the excitation at the resonance given, in proportion to its amplitude [J]."""
        return self.over_balance * float(self.peak.work.input)

    @property
    def slipping_at_peak(self) -> float:
        """Elements that slip or lift off in a period of the resonance given; NaN for a march."""
        return np.nan if self.is_march else moving_contacts(self.peak)

    @property
    def drift_at_peak(self) -> float:
        """How fast the damper walks at the resonance given [m/s]; NaN for a march."""
        return np.nan if self.is_march else float(self.peak.drift)


def _doubt_of_march(curve: Curve, kept: KeptBand) -> float:
    """Relative error of a march with fewer contact points than the curve has, from how far it is
    from the balance; 0 for others.
    """
    if kept.points is None:
        return 0.0
    own = curve.settings.points
    if own is not None and kept.points >= own:
        return 0.0
    return DOUBT_OF_FEWER_POINTS * abs(curve.balance_amplitude / kept.highest - 1)


class StudiedLoads(NamedTuple):
    """Load cases of each mass by ascending load, the curve of each, and the best loads searched."""

    cases: list[LoadCase]
    curves: list[Curve]
    best: list[BestLoad]


def study_loads(
    scene: Scene,
    cases: list[LoadCase],
    family: Callable[[LoadCase], Family],
    settings: Settings,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
    keep: Keep = compute_without_keeping,
    softer: SofterBody | None = None,
    best: float = 0.0,
    searches: Sequence[Search] = (),
) -> StudiedLoads:
    """One response curve a load case, and the results of searches for the best load, shared over
    the ranks; every rank returns all of them.

    What takes longest comes first, and the next one goes to the rank that is free. A best load that
    is not among the cases is studied like them: a search compares balances, and whether the blade
    keeps to one of them is not known before it is judged.

    Args:
        family: of a load case, its models.
        settings: modes and damper model to keep; each case then takes the rest from what its own
            curve needs.
        progress: wraps the numbers of this rank's cases, as tqdm does, under a label.
        keep: keep(case, compute) gives the curve of a load, found from an earlier run or computed
            and kept.
        softer: the body less the error of its stiffness, for the error by its mesh.
        best: load with the smallest resonance [N]; 0 where it is not known.
        searches: each gives a best load and the case of any load; they take as long as the response
            of a load below the best one.
    """
    given = {(case.load, case.mass) for case in cases}
    order = longest_first([case.load for case in cases], best)

    def curve_at(case: LoadCase) -> Curve:
        return keep(case, partial(curve_of, scene, case, family, settings, softer))

    def shown(numbers: Iterable[int]) -> Iterable[int]:
        return progress(numbers, "forced responses", total=len(tasks), delay=0.0)

    def searched(search: Search) -> tuple[BestLoad, tuple[LoadCase, Curve] | None]:
        found, case_at = search()
        if found.reason or (studied_load(found), found.mass) in given:
            return found, None
        case = case_at(studied_load(found))
        return found, (case, curve_at(case))

    tasks: list[Callable[[], Any]] = [
        *(partial(searched, search) for search in searches),
        *(partial(curve_at, cases[i]) for i in order),
    ]
    done: list[Any] = share_work(lambda task: task(), tasks, comm, shown, on_demand=True)
    found = done[: len(searches)]
    studied = [(cases[i], curve) for i, curve in zip(order, done[len(searches) :], strict=True)]
    studied += [added for _, added in found if added is not None]
    masses = [case.mass for case in cases]
    studied.sort(key=lambda pair: (masses.index(pair[0].mass), pair[0].load))
    return StudiedLoads(
        [case for case, _ in studied], [curve for _, curve in studied], [one for one, _ in found]
    )


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
    sought = _sought_in_time(scene, models, curve)
    judged = judged_resonance(marches, curve, replace(scene, accuracy=room), sought is not None)
    marks, top = judged.marks, judged.point
    estimated, in_time = estimated_errors(curve), None
    if not judged.contradicted and sought is None:
        curve, estimated, in_time = judged_in_time(scene, marches, curve, top)
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
        kept=judged.kept,
        marched_instead=judged.contradicted,
        beside=judged.beside,
        unmarched=judged.unmarched,
        undriven=judged.undriven,
        in_time=in_time,
        sought=sought,
        interval=_interval_of(scene, model, curve, top),
        unfollowed=lifts and too_large_to_follow(models, curve.settings),
        notes=curve.notes,
        halved=unseen.halved,
        body_mesh=unseen.body_mesh,
        layer_law=unseen.layer_law,
        layer_shift=unseen.layer_shift,
        layer_height=unseen.layer_height,
    )


def _interval_of(
    scene: Scene, model: ReducedModel, curve: Checked, top: Solution
) -> LoadInterval | None:
    """The amplitudes over all admissible friction forces, where the scene asks for them."""
    if not scene.study.interval:
        return None
    return load_interval(model, curve.settings, top, scene.accuracy, len(curve.points))


def _sought_in_time(scene: Scene, models: Family, curve: Checked) -> ResonanceInTime | None:
    """The resonance by marches, where most contacts lift off and balances do not tell it to the
    accuracy.
    """
    top = peak_of(curve.points)
    error = curve.settings.error
    if not scene.study.stability or error is None or error <= scene.accuracy:
        return None
    if curve.settings.softened or not mostly_lifts_off(top):
        return None
    return resonance_in_time(models, curve.settings, top)


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


def design_table(curves: list[Curve], limits: tuple[Limit, Limit]) -> dict[str, np.ndarray]:
    """The design table: one row a load, from no damper (load 0) to full stick (load inf)."""
    free, stuck = (_linear_row(limit) for limit in limits)
    rows = [free, *map(_row, curves), stuck]
    if any(c.interval is not None for c in curves):
        ends = [limits[0].peak_amplitude, limits[1].peak_amplitude]
        added = [_certain(ends[0]), *(_interval_row(c) for c in curves), _certain(ends[1])]
        rows = [row | more for row, more in zip(rows, added, strict=True)]
        free = rows[0]
    table = {name: np.array([row[name] for row in rows]) for name in free}
    if any(c.mass is not None for c in curves):
        table["mass"] = np.array([np.nan, *(c.mass for c in curves), np.nan])
    table["reduction"] = free["peak_amplitude"] / table["peak_amplitude"]
    return table


def _row(c: Curve) -> dict[str, Any]:
    return {
        "load": c.load,
        "peak_frequency": c.peak_frequency,
        "peak_amplitude": c.peak_amplitude,
        "reduction": 1.0,
        "dissipated": c.friction_work,
        "slipping": c.slipping_at_peak,
        "drift": c.drift_at_peak,
        "error": np.nan if c.error is None else c.error,
        "halved": c.halved,
        "body_mesh": c.body_mesh,
        "layer_law": c.layer_law,
        "harmonics": c.settings.harmonics,
        "points": len(c.frequency),
        "unconverged": int((~c.converged).sum()),
    }


def _certain(amplitude: float) -> dict[str, float | str]:
    """Columns of the interval where the response is linear."""
    return {"lowest": amplitude, "highest": amplitude, "interval": POINT}


def _interval_row(c: Curve) -> dict[str, float | str]:
    if c.interval is None:
        return {"lowest": np.nan, "highest": np.nan, "interval": ""}
    return {
        # the curve's highest point may lie below its maximum by the tolerance
        "lowest": min(c.interval.lowest, c.peak_amplitude),
        "highest": max(c.interval.highest, c.peak_amplitude),
        "interval": c.interval.certificate,
    }


def _linear_row(limit: Limit) -> dict[str, Any]:
    return {
        "load": limit.load,
        "peak_frequency": limit.peak_frequency,
        "peak_amplitude": limit.peak_amplitude,
        "reduction": 1.0,
        "dissipated": 0.0,
        "slipping": 0,
        "drift": 0.0,
        "error": limit.error,
        "halved": limit.halved,
        "body_mesh": limit.body_mesh,
        "layer_law": 0.0,
        "harmonics": 1,
        "points": len(limit.frequency),
        "unconverged": 0,
    }


def default_loads(scene: Scene) -> tuple[float, ...]:
    """Loads when none are given: from that under which friction can hold the excitation, over two
    and a half decades.
    """
    least = holding_load(scene)
    return tuple(float(f"{x:.2g}") for x in np.geomspace(least, 300 * least, DEFAULT_LOADS))
