"""The best load: the static load of a seat that makes the resonance smallest, by an exact search.

Peaks are followed from load to load along their exact derivatives (``hbm.optimum``); the damper is
seated anew for each load. When the search is done, the settings are judged at its end; where they
are too poor for the accuracy, it is repeated with richer ones near the load that it found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from ...errors import NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.node_gradients import node_gradients
from ...hbm.optimum import Optimum, lowest_peak
from ...hbm.peak import Peak, with_slope
from ...hbm.peak_levels import Variation
from ...hbm.solution import Solution
from ...scene.tables import Scene
from ...scene.validate_contact import friction_of_seats
from ..adaptive.band_sweep import default_band, solver_options
from ..adaptive.family import Family, family_member, joined_elements, with_excited_harmonics
from ..adaptive.peak_errors import too_large
from ..adaptive.resonance_choice import choose_at_peak
from ..adaptive.settings import FIRST_SETTINGS, Settings, same_settings
from .assemble_model import LoadCase

CaseAt = Callable[[float], LoadCase]
FamilyOf = Callable[[LoadCase], Family]

# loads of a design chart over the best one: the branch where the damper slides, the optimum, and
# the branch where it sticks
CHART_LOAD_FACTORS = (1 / 8, 1 / 4, 1 / 2, 1.0, 2.0, 4.0, 8.0, 15.0, 30.0)
# range of the search, over the force at which friction could hold the excitation
SEARCH_RANGE = (0.1, 1e4)
# of the height of the resonance, over the accuracy of the scene: what the search stops at
HEIGHT_TOLERANCE_SHARE = 0.02
# relative step of the load by which the seating is differentiated
SEATING_DIFFERENCE_STEP = 1e-4
# searches, each with richer settings than the last
MAX_SEARCHES = 3
# of the first search, where these are open and those to begin with are richer: it comes within some
# 6 % of the best load in a fortieth of the time
FIRST_SEARCH = {"harmonics": 3, "points": 8}
# unknowns of a balance in which contacts lift off from which a search with it is not worth its
# time: with 1488 one took over six minutes and ended without a solution
MAX_SEARCH_UNKNOWNS = 1400
# the fewest that such a search is left with
FEWEST_SEARCHED = {"points": 4, "harmonics": 3}
# range of a search on each side of a load that is known to be near the best, as a factor
REPEATED_RANGE = 4.0


@dataclass(frozen=True)
class KeptLoad:
    """The load with the lowest resonance of those that the blade keeps."""

    # of a seat [N], one of those studied
    load: float
    # relative, of the amplitude: by how much another load may be lower
    tolerance: float
    # loads between which the amplitude is within the scene's accuracy of the lowest [N]; NaN where
    # none of those studied is as high
    between: tuple[float, float]


@dataclass(frozen=True)
class BestLoad:
    """What the search found; where it failed, ``reason`` says why and the numbers are NaN."""

    # of the damper [kg]; as meshed when None
    mass: float | None
    # mean normal force on each seat [N]
    load: float
    # resonance there [Hz]
    frequency: float
    # [m]
    amplitude: float
    # friction work a period there [J]
    dissipated: float
    # work that the excitation puts in a period there [J]
    input_work: float
    # relative, of the amplitude: how far the search may have stopped above the minimum
    tolerance: float
    # loads between which the amplitude is within the scene's accuracy of the lowest [N]; NaN where
    # the search did not get that far
    between: tuple[float, float]
    # with the estimated error of the amplitude
    settings: Settings
    # (k,) loads that were tried, ascending [N], and the resonance amplitude of each [m]
    tried: np.ndarray
    heights: np.ndarray
    # range of loads that was searched [N]
    searched: tuple[float, float]
    # solved altogether; 0 where the search failed
    points: int
    # empty where the search succeeded
    reason: str = ""
    # what is lowest of the motions that the blade keeps, where it does not keep to the balances
    # that the search compares
    kept: KeptLoad | None = None


def find_best_load(
    scene: Scene,
    case_at: CaseAt,
    family_of: FamilyOf,
    settings: Settings,
    mass: float | None,
    start: float | None = None,
    tolerance: float | None = None,
    near: Peak | None = None,
    with_range: bool = True,
) -> BestLoad:
    """The load with the smallest resonance, and how sure it is.

    Args:
        case_at: static load of a seat [N] -> the seated damper's friction elements.
        family_of: load case -> its models.
        settings: where to begin; what is open in them is enriched as the accuracy needs.
        start: load near the best one [N]; searched farther only where the best of its
            neighbourhood lies at an end of that.
        tolerance: of the height, relative; HEIGHT_TOLERANCE_SHARE of the accuracy when left out.
        near: the resonance under the start, of these models or similar ones, where it is known.
        with_range: loads around are tried as well, until the resonance is higher by the accuracy.
    """
    search = _Search(
        scene,
        lru_cache(maxsize=None)(case_at),
        family_of,
        search_range(scene),
        tolerance or HEIGHT_TOLERANCE_SHARE * scene.accuracy,
        scene.accuracy if with_range else 0.0,
    )
    family = search.family_at(start or _middle(search.loads))
    reason = ""
    # where the resonance is not solved with few harmonics, it may be with those that were asked for
    for begun in dict.fromkeys((_first_search_settings(family, settings), settings)):
        try:
            found, chosen = _repeated_search(search, begun, start, near)
        except NotSolvedError as error:
            reason = str(error)
            continue
        return _record(search, found, chosen, mass)
    return _unknown(settings, mass, search.loads, reason)


def _first_search_settings(family: Family, settings: Settings) -> Settings:
    """The settings with at most FIRST_SEARCH of what is open, or what the excitation needs."""
    fewer: dict[str, Any] = {
        name: min(most, getattr(settings, name) or most)
        for name, most in FIRST_SEARCH.items()
        if name in settings.chosen
    }
    if "harmonics" in fewer and "samples" in settings.chosen:
        least = max(FIRST_SETTINGS["samples"], 8 * (fewer["harmonics"] + 1))
        fewer["samples"] = min(settings.samples, least)
    return with_excited_harmonics(family, replace(settings, **fewer))


@dataclass(frozen=True)
class _Search:
    """What does not change from one search to the next with richer settings."""

    scene: Scene
    case_at: CaseAt
    family_of: FamilyOf
    # between which the best one is sought [N]
    loads: tuple[float, float]
    # of the height, relative
    tolerance: float
    # relative, of the resonances under the lowest and the highest load that are tried
    rise: float

    def family_at(self, load: float) -> Family:
        """The models under a load [N]."""
        return self.family_of(self.case_at(load))


def _repeated_search(
    search: _Search, settings: Settings, start: float | None, known: Peak | None
) -> tuple[Optimum, Settings]:
    """The best load by settings that hold there, and these.

    Where MAX_SEARCHES were not enough, the resonance under the load that they ended at.

    Args:
        known: the resonance under the start, where it is known.

    Raises:
        NotSolvedError: a resonance was not.
    """
    bounds = search.loads if start is None else _near(start, search.loads)
    points = 0
    for left in reversed(range(MAX_SEARCHES)):
        found = _search_once(search, settings, bounds, start, known)
        points += found.points
        if found.value in bounds and bounds != search.loads:
            found = _search_once(search, settings, search.loads, found.value, found.peak)
            points += found.points
        if not settings.chosen and settings.error is not None:
            break
        family = search.family_at(found.value)
        # the whole accuracy: the height changes little with the load, and its errors by the meshes
        # are estimated for the curves
        accuracy = search.scene.accuracy
        richer, peak, _ = choose_at_peak(
            family, settings, found.peak, accuracy, fixed=("modes",), sufficient=1.0
        )
        next_one = _smaller_settings(family, richer, peak.solution)
        smaller = next_one != richer
        if smaller and (not left or same_settings(next_one, settings)):
            settings = _with_change_between(settings, found.peak, richer, peak)
            break
        enough = same_settings(richer, settings)
        settings = next_one
        found = replace(found, peak=peak)
        if enough:
            break
        start = found.value
        known = None if smaller else peak
        bounds = _near(start, search.loads)
    return replace(found, points=points), settings


def _smaller_settings(family: Family, settings: Settings, point: Solution) -> Settings:
    """The settings with fewer contact points, then fewer harmonics, until a search with them is
    worth its time where contacts lift off; of what the scene leaves open.
    """
    for name, fewest in FEWEST_SEARCHED.items():
        # 15 harmonics become 7, 16 points 8
        while name in settings.chosen and too_large(family, settings, point, MAX_SEARCH_UNKNOWNS):
            now = getattr(settings, name) or fewest
            fewer: dict[str, Any] = {name: max(fewest, now // 2)}
            if fewer[name] >= now:
                break
            settings = replace(settings, error=None, **fewer)
    return settings


def _with_change_between(
    settings: Settings,
    found: Peak,
    richer: Settings,
    peak: Peak,
) -> Settings:
    """The settings of the last search, with the error that richer ones leave: how far these move
    the height, and what they leave themselves where that is known.
    """
    left = richer.error if richer.error is not None and np.isfinite(richer.error) else 0.0
    return replace(settings, error=abs(peak.height / found.height - 1) + left)


def _near(load: float, searched: tuple[float, float]) -> tuple[float, float]:
    """Loads [N] round one, inside the range that is searched."""
    return max(searched[0], load / REPEATED_RANGE), min(searched[1], load * REPEATED_RANGE)


def _middle(bounds: tuple[float, float]) -> float:
    """The load [N] as many times the lower end of a range as the upper end is times that."""
    return float(np.sqrt(bounds[0] * bounds[1]))


def search_range(scene: Scene) -> tuple[float, float]:
    """Loads [N] between which the best one is sought."""
    low, high = SEARCH_RANGE
    return low * holding_load(scene), high * holding_load(scene)


def holding_load(scene: Scene) -> float:
    """The load [N] under which friction can hold the excitation."""
    mu = float(np.mean(friction_of_seats(scene.contact)))
    return scene.excitation.force / max(mu, 1e-3)


def _search_once(
    search: _Search,
    settings: Settings,
    bounds: tuple[float, float],
    start: float | None,
    known: Peak | None,
) -> Optimum:
    """The search with these settings, from a load and the resonance there, where they are known."""
    scene = search.scene
    along = load_variation(search.case_at, search.family_of, settings)
    middle = start or _middle(bounds)
    band = scene.study.band or default_band(along.model_at(middle), scene.excitation.mode)
    return lowest_peak(
        along,
        (2 * np.pi * band[0], 2 * np.pi * band[1]),
        bounds,
        settings.harmonics,
        settings.samples,
        start=middle,
        near=known,
        tolerance=search.tolerance,
        rise=search.rise,
        options=solver_options(scene.accuracy),
    )


def load_variation(
    case_at: CaseAt,
    family_of: FamilyOf,
    settings: Settings,
) -> Variation:
    """Models along the static load, the damper seated anew for each."""

    @cache
    def model_at(load: float) -> ReducedModel:
        return family_member(family_of(case_at(load)), settings).model

    def sloped(
        model: ReducedModel,
        peak: Peak,
        load: float,
    ) -> Peak:
        groups = family_member(family_of(case_at(load)), settings).groups
        low, high = (
            joined_elements(case_at(load * (1 + sign * SEATING_DIFFERENCE_STEP)).elements, groups)
            for sign in (-1, 1)
        )
        rates = {
            "load": _relative_rate(low.n0, high.n0),
            "kt": _relative_rate(low.kt, high.kt),
            "kn": _relative_rate(low.kn, high.kn),
        }
        proportional = abs(rates["load"] - 1).max() < SEATING_DIFFERENCE_STEP
        if proportional and not (rates["kt"].any() or rates["kn"].any()):
            return with_slope(model, peak, "load", load)
        names = [name for name in rates if np.any(rates[name])]
        gradients = node_gradients(model, peak.solution, names)
        slope = sum(float(gradients[name] @ rates[name]) for name in names)
        return replace(peak, value=load, slope=slope)

    return Variation(model_at, sloped)


def _relative_rate(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) derivative of ln |x| by the logarithm of the load; 0 where x is 0 or hardly changes."""
    middle = (low + high) / 2
    change = (high - low) / (2 * SEATING_DIFFERENCE_STEP)
    rate = np.divide(change, middle, out=np.zeros_like(middle), where=middle != 0)
    return np.where(abs(rate) < SEATING_DIFFERENCE_STEP, 0.0, rate)


