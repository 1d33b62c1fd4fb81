"""The response stage: best loads, responses of every load, what they depend on, their stresses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

from geometry.mesh import Mesh, sector_of

from ...data import Patch
from ...errors import NotSolvedError
from ...hbm.parallel import share_work
from ...io.stage_cache import cached_stage, on_root
from ...scene.aerodynamics import has_flow
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...scene.validate_contact import is_frictionless
from ...util.communicator import Communicator
from ...util.message import method
from ..adaptive.family import Family
from ..adaptive.settings import Settings
from ..influences import Influence, influences, parameters_of
from .assemble_model import LoadCase, rigid_body
from .best_load import BestLoad, chart_loads
from .best_load_remarks import (
    best_load_remarks,
    lower_studied_remarks,
    stress_message,
)
from .best_load_search import find_best_load
from .bodies import Bodies, is_wheel
from .body_mesh import SofterBody
from .case_models import family_of_case, load_cases, softer_body
from .changed_cases import cases_of, changed_cases
from .curve import Curve, load_of
from .damped_motion import (
    DampedStress,
    MotionPart,
    SolvedPoint,
    damper_motion,
    motion_in_diameter,
    stress_of_motion,
    sum_of_parts,
)
from .history import FRICTIONLESS
from .kept_best_load import study_kept_loads
from .linear_limits import Limit, judged_limits
from .loads import Search, best_curve, curve_of, study_loads
from .other_diameters import ClassVerdict, class_verdicts, sentence_of_classes
from .reduced_sector import with_damper_mass
from .response_remarks import response_remarks
from .run_records import ReducedRun, Response, Seating, SolvedRun
from .seated_loads import seat_at_loads, studied_loads, with_more_loads
from .stability_remarks import Disturbances, judged_disturbances
from .stage_inputs import stage_key
from .stage_runner import StageRunner
from .utilisation import utilisation_message

# name of the stage
INFLUENCES = "influences"


@dataclass(frozen=True)
class _Study:
    """What all parts of the stage share."""

    scene: Scene
    mesh: Mesh
    # of a load case, its models
    family: Callable[[LoadCase], Family]
    # to begin with
    settings: Settings
    keep: StageRunner

    @property
    def sectors(self) -> int:
        """Of the wheel; 0 without one."""
        return sector_of(self.mesh).count if is_wheel(self.mesh) else 0


def run_response(
    before: ReducedRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
) -> SolvedRun:
    """The responses of every load of the study, from a reduced sector.

    Args:
        bodies: with the factors that earlier stages have left, for the stresses.
        patches: the contact patches of the mesh.
        keep: computes what the run folder does not hold.

    Raises:
        NotSolvedError: no solution, from the balance or the search of the best load.
    """
    scene = before.scene
    mesh = before.mesh
    clock = keep.clock
    family = partial(family_of_case, scene, mesh, before.reduced, patches)
    study = _Study(scene, mesh, family, before.settings, keep)
    searches = _best_load_searches(study, before.contact)
    best: list[BestLoad] = []
    if scene.study.loads is None:
        with clock("best load"):
            best = share_work(lambda one: one.find(), searches, keep.comm, on_demand=True)
    if best and not any(b.reason for b in best):
        loads = studied_loads(scene, before.contact.own, chart_loads(best))
        before = replace(before, contact=seat_at_loads(scene, before.contact, loads, clock))
    cases = load_cases(scene, mesh, before.contact)
    softer = softer_body(scene, mesh, before.reduced, patches, before.mode_errors)
    if softer is None:
        clock.messages.append(
            "errors by the body's mesh are not estimated: the reduced model has other modes than "
            "those of the stage, or its elements are far too large"
        )
    response, cases = _load_responses(study, before.contact, cases, softer, best, searches)
    loads = [case.load for case in cases]
    before = replace(before, contact=with_more_loads(scene, before.contact, loads, clock.messages))
    clock.messages.extend(lower_studied_remarks(scene, response.best, response.curves))
    with clock("influences"):
        found = _influences(study, before.contact, response.best_found)
    curves = response.curves
    with clock("stresses"):
        damped = keep(
            "damped_stress",
            stage_key("damped motion", scene, [(c.load, c.mass, c.peak.f) for c in curves]),
            lambda: _stresses(before, bodies, patches, response, cases),
        )
        best_one = response.best_curve
        clock.messages.append(stress_message(damped[best_one], curves[best_one].over_balance))
    response = replace(response, influences=found)
    result = SolvedRun(**vars(before), response=response, damped=damped)
    clock.messages.extend(filter(None, [utilisation_message(result)]))
    return result


def own_curve(curves: Sequence[Curve], load: float, mass: float) -> int:
    """Number of the curve nearest to the damper's own load [N]; of several damper masses, that of
    the mass nearest to its own [kg].
    """
    return min(
        range(len(curves)),
        key=lambda k: (abs((curves[k].mass or mass) - mass), abs(curves[k].load - load)),
    )


def _stresses(
    before: ReducedRun,
    bodies: Bodies,
    patches: list[Patch],
    response: Response,
    cases: Sequence[LoadCase],
) -> dict[int, DampedStress]:
    """The stress under the best load and under the damper's own one, by number of the curve.

    Where a rank has the bodies for itself, nodal diameters and loads are dealt over the ranks: the
    many harmonics of the best load take most of the time. Else all on rank 0.
    """
    own = before.contact.own
    curves = response.curves
    wanted = {response.best_curve}
    if own is not None:
        wanted.add(own_curve(curves, own, before.contact.problem.mass))
    numbers = sorted(wanted)
    factorised = lru_cache(maxsize=None)(lambda n: bodies.alone.factorised(n))

    peaks = {k: SolvedPoint(cases[k], curves[k].peak, curves[k].settings.points) for k in numbers}

    def part(of: tuple[int, int]) -> MotionPart:
        k, i = of
        return motion_in_diameter(bodies.alone, patches, before.modes, i, peaks[k], factorised)

    def stress(k: int, parts: Sequence[MotionPart]) -> DampedStress:
        reduced = with_damper_mass(before.reduced, cases[k].mass)
        body = rigid_body(before.scene, before.mesh, reduced, patches, curves[k].settings.damper)
        motion = sum_of_parts(bodies.alone, patches, curves[k].peak, parts)
        moved = damper_motion(before.mesh, patches, peaks[k], body)
        return stress_of_motion(bodies.alone, cases[k], motion, motion.harmonics + moved)

    def stresses(comm: Communicator | None) -> list[DampedStress]:
        pieces = [(k, i) for k in numbers for i in range(len(before.modes))]
        parts = share_work(part, pieces, comm)
        of_load = {
            k: [x for x, (n, _) in zip(parts, pieces, strict=True) if n == k] for k in numbers
        }
        return share_work(lambda k: stress(k, of_load[k]), numbers, comm)

    if bodies.ranks_of_sector == 1:
        found = stresses(bodies.comm)
    else:
        found = on_root(bodies.comm, lambda: stresses(None))
    return dict(zip(numbers, found, strict=True))


def _load_responses(
    study: _Study,
    contact: Seating,
    cases: list[LoadCase],
    softer: SofterBody | None,
    best: Sequence[BestLoad],
    searches: Sequence[Search],
) -> tuple[Response, list[LoadCase]]:
    """Curves of all loads, the best loads, and what is left without friction; and the load cases of
    the curves, which are more where a best load was found that was not given.

    Args:
        contact: for what the best load depends on, which a free rank finds beside added loads.
        softer: the body less the error of its stiffness, for the error by its mesh.
        best: loads that were searched before; none when they were not.
        searches: for them.
    """
    scene, family, settings, keep = study.scene, study.family, study.settings, study.keep
    clock = keep.clock

    def curve_at(case: LoadCase) -> Curve:
        return keep.alone(
            f"response_{_case_label(case)}",
            stage_key("response", scene, case.load, case.mass, replace(settings, error=None)),
            partial(curve_of, scene, case, family, settings, softer),
        )

    with clock("response"):
        studied = study_loads(
            cases,
            curve_at,
            keep.comm,
            clock.progress,
            min((b.load for b in best if not b.reason), default=0.0),
            () if best else searches,
        )
        if best:
            studied = studied._replace(best=list(best))
        if scene.study.stability:
            beside = _influences_beside(study, contact, studied.best)
            curves_of = partial(_added_curves, study, curve_at, beside)
            studied = study_kept_loads(studied, searches, curves_of, scene.accuracy)
        cases, curves, found = studied
        band = min(c.frequency[0] for c in curves), max(c.frequency[-1] for c in curves)
        limits = _limits_of_masses(study, cases, softer, band)
        models = family(cases[-1])
    best = tuple(found)
    clock.messages.extend(best_load_remarks(scene, best))
    nodes = -(-len(cases[0].elements.kt) // 2)
    judged = Disturbances()
    others: dict[int, tuple[ClassVerdict, ...]] = {}
    if scene.study.stability:
        order = scene.excitation.engine_order
        judged = judged_disturbances(models, settings, order, study.sectors, has_flow(scene))
        with clock("response"):
            k = best_curve(curves, best)
            others[k] = _class_verdicts(study, family(cases[k]), curves[k])
    clock.messages.extend(response_remarks(scene, settings, curves, nodes, judged))
    clock.messages.extend(_class_remarks(curves, others, judged))
    return Response(settings, curves, limits, best, others=others), cases


def _limits_of_masses(
    study: _Study,
    cases: Sequence[LoadCase],
    softer: SofterBody | None,
    band: tuple[float, float],
) -> tuple[Limit, ...]:
    """No damper, and full stick of each mass of the damper under its largest load."""
    mode, open_points = study.scene.excitation.mode, not study.scene.contact.points
    found: list[Limit] = []
    # the last case of each mass
    for mass, case in {case.mass: case for case in cases}.items():
        soft = None if softer is None else softer.family(case)
        models = study.family(case)
        free, stuck = judged_limits(models, study.settings, soft, mode, band, open_points)
        found = [free, *found[1:], replace(stuck, mass=mass)]
    return tuple(found)


def _class_verdicts(study: _Study, models: Family, curve: Curve) -> tuple[ClassVerdict, ...]:
    """Verdicts on the resonance of a curve in other nodal diameters, kept with the run."""
    if models.disturbed is None:
        return ()
    order = study.scene.excitation.engine_order

    def compute() -> tuple[ClassVerdict, ...]:
        return class_verdicts(models, curve.settings, curve.peak, order, study.sectors)

    known = curve.load, curve.mass, curve.peak.f, replace(curve.settings, error=None)
    key = stage_key("response", study.scene, "other diameters", *known)
    return study.keep("other_diameters", key, lambda: on_root(study.keep.comm, compute))


def _class_remarks(
    curves: Sequence[Curve],
    others: dict[int, tuple[ClassVerdict, ...]],
    judged: Disturbances,
) -> list[str]:
    """What was found in the other nodal diameters."""
    said = (sentence_of_classes(load_of(curves[k]), v, judged) for k, v in others.items())
    return [method(text) for text in said if text]


def _case_label(case: LoadCase) -> str:
    """ "90N" or "90N_30g"."""
    return f"{case.load:g}N{_mass_label(case.mass)}"


def _mass_label(mass: float | None) -> str:
    return "" if mass is None else f"_{1e3 * mass:g}g"


def _best_load_searches(study: _Study, contact: Seating) -> list[Search]:
    """The search for the best load of each mass of the damper, on one rank; none where a single
    load was asked for, or where no friction makes one load better than another.
    """
    scene, settings = study.scene, study.settings
    loads = scene.study.loads
    if loads is not None and (len(loads) == 1 or is_frictionless(scene)):
        return []

    def search(mass: float | None) -> Search:
        tangents = study.mesh.dimension - 1
        case_at = cases_of(scene, contact.problem, tangents, mass, contact.rough)
        key = stage_key("response", scene, "best load", mass, replace(settings, error=None))
        find = partial(find_best_load, scene, case_at, study.family, settings, mass)
        return Search(
            partial(study.keep.alone, f"best_load{_mass_label(mass)}", key, find), case_at
        )

    return [search(mass) for mass in scene.study.masses or (None,)]


def _added_curves(
    study: _Study,
    curve_at: Callable[[LoadCase], Curve],
    beside: list[_InfluenceStage],
    cases: list[LoadCase],
) -> list[Curve]:
    """The responses of further loads, mostly a single one.

    Args:
        beside: stages that are computed ahead beside them; each is taken out of the list.
    """
    stages = [beside.pop() for _ in range(len(beside))]
    tasks: list[Callable[[], Any]] = [
        *(partial(curve_at, case) for case in cases),
        *(partial(one.computed_alone, study.keep) for one in stages),
    ]
    done = share_work(lambda task: task(), tasks, study.keep.comm, on_demand=True)
    for found in filter(None, done[len(cases) :]):
        study.keep.ahead[INFLUENCES] = found
    return done[: len(cases)]


@dataclass(frozen=True)
class _InfluenceStage:
    """What a best load depends on."""

    key: str
    compute: Callable[[Communicator | None], list[Influence]]

    def computed_alone(self, keep: StageRunner) -> tuple[list[Influence], float | None] | None:
        """By one rank: what `cached_stage` gives; None where it was not found."""
        try:
            return cached_stage(keep.folder, INFLUENCES, self.key, lambda: self.compute(None))
        except NotSolvedError:
            return None


def _influences_beside(
    study: _Study, contact: Seating, best: Sequence[BestLoad]
) -> list[_InfluenceStage]:
    """The influences, for a rank that has nothing else to do; none where there is one rank, or
    several dampers, of which the best one is not known yet.
    """
    comm = study.keep.comm
    if comm is None or comm.size == 1 or len(best) != 1 or best[0].reason:
        return []
    return list(filter(None, [_influence_stage(study, contact, best[0])]))


def _influence_stage(study: _Study, contact: Seating, best: BestLoad) -> _InfluenceStage | None:
    """What the best load of the search depends on; None where that is not wanted."""
    scene = study.scene
    if not scene.study.influences:
        return None
    # which motions the blade keeps does not matter to them
    searched = replace(best, kept=None)
    tangents = study.mesh.dimension - 1
    changed = changed_cases(scene, contact.problem, tangents, best.mass, contact.rough)
    # a history of the seating has its friction already
    frictionless = scene.contact.history == FRICTIONLESS
    flank_angles = kind_named(scene.kind).flank_angles
    angles = flank_angles(scene) if flank_angles is not None and frictionless else None
    parameters = parameters_of(scene, angles)

    def compute(comm: Communicator | None) -> list[Influence]:
        return influences(scene, searched, study.family, changed, parameters, comm)

    return _InfluenceStage(stage_key("response", scene, INFLUENCES, searched), compute)


def _influences(study: _Study, contact: Seating, best: BestLoad | None) -> tuple[Influence, ...]:
    """What the best load depends on; none where it was not found or not wanted."""
    keep = study.keep
    stage = None if best is None else _influence_stage(study, contact, best)
    if stage is None:
        return ()
    try:
        return tuple(keep(INFLUENCES, stage.key, lambda: stage.compute(keep.comm)))
    except NotSolvedError as error:
        keep.clock.messages.append(f"what the best load depends on is not known: {error}")
        return ()
