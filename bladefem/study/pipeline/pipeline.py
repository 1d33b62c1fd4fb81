"""From a scene to forced responses, stage by stage; each is kept in the run folder and found there
by the next run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar, overload

import numpy as np

from geometry.mesh import Mesh

from ...contact.frictional_seating import FrictionalProblem, normal_part
from ...contact.peak_pressure import peak_remarks
from ...contact.seating import ContactProblem
from ...contact.seating import solve as seat
from ...data import Patch
from ...errors import InputError, NotSolvedError, suggestion
from ...io.stage_cache import found_remark, on_root, stage
from ...reduction.truncate import truncated
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...scene.units import show
from ...scene.validate import refuse_response
from ...scene.warnings import doubts
from ...util.communicator import Communicator
from ...util.message import method, warning
from ...util.progress import Progress, unwatched
from ..adaptive.check_points import peak_of
from ..adaptive.choice import covered_band
from ..adaptive.contact_mesh import coarse_sentence
from ..adaptive.family import Family, Member, coarsened_elements, family_member, shared_harmonics
from ..adaptive.resonance_choice import choose_at_peak, peak_from
from ..adaptive.settings import DAMPERS, Settings, enriched_settings, first_settings
from ..influences import Influence, influences, parameters_of
from ..modes.clamped_aerofoil import clamped_blade
from ..modes.stress import strength
from .assemble_model import LoadCase, joint_model
from .best_load import BestLoad, chart_loads, find_best_load
from .body_mesh import (
    ModeErrors,
    SofterBody,
    frequency_ratio,
    mode_errors,
    softened,
)
from .changed_cases import cases_of, changed_cases, seated_case
from .contact_cycle import labels
from .damped_motion import DampedStress, damped_stress
from .history import (
    FRICTIONLESS,
    coarse_history,
    condense_friction,
    damper_masses,
    history_sentence,
    refuse_jamming,
    seat_by_history,
)
from .liftoff import named
from .linear_limits import linear_limits
from .load_interval import interval_sentence
from .loads import Curve, beyond_tolerance, default_loads, study_loads
from .resonance_list import reach_sentence
from .run_records import ModalRun, ReducedRun, Response, Run, SeatedRun, Seating, SolvedRun
from .stability import stability_sentence, unstable_sentence
from .stage_inputs import stage_key
from .stages import (
    Bodies,
    Reduced,
    build_mesh,
    condense_contact,
    excited_modes,
    find_modes,
    harmonic_diameters,
    on_layer,
    reduce_sector,
    weighted,
)
from .utilisation import utilisation_message
from .validate_mesh import found_patches

# higher ones borrow the nodal diameter next to their own
EXACT_HARMONICS = 3
# of the largest balance that the automatic choice solves; model.harmonics may ask for more
UNKNOWNS = 6000
# largest estimated error by the mesh of a stress that is no warning
TRUSTED_STRESS = 0.2
STAGES = ("mesh", "modes", "contact", "reduction", "response")
Folder: TypeAlias = str | Path | None
Result = TypeVar("Result")


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["mesh"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> Run: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["modes"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> ModalRun: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["contact"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> SeatedRun: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["reduction"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> ReducedRun: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["response"] = ...,
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> SolvedRun: ...


def run(
    scene: Scene,
    folder: Folder,
    until: str = "response",
    comm: Communicator | None = None,
    progress: Progress = unwatched,
) -> Run:
    """Run a scene as far as a stage, on all ranks of a communicator.

    Args:
        folder: the run folder; finished stages are picked up from it. None: in memory.
        until: one of STAGES.
        progress: wraps long loops, as tqdm does: progress(items, label).

    Returns:
        the record of that stage, see :mod:`bladefem.study.pipeline.run_records`.

    Raises:
        InputError: the scene cannot be run as it is; NotSolvedError: a stage found no solution.
    """
    if until not in STAGES:
        raise InputError(f"until = {until!r}: expected a stage{suggestion(until, STAGES)}")
    responds = until in STAGES[3:]
    if responds:
        refuse_response(scene)
    keep = _Keeper(folder, comm, Clock({}, [*map(warning, doubts(scene))], progress))
    meshed = _run_mesh(scene, keep)
    if until == "mesh":
        return meshed
    check_blade(scene, meshed.mesh)
    patches = [] if until == "modes" else found_patches(scene, meshed.mesh, excited=responds)
    if patches:
        refuse_jamming(scene, meshed.mesh, patches)
    bodies = Bodies(scene, meshed.mesh, comm, progress)
    modal = _run_modes(meshed, bodies, keep, responds)
    if until == "modes":
        return modal
    seated = _run_contact(modal, bodies, patches, keep)
    if until == "contact":
        return seated
    reduced = _run_reduction(seated, bodies, patches, keep)
    if until == "reduction":
        return reduced
    return _run_response(reduced, patches, keep)


def _run_mesh(scene: Scene, keep: _Keeper) -> Run:
    clock = keep.clock
    with clock("mesh"):
        mesh = keep("mesh", stage_key("mesh", scene), lambda: build_mesh(scene, keep.comm))
    # what was done to a user's own elements
    clock.messages.extend(mesh.report.get("notes", ()))
    return Run(
        scene=scene,
        folder=None if keep.folder is None else Path(keep.folder),
        mesh=mesh,
        timings=clock.seconds,
        messages=clock.messages,
    )


def _run_modes(
    before: Run,
    bodies: Bodies,
    keep: _Keeper,
    responds: bool,
) -> ModalRun:
    key = stage_key("modes", before.scene)
    # the reduction needs more modes of the same pencils
    reduced = judged_modes(before.scene, first_settings(before.scene)) if responds else 0
    with keep.clock("modes"):
        modes = keep("modes", key, lambda: find_modes(bodies, reduced=reduced))
        clamped = keep("clamped", key, lambda: clamped_blade(bodies))
    return ModalRun(**vars(before), modes=modes, clamped=clamped)


def _run_contact(
    before: ModalRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: _Keeper,
) -> SeatedRun:
    scene = before.scene
    mesh = before.mesh
    clock = keep.clock
    with clock("contact"):
        seating = _seated(scene, bodies, patches, keep, clock)
        if mesh.dimension == 2:
            coarse = coarse_sentence(m for pair in seating.maps.values() for m in pair)
            clock.messages.extend(map(warning, filter(None, [coarse])))
        clock.messages.extend(map(warning, peak_remarks(seating.maps, scene, mesh.depth)))
    return SeatedRun(**vars(before), contact=seating)


def _run_reduction(
    before: SeatedRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: _Keeper,
) -> ReducedRun:
    scene = before.scene
    mesh = before.mesh
    with keep.clock("stresses"):
        excited = excited_modes(scene, mesh, before.modes)
        stressed = keep("strength", stage_key("stress", scene), lambda: strength(bodies, excited))
    cases = load_cases(scene, mesh, before.contact)
    middle = cases[len(cases) // 2]
    with keep.clock("reduction"):
        settings, reduced = reduced_sector(scene, bodies, middle, patches, keep)
        errors = keep(
            "mode_errors",
            stage_key("reduction", scene, "mode errors"),
            lambda: mode_errors(bodies, patches, excited),
        )
    return ReducedRun(
        **vars(before),
        strength=stressed,
        settings=settings,
        reduced=reduced,
        mode_errors=errors,
    )


def _run_response(before: ReducedRun, patches: list[Patch], keep: _Keeper) -> SolvedRun:
    scene = before.scene
    mesh = before.mesh
    settings = before.settings
    clock = keep.clock
    family = partial(family_of_case, scene, mesh, before.reduced, patches)
    with clock("best load"):
        best = _best_loads(scene, mesh, before.contact, family, settings, keep)
        clock.messages.extend(_best_remarks(scene, best))
    charted = scene.study.loads is None and best and not any(b.reason for b in best)
    if charted:
        loads = studied_loads(scene, before.contact.own, chart_loads(best))
        before = replace(before, contact=_at_loads(scene, before.contact, loads, clock))
    cases = load_cases(scene, mesh, before.contact)
    softer = softer_body(scene, mesh, before.reduced, patches, before.mode_errors)
    if softer is None:
        clock.messages.append(
            "errors by the body's mesh are not estimated: the reduced model has other modes than "
            "those of the stage, or its elements are far too large"
        )
    response = _response(scene, cases, family, settings, keep, softer)
    with clock("influences"):
        found = _influences(scene, mesh, before.contact, family, best, keep)
    curves = response.curves
    with clock("stresses"):
        damped = keep(
            "damped_stress",
            stage_key("stress", scene, [(c.load, c.mass, c.peak.f) for c in curves]),
            lambda: _stresses(before, patches, curves, cases, keep.comm),
        )
        clock.messages.append(stress_message(curves, damped))
    response = replace(response, best=best, influences=found)
    result = SolvedRun(**vars(before), response=response, damped=damped)
    clock.messages.extend(filter(None, [utilisation_message(result)]))
    return result


def _stresses(
    before: ReducedRun,
    patches: Sequence[Patch],
    curves: Sequence[Curve],
    cases: Sequence[LoadCase],
    comm: Communicator | None,
) -> dict[int, DampedStress]:
    """The stress at the lowest resonance and at that of the damper's own load, by number of the
    curve; on rank 0, whose bodies share one factorisation over the nodal diameters.
    """
    own = before.contact.own
    wanted = {min(range(len(curves)), key=lambda k: curves[k].peak_amplitude)}
    if own is not None:
        wanted.add(min(range(len(curves)), key=lambda k: abs(curves[k].load - own)))

    def compute() -> dict[int, DampedStress]:
        from ...fem.compat import MPI

        alone = Bodies(before.scene, before.mesh, MPI.COMM_SELF)
        factorised = lru_cache(maxsize=None)(alone.factorised)
        found = {}
        for k in sorted(wanted):
            points = curves[k].settings.points
            found[k] = damped_stress(
                alone, patches, before.modes, cases[k], curves[k].peak, points, factorised
            )
        return found

    return on_root(comm, compute)


def stress_message(curves: list[Curve], stressed: dict[int, DampedStress]) -> str:
    """The stress of the lowest resonance, and how far it can be trusted."""
    best = min(range(len(curves)), key=lambda k: curves[k].peak_amplitude)
    found = stressed[best]
    place = ", ".join(f"{1e3 * x:.1f}" for x in found.place)
    text = (
        f"alternating stress at the best load, {found.load:.4g} N: {1e-6 * found.largest:.4g} MPa "
        f"at ({place}) mm, of all modes, harmonics and damper forces; by its mesh "
        f"{found.mesh_error:.1%} uncertain there"
    )
    if found.mesh_error <= TRUSTED_STRESS:
        return text
    return warning(f"{text}: a sharp edge or too coarse a mesh, so no stress to sign")


@dataclass(frozen=True)
class Clock:
    """Seconds a stage, and what was worth saying; shows the stage at work."""

    seconds: dict[str, float]
    messages: list[str]
    progress: Progress = unwatched

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            for _ in self.progress([name], name, delay=0.0, bar_format="{desc} ..."):
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


@dataclass(frozen=True)
class _Keeper:
    """Compute a stage or find it in the folder, and say so."""

    # None keeps nothing
    folder: Folder
    comm: Communicator | None
    clock: Clock

    def __call__(
        self,
        name: str,
        key: str,
        compute: Callable[[], Result],
    ) -> Result:
        return self._said(name, *stage(self.folder, name, key, compute, self.comm))

    def alone(
        self,
        name: str,
        key: str,
        compute: Callable[[], Result],
    ) -> Result:
        """The same for what one rank does without the others."""
        return self._said(name, *stage(self.folder, name, key, compute))

    def _said(
        self,
        name: str,
        result: Result,
        seconds: float | None,
    ) -> Result:
        if seconds is not None:
            self.clock.messages.append(found_remark(name, seconds))
        return result


def _response(
    scene: Scene,
    cases: list[LoadCase],
    family: Callable[[LoadCase], Family],
    settings: Settings,
    keep: _Keeper,
    softer: SofterBody | None,
) -> Response:
    clock = keep.clock
    with clock("response"):
        curves = study_loads(
            scene,
            cases,
            family,
            settings,
            keep.comm,
            clock.progress,
            lambda case, make: keep.alone(
                f"response_{_name(case)}",
                stage_key("response", scene, case.load, case.mass, replace(settings, error=None)),
                make,
            ),
            softer,
        )
        band = min(c.frequency[0] for c in curves), max(c.frequency[-1] for c in curves)
        rich = family_member(family(cases[-1]), settings).model
        limits = linear_limits(rich, scene.excitation.mode, band)
    clock.messages.extend(_remarks(scene, settings, curves, -(-len(cases[0].elements.kt) // 2)))
    return Response(settings, curves, limits)


def _name(case: LoadCase) -> str:
    """ "90N" or "90N_30g"."""
    return f"{case.load:g}N" + ("" if case.mass is None else f"_{1e3 * case.mass:g}g")


def _seated(
    scene: Scene,
    bodies: Bodies,
    patches: list[Patch],
    keep: _Keeper,
    clock: Clock,
) -> Seating:
    """The damper on its seats under every load, without friction or after the scene's history."""
    key = stage_key("contact", scene)
    rough = None
    if scene.contact.history == FRICTIONLESS:
        bare = keep("contact", key, lambda: condense_contact(bodies, patches))
    else:
        rough = keep("contact_friction", key, lambda: condense_friction(bodies, patches))
        bare = normal_part(rough)
    problem = on_layer(scene, bare)
    own = _own_load(scene, problem, rough, clock.messages)
    return _at_loads(
        scene, Seating(problem, {}, own, rough=rough), studied_loads(scene, own), clock
    )