def _record(search: _Search, found: Optimum, settings: Settings, mass: float | None) -> BestLoad:
    tried = sorted(found.tried, key=lambda peak: peak.value)
    solution = found.peak.solution
    return BestLoad(
        mass=mass,
        load=found.value,
        frequency=solution.frequency,
        amplitude=found.peak.height,
        dissipated=solution.work.dissipated,
        input_work=solution.work.input,
        tolerance=search.tolerance,
        between=tolerated_loads(tried, search.scene.accuracy),
        settings=settings,
        tried=np.array([peak.value for peak in tried]),
        heights=np.array([peak.height for peak in tried]),
        searched=search.loads,
        points=found.points,
    )


def _unknown(
    settings: Settings,
    mass: float | None,
    searched: tuple[float, float],
    reason: str,
) -> BestLoad:
    return BestLoad(
        mass=mass,
        load=np.nan,
        frequency=np.nan,
        amplitude=np.nan,
        dissipated=np.nan,
        input_work=np.nan,
        tolerance=np.nan,
        between=(np.nan, np.nan),
        settings=replace(settings, error=np.inf),
        tried=np.zeros(0),
        heights=np.zeros(0),
        searched=searched,
        points=0,
        reason=reason,
    )


def tolerated_loads(tried: Sequence[Peak], accuracy: float) -> tuple[float, float]:
    """Loads [N] on either side of the best one at which the amplitude has grown by the accuracy.

    On the curve through heights and slopes of the peaks that were tried; NaN on a side where none
    of them is that high.

    Args:
        tried: peaks with their loads ascending.
    """
    logs = np.log([peak.value for peak in tried])
    heights = np.array([peak.height for peak in tried])
    slopes = np.array([peak.slope for peak in tried])
    if len(tried) < 2:
        return np.nan, np.nan
    lowest = heights.min()
    curve = CubicHermiteSpline(logs, heights / lowest - 1 - accuracy, slopes / lowest)
    return ends_of_range(
        heights, accuracy, lambda last, j: np.exp(brentq(curve, logs[last], logs[j]))
    )


