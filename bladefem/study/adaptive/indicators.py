"""How wrong is a solved point? The same point in a richer model shows it, for each choice that was
made.

eta_d = |T_d - T| / |T_d|, where T is the first harmonic at the probe and T_d the same in the model
enriched in direction d, solved from the point that is judged: a step or two where the contacts stay
closed. One Newton step alone would overshoot where they lift off (docs/stability.md, F23).

Modes are doubled and samples taken four times; 1 and 3 harmonics are compared with 7 and 15, since
fewer miss internal resonances (F20; at a peak, `peak_errors` compares 1 with 15), from 7 on with
twice as many; contact points with the finest ones, because a number half as large again can be
blind (F19).

Where all contacts stick, friction is linear: harmonics and samples are exact and need no look. A
point, or a richer model of it, that was not solved gives no indicator: its error is unknown
(infinite), and nothing is refined because of it.

One model that is richer in all respects at once (`total_error`) gives the whole error for the price
of one; which respect is to blame takes one model each (`indicate_errors`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...hbm.full_stick import sticks_safely
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution
from ...hbm.solve import solve
from ...hbm.solver.newton import DEFAULT_OPTIONS, Options
from .family import Family, carried_displacements, family_member, lowest_harmonics
from .settings import DAMPER_MODELS, DIRECTIONS, Settings

# for a point that only estimates the error of another one
ESTIMATE_OPTIONS = Options(1e-5, 30, fallbacks=False, frugal=True)


@dataclass(frozen=True)
class Indicators:
    """Estimated relative errors of the first harmonic at the probe, by their source.

    Sources are settings.DIRECTIONS, and "together" for several of them at once; infinite where a
    model was not solved.
    """

    errors: Mapping[str, float]
    # the richer solutions that were found
    better: Mapping[str, Solution] = field(default_factory=dict, repr=False)

    @property
    def total(self) -> float:
        """Their sum; infinite where one is unknown."""
        return float(sum(self.errors.values()))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Sources without an estimate, because the richer model was not solved."""
        return tuple(name for name, error in self.errors.items() if not np.isfinite(error))

    @property
    def worst(self) -> str:
        """The name of the largest."""
        return max(self.errors, key=self.errors.__getitem__)


def indicate_errors(
    family: Family,
    settings: Settings,
    solution: Solution,
    known: Mapping[str, float] | None = None,
) -> Indicators:
    """All indicators of a point that was solved with some settings.

    Args:
        known: those that need not be found again.
    """
    if not solution.converged:
        return Indicators({name: np.inf for name in DIRECTIONS})
    errors = dict(known or {})
    better = {}
    if sticks_safely(family_member(family, settings).model, solution):
        errors |= {"harmonics": 0.0, "samples": 0.0}
    for name in DIRECTIONS:
        other = None if name in errors else richer_settings(family, settings, name)
        if other is not None:
            better[name] = moved_solution(family, settings, solution, other, ESTIMATE_OPTIONS)
            errors[name] = _change(family, settings, solution, better[name])
    return Indicators({name: errors.get(name, 0.0) for name in DIRECTIONS}, better)


def total_error(
    family: Family,
    settings: Settings,
    solution: Solution,
) -> Indicators:
    """The whole error of a point at once: against one model that is richer in every respect that
    has a richer one.

    Respects that are at their richest are compared with a poorer model, one by one, as
    `indicate_errors` does.
    """
    if not solution.converged:
        return indicate_errors(family, settings, solution)
    exact = (
        ("harmonics", "samples")
        if sticks_safely(family_member(family, settings).model, solution)
        else ()
    )
    rich = settings
    errors = {}
    better = {}
    for name in DIRECTIONS:
        other = None if name in exact else richer_settings(family, settings, name)
        if other is None:
            continue
        if _poorer(settings, other, name):
            point = moved_solution(family, settings, solution, other, ESTIMATE_OPTIONS)
            errors[name] = _change(family, settings, solution, point)
        else:
            rich = replace(rich, **{name: getattr(other, name)})
            rich = replace(rich, samples=max(rich.samples, other.samples))
    if rich != settings:
        better["together"] = moved_solution(family, settings, solution, rich, ESTIMATE_OPTIONS)
        errors["together"] = _change(family, settings, solution, better["together"])
    return Indicators(errors, better)


def richest_settings(family: Family, settings: Settings) -> Settings:
    """Settings richer in every respect that has a richer one."""
    rich = settings
    for name in DIRECTIONS:
        other = richer_settings(family, settings, name)
        if other is not None and not _poorer(settings, other, name):
            rich = replace(rich, **{name: getattr(other, name)})
            rich = replace(rich, samples=max(rich.samples, other.samples))
    return rich


def _poorer(
    settings: Settings,
    other: Settings,
    name: str,
) -> bool:
    """Whether the model that judges a respect has less of it, because there is no more."""
    return name in ("harmonics", "modes") and getattr(other, name) < getattr(settings, name)


def judging_harmonics(harmonics: int) -> int:
    """What so many harmonics are compared with: fewer miss internal resonances."""
    return 4 * harmonics + 3 if harmonics < 7 else 2 * harmonics + 1


def richer_settings(
    family: Family,
    settings: Settings,
    name: str,
) -> Settings | None:
    """The settings that a direction is judged by; None where the family has nothing to compare
    with.
    """
    H = settings.harmonics
    if name == "harmonics":
        more = min(judging_harmonics(H), family.harmonics)
        # as with the modes
        if more <= H:
            return replace(settings, harmonics=max(lowest_harmonics(family, settings), H // 2))
        return replace(
            settings,
            harmonics=more,
            samples=settings.samples and max(settings.samples, 8 * more + 8),
        )
    # 0: located exactly
    if name == "samples":
        return replace(settings, samples=4 * settings.samples) if settings.samples else None
    # where there are no more, half of them, which are more wrong than all
    if name == "modes":
        more = min(2 * settings.modes, family.modes)
        return replace(
            settings, modes=more if more > settings.modes else max(1, settings.modes // 2)
        )
    if name == "points":
        here = family_member(family, settings).groups
        return (
            None
            if settings.points is None or here.max() + 1 == len(here)
            else replace(settings, points=None)
        )
    later = [
        d for d in DAMPER_MODELS[DAMPER_MODELS.index(settings.damper) + 1 :] if d in family.dampers
    ]
    return replace(settings, damper=later[-1]) if later else None


def moved_solution(
    family: Family,
    settings: Settings,
    solution: Solution,
    other: Settings,
    options: Options = DEFAULT_OPTIONS,
) -> Solution:
    """The point solved with other settings, started from where it is."""
    old = family_member(family, settings)
    new = family_member(family, other)
    start = replace(solution, w=carried_displacements(solution.w, old, new, other.harmonics))
    return solve(
        new.model, solution.omega, other.harmonics, other.samples, start=start, options=options
    )


def judged_orders(model: ReducedModel) -> np.ndarray:
    """Harmonics whose motion at the probe is judged: those that are excited, the first where there
    is none.
    """
    return np.array(sorted(h for h in model.excitation if h > 0) or [1])


def _change(
    family: Family,
    settings: Settings,
    solution: Solution,
    better: Solution,
) -> float:
    if not better.converged:
        return np.inf
    orders = judged_orders(family_member(family, settings).model)
    old = solution.probe[orders, 0]
    new = better.probe[orders, 0]
    return float(np.linalg.norm(new - old) / max(np.linalg.norm(new), np.finfo(float).tiny))