def _at_loads(
    scene: Scene,
    seating: Seating,
    loads: Iterable[float],
    clock: Clock,
) -> Seating:
    """The seats under some loads."""
    rough = seating.rough
    if rough is None:
        speed = scene.operation.speed
        bedded = scene.contact.bedded
        maps = {load: seat(seating.problem, speed, normal=load, bedded=bedded) for load in loads}
        return replace(seating, maps=maps)
    seated = {load: seat_by_history(scene, rough, load) for load in loads}
    masses = damper_masses(scene, rough, seated)
    clock.messages.append(history_sentence(masses))
    clock.messages.extend(map(warning, coarse_history(seated)))
    maps = {load: found.maps for load, found in seated.items()}
    return replace(seating, maps=maps, masses=tuple(masses))


def _own_load(
    scene: Scene,
    problem: ContactProblem,
    rough: FrictionalProblem | None,
    messages: list[str],
) -> float | None:
    """Mean normal load of a seat [N] by the damper's mass at the operating speed; None when nothing
    presses it.
    """
    if not scene.operation.speed > 0:
        return None
    try:
        if rough is None:
            maps = seat(problem, scene.operation.speed, bedded=scene.contact.bedded)
        else:
            maps = seat_by_history(scene, rough, None).maps
    except NotSolvedError as error:
        messages.append(warning(f"the damper's own centrifugal load does not seat it: {error}"))
        return None
    own = float(np.mean([m.force.sum() for m in maps]))
    messages.append(
        f"own load: the damper's {1e3 * problem.mass:.3g} g press each seat with {own:.4g} N at "
        f"{show(scene.operation.speed, 'rad/s')}"
    )
    return own


