"""Harmonics chosen by a march in time, where most contacts lift off.

Balances with more harmonics are often not solved there, or end on another motion of several, so
that which of them is taken would depend on the last digit of a start: 564, 656 or 685 um on the
shipped wedge under 36 N. A march has no harmonics left out, and begins at the very motion that is
judged: harmonics are enough once the blade, marched from the resonance of a balance, keeps its
amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ...errors import NotSolvedError
from ...hbm.peak import Peak
from ...hbm.solution import Solution, mostly_lifts_off, size
from .family import Family, lowest_harmonics
from .peak_errors import PeakErrors, peak_errors, peak_from, too_large
from .resonance_choice import LARGEST_BALANCE, MAX_ENRICHMENTS, MAX_LIFTING_UNKNOWNS, Choice
from .settings import DIRECTIONS, RICHEST_SETTINGS, Settings, enriched_settings

# respects that a march leaves nothing of
COVERED_IN_TIME = ("harmonics", "samples")
# relative change of a peak by a richer model beyond which both may be different motions
OTHER_MOTION = 0.3
# of the accuracy: width of a band, over its upper end, beyond which the blade keeps to no periodic
# motion, so that no balance with more harmonics is tried: it would find another motion, slowly
PERIODIC_SHARE = 0.4


@dataclass(frozen=True)
class MarchedBand:
    """Amplitudes of single periods [m] between which a blade keeps."""

    lowest: float
    highest: float

    def beyond(self, amplitude: float) -> float:
        """How far an amplitude lies outside of the band, over its nearer end: what another balance
        could better. None does inside, where the motion is no periodic one.
        """
        return max(amplitude / self.highest - 1, 1 - amplitude / self.lowest, 0.0)

    @property
    def width(self) -> float:
        """Over the upper end."""
        return 1 - self.lowest / self.highest

    def farthest(self, amplitude: float) -> float:
        """How far an amplitude lies from the end that is farther from it, over that end."""
        return max(abs(amplitude / end - 1) for end in (self.lowest, self.highest))


class March(Protocol):
    """What the blade keeps to after a motion of some settings."""

    def __call__(
        self,
        settings: Settings,
        point: Solution,
        on: Settings | None = None,
    ) -> MarchedBand | None:
        """None where that is not marched.

        Args:
            on: settings of the model that is marched, those of the motion when None.
        """


def marched_widely(march: March | None, settings: Settings, top: Solution) -> bool:
    """At least half of the contacts lift off at the resonance, and a march may judge that."""
    return march is not None and mostly_lifts_off(top) and not settings.softened


def choose_in_time(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
    march: March,
    fixed: tuple[str, ...] = (),
) -> Choice | None:
    """Settings at whose peak the blade keeps the amplitude of the balance, or the nearest to it;
    the peak with them, and its errors. None where a march is not possible.

    Richer models judge the other respects; one is made richer where they change the peak by more
    than the accuracy together.

    Args:
        peak: found with `settings`.
        fixed: names that may not be changed here although they are not the user's.
    """
    found: Choice | None = None
    for _ in range(MAX_ENRICHMENTS):
        climbed = _with_enough_harmonics(family, settings, peak, accuracy, march)
        if climbed is None:
            break
        settings, peak, left_out = climbed
        errors = _with_left_out(family, settings, peak, accuracy, left_out)
        found = Choice(replace(settings, error=errors.total), peak, errors)
        needs = {n: need for n, need in errors.needs.items() if n not in COVERED_IN_TIME}
        if sum(needs.values()) <= accuracy:
            break
        held = (*fixed, *COVERED_IN_TIME)
        better = _richer_in_the_worst(family, settings, peak, errors, held)
        if better is None:
            break
        try:
            further = peak_from(family, settings, peak.solution, better, accuracy, fallbacks=False)
        except NotSolvedError:
            break
        kept = _kept_on(march, settings, peak, better, further)
        if kept is not None:
            name = next(n for n in DIRECTIONS if getattr(better, n) != getattr(settings, n))
            errors = _with_kept(errors, name, kept.farthest(peak.height))
            return Choice(replace(settings, error=errors.total), peak, errors)
        settings, peak = better, further
    return found


def _kept_on(
    march: March,
    settings: Settings,
    peak: Peak,
    richer: Settings,
    further: Peak,
) -> MarchedBand | None:
    """What a richer model keeps to after a peak, where its own next to that is another motion and
    farther off; None where it is not.
    """
    if abs(further.height / peak.height - 1) <= OTHER_MOTION:
        return None
    kept = march(settings, peak.solution, on=richer)
    if kept is None or kept.beyond(peak.height) >= kept.beyond(further.height):
        return None
    return kept


def _with_kept(errors: PeakErrors, name: str, change: float) -> PeakErrors:
    """Errors with the change by one respect as a march tells it."""
    return replace(
        errors,
        height={**errors.height, name: change},
        frequency={**errors.frequency, name: 0.0},
    )


def _with_left_out(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
    left_out: float,
) -> PeakErrors:
    """The errors of a peak by richer models, and what harmonics and samples leave out.

    Richer models may end on other motions that are as high by chance: on the shipped wedge under 18
    N 32 points a seat have what 8 have, with one harmonic all 63 have 6.5 % less, and marched in
    time 13 %. So the larger of both changes is taken.
    """
    known = {name: (0.0, 0.0) for name in COVERED_IN_TIME} | {"harmonics": (left_out, 0.0)}
    errors = replace(peak_errors(family, settings, peak, accuracy, known), in_time=True)
    change = _change_with_all_points(family, settings, peak, accuracy)
    if not errors.height["points"] < change < OTHER_MOTION:
        return errors
    return replace(errors, height={**errors.height, "points": change})


def _change_with_all_points(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
) -> float:
    """Relative change of the height by all contact points with the fewest harmonics, with which
    they cost little; 0 where it is not found, or there are no more.
    """
    if settings.points is None or "points" not in settings.chosen:
        return 0.0
    fewest = lowest_harmonics(family, settings)
    own = replace(settings, harmonics=fewest)
    every = replace(own, points=RICHEST_SETTINGS["points"])
    try:
        base = peak_from(family, settings, peak.solution, own, accuracy, fallbacks=False)
        found = peak_from(family, own, base.solution, every, accuracy, fallbacks=False)
    except NotSolvedError:
        return 0.0
    return abs(base.height / found.height - 1)


def _with_enough_harmonics(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
    march: March,
) -> tuple[Settings, Peak, float] | None:
    """More and more harmonics, until the blade keeps within the accuracy of the peak, or to no
    periodic motion, or the next ones lead no nearer or below what it keeps to; what is left out
    then. None where the first peak is not marched.
    """
    band = march(settings, peak.solution)
    if band is None:
        return None
    best = settings, peak, band
    while band.beyond(size(peak.solution)) > accuracy and band.width <= PERIODIC_SHARE * accuracy:
        richer = _one_step_richer(family, settings, peak, "harmonics")
        if richer is None:
            break
        try:
            peak = peak_from(family, settings, peak.solution, richer, accuracy, fallbacks=False)
        except NotSolvedError:
            break
        settings = richer
        if peak.height < (1 - OTHER_MOTION) * band.lowest:
            # another motion, while the blade is known to keep a higher one
            break
        further = march(settings, peak.solution)
        known = best[2].beyond(size(best[1].solution))
        if further is None or further.beyond(size(peak.solution)) >= known:
            break
        band = further
        best = settings, peak, band
    settings, peak, band = best
    return settings, peak, band.farthest(size(peak.solution))


def _richer_in_the_worst(
    family: Family,
    settings: Settings,
    peak: Peak,
    errors: PeakErrors,
    held: tuple[str, ...],
) -> Settings | None:
    """One step richer in the respect that is worst of those that are not held, since a march with
    several steps more contact points takes too long; None where nothing helps.
    """
    needs = errors.needs
    names = [name for name in needs if name not in held and np.isfinite(needs[name])]
    for name in sorted(names, key=lambda name: -needs[name]):
        richer = _one_step_richer(family, settings, peak, name)
        if richer is not None and needs[name] > 0:
            return richer
    return None


def _one_step_richer(
    family: Family,
    settings: Settings,
    peak: Peak,
    name: str,
) -> Settings | None:
    """None where that is the user's, or the balance would be too large."""
    richer = enriched_settings(settings, name, 1.0) if name in settings.chosen else None
    if richer is None:
        return None
    limits = MAX_LIFTING_UNKNOWNS, LARGEST_BALANCE
    return None if too_large(family, richer, peak.solution, *limits) else richer
