"""The models that a scene's measured responses are fitted with, and the richer ones that tell what
these leave out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np

from ..hbm.model import ReducedModel
from ..hbm.parameters import vary
from ..util.arrays import IntegerArray, RealArray
from .adaptive.family import Family, family_member
from .adaptive.indicators import richer_settings
from .adaptive.settings import DAMPER_MODELS, DIRECTIONS, Settings, enriched_settings
from .contact_identification import MeasuredLevel
from .fit_truncation import RicherBalance
from .pipeline.case_models import family_of_case, load_cases, softer_body
from .pipeline.run_records import ReducedRun

# of a balance that fits: three harmonics leave up to 6 % of plane blades whose dampers lift off
FEWEST_HARMONICS = 7
FEWEST_SAMPLES = 128
# directions in which a fit is judged: in words
MEANINGS = {
    "harmonics": "harmonics",
    "samples": "samples of a period",
    "modes": "modes",
    "points": "contact points",
    "damper": "the damper's elasticity",
}
# unknowns of the largest balances that are fitted, which takes ten solutions or so of each reading,
# and that judge them, which takes one or two
LARGEST_FIT = 1000
LARGEST_JUDGE = 3000
BODY_MESH = "the mesh of blade and damper"


@dataclass(frozen=True)
class Readings:
    """k readings at the probe."""

    # (k,) normal load of a seat and size of the excitation [N]
    load: RealArray
    force: RealArray
    # (k,) [Hz], and root of the sum of squares of the moving harmonics [m]
    frequency: RealArray
    amplitude: RealArray


@dataclass(frozen=True)
class MeasuredModels:
    """All models of the loads that were measured."""

    readings: Readings
    # size of the scene's own excitation [N]
    force: float
    # load to its models, on the body as meshed and on that less the error of its stiffness; the
    # second are empty where that is not known
    families: Mapping[float, Family]
    softer: Mapping[float, Family]

    @property
    def family(self) -> Family:
        """Models of one of the loads, to ask which there are."""
        return next(iter(self.families.values()))

    def levels(self, settings: Settings) -> tuple[list[MeasuredLevel], IntegerArray]:
        """Readings by load and force with their models, and the numbers of the readings in that
        order.
        """
        models = self._models(self.families, settings)
        levels, order = [], []
        for (load, force), model in models.items():
            rows = np.flatnonzero(self._at(load, force))
            rows = rows[np.argsort(self.readings.frequency[rows])]
            omega = 2 * pi * self.readings.frequency[rows]
            levels.append(MeasuredLevel(model, omega, self.readings.amplitude[rows]))
            order.append(rows)
        return levels, np.concatenate(order)

    def richer(self, settings: Settings) -> list[RicherBalance]:
        """What each direction is judged by, and the error of the body's mesh."""
        found = []
        for name in DIRECTIONS:
            other = self._judge(settings, name)
            if other is not None:
                found.append(self._balance(MEANINGS[name], self.families, other))
        if self.softer:
            # no interval holds it: blades are not alike either, and who measures takes the
            # frequency from the blade
            found.append(self._balance(BODY_MESH, self.softer, settings, widens=False))
        return found

    def enriched(self, settings: Settings, what: str, need: float) -> Settings | None:
        """Settings richer in what a richer balance showed to be missing; None where there are none
        that can be afforded.

        Args:
            what: of a balance of `richer`.
            need: how many times smaller its change should become.
        """
        name = next((name for name, words in MEANINGS.items() if words == what), None)
        more = None if name is None else enriched_settings(settings, name, need)
        if more is None or not self._can_be_had(more) or self._unknowns(more) > LARGEST_FIT:
            return None
        return more

    def _at(self, load: float, force: float) -> np.ndarray:
        return (self.readings.load == load) & (self.readings.force == force)

    def _models(
        self, families: Mapping[float, Family], settings: Settings
    ) -> dict[tuple[float, float], ReducedModel]:
        """(load, force) to the model that is driven so."""
        found = {}
        for load, family in families.items():
            model = family_member(family, settings).model
            for force in np.unique(self.readings.force[self.readings.load == load]):
                found[load, float(force)] = vary(model, "force", float(force) / self.force)
        return found

    def _balance(
        self,
        what: str,
        families: Mapping[float, Family],
        settings: Settings,
        widens: bool = True,
    ) -> RicherBalance:
        models = tuple(self._models(families, settings).values())
        return RicherBalance(what, models, settings.harmonics, settings.samples, widens)

    def _judge(self, settings: Settings, name: str) -> Settings | None:
        """Settings to compare with in a direction: richer ones, else poorer ones, which are more
        wrong.
        """
        if name != "points":
            return richer_settings(self.family, settings, name)
        nodes = len(family_member(self.family, settings).groups) // 2
        own = nodes if settings.points is None else min(settings.points, nodes)
        for points in [nodes // 2**k for k in range(nodes.bit_length())]:
            other = replace(settings, points=points)
            if own < points and self._unknowns(other) <= LARGEST_JUDGE:
                return other
        return replace(settings, points=own // 2) if own > 1 else None

    def _can_be_had(self, settings: Settings) -> bool:
        family = self.family
        dampers = family.dampers or DAMPER_MODELS
        return (
            settings.modes <= family.modes
            and settings.harmonics <= family.harmonics
            and settings.damper in dampers
        )

    def _unknowns(self, settings: Settings) -> int:
        """Real unknowns of the balance."""
        member = family_member(self.family, replace(settings, harmonics=1))
        dofs = len(member.model.elements.kt) * member.model.directions
        return int(dofs * (2 * settings.harmonics + 1))


def measured_models(run: ReducedRun, readings: Readings) -> MeasuredModels:
    """Models of a reduced run that was seated under the loads of the readings."""
    scene = run.scene
    patches = list(run.contact.problem.patches)
    cases = load_cases(scene, run.mesh, run.contact)
    family = partial(family_of_case, scene, run.mesh, run.reduced, patches)
    softer = softer_body(scene, run.mesh, run.reduced, patches, run.mode_errors)
    return MeasuredModels(
        readings,
        scene.excitation.force,
        {case.load: family(case) for case in cases},
        {} if softer is None else {case.load: softer.family(case) for case in cases},
    )


def first_fit_settings(settings: Settings) -> Settings:
    """The settings of a run with as many harmonics and samples as a fit begins with."""
    H = max(settings.harmonics, FEWEST_HARMONICS)
    samples = max(settings.samples, FEWEST_SAMPLES, 8 * (H + 1))
    return replace(settings, harmonics=H, samples=samples)