def _best_loads(
    scene: Scene,
    mesh: Mesh,
    contact: Seating,
    family: Callable[[LoadCase], Family],
    settings: Settings,
    keep: _Keeper,
) -> tuple[BestLoad, ...]:
    """The best load of each mass of the damper; none where a single load was asked for."""
    if scene.study.loads is not None and len(scene.study.loads) == 1:
        return ()

    def search(mass: float | None) -> BestLoad:
        case_at = cases_of(scene, contact.problem, mesh.dimension - 1, mass, contact.rough)
        return find_best_load(scene, case_at, family, settings, mass)

    def compute() -> list[BestLoad]:
        return on_root(keep.comm, lambda: [search(mass) for mass in scene.study.masses or (None,)])

    key = stage_key(
        "response", scene, "best load", scene.study.masses, replace(settings, error=None)
    )
    return tuple(keep("best_load", key, compute))


def _influences(
    scene: Scene,
    mesh: Mesh,
    contact: Seating,
    family: Callable[[LoadCase], Family],
    best: tuple[BestLoad, ...],
    keep: _Keeper,
) -> tuple[Influence, ...]:
    """What the lowest of the best loads hangs on; none where it was not found or not asked for."""
    found = [b for b in best if not b.reason]
    if not found or not scene.study.influences:
        return ()
    lowest = min(found, key=lambda b: b.amplitude)
    changed = changed_cases(scene, contact.problem, mesh.dimension - 1, lowest.mass, contact.rough)
    # a history of the seating has its friction already
    frictionless = scene.contact.history == FRICTIONLESS
    flank_angles = kind_named(scene.kind).flank_angles
    angles = flank_angles(scene) if flank_angles is not None and frictionless else None
    parameters = parameters_of(scene, angles)

    def compute() -> list[Influence]:
        return on_root(keep.comm, lambda: influences(scene, lowest, family, changed, parameters))

    key = stage_key("response", scene, "influences", lowest)
    try:
        return tuple(keep("influences", key, compute))
    except NotSolvedError as error:
        keep.clock.messages.append(f"what the best load hangs on is not known: {error}")
        return ()


