"""The best load: the static load of a seat that makes the resonance smallest, by an exact search.

Peaks are followed from load to load along their exact derivatives (``hbm.optimum``); the damper is
seated anew for each load. When the search is done, the settings are judged at its end; where they
are too poor for the accuracy, it is repeated with richer ones near the load that it found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...errors import NotSolvedError
from ...hbm.optimum import Optimum, lowest_peak
from ...hbm.peak import Peak
from ...hbm.solution import Solution
from ...scene.tables import Scene
from ...scene.validate_contact import friction_of_seats
from ..adaptive.band_sweep import default_band, solver_options
from ..adaptive.family import Family, with_excited_harmonics
from ..adaptive.peak_errors import too_large
from ..adaptive.resonance_choice import choose_at_peak
from ..adaptive.settings import FIRST_SETTINGS, Settings, same_settings
from .best_load import BestLoad, tolerated_loads
from .load_variation import CaseAt, FamilyOf, load_variation

# range of the search, over the force at which friction could hold the excitation
SEARCH_RANGE = (0.1, 1e4)
# of the height of the resonance, over the accuracy of the scene: what the search stops at
HEIGHT_TOLERANCE_SHARE = 0.02
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