def ends_of_range(
    heights: np.ndarray,
    accuracy: float,
    crossing: Callable[[int, int], float],
) -> tuple[float, float]:
    """Loads [N] on either side of the lowest resonance at which it has grown by the accuracy; NaN
    on a side where none is that high.

    Args:
        heights: (k,) of ascending loads.
        crossing: of two neighbours, one within the accuracy and one above it, the load between.
    """
    best = int(np.argmin(heights))
    ends = [np.nan, np.nan]
    for i, side in enumerate((range(best - 1, -1, -1), range(best + 1, len(heights)))):
        last = best
        for j in side:
            if heights[j] > (1 + accuracy) * heights[best]:
                ends[i] = float(crossing(last, j))
                break
            last = j
    return ends[0], ends[1]


def chart_loads(bests: Sequence[BestLoad]) -> tuple[float, ...]:
    """Loads of a design chart [N], from an eighth of the best one to thirty times it.

    With several best loads, of several masses, from an eighth of the smallest to thirty times the
    largest, each of them included.
    """
    loads = {
        float(f"{factor * best.load:.2g}")
        for best in bests
        for factor in CHART_LOAD_FACTORS
        if factor != 1.0
    }
    return tuple(sorted(loads | {studied_load(best) for best in bests}))


def studied_load(best: BestLoad) -> float:
    """The best load [N] with the digits with which its response is studied and shown: of the
    motions that the blade keeps, else of the balances of the search.
    """
    return float(f"{best.load:.4g}") if best.kept is None else best.kept.load
