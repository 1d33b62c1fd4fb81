"""Speed against accuracy: methods and models of one scene, timed on the same frequencies round its
resonance.

Every variant solves the same frequencies. Its resonance is the vertex of a parabola in 1 /
amplitude^2 over frequency^2 through the highest three, so that errors of resonance amplitude and
frequency do not depend on the grid. The reference climbs a ladder of harmonics and samples as far
as the time allows; the change of its last rung is its own error, below which no other error means
anything.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.solution import size
from ...util.percent import percent
from ..adaptive.band_sweep import covered_band
from ..adaptive.checked_curve import CheckedCurve
from ..adaptive.choice_in_time import March
from ..adaptive.family import Family, family_member
from ..adaptive.resonance_curve import resonance_curve
from ..adaptive.settings import DAMPER_MODELS, Settings
from .cpu_clock import Clock, running_clock
from .methods import chart_methods, obstacle_in_time, sampled_balance, tangential_model
from .rows import (
    Bench,
    ChartPeak,
    Job,
    chart_rows,
    parabola_resonance,
    relative_errors,
    timed_sweep,
)

# frequencies, in half widths of the resonance
FREQUENCIES_IN_HALF_WIDTHS = (-6, -3, -1.5, -0.75, -0.3, 0, 0.3, 0.75, 1.5, 3, 6)
# harmonics and samples of the reference
REFERENCE_SETTINGS = ((3, 128), (7, 512), (15, 1024), (31, 4096))
# on each seat where all methods are compared: the flow's time grows with the square of them
POINTS_PER_SEAT = 4
# of the whole time, for the reference of one model
BENCH_SHARE = 0.25
# rungs of the reference that are climbed in any case, above the first one with the chosen harmonics
RUNGS_ABOVE_CHOSEN = 2
# a rung costs up to that many times the one before it
NEXT_RUNG_COST = 6
# seconds of compilation worth a remark
REPORTED_COMPILE_SECONDS = 0.5


@dataclass(frozen=True)
class Chart:
    """Tables (name, family, time, errors, chosen, ...) and what a reader has to know."""

    # all on the same model
    methods: pd.DataFrame
    # all by the full balance
    models: pd.DataFrame
    remarks: list[str]
    # the automatic choice
    settings: Settings
    # all with the settings of the automatic choice; time is that of everything
    meshes: pd.DataFrame | None = None
    # of the automatic choice
    curve: CheckedCurve | None = None


def method_chart(
    family: Family,
    settings: Settings,
    mode: int,
    accuracy: float,
    budget: float = 120.0,
    band: tuple[float, float] | None = None,
    poorer: Mapping[str, Family] | None = None,
    march: March | None = None,
    fixed: tuple[str, ...] = (),
) -> Chart:
    """The chart of one load case.

    Args:
        settings: where the automatic choice starts; its damper model is the poorest that is looked
            at but "mass".
        mode: whose resonance is studied, 1 = lowest.
        accuracy: wanted of the resonance amplitude.
        budget: CPU seconds for references and variants, the cheap ones first; what does not fit is
            left out and named. The automatic choice comes on top, and so does what numba compiles
            on first use.
        band: [Hz] where the resonance is sought.
        poorer: names of other families that are compared with the first one by their richest
            member.
        march: what the blade keeps to after a motion; the automatic choice asks it as in a run.
        fixed: of ``study.adaptive.resonance_curve``.

    Raises:
        InputError: the budget is no time.
        NotSolvedError: not even the poorest reference converged.
    """
    check_budget(budget)
    with running_clock() as clock:
        begun = clock.now()
        curve = resonance_curve(family, settings, band, mode, accuracy, march, fixed)
        chosen = curve.settings
        found = clock.now()
        remarks = [
            f"automatic choice: {chosen.sentence()}, found in {found - begun:.2g} s; it keeps the "
            "accuracy of the resonance amplitude, not that of each phase"
        ]
        omegas = chart_frequencies([(p.omega, size(p)) for p in curve.points if p.converged])
        course = _Course(family, chosen, omegas, found + budget, clock, remarks)
        models = list(_models(course, poorer or {}))
        jobs = [*models, *_methods(course, mode, models[0].bench)]
        table = pd.DataFrame(chart_rows(jobs, course.end, clock))
    remarks += [f"{row['name']}: {row['reason']}" for _, row in table.iterrows() if row["reason"]]
    if clock.compiled > REPORTED_COMPILE_SECONDS:
        remarks.append(
            f"{clock.compiled:.2g} s were spent on compilation, once; they are not part of any "
            "time above"
        )
    methods = table[len(models) :].reset_index(drop=True)
    return Chart(methods, table[: len(models)], remarks, chosen, curve=curve)


def check_budget(seconds: float) -> None:
    """Raises:
    InputError: not a positive finite time.
    """
    if not 0 < seconds < np.inf:
        raise InputError(f"--budget {seconds:g}: expected a positive, finite number of seconds")


@dataclass(frozen=True)
class _Course:
    """What models and methods share."""

    family: Family
    chosen: Settings
    # (k,) [rad/s]
    omegas: np.ndarray
    # of the time, by the clock [s]
    end: float
    clock: Clock
    remarks: list[str]

    @property
    def richest(self) -> Settings:
        """Everything that was reduced."""
        dampers = self.family.dampers
        return replace(
            self.chosen,
            modes=self.family.modes,
            points=None,
            damper=dampers[-1] if dampers else "rigid",
        )


def chart_frequencies(curve: Iterable[tuple[float, float]]) -> np.ndarray:
    """(k,) circular frequencies on both sides of the highest point of (omega, height), spaced by
    its half width.
    """
    omega, height = np.array(sorted(curve)).T
    top = int(height.argmax())
    high = omega[height > height[top] / np.sqrt(2)]
    half = max((high[-1] - high[0]) / 2, 1e-4 * omega[top])
    return np.array([w for w in omega[top] + half * np.array(FREQUENCIES_IN_HALF_WIDTHS) if w > 0])


def _climb_ladder(
    course: _Course,
    model: Callable[[int], ReducedModel],
    omegas: np.ndarray,
    name: str,
) -> list[ChartPeak]:
    """The resonance on each rung of REFERENCE_SETTINGS that was reached, the first one first.

    Raises:
        NotSolvedError: not even the first rung converged.
    """
    clock = course.clock
    start = clock.now()
    budget = BENCH_SHARE * (course.end - start)
    used = 0.0
    first_rich = next(
        (k for k, (H, _) in enumerate(REFERENCE_SETTINGS) if H >= course.chosen.harmonics),
        len(REFERENCE_SETTINGS),
    )
    least = first_rich + RUNGS_ABOVE_CHOSEN
    reached: list[ChartPeak] = []
    for rung, (H, samples) in enumerate(REFERENCE_SETTINGS):
        left = budget - (clock.now() - start)
        if rung >= least and NEXT_RUNG_COST * used > left:
            break
        begun = clock.now()
        allowed = np.inf if rung < least else budget
        run = sampled_balance(H, samples)
        points = timed_sweep(model(H), run, omegas, (allowed, allowed), clock).points
        used = clock.now() - begun
        if len(points) < len(omegas) or not all(p.converged for p in points):
            break
        reached.append(parabola_resonance(omegas, np.array([p.first for p in points])))
    if not reached:
        raise NotSolvedError(f"the reference of the {name} did not converge: {points[-1].reason}")
    return reached


def _bench(
    course: _Course,
    model: Callable[[int], ReducedModel],
    omegas: np.ndarray,
    name: str,
) -> Bench:
    """Climb the ladder past the chosen harmonics, and on while the next rung fits into a quarter of
    the time.
    """
    reached = _climb_ladder(course, model, omegas, name)
    truth = reached[-1]
    doubt = (
        relative_errors(reached[-2], truth)
        if len(reached) > 1
        else {f"error{end}": np.nan for end in ("", "_frequency", "_phasor")}
    )
    harmonics, samples = REFERENCE_SETTINGS[len(reached) - 1]
    moved = (
        f"changed by {percent(doubt['error'])} on its last rung"
        if len(reached) > 1
        else "the only one reached"
    )
    course.remarks.append(
        f"reference of the {name}: H {harmonics}, {samples} samples, resonance by the parabola "
        f"through the highest three frequencies {truth.frequency:.6g} Hz, "
        f"{1e6 * truth.amplitude:.6g} um, {moved}"
    )
    return Bench(omegas, truth, doubt)


def _methods(
    course: _Course,
    mode: int,
    shared: Bench,
) -> Iterator[Job]:
    """All methods that apply, on one model."""
    chosen, (model, bench, reason) = course.chosen, _simplified(course, mode, shared)
    for m in chart_methods(not reason):
        yield Job(m.name, m.family, model, m.run, bench, ordered=True)
    yield Job(
        f"automatic: H {chosen.harmonics}, {chosen.samples} samples",
        "automatic choice",
        model,
        sampled_balance(chosen.harmonics, chosen.samples),
        bench,
        needed=True,
        chosen=True,
    )


def _simplified(
    course: _Course,
    mode: int,
    shared: Bench,
) -> tuple[ReducedModel, Bench, str]:
    """A tangential model that all methods take, with its reference; the richest and why where there
    is none such.
    """
    family = course.family
    most = replace(course.richest, harmonics=REFERENCE_SETTINGS[-1][0])
    few = replace(most, points=POINTS_PER_SEAT)
    model = family_member(
        family, replace(few, damper="mass") if "mass" in family.dampers else few
    ).model
    reason = (
        obstacle_in_time(model)
        if model.directions != 1
        else obstacle_in_time(tangential_model(model))
    )
    if reason:
        course.remarks.append(
            "paper's iteration, exact events, direct integration and shooting do not apply: "
            + reason
        )
        return family_member(family, most).model, shared, reason
    model = tangential_model(model)
    omegas = course.omegas
    if family.dampers:
        course.remarks.append(
            "methods are compared on the scene's tangential model: prescribed normal load, damper "
            f"a mass, up to {POINTS_PER_SEAT} contact points on each seat; what that model itself "
            "costs in accuracy is given with the models"
        )
        omegas = _own_frequencies(model, omegas, mode)
    return model, _bench(course, lambda H: model, omegas, "methods"), ""


def _models(course: _Course, poorer: Mapping[str, Family]) -> Iterator[Job]:
    """All models by the full balance, one choice poorer at a time."""
    family = course.family
    chosen = course.chosen
    richest = course.richest
    bench = _bench(
        course,
        lambda H: family_member(family, replace(richest, harmonics=H)).model,
        course.omegas,
        "models",
    )
    rich = replace(richest, harmonics=max(chosen.harmonics, 3), samples=max(chosen.samples, 256))
    for whose, name, kind, s in [
        *((family, *variant) for variant in _variants(family, rich)),
        *((other, name, "nodal diameters", rich) for name, other in poorer.items()),
    ]:
        yield Job(
            name,
            kind,
            family_member(whose, s).model,
            sampled_balance(s.harmonics, s.samples),
            bench,
            needed=kind == "rich model",
        )
    yield Job(
        "automatic",
        "automatic choice",
        family_member(family, chosen).model,
        sampled_balance(chosen.harmonics, chosen.samples),
        bench,
        needed=True,
        chosen=True,
    )


def _variants(family: Family, rich: Settings) -> Iterator[tuple[str, str, Settings]]:
    """One choice poorer at a time."""
    yield "all of it", "rich model", rich
    for modes in (1, 2, 3, 5, 10, 20, 40, 80):
        if modes < family.modes:
            yield _counted(modes, "mode"), "modes", replace(rich, modes=modes)
    nodes = len(family_member(family, rich).groups) // 2
    for points in (1, 2, 4, 8, 16, 32, 64):
        if points < nodes:
            yield _counted(points, "point"), "contact points", replace(rich, points=points)
    for damper in DAMPER_MODELS:
        if damper in family.dampers and damper != rich.damper:
            yield f"{damper} damper", "damper model", replace(rich, damper=damper)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def _own_frequencies(
    model: ReducedModel,
    omegas: np.ndarray,
    mode: int,
) -> np.ndarray:
    """Frequencies round the resonance of the tangential model, which may lie elsewhere."""
    swept = covered_band(model, Settings(1, 3, 128, "mass"), None, mode, 0.05)
    good = [(p.omega, size(p)) for p in swept if p.converged]
    return chart_frequencies(good) if good else omegas
