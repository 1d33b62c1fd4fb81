"""Models of a load case: from the reduced sector with as many modes as its resonance needs, to all
harmonics and contact points that the automatic choice may ask for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from geometry.mesh import Mesh

from ...data import Patch, PortModel
from ...errors import NotSolvedError
from ...hbm.model import ReducedModel, softened_layer
from ...reduction.assemble import wheel_models
from ...reduction.other_diameters import has_rigid_motion, spanned_models
from ...reduction.truncate import truncate_modes
from ...scene.aerodynamics import has_flow
from ...scene.tables import Scene
from ..adaptive.band_sweep import covered_band
from ..adaptive.cheaper_settings import cheaper_settings
from ..adaptive.check_points import peak_of
from ..adaptive.family import Family, Member, family_member, shared_harmonics
from ..adaptive.peak_errors import peak_from
from ..adaptive.resonance_choice import LARGEST_BALANCE, choose_at_peak
from ..adaptive.settings import DAMPER_MODELS, Settings, enriched_settings, first_settings
from ..adaptive.stiff_layer import softened_where_lifting
from .assemble_model import LoadCase, joint_model
from .bodies import Bodies, is_wheel
from .body_mesh import ModeErrors, SofterBody, frequency_ratio, softened_sector
from .changed_cases import seated_case
from .coriolis import with_coriolis
from .damper_coriolis import with_damper_coriolis
from .joined_contacts import joined_member
from .liftoff import naming_the_load
from .normal_modes import harmonic_diameters
from .reduced_sector import Reduced, reduce_sector, with_damper_mass
from .run_records import Seating
from .stage_inputs import stage_key

# higher ones borrow the nodal diameter next to their own
EXACT_HARMONICS = 3
# contact points of both seats with which the automatic choice may take the most harmonics; those
# with more points are refused by their unknowns (adaptive.resonance_choice)
FEWEST_POINTS = 16
HARMONICS = (3, 7, 15, 31)


def load_cases(
    scene: Scene,
    mesh: Mesh,
    contact: Seating,
) -> list[LoadCase]:
    """The friction elements of each load, for each mass of the damper."""
    return [
        seated_case(scene, contact.problem, contact.maps[load], load, mesh.dimension - 1, mass)
        for mass in scene.study.masses or (None,)
        for load in contact.maps
    ]


def middle_case(cases: Sequence[LoadCase]) -> LoadCase:
    """The middle load of the middle damper mass, for choices that are made once for all cases.

    Not the middle of the list: of an even number of masses that is the first load of one of them,
    under which the damper may lift off.
    """
    masses = list(dict.fromkeys(case.mass for case in cases))
    own = [case for case in cases if case.mass == masses[len(masses) // 2]]
    return sorted(own, key=lambda case: case.load)[len(own) // 2]


def family_of_case(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: list[Patch],
    case: LoadCase,
) -> Family:
    """All models of a load case that the reduced sector allows."""
    reduced = with_damper_mass(reduced, case.mass)
    most = affordable_harmonics(case)

    def shared(settings: Settings) -> Member:
        harmonics = max(settings.harmonics, min(shared_harmonics(settings.harmonics), most))
        return build(replace(settings, harmonics=harmonics))

    # a point's own model and those of its five indicators
    @lru_cache(maxsize=6)
    def build(settings: Settings) -> Member:
        few = {n: truncate_modes(body, settings.modes) for n, body in reduced.sector.items()}
        model = joint_model(
            scene,
            mesh,
            replace(reduced, sector=few),
            patches,
            case,
            settings.harmonics,
            settings.damper,
        )
        return joined_member(model, patches, settings.points, scene.contact.points)

    others = other_diameters(scene, reduced)

    def disturbed(settings: Settings, shift: int) -> ReducedModel:
        assert others is not None
        sides = wheel_models(
            others(settings.modes),
            reduced.following,
            scene.excitation.engine_order,
            reduced.sectors,
            settings.harmonics,
            shift,
        )
        H, damper = settings.harmonics, settings.damper
        model = joint_model(scene, mesh, reduced, patches, case, H, damper, sides)
        joined = joined_member(model, patches, settings.points, scene.contact.points).model
        return softened_layer(joined) if settings.softened else joined

    return Family(
        shared,
        max(len(body.omega) for body in reduced.sector.values()),
        2 * most + 1,
        DAMPER_MODELS,
        disturbed if others is not None else None,
    )


def other_diameters(
    scene: Scene,
    reduced: Reduced,
) -> Callable[[int], dict[int, PortModel]] | None:
    """The sector with so many modes in all nodal diameters; None where those that were not reduced
    are not known: no span, rigid motions, a flow, Coriolis forces that count.
    """
    span = reduced.span
    coupled = any(body.damping is not None for body in reduced.sector.values())
    if span is None or coupled or has_flow(scene) or has_rigid_motion(reduced.sector):
        return None

    @lru_cache(maxsize=2)
    def found(modes: int) -> dict[int, PortModel]:
        few = {n: truncate_modes(body, modes) for n, body in reduced.sector.items()}
        return spanned_models(span, few, reduced.sectors, modes)

    return found


def softer_body(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: Sequence[Patch],
    errors: ModeErrors,
) -> SofterBody | None:
    """All models of each load case on the blade less the error of its stiffness, and less half of
    it.
    """

    def less(share: float) -> SofterBody | None:
        part = replace(errors, energies=share * errors.energies)
        softer = softened_sector(reduced, part)
        if softer is None:
            return None
        ratio = frequency_ratio(reduced, softer, part, scene.excitation.mode)
        return SofterBody(partial(family_of_case, scene, mesh, softer, list(patches)), ratio)

    whole = less(1.0)
    return None if whole is None else replace(whole, half=less(0.5))


def affordable_harmonics(case: LoadCase) -> int:
    """Harmonics that LARGEST_BALANCE allows with FEWEST_POINTS contact points; twice as many judge
    them, at single points.
    """
    directions = 1 + case.elements.tangents
    dofs = min(case.selection.shape[1], FEWEST_POINTS * directions)
    return max((h for h in HARMONICS if dofs * (2 * h + 1) <= LARGEST_BALANCE), default=3)


def judged_modes(scene: Scene, settings: Settings) -> int:
    """Modes of each nodal diameter to reduce with: where their number is open, twice as many as the
    balance takes, which judge it.
    """
    return settings.modes if scene.model.modes else 2 * settings.modes


def reduced_sector(
    scene: Scene,
    bodies: Bodies,
    case: LoadCase,
    patches: list[Patch],
    keep: Callable[[str, str, Callable[[], Any]], Any],
) -> tuple[Settings, Reduced]:
    """The sector with as many modes as the resonance of one load needs, and settings to start the
    others from; those there were where richer models of that resonance are not solved.

    Args:
        keep: keep(name, key, compute) gives the result of a stage, found from an earlier run or
            computed and kept.
    """
    start = replace(first_settings(scene), most=affordable_harmonics(case))
    diameters = harmonic_diameters(scene, bodies.mesh, EXACT_HARMONICS)
    spanned = bool(scene.study.stability) and is_wheel(bodies.mesh)
    made: dict[int, Reduced] = {}

    def reduced(settings: Settings) -> Reduced:
        count = judged_modes(scene, settings)
        if count not in made:
            key = stage_key("reduction", scene, np.array(diameters), count, spanned)
            reduce = partial(reduce_sector, bodies, patches, diameters, count, spanned=spanned)
            # each on its own: where modes are added both serve the next run
            blade = with_coriolis(scene, keep(f"reduction_{count}_modes", key, reduce))
            made[count] = with_damper_coriolis(scene, bodies.mesh, blade, patches, case)
        return made[count]

    if not start.chosen:
        return start, reduced(start)
    key = stage_key("response", scene, "settings", case.load, case.mass)

    def family_of(settings: Settings) -> Family:
        return family_of_case(scene, bodies.mesh, reduced(settings), patches, case)

    settings = keep("settings", key, partial(_with_modes, scene, case, start, family_of))
    return settings, reduced(settings)


def _with_modes(
    scene: Scene,
    case: LoadCase,
    settings: Settings,
    family_of: Callable[[Settings], Family],
) -> Settings:
    """Settings with as many modes as the resonance of a load needs.

    Args:
        settings: those to begin with.
        family_of: all models with the modes of some settings, and those that judge them.
    """
    mode = scene.excitation.mode
    while True:
        family = family_of(settings)
        model = family_member(family, settings).model
        with naming_the_load(case, model, mode, scene.excitation.force, scene.study.band):
            rough = covered_band(model, settings, scene.study.band, mode, 1.0)
            settings = softened_where_lifting(family, settings, peak_of(rough))
            peak = peak_from(family, settings, peak_of(rough), settings, scene.accuracy)
        try:
            enough = choose_at_peak(family, settings, peak, scene.accuracy, fixed=("modes",))
        except NotSolvedError:
            # where the damper comes off at this load; each curve judges the modes again
            return settings
        settings, _, found = cheaper_settings(family, *enough, scene.accuracy)
        more = enriched_settings(settings, "modes")
        known = "modes" in settings.chosen and np.isfinite(found.height["modes"])
        if not known or found.needs["modes"] <= scene.accuracy / 10 or more is None:
            return settings
        settings = more