def _best_remarks(scene: Scene, best: tuple[BestLoad, ...]) -> Iterator[str]:
    """How the best load was found, or why it was not."""
    for b in best:
        damper = "" if b.mass is None else f" of a damper of {1e3 * b.mass:.4g} g"
        if b.reason:
            yield (
                f"best load{damper}: not found between {b.searched[0]:.3g} and {b.searched[1]:.3g} "
                f"N, since {b.reason}"
            )
            continue
        yield (
            f"best load{damper}: {b.load:.4g} N by exact search between {b.searched[0]:.3g} and "
            f"{b.searched[1]:.3g} N, {len(b.tried)} loads and {b.points} points; no load near it "
            f"lowers the amplitude by more than {100 * b.tolerance:.2g} %; {b.settings.sentence()}"
        )


def studied_loads(
    scene: Scene,
    own: float | None,
    laid: Sequence[float] | None = None,
) -> list[float]:
    """Mean normal loads of a seat to study [N], ascending with the damper's own one where that is
    wanted.

    Args:
        laid: loads of the design chart where the scene gives none; rough ones when left out.
    """
    given = scene.study.loads or laid or default_loads(scene)
    if not scene.study.own_load:
        return list(given)
    if own is None:
        raise InputError(
            "study.own_load = true: nothing presses the damper on its seats at operation.speed = "
            f"{show(scene.operation.speed, 'rad/s')}, expected a speed that does, or study.loads "
            "alone"
        )
    return sorted({*given, float(f"{own:.4g}")})


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


