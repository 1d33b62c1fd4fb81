"""How wrong is a solved point? A few Newton steps in a richer model tell, for each choice that was made.

With z the solution and dz the steps in the model enriched in direction d,
eta_d = |T(z + dz) - T(z)| / |T(z + dz)|, where T is the first harmonic at the probe. One step is enough where the
contacts stay closed; with lift-off it overshoots (16 % told for 0.4 % on the wedge of 46 nodes), three mostly do not,
and where three have not converged the richer model is solved.

Modes are doubled, samples and harmonics taken four times (1, 3, 7 harmonics are compared with 7, 15, 31: against 2H+1
an internal resonance of a higher harmonic was missed, told 2.5e-4 for a true 1.3e-3); contact points are compared with
the finest ones, because a number half as large again can be blind (true error 45 % with an indicator of 1e-14).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..hbm.api import as_solution, solve
from ..hbm.fallback import Attempt
from ..hbm.linear import condense
from ..hbm.newton import Options, newton
from ..hbm.residual import Balance
from ..hbm.solution import Solution
from .family import Family, carried, member
from .settings import DAMPERS, DIRECTIONS, Settings

__all__ = ["Indicators", "few_steps", "indicate", "richer"]


STEPS = 3
TOLERANCE = 1e-5    # residual at which a step into the richer model counts as arrived


@dataclass(frozen=True)
class Indicators:
    """Estimated relative errors of the first harmonic at the probe, by their source (settings.DIRECTIONS)."""

    errors: Mapping[str, float]

    @property
    def total(self) -> float:
        """Their sum; infinite where the richer model could not be solved either."""
        return float(sum(self.errors.values()))

    @property
    def worst(self) -> str:
        """The name of the largest."""
        return max(self.errors, key=self.errors.__getitem__)


def indicate(family: Family, settings: Settings, solution: Solution) -> Indicators:
    """All indicators of a point that was solved with some settings."""
    errors = {}
    for name in DIRECTIONS:
        other = richer(family, settings, name)
        if other is None:
            errors[name] = 0.0
        elif not solution.converged:
            errors[name] = np.inf
        else:
            better = few_steps(family, settings, solution, other)
            errors[name] = _change(solution, better) if better.converged else np.inf
    return Indicators(errors)


def richer(family: Family, settings: Settings, name: str) -> Settings | None:
    """The settings that a direction is judged by; None where the family has nothing to compare with."""
    H = settings.harmonics
    if name == "harmonics":
        more = min(4 * H + 3 if H < 15 else 2 * H + 1, family.harmonics)
        if more <= H:       # as with the modes
            return replace(settings, harmonics=max(1, H // 2))
        return replace(settings, harmonics=more, samples=max(settings.samples, 8 * more + 8))
    if name == "samples":
        return replace(settings, samples=4 * settings.samples)
    if name == "modes":     # where there are no more, half of them, which are more wrong than all
        more = min(2 * settings.modes, family.modes)
        return replace(settings, modes=more if more > settings.modes else max(1, settings.modes // 2))
    if name == "points":
        here = member(family, settings).groups
        return None if settings.points is None or here.max() + 1 == len(here) else replace(settings, points=None)
    later = [d for d in DAMPERS[DAMPERS.index(settings.damper) + 1:] if d in family.dampers]
    return replace(settings, damper=later[-1]) if later else None


def few_steps(family: Family, settings: Settings, solution: Solution, other: Settings) -> Solution:
    """The solution moved into the model of other settings: STEPS Newton steps, or solved where these do not arrive."""
    old, new = member(family, settings), member(family, other)
    H = other.harmonics
    start = carried(solution.w, old, new, H)
    balance = Balance(new.model, condense(new.model, solution.omega, H), other.samples)
    end = newton(balance, start, Options(TOLERANCE, STEPS))
    if end.converged:
        return as_solution(balance, Attempt("indicator", end), end.iterations, end.reason)
    there = replace(solution, w=end.state.w if np.isfinite(end.state.error) else start)
    return solve(new.model, solution.omega, H, other.samples, start=there, options=Options(TOLERANCE, 30))


def _change(solution: Solution, better: Solution) -> float:
    old, new = solution.probe[1, 0], better.probe[1, 0]
    return float(abs(new - old) / max(abs(new), np.finfo(float).tiny))
