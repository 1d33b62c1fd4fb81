"""How the height of a resonance moves in richer models, wherever they put it: the estimated errors
of a choice.

The indicators of ``indicators.py`` compare the first harmonic at one frequency. Next to a steep
resonance a shift of a tenth of a hertz changes it by tens of per cent, while the height of the peak
stays the same to one per cent (8 contact points in place of 126 on the shipped wedge at 80 N: 37 %
by the first, 0.8 % by the second). Here the peak is found again in every richer model, from the
peak that is judged; heights are compared, and the shift of the frequency is an error of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ...errors import NotSolvedError
from ...hbm.full_stick import sticks_safely
from ...hbm.peak import Peak, find_peak
from ...hbm.solution import Solution, lifts_off, size
from ...hbm.truncation_indicator import truncation_indicator
from .band_sweep import solver_options
from .check_points import MIN_SHARE_OF_ACCURACY
from .family import (
    Family,
    carried_displacements,
    family_member,
    lowest_harmonics,
    same_equations,
)
from .indicators import ESTIMATE_OPTIONS, judging_harmonics, moved_solution, richer_settings
from .settings import DIRECTIONS, Settings

# of the accuracy: to which a peak is found, and one that only estimates an error
PEAK_ACCURACY_SHARE = 0.05
JUDGE_ACCURACY_SHARE = 0.2
# the same for one whose search meets a point that is not solved: on the shipped wedge with 4000
# N/mm^3 and 80 N walks to such points on a flat top took 26 s for a gain of 0.1 %
JUDGE_ENOUGH_SHARE = 0.2
# the same where a softer layer stands for a stiff one: 30 s with 23 harmonics otherwise
SOFTENED_ENOUGH_SHARE = 0.5
# of the accuracy: change of a resonance by a model that judges it, reached at once, that is
# believed
AT_ONCE_SHARE = 0.5
# Newton steps of a point of such a peak
JUDGE_STEPS = 15
# the same of a model that only estimates an error there, and of one with more contact points, whose
# peak takes some seconds from one with fewer
LIFTING_JUDGE = 3100
LIFTING_POINTS_JUDGE = 6000
# harmonics and contact points of a seat of the models that tell an error in another respect where
# those of the judged one are too large
REDUCED_SETTINGS = {"harmonics": (7, 3, 1), "points": (32, 16, 8, 4)}
# harmonics from which half as many again, and not twice as many, judge them where contacts lift
# off: that takes a sixth of the time
MANY_HARMONICS = 15
# share of the contacts that lift off from which a judge has no more than twice the harmonics
FEW_LIFTING = 0.25
# motion of the contacts over the first harmonic that a judge may be blind to, and unknowns up to
# which one that sees it takes its place
BLIND_MOTION = 1e-3
SEEING_JUDGE = 1200
# harmonics of the model that judges fewest of them, and unknowns beyond which it has fewer: a mode
# of all blades in step at the twelfth harmonic lowers the shipped own blade under 400 N by 2.3 %
# from seven harmonics, which one harmonic was judged by, to fifteen
OVERTONES = 15
OVERTONES_JUDGE = 3100
# contact points of the model that judges, over those of the judged one
MORE_POINTS = 4
# weight of a relative shift of the frequency against a relative change of the height: an accuracy
# of 5 % holds the frequency to 0.5 %
SHIFT_WEIGHT = 5.0

# relative fall, of a peak's curve at the frequency of another maximum and of that one's height,
# from which on it is another one
ANOTHER_FALL = 0.25


@dataclass(frozen=True)
class PeakErrors:
    """How a peak moves in richer models, by what was made richer (settings.DIRECTIONS)."""

    # relative change of its height; infinite where the richer model was not solved, or is too large
    # to be
    height: Mapping[str, float]
    # relative change of its frequency
    frequency: Mapping[str, float]
    # the peaks that were found
    better: Mapping[str, Peak] = field(default_factory=dict, repr=False)
    # relative fall of the height beside the peak by that change of frequency; left out where it is
    # not known
    fall: Mapping[str, float] = field(default_factory=dict, repr=False)
    # those of harmonics and samples are what a march in time leaves (`choice_in_time`)
    in_time: bool = False

    @property
    def total(self) -> float:
        """Sum of the changes of height: the estimated error of the amplitude."""
        return float(sum(self.height.values()))

    @property
    def needs(self) -> Mapping[str, float]:
        """What decides whether a respect is made richer: height and weighted frequency, which a
        flat top does not determine.
        """
        shifts = {
            name: min(SHIFT_WEIGHT * shift, self.fall.get(name, np.inf))
            for name, shift in self.frequency.items()
        }
        return {name: max(change, shifts[name]) for name, change in self.height.items()}

    @property
    def shift(self) -> float:
        """Sum of the changes of frequency: its estimated error."""
        return float(sum(self.frequency.values()))


def peak_from(
    family: Family,
    old: Settings,
    near: Peak | Solution,
    new: Settings,
    accuracy: float,
    fallbacks: bool = True,
) -> Peak:
    """The peak of a model with other settings, uphill of a point solved with the old ones.

    Args:
        near: that point, or the peak of the old settings, whose bend may spare points.
        fallbacks: where Newton's method fails from that point; without them it takes at most
            JUDGE_STEPS steps a point, since a peak that only estimates an error is not worth more.

    Raises:
        NotSolvedError: a point was not solved, or no maximum was closed in.
    """
    before = family_member(family, old)
    after = family_member(family, new)
    point = near.solution if isinstance(near, Peak) else near
    start = replace(point, w=carried_displacements(point.w, before, after, new.harmonics))
    options = solver_options(accuracy)
    share = PEAK_ACCURACY_SHARE
    enough = SOFTENED_ENOUGH_SHARE if new.softened else JUDGE_ENOUGH_SHARE
    if not fallbacks:
        options = replace(options, fallbacks=False, iterations=JUDGE_STEPS)
        share = JUDGE_ACCURACY_SHARE
    return find_peak(
        after.model,
        point.omega,
        new.harmonics,
        new.samples,
        near=start,
        tolerance=share * accuracy,
        enough=0.0 if fallbacks else enough * accuracy,
        judged=near if isinstance(near, Peak) and not fallbacks else None,
        options=options,
    )


def fall_beside(peak: Peak, shift: float) -> float:
    """Relative fall of the height next to a peak, by a relative change of frequency; infinite where
    its curvature is not known.
    """
    if peak.bend <= 0:
        return np.inf
    bent = peak.bend * (shift * peak.omega * peak.height) ** 2 / 2
    return float(1 - 1 / np.sqrt(1 + bent))


def peak_errors(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
    known: Mapping[str, tuple[float, float]] | None = None,
) -> PeakErrors:
    """The peak again in a model that is richer in one respect, for each of them.

    Args:
        known: respect to changes of height and frequency that need not be found again.
    """
    known = known or {}
    point = peak.solution
    exact = (
        ("harmonics", "samples")
        if sticks_safely(family_member(family, settings).model, point)
        else ()
    )
    heights = dict.fromkeys(DIRECTIONS, 0.0)
    shifts = dict.fromkeys(DIRECTIONS, 0.0)
    better = {}
    fall = {}
    for name in DIRECTIONS:
        if name in exact:
            continue
        if name in known:
            heights[name], shifts[name] = known[name]
            continue
        other = judge_settings(family, settings, name, point)
        # peaks of the same equations differ by what a search leaves, which is no error of theirs
        if other is None or same_equations(family, settings, other):
            continue
        change, judged = _change_by(family, settings, peak, name, other, accuracy)
        heights[name], shifts[name] = change.height, change.frequency
        if np.isfinite(change.height):
            fall[name] = change.fall
        if judged is not None:
            better[name] = judged
    return PeakErrors(heights, shifts, better, fall)


class _Change(NamedTuple):
    """Relative changes of a peak by a richer model; infinite where that was not solved."""

    height: float = np.inf
    frequency: float = np.inf
    # of the height beside the peak by that change of frequency
    fall: float = np.inf


def _change_by(
    family: Family,
    settings: Settings,
    peak: Peak,
    name: str,
    other: Settings,
    accuracy: float,
) -> tuple[_Change, Peak | None]:
    """What a model that is richer in one respect changes, or a nearer or a poorer one where that is
    not solved or has another maximum alone.

    Args:
        other: the settings that the respect is judged by.

    Returns:
        the change, and the peak with these settings where it was found.
    """
    point = peak.solution
    pairs = [
        None if judge is None else compared_settings(family, settings, judge, name, point)
        for judge in (other, _nearer_judge(settings, name, other, point))
    ]
    elsewhere: tuple[_Change, Peak | None] | None = None
    for pair in [*pairs, poorer_settings(family, settings, name)]:
        if pair is None:
            continue
        try:
            change, base, found = _told_by(family, settings, peak, name, pair, accuracy)
        except NotSolvedError:
            continue
        told = change, found if pair is pairs[0] else None
        if not _is_another_maximum(base, found):
            return told
        elsewhere = elsewhere or told
    return elsewhere or (_Change(), None)


def _told_by(
    family: Family,
    settings: Settings,
    peak: Peak,
    name: str,
    pair: tuple[Settings, Settings, float],
    accuracy: float,
) -> tuple[_Change, Peak, Peak]:
    """What one model changes to another, times a factor, and the peaks of both.

    Raises:
        NotSolvedError: a point was not solved, or no maximum was closed in.
    """
    own, judge, factor = pair
    base = peak
    if own != settings:
        base = peak_from(family, settings, peak, own, accuracy, fallbacks=False)
    found = _judging_peak(family, own, base, judge, accuracy)
    height = factor * abs(base.height / found.height - 1)
    richer = judge.harmonics > own.harmonics
    if name == "harmonics" and richer and height <= accuracy:
        beyond = _height_beyond_judge(family, judge, found, accuracy)
        height = max(height, factor * abs(base.height / beyond - 1))
    shift = factor * abs(base.vertex / found.vertex - 1)
    fall = max(fall_beside(base, shift), fall_beside(found, shift))
    return _Change(height, shift, fall), base, found


def _is_another_maximum(peak: Peak, found: Peak) -> bool:
    """The search for the peak of a richer model has led down to another maximum of its response:
    one that is nearer tells more. Where there is none the resonance may have moved.

    Where the first point is not solved the search begins beside it: on the rippled top of a random
    model (seed 73 of benchmarks/choice_random.py) it ended 3 % higher in frequency and 40 % lower
    in height, and the choice with an error of 400 %.
    """
    fall = fall_beside(peak, abs(peak.vertex / found.vertex - 1))
    lower = found.height < (1 - ANOTHER_FALL) * peak.height
    return lower and np.isfinite(fall) and fall > ANOTHER_FALL


def _height_beyond_judge(
    family: Family,
    judge: Settings,
    found: Peak,
    accuracy: float,
) -> float:
    """Height of the peak with more harmonics than the judge has, where what it leaves out moves the
    contacts; else that of the judge, and where the other one is too large or not found.

    At the frequency of the judge, or at a peak next to it, whichever is nearer to the height of the
    judge: where an overtone splits a resonance the search may lead to the lower part.

    With seven harmonics a floating damper's resonance is 2.5 % too high; fifteen, which differ by
    0.5 %, are 1.6 % too high themselves (seed 192 of benchmarks/choice_random.py).
    """
    other = richer_settings(family, judge, "harmonics")
    if other is None or other.harmonics <= judge.harmonics:
        return found.height
    model = family_member(family, other).model
    # where normal loads follow the motion the richer peak is often another motion's
    if not model.loads_prescribed:
        return found.height
    left_out = truncation_indicator(model, [found.solution], other.harmonics)
    large = model.unknowns(other.harmonics) > LIFTING_JUDGE
    if large or left_out[0] <= MIN_SHARE_OF_ACCURACY * accuracy:
        return found.height
    here = moved_solution(family, judge, found.solution, other, ESTIMATE_OPTIONS)
    heights = [size(here)] if here.converged else []
    # a nearer height would differ by less than the search of a judging peak leaves
    if heights and abs(heights[0] / found.height - 1) <= JUDGE_ACCURACY_SHARE * accuracy:
        return heights[0]
    try:
        heights.append(peak_from(family, judge, found, other, accuracy, fallbacks=False).height)
    except NotSolvedError:
        pass
    return min(heights, key=lambda height: abs(height - found.height), default=found.height)


def _judging_peak(
    family: Family,
    own: Settings,
    base: Peak,
    judge: Settings,
    accuracy: float,
) -> Peak:
    """The peak of the model that judges, by way of one with fewer harmonics where there is one: on
    the shipped wedge under 150 N fifteen are reached from one in 0.4 s by seven, in 7 s without;
    under 73 N 31 from 15 in 3 s by 23, in 24 s without.

    Where normal loads do not follow the motion one solution leads there, mostly, and that peak in
    between is left out: it took up to half of a judge's time. Not where it is another one by more
    than AT_ONCE_SHARE of the accuracy, since an overtone may have split the resonance, and led to
    the lower part.

    Raises:
        NotSolvedError: a point was not solved, or no maximum was closed in.
    """
    many = own.harmonics >= MANY_HARMONICS
    more = _half_as_many_again(own) if many else judging_harmonics(own.harmonics)
    if more < judge.harmonics:
        found = _peak_at_once(family, own, base, judge, accuracy)
        if found is not None and abs(base.height / found.height - 1) <= accuracy * AT_ONCE_SHARE:
            return found
        between = replace(own, harmonics=more, samples=judge.samples)
        try:
            stone = peak_from(family, own, base, between, accuracy, fallbacks=False)
            return peak_from(family, between, stone, judge, accuracy, fallbacks=False)
        except NotSolvedError:
            pass
    return peak_from(family, own, base, judge, accuracy, fallbacks=False)


def _peak_at_once(
    family: Family,
    own: Settings,
    base: Peak,
    judge: Settings,
    accuracy: float,
) -> Peak | None:
    """The peak of the model that judges, where normal loads do not follow the motion and its point
    at the frequency of the judged peak is solved without more than one try; else None.
    """
    if not family_member(family, own).model.loads_prescribed:
        return None
    options = replace(solver_options(accuracy), fallbacks=False, iterations=JUDGE_STEPS)
    here = moved_solution(family, own, base.solution, judge, options)
    if not here.converged:
        return None
    near = replace(base, solution=here)
    try:
        return peak_from(family, judge, near, judge, accuracy, fallbacks=False)
    except NotSolvedError:
        return None


def _half_as_many_again(settings: Settings) -> int:
    """What MANY_HARMONICS are judged by where contacts lift off."""
    return settings.harmonics + (settings.harmonics + 1) // 2


def poorer_settings(
    family: Family,
    settings: Settings,
    name: str,
) -> tuple[Settings, Settings, float] | None:
    """The judged model and one with half as many contact points or fewer harmonics, which is more
    wrong than the judged one: what is compared where the richer model was not solved. None where
    the model has no less.
    """
    if name == "points" and settings.points is not None and settings.points > 1:
        return settings, replace(settings, points=settings.points // 2), 1.0
    if name == "harmonics":
        least = lowest_harmonics(family, settings)
        fewer = max(least, settings.harmonics // 2)
        if fewer < settings.harmonics:
            return settings, replace(settings, harmonics=fewer), 1.0
    return None


def judge_settings(
    family: Family,
    settings: Settings,
    name: str,
    point: Solution,
) -> Settings | None:
    """The settings that one respect is judged by: those of ``indicators.richer_settings``, but of
    harmonics OVERTONES at least where few contacts lift off, of contact points only MORE_POINTS
    times as many, and of more than one harmonic twice as many, of MANY_HARMONICS half as many
    again, where FEW_LIFTING of the contacts or more lift off, unless these are blind.

    Parts of a seat are halved again and again, so that the finer points are parts of the coarser
    ones; all of them cost 20 times as much on the shipped wedge. Where many contacts lift off, four
    times the harmonics are seldom reached from the point that is judged. Where few do, twice as
    many may see nothing of an internal resonance: on an imported wedge under 180 N, whose ninth
    harmonic meets one, seven in place of three harmonics change the height by 0.4 %, fifteen by
    2.3 %.
    """
    other = richer_settings(family, settings, name)
    lifting = point.states["lift"]
    if name == "harmonics" and other is not None:
        if lifting > 0:
            many = settings.harmonics >= MANY_HARMONICS or lifting >= FEW_LIFTING * len(point.w)
            if many:
                near = _nearer_judge(settings, name, other, point)
                return other if near is None or _is_blind(family, near, other, point) else near
        return _with_overtones(family, settings, other, point)
    if name != "points" or other is None or settings.points is None:
        return other
    groups = family_member(family, settings).groups
    more = MORE_POINTS * settings.points
    # two seats
    return replace(settings, points=more) if 2 * more < len(groups) else other


def _with_overtones(
    family: Family,
    settings: Settings,
    other: Settings,
    point: Solution,
) -> Settings:
    """A judge of few harmonics with OVERTONES of them, where that is no large balance."""
    most = min(OVERTONES, family.harmonics)
    if not settings.harmonics < other.harmonics < most:
        return other
    richer = _with_harmonics(other, most)
    large = too_large(family, richer, point, OVERTONES_JUDGE, OVERTONES_JUDGE)
    return other if large else richer


def _is_blind(family: Family, near: Settings, other: Settings, point: Solution) -> bool:
    """The harmonics that a judge leaves out, and another that is no large balance has, move the
    contacts more than those that it adds, and not too little to be seen.

    On a random model the eighth harmonic meets a mode: seven in place of three change the height by
    0.07 %, fifteen by 1.6 % (seed 449 of benchmarks/choice_random.py).
    """
    if too_large(family, other, point, SEEING_JUDGE):
        return False
    model = family_member(family, other).model
    seen, all_of_them = (
        float(truncation_indicator(model, [point], each.harmonics)[0]) for each in (near, other)
    )
    beyond = np.sqrt(max(all_of_them**2 - seen**2, 0.0))
    return bool(beyond > max(seen, BLIND_MOTION))


def _with_harmonics(settings: Settings, harmonics: int) -> Settings:
    """So many harmonics, and the samples that they need; 0 samples are located exactly."""
    samples = settings.samples and max(settings.samples, 8 * harmonics + 8)
    return replace(settings, harmonics=harmonics, samples=samples)


def _nearer_judge(
    settings: Settings,
    name: str,
    other: Settings | None,
    point: Solution,
) -> Settings | None:
    """Twice the harmonics, of MANY_HARMONICS half as many again, in place of four times as many;
    those of ``indicators.richer_settings`` in place of OVERTONES. None in other respects, where no
    contact lifts off and OVERTONES are not more, or where that is no fewer.
    """
    own = settings.harmonics
    if judging_harmonics(own) < OVERTONES:
        more = judging_harmonics(own)
    elif lifts_off(point):
        more = 2 * own + 1 if own < MANY_HARMONICS else _half_as_many_again(settings)
    else:
        return None
    if name != "harmonics" or other is None or other.harmonics <= more:
        return None
    return _with_harmonics(settings, more)


def compared_settings(
    family: Family,
    settings: Settings,
    other: Settings,
    name: str,
    point: Solution,
    largest_with_points: float | None = None,
) -> tuple[Settings, Settings, float] | None:
    """The two models whose difference tells an error, and by which factor: the judged and the
    richer one; where contacts lift off and that is too large, one with twice as many contact
    points, whose error of first order is half as large, or both with REDUCED_SETTINGS harmonics,
    for the error by harmonics with fewer points; None where that does not help.

    The respects are taken as independent of each other then: on the shipped wedge with 4000 N/mm^3
    and 320 N, 16 in place of 63 points a seat change the height by 5.2 % with 3 harmonics and by
    4.1 % with 7.

    Args:
        largest_with_points: unknowns at most of a model with more contact points;
            LIFTING_POINTS_JUDGE when left out.
    """
    points_limit = LIFTING_POINTS_JUDGE if largest_with_points is None else largest_with_points
    limit = points_limit if name == "points" else LIFTING_JUDGE
    if not too_large(family, other, point, limit):
        return settings, other, 1.0
    if name == "points" and settings.points is not None:
        twice = replace(settings, points=2 * settings.points)
        if not too_large(family, twice, point, limit):
            return settings, twice, 2.0
    respect = "points" if name == "harmonics" else "harmonics"
    here = getattr(settings, respect)
    for fewer in REDUCED_SETTINGS[respect]:
        if here is not None and fewer >= here:
            continue
        reduced: dict[str, Any] = {respect: fewer}
        richer_one = replace(other, **reduced)
        if not too_large(family, richer_one, point, limit):
            return replace(settings, **reduced), richer_one, 1.0
    return None


def too_large(
    family: Family,
    settings: Settings,
    point: Solution,
    lifting: float,
    closed: float = np.inf,
) -> bool:
    """The balance would have more unknowns than a limit.

    Args:
        lifting: that limit where contacts lift off.
        closed: the same where none does.
    """
    model = family_member(family, settings).model
    unknowns = model.unknowns(settings.harmonics)
    return unknowns > (lifting if lifts_off(point) else closed)
