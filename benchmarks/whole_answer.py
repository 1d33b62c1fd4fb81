"""From drawing the mesh to the design curve: total CPU time against the strictest error, for the
shipped scenes that have a response.

    python benchmarks/whole_answer.py [scenes ...] [--budget 60] [--coarse 1] [--loads ...] [--draw]

Each way of getting the answer of a scene is timed as a whole, in CPU seconds of one process without
compilation: drawing, seating under every load, reduction, the search for settings where there is
one, and the response under every load. Three errors of each load are taken against the same loads
on a finer mesh, with more harmonics, all contact points and modes, and the elastic damper:

- resonance amplitude,
- resonance frequency,
- the worst phasor of eleven frequencies within three half widths of the resonance, over the highest
  one. Each way is asked at the same frequencies, and at the same distances from its own resonance;
  the better of the two counts. A shift of a sharp peak counts once then, as an error of the
  frequency, and a flat top, whose highest point may lie anywhere, not at all.

The largest of the three, of the worst load, is the error of the whole answer. Ways: the automatic
choice on meshes from coarse to the scene's own, with the accuracy that the scene asks for (the
star) and with others; the same mesh with given harmonics, contact points, modes and damper model;
the paper's loop (`whole_answer_loop.py`). Unstable motions are no resonances: a damper that bounces
has some three times as high as those that the blade keeps (plane blades, 4 N).

The judge in time knows no harmonics: the reduced model with four contact points on a seat is
marched for 100 periods from its own resonance (`bladefem.hbm.ring_march`: bodies exactly, friction
step by step), all blades of a travelling wave free, and its last period is compared.

Files: docs/figures/answer_SCENE.csv (ways), answer_SCENE_loads.csv (ways by loads),
answer_SCENE.txt (what to paste into the scene), answer_SCENE.png, and the scene's section of
docs/accuracy.md. --draw makes picture, text and section from the tables again; --coarse makes all
elements larger, the scene's own and those of the truth, --loads takes others than the scene's; the
chart says both. A way whose responses take more CPU seconds than --budget is left out. The scene
"paper" is the plane one with normal loads that do not follow the motion; the mistuned wheel has
blades that are alike here, and none of the settings that its scene gives.
"""

from __future__ import annotations

import argparse
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numba.core.compiler_lock import global_compiler_lock
from whole_answer_loop import loop_resonance, paper_loop
from whole_answer_picture import draw_answer, write_advice, write_section

from bladefem.errors import InputError, NotSolvedError
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.ring_march import march_ring, state_of_solution
from bladefem.hbm.solution import Solution, size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.scene.tables import Mistuning, Scene
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.band_sweep import covered_band, default_band, solver_options
from bladefem.study.adaptive.checked_curve import CheckedCurve
from bladefem.study.adaptive.family import Family, family_member
from bladefem.study.adaptive.indicators import moved_solution
from bladefem.study.adaptive.settings import Settings, restarted_settings, scene_line
from bladefem.study.chart.cpu_clock import Clock, running_clock
from bladefem.study.chart.rows import parabola_resonance
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.body_mesh import SofterBody, mode_errors
from bladefem.study.pipeline.case_models import (
    family_of_case,
    load_cases,
    reduced_sector,
    softer_body,
)
from bladefem.study.pipeline.damper_contact import contact_patches
from bladefem.study.pipeline.loads import curve_of
from bladefem.study.pipeline.normal_modes import excited_modes, find_modes, harmonic_diameters
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.seated_loads import seat_every_load
from bladefem.study.pipeline.stage_runner import StageClock, StageRunner
from bladefem.study.stability.error_in_time import Marches
from bladefem.study.stability.judged_resonance import judged_resonance
from bladefem.study.stability.verdicts import model_in_time

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
# element sizes over the scene's own; the last is that of the truth
SCALES = (1.5, 1.0)
# of the truth, and its harmonics
FINEST = {"plane": (0.8, 7), "paper": (0.6, 7)}
FINEST_OTHERS = (0.85, 7)
# the plane blades with normal loads that do not follow the motion
PAPER = "paper"
SCENES = ["plane", PAPER, "wedge", "own_blade", "mistuned"]
# relative width of the band of a marched resonance beyond which it is no periodic motion
WIDE_BAND = 0.1
# frequencies of the phasors, in half widths of the resonance; accuracy of their balance
FREQUENCIES_IN_HALF_WIDTHS = (-3, -1.5, -0.7, -0.3, -0.1, 0, 0.1, 0.3, 0.7, 1.5, 3)
ASKED_ACCURACY = 1e-3
# of all frequencies, among which the one that fits the phasors best is looked for
SHIFTS = np.linspace(-0.004, 0.004, 17)
# periods and contact points of the judge in time
JUDGED_PERIODS = 100
JUDGED_POINTS = 4
# contact points on a seat of the fixed models
FIXED_POINTS = 16
# accuracies asked of the automatic choice beside the scene's, over the scene's
OTHER_ACCURACIES = (4.0, 0.25)