def family_of_case(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: list[Patch],
    case: LoadCase,
) -> Family:
    """All models of a load case that the reduced sector allows."""
    nodes = len(case.elements.kt)
    reduced = weighted(reduced, case.mass)
    most = _affordable(case)

    def shared(settings: Settings) -> Member:
        harmonics = max(settings.harmonics, min(shared_harmonics(settings.harmonics), most))
        return build(replace(settings, harmonics=harmonics))

    # a point's own model and those of its five indicators
    @lru_cache(maxsize=6)
    def build(settings: Settings) -> Member:
        few = {n: truncated(body, settings.modes) for n, body in reduced.sector.items()}
        model = joint_model(
            scene,
            mesh,
            replace(reduced, sector=few),
            patches,
            case,
            settings.harmonics,
            settings.damper,
        )
        groups = np.arange(nodes) if settings.points is None else labels(patches, settings.points)
        return Member(coarsened_elements(model, groups), groups)

    return Family(
        shared, max(len(body.omega) for body in reduced.sector.values()), 2 * most + 1, DAMPERS
    )


def softer_body(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: Sequence[Patch],
    errors: ModeErrors,
) -> SofterBody | None:
    """All models of each load case on the blade less the error of its stiffness."""
    softer = softened(reduced, errors)
    if softer is None:
        return None
    ratio = frequency_ratio(reduced, softer, errors, scene.excitation.mode)
    return SofterBody(partial(family_of_case, scene, mesh, softer, list(patches)), ratio)


def _affordable(case: LoadCase) -> int:
    """Harmonics that UNKNOWNS allow with all contact points; twice as many judge them, at single
    points.
    """
    dofs = case.selection.shape[1]
    return max((h for h in (3, 7, 15, 31) if dofs * (2 * h + 1) <= UNKNOWNS), default=3)


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
    keep: Callable[[str, str, Callable[[], Reduced]], Reduced],
) -> tuple[Settings, Reduced]:
    """The sector with as many modes as the resonance of one load needs, and settings to start the
    others from.
    """
    settings = replace(first_settings(scene), most=_affordable(case))
    diameters = harmonic_diameters(scene, bodies.mesh, EXACT_HARMONICS)
    while True:
        count = judged_modes(scene, settings)
        key = stage_key("reduction", scene, np.array(diameters), count)
        reduced = keep("reduction", key, partial(reduce_sector, bodies, patches, diameters, count))
        if not settings.chosen:
            return settings, reduced
        family = family_of_case(scene, bodies.mesh, reduced, patches, case)
        model = family_member(family, settings).model
        mode = scene.excitation.mode
        with named(case, model, mode, scene.excitation.force):
            rough = covered_band(model, settings, scene.study.band, mode, 1.0)
            peak = peak_from(family, settings, peak_of(rough), settings, scene.accuracy)
        settings, _, found = choose_at_peak(
            family, settings, peak, scene.accuracy, fixed=("modes",)
        )
        more = enriched_settings(settings, "modes")
        known = "modes" in settings.chosen and np.isfinite(found.height["modes"])
        if not known or found.needs["modes"] <= scene.accuracy / 10 or more is None:
            return settings, reduced
        settings = more