@dataclass(frozen=True)
class Prepared:
    """A scene on one mesh, reduced, with its loads."""

    scene: Scene
    settings: Settings
    # [N]
    loads: list[float]
    cases: list
    families: list[Family]
    # of mesh, seating and reduction; of the search for modes and damper model [s]
    seconds: float
    search: float
    dofs: int
    # the body less the error of its stiffness, for the error by its mesh
    softer: SofterBody | None

    @property
    def richest(self) -> Settings:
        """All modes and points, the most elastic damper."""
        dampers = self.families[0].dampers
        return replace(
            self.settings,
            modes=self.families[0].modes,
            points=None,
            damper=dampers[-1] if dampers else "rigid",
        )


def prepare(scene: Scene, scale: float, clock: Clock) -> Prepared:
    """Mesh, seats and reduction of a scene whose elements are scaled."""
    scene = replace(
        scene,
        mesh=replace(scene.mesh, scale=scene.mesh.scale * scale),
        study=replace(scene.study, influences=False),
    )
    begun = clock.now()
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = contact_patches(mesh)
    stages = StageClock({}, [])
    seating = seat_every_load(scene, bodies, patches, StageRunner(None, None, stages), stages)
    cases = load_cases(scene, mesh, seating)
    reducing = []

    def keep(name: str, key: str, make: Callable) -> object:
        start = clock.now()
        made = make()
        reducing.append(clock.now() - start)
        return made

    start = clock.now()
    settings, reduced = reduced_sector(scene, bodies, cases[len(cases) // 2], patches, keep)
    search = clock.now() - start - sum(reducing)
    excited = excited_modes(scene, mesh, find_modes(bodies, harmonic_diameters(scene, mesh, 1)))
    errors = mode_errors(bodies, patches, excited)
    softer = softer_body(scene, mesh, reduced, patches, errors)
    families = [family_of_case(scene, mesh, reduced, patches, case) for case in cases]
    return Prepared(
        scene,
        settings,
        [case.load for case in cases],
        cases,
        families,
        clock.now() - begun - search,
        search,
        mesh.dimension * len(mesh.points),
        softer,
    )


@dataclass(frozen=True)
class Answer:
    """The resonance under one load, and how to ask for the response at another frequency."""

    # root of the sum of squares of the harmonics [m]
    amplitude: float
    # [Hz]
    frequency: float
    # (k,) omega [rad/s] -> (k,) first harmonics at the probe [m] and (k,) heights [m]
    ask: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    # estimated relative error, where there is one
    estimate: float = np.nan
    # what was used, where it was chosen
    settings: Settings | None = None
    peak: Solution | None = None


def asked_options() -> Options:
    """What is lost is left out: where contacts lift off, motions end."""
    return replace(solver_options(ASKED_ACCURACY), fallbacks=False)


def asking(model: ReducedModel, settings: Settings, top: Solution) -> Callable:
    """First harmonics, and roots of the sum of squares, by the balance, from the peak outwards on
    either side; NaN where it was not solved.
    """

    def ask(omegas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = {}
        for side in (omegas >= top.omega, omegas < top.omega):
            last = top
            for omega in sorted(omegas[side], key=lambda w: abs(w - top.omega)):
                point = solve(
                    model,
                    omega,
                    settings.harmonics,
                    settings.samples,
                    start=last,
                    options=asked_options(),
                )
                last = point if point.converged else last
                lost = np.nan, np.nan
                found[omega] = (point.probe[1, 0], size(point)) if point.converged else lost
        phasors, heights = zip(*(found[omega] for omega in omegas), strict=True)
        return np.array(phasors), np.array(heights)

    return ask


def by_choice(known: Prepared, k: int) -> Answer:
    """The automatic choice, as a run makes it."""
    start = restarted_settings(known.settings)
    case, family = known.cases[k], known.families[k]
    curve = curve_of(known.scene, case, lambda _: family, start, known.softer)
    s = curve.settings
    model = family_member(family, s).model
    reported = np.nan if curve.error is None else curve.error
    ask = asking(model, s, curve.peak)
    return Answer(curve.peak_amplitude, curve.peak_frequency, ask, reported, s, curve.peak)


def by_settings(settings: Settings, known: Prepared, k: int) -> Answer:
    """A sweep with given settings, and its resonance judged as that of a run: where the highest
    point is unstable, again with more harmonics, or others beside it are, marches from there tell
    what the blade keeps to.
    """
    scene, family = known.scene, known.families[k]
    model = family_member(family, settings).model
    points = covered_band(model, settings, scene.study.band, scene.excitation.mode, scene.accuracy)
    found = judged_resonance(Marches(family), CheckedCurve(settings, points, {}), scene)
    top = found.point
    return Answer(found.amplitude, top.frequency, asking(model, settings, top))


def by_loop(settings: Settings, known: Prepared, k: int) -> Answer:
    """The paper's loop, its resonance looked for on ever narrower grids."""
    model = family_member(known.families[k], replace(settings, harmonics=1)).model
    band = known.scene.study.band or default_band(model, known.scene.excitation.mode)
    found = loop_resonance(model, band)
    places = np.array(sorted(found))
    top = parabola_resonance(2 * np.pi * places, np.array([found[f] for f in places]))

    def ask(omegas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = np.array([paper_loop(model, omega) for omega in omegas])
        return values, abs(values)

    return Answer(top.amplitude, top.frequency, ask)


@dataclass(frozen=True)
class Truth:
    """The resonance under one load, and the response round it."""

    amplitude: float
    frequency: float
    # (k,) frequencies over that of the resonance
    ratios: np.ndarray
    # (k,) first harmonics at the probe [m]
    phasors: np.ndarray


def truth_of(known: Prepared, k: int, harmonics: int) -> Truth:
    """The highest peak of the automatic choice, carried to all that was reduced.

    Harmonics are those of the choice or those given, whichever are more; the resonance is the
    vertex of a parabola through the highest points.

    Raises:
        NotSolvedError: the peak was lost on the way, or the blade keeps to no periodic motion.
    """
    family = known.families[k]
    case = known.cases[k]
    curve = curve_of(known.scene, case, lambda _: family, restarted_settings(known.settings))
    if curve.march_replaces_balance and curve.marched > WIDE_BAND:
        raise NotSolvedError(
            f"{case.load:g} N: the blade bounces between amplitudes {100 * curve.marched:.0f} % "
            "apart, which no balance tells"
        )
    harmonics = max(harmonics, curve.settings.harmonics)
    samples = max(512, 32 * (harmonics + 1))
    s = replace(known.richest, harmonics=harmonics, samples=samples)
    model = family_member(family, s).model
    top = moved_solution(family, curve.settings, curve.peak, s, asked_options())
    if not top.converged:
        raise NotSolvedError(f"{case.load:g} N: the peak was lost in the richer model")
    high = 2 * np.pi * curve.frequency[curve.amplitude > curve.peak_amplitude / np.sqrt(2)]
    half = max(np.ptp(high) / 2, 1e-4 * top.omega)
    places = top.omega + half * np.array(FREQUENCIES_IN_HALF_WIDTHS)
    phasors, heights = asking(model, s, top)(places)
    good = np.isfinite(heights)
    peak = parabola_resonance(places[good], heights[good])
    return Truth(peak.amplitude, peak.frequency, places / (2 * np.pi * peak.frequency), phasors)


def errors_of(answer: Answer, truth: Truth) -> dict[str, float]:
    """Relative errors of one load."""
    apart = [
        worst_phasor(answer, truth, 2 * np.pi * frequency)
        for frequency in (answer.frequency, truth.frequency)
    ]
    known = [error for error in apart if np.isfinite(error)]
    return {
        "error_amplitude": abs(answer.amplitude / truth.amplitude - 1),
        "error_frequency": abs(answer.frequency / truth.frequency - 1),
        "error_phasor": min(known, default=np.nan),
    }


def worst_phasor(answer: Answer, truth: Truth, resonance: float) -> float:
    """Largest difference of a phasor at the same distances from a resonance [rad/s], over the
    highest phasor; NaN where none was solved.
    """
    found, _ = answer.ask(resonance * truth.ratios)
    apart = abs(found - truth.phasors) / np.nanmax(abs(truth.phasors))
    return float(np.nanmax(apart)) if np.isfinite(apart).any() else np.nan


def shifted_phasor(answer: Answer, truth: Truth) -> tuple[float, float]:
    """Relative shift of the frequencies at which the worst phasor is smallest, and that phasor: on
    a flat top the highest point does not tell where the response stands, and a shift by a tenth of
    the half width turns phasors there by a tenth.
    """
    here = 2 * np.pi * truth.frequency
    apart = {s: worst_phasor(answer, truth, here * (1 + s)) for s in SHIFTS}
    known = {s: error for s, error in apart.items() if np.isfinite(error)}
    best = min(known, key=known.__getitem__, default=np.nan)
    return best, known.get(best, np.nan)


def judged(known: Prepared, k: int, answer: Answer) -> float:
    """Relative difference of a march from the balance of seven harmonics that it starts from; NaN
    where there is no such march.
    """
    s = replace(known.richest, points=JUDGED_POINTS, harmonics=7, samples=512, damper="rigid")
    model = model_in_time(known.families[k], s)
    try:
        moved = moved_solution(known.families[k], answer.settings, answer.peak, s)
        top = solve(model, moved.omega, 7, 512, start=moved)
        if not top.converged:
            return np.nan
        march = march_ring(model, state_of_solution(model, top, 1e-3), JUDGED_PERIODS)
    except (InputError, NotSolvedError):
        return np.nan
    lines = 2 / march.motion.shape[-1] * np.fft.rfft(march.motion[-1], axis=-1)
    heights = np.linalg.norm(lines[..., 1 : top.harmonics + 1], axis=-1)
    return float(np.max(abs(heights / size(top) - 1))) if march.settled else np.nan


def ways(known: Prepared) -> Iterator[tuple[str, str, Callable[[Prepared, int], Answer]]]:
    """Name, family and function of each way on the scene's own mesh: fixed models differ in one
    respect from that of three harmonics.
    """
    yield "automatic", "automatic choice", by_choice
    base = replace(known.richest, harmonics=3, samples=256, points=FIXED_POINTS, damper="rigid")
    for H in (1, 3, 7):
        yield f"H {H}", "harmonics", partial(by_settings, replace(base, harmonics=H))
    others = {
        "4 points a seat": ("contact points", {"points": 4}),
        "all points": ("contact points", {"points": None}),
        "elastic damper": ("damper model", {"damper": "elastic"}),
    }
    for name, (family, given) in others.items():
        if given.get("damper", "rigid") in known.families[0].dampers:
            yield name, family, partial(by_settings, replace(base, **given))
    modes = known.scene.excitation.mode
    fewer = replace(base, modes=modes)
    yield f"{modes} mode" + "s" * (modes > 1), "modes", partial(by_settings, fewer)
    yield "paper's loop", "paper's loop", partial(by_loop, base)


# CPU seconds after which a way that was compiling when its time was up is asked again
AGAIN = 0.2


class OutOfTime(BaseException):
    """No library catches it."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Ends the block by OutOfTime after some CPU seconds."""

    def stop(*_: object) -> None:
        # an exception inside numba's compiler leaves it unable to compile anything after
        if global_compiler_lock.is_locked():
            signal.setitimer(signal.ITIMER_PROF, AGAIN)
        else:
            raise OutOfTime

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, 0.0 if np.isinf(seconds) else max(seconds, 1e-3))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


ERRORS = ("error_amplitude", "error_frequency", "error_phasor")


class Table:
    """Rows of ways and of loads, as they are found."""

    def __init__(
        self, truths: list[Truth | None], budget: float, clock: Clock, coarse: float
    ) -> None:
        self.coarse = coarse
        self.truths = truths
        self.budget = budget
        self.clock = clock
        self.rows: list[dict] = []
        self.loads: list[dict] = []
        # the judge in time, by load
        self.march: dict[float, float] = {}

    def add(self, name: str, family: str, known: Prepared, scale: float, way: Callable) -> None:
        """Solve all loads in one way; it is left out where that would take more than the budget."""
        chosen = family in ("automatic choice", "mesh")
        spent = known.seconds + (known.search if chosen else 0.0)
        found, used = [], 0.0
        reason = ""
        for k, load in enumerate(known.loads):
            begun = self.clock.now()
            try:
                with limited(np.inf if name == "automatic" else self.budget - used):
                    answer = way(known, k)
            except NotSolvedError as error:
                reason = f"{load:g} N: {error}"
                break
            except (OutOfTime, SystemError):
                # numba reports the first as the second
                reason = (
                    f"left out: {self.budget:g} s were used up at {load:g} N, load {k + 1} of "
                    f"{len(known.loads)}"
                )
                break
            used += self.clock.now() - begun
            if name == "automatic":
                self.march[load] = judged(known, k, answer)
            truth = self.truths[k]
            errors = dict.fromkeys(ERRORS, np.nan) if truth is None else errors_of(answer, truth)
            own = {"name": name, "load": load, **errors, "estimate": answer.estimate}
            if name == "automatic" and truth is not None:
                own["shift"], own["shifted_phasor"] = shifted_phasor(answer, truth)
            own |= {"amplitude": answer.amplitude, "frequency": answer.frequency}
            if answer.settings is not None:
                s = answer.settings
                own |= {"harmonics": s.harmonics, "points": s.points or 0, "damper": s.damper}
            found.append(own)
        self.loads += found
        row = {"name": name, "family": family, "scale": scale, "dofs": known.dofs}
        row["accuracy"] = known.scene.accuracy
        row |= {"time": spent + used, "response": used, "reason": reason}
        of_loads = pd.DataFrame(found, columns=["load", *ERRORS])
        for column in ERRORS:
            row[column] = np.nan if reason else of_loads[column].max()
        worst = of_loads[list(ERRORS)].max(axis=1)
        row["error"] = np.nan if reason else worst.max()
        row["median"] = np.nan if reason else worst.median()
        row["chosen"] = name == "automatic"
        row["converged"] = not reason
        row["settings"] = _pasted(way) if not reason else ""
        self.rows.append(row)
        print(name, {k: v for k, v in row.items() if k not in ("name", "settings")}, flush=True)

    def write(self, name: str, scale: float, harmonics: int) -> None:
        """Both tables of a scene, as far as they are."""
        rows = pd.DataFrame(self.rows).assign(
            truth_scale=scale, truth_harmonics=harmonics, coarse=self.coarse
        )
        loads = pd.DataFrame(self.loads)
        loads["judge"] = loads["load"].map(self.march).where(loads["name"] == "automatic")
        rows.to_csv(FIGURES / f"answer_{name}.csv", index=False, float_format="%.5g")
        loads.to_csv(FIGURES / f"answer_{name}_loads.csv", index=False, float_format="%.6g")


def _pasted(way: Callable) -> str:
    """The line of a scene that makes a run do the same; empty for a choice or a loop."""
    if not isinstance(way, partial) or way.func is not by_settings:
        return ""
    return scene_line(way.args[0])


def scene_named(name: str) -> Scene:
    """A shipped scene, with settings left to the choice, and blades that are alike; or the plane
    blades as the paper has them: with normal loads that do not follow the motion.
    """
    scene = load_scene(ROOT / "scenes" / f"{'plane' if name == PAPER else name}.toml")
    if scene.mistuning != Mistuning():
        title = f"{scene.title}, blades alike, settings chosen"
        scene = replace(_open(scene), mistuning=Mistuning(), title=title)
    if name != PAPER:
        return scene
    contact = replace(scene.contact, normal="prescribed")
    return replace(scene, contact=contact, title=f"{scene.title}, normal loads prescribed")


def measure(name: str, budget: float, coarse: float, wanted: Sequence[float]) -> None:
    """Tables of one scene; ``coarse`` times as large are all elements; loads [N] are the scene's
    where none are wanted.
    """
    scene = scene_named(name)
    loads = tuple(wanted) or scene.study.loads
    scene = replace(scene, study=replace(scene.study, loads=loads))
    scene = replace(scene, mesh=replace(scene.mesh, scale=scene.mesh.scale * coarse))
    scale, harmonics = FINEST.get(name, FINEST_OTHERS)
    with running_clock() as clock:
        finest = prepare(_open(scene), scale, clock)
        print(name, "truth:", finest.dofs, "dofs", f"{finest.seconds:.1f} s", flush=True)
        truths = []
        for k, load in enumerate(finest.loads):
            begun = clock.now()
            try:
                truths.append(truth_of(finest, k, harmonics))
            except NotSolvedError as error:
                truths.append(None)
                print(f"  {error}", flush=True)
                continue
            print(
                f"  {load:g} N: {truths[-1].frequency:.3f} Hz, {1e6 * truths[-1].amplitude:.2f} um"
                f" in {clock.now() - begun:.1f} s",
                flush=True,
            )
        del finest
        table = Table(truths, budget, clock, coarse)
        own = prepare(scene, 1.0, clock)
        for way in ways(own):
            table.add(*way[:2], own, 1.0, way[2])
            table.write(name, scale, harmonics)
        del own
        for factor in OTHER_ACCURACIES:
            accuracy = factor * scene.accuracy
            other = prepare(replace(scene, accuracy=accuracy), 1.0, clock)
            label = f"automatic, {100 * accuracy:g} %"
            table.add(label, "automatic choice", other, 1.0, by_choice)
            table.write(name, scale, harmonics)
        for ratio in SCALES[:-1]:
            larger = prepare(scene, ratio, clock)
            table.add(f"elements x {ratio:g}", "mesh", larger, ratio, by_choice)
            table.write(name, scale, harmonics)


def _open(scene: Scene) -> Scene:
    """Without the settings that the scene gives: the truth takes the richest."""
    return replace(
        scene,
        contact=replace(scene.contact, points=None),
        model=replace(scene.model, modes=None, harmonics=None, samples=None, damper=None),
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--budget", type=float, default=60.0)
    parser.add_argument("--coarse", type=float, default=1.0)
    parser.add_argument("--loads", type=float, nargs="*", default=())
    parser.add_argument("--draw", action="store_true")
    options = parser.parse_args()
    for name in options.scenes:
        if not options.draw:
            measure(name, options.budget, options.coarse, options.loads)
        scene = scene_named(name)
        rows = pd.read_csv(FIGURES / f"answer_{name}.csv")
        loads = pd.read_csv(FIGURES / f"answer_{name}_loads.csv")
        write_advice(rows, loads, scene.accuracy, FIGURES / f"answer_{name}.txt")
        draw_answer(rows, loads, scene, FIGURES / f"answer_{name}.png")
        write_section(name, scene.title, FIGURES, ROOT / "docs" / "accuracy.md")


if __name__ == "__main__":
    main()