def _remarks(
    scene: Scene,
    settings: Settings,
    curves: list[Curve],
    nodes: int,
) -> list[str]:
    """What a reader of the results has to know; ``nodes`` are the contact points of a seat."""
    remarks: list[str] = [method(settings.sentence(nodes)), method(settings.method)]
    if scene.model.static == "uncoupled":
        remarks.append(
            method(
                "mean displacements held as the static contact solution left them (model.static)"
            )
        )
    if scene.study.stability:
        remarks.append(method(stability_sentence([(c.stability, c.multiplier) for c in curves])))
    remarks.extend(warning(text) for text in map(unstable_sentence, curves) if text)
    intervals = [c.interval for c in curves if c.interval is not None]
    if intervals:
        remarks.append(interval_sentence([c.load for c in curves], intervals))
    lost = sum(int((~c.converged).sum()) for c in curves)
    if lost:
        remarks.append(
            warning(
                f"{lost} of {sum(len(c.frequency) for c in curves)} response points did not "
                "converge; they are marked in tables and pictures"
            )
        )
    for text in filter(None, map(beyond_tolerance, curves)):
        remarks.append(warning(text))
    single = [f"{c.load:g} N" for c in curves if c.unfollowed]
    if single:
        remarks.append(
            warning(
                f"under {', '.join(single)} contacts lift off, and the response was not followed "
                "round folds: a sweep sees one motion a frequency, a higher one may exist"
            )
        )
    remarks.extend(warning(text) for text in map(reach_sentence, curves) if text)
    for c in curves:
        remarks.extend(map(warning, _resonance_warnings(c, scene.accuracy)))
    return remarks


def _resonance_warnings(c: Curve, accuracy: float) -> Iterator[str]:
    """Why the highest point of a curve may be wrong."""
    near = np.flatnonzero(c.frequency == c.peak_frequency)[0] + np.array([-1, 1])
    if not c.converged[near[(near >= 0) & (near < len(c.frequency))]].all():
        yield (
            f"load {c.load:g} N: the highest point that was solved lies next to one that was not; "
            "the resonance may be higher"
        )
    if c.error == np.inf:
        yield (
            f"load {c.load:g} N: the error of the resonance amplitude is unknown, since richer "
            "models of it were not solved; nothing was refined because of that"
        )
    elif c.error is not None and c.error > accuracy:
        yield (
            f"load {c.load:g} N: estimated error {100 * c.error:.2g} % of the resonance "
            f"amplitude, above the wanted {100 * accuracy:.2g} %{_of_the_contact_mesh(c)}"
        )


def _of_the_contact_mesh(curve: Curve) -> str:
    """The part of an estimated error that a finer contact mesh lowers, where it is the larger."""
    if curve.error is None or not np.isfinite(curve.halved) or curve.halved < curve.error / 2:
        return ""
    return (
        f"; {100 * curve.halved:.2g} % are what half as many contact points change, expected a "
        "finer contact mesh (mesh.seat_elements, mesh.contact_size)"
    )


def check_blade(scene: Scene, mesh: Mesh) -> None:
    """Modes and responses need a blade, and a blade needs its clamp."""
    kind = kind_named(scene.kind)
    if not kind.has_blade:
        raise InputError(
            f"kind '{scene.kind}' has no blade to vibrate: 'bladefem run' computes its "
            f"{kind.result}, 'bladefem mesh' draws it"
        )
    clamp = scene.support.clamp
    if clamp and clamp not in (*mesh.faces, *mesh.nodes):
        raise InputError(
            f"the mesh has no face or node set '{clamp}' to hold the blade; it has "
            f"{', '.join(sorted((*mesh.faces, *mesh.nodes)))}"
        )
