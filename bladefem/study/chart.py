"""Speed against accuracy: methods and models of one scene, timed on the same frequencies round its resonance.

Every variant solves the same frequencies. Its resonance is the vertex of a parabola in 1 / amplitude^2 over
frequency^2 through the highest three, so that errors of resonance amplitude and frequency do not hang on the grid.
The reference climbs a ladder of harmonics and samples as far as the time allows; the change of its last rung is its
own error, below which no other error means anything.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ..errors import NotSolvedError
from ..hbm.model import ReducedModel
from ..hbm.sweep import size
from .choice import adapted, covered
from .family import Family, member
from .methods import Method, Point, applicable, balance, methods, tangential
from .settings import DAMPERS, Settings

__all__ = ["Chart", "Peak", "chart", "timed_model"]

WIDTHS = (-6, -3, -1.5, -0.75, -0.3, 0, 0.3, 0.75, 1.5, 3, 6)      # frequencies, in half widths of the resonance
DEARER = 3.0        # times that a variant may cost more than the cheaper one of its kind before it
LADDER = ((3, 128), (7, 512), (15, 1024), (31, 4096))               # harmonics and samples of the reference


@dataclass(frozen=True)
class Chart:
    """Tables (name, family, time, errors, chosen, ...) and what a reader has to know."""

    methods: pd.DataFrame       # all on the same model
    models: pd.DataFrame        # all by the full balance
    remarks: list[str]
    settings: Settings          # the automatic choice
    meshes: pd.DataFrame | None = None      # all with the settings of the automatic choice; time is that of everything


@dataclass(frozen=True)
class Peak:
    """Responses on the common frequencies and the resonance that they tell."""

    first: np.ndarray           # (k,) complex [m]
    amplitude: float            # of the resonance [m]
    frequency: float            # [Hz]
    inside: bool                # the highest point is not at the end of the frequencies


@dataclass(frozen=True)
class Bench:
    """What all variants share."""

    omegas: np.ndarray          # (k,) [rad/s]
    truth: Peak
    doubt: dict[str, float]     # the reference's own error
    budget: float               # seconds for all variants, or for one


def chart(family: Family, settings: Settings, mode: int, accuracy: float, budget: float = 120.0,
          band: tuple[float, float] | None = None, poorer: Mapping[str, Family] | None = None) -> Chart:
    """The chart of one load case.

    Args:
        settings: where the automatic choice starts; its damper model is the poorest that is looked at but "mass".
        mode: whose resonance is studied, 1 = lowest.
        accuracy: wanted of the resonance amplitude.
        budget: seconds for everything; variants that would take more than their share are left out and named.
        band: [Hz] where the resonance is sought.
        poorer: names of other families that are compared with the first one by their richest member.

    Raises:
        NotSolvedError: not even the poorest reference converged.
    """
    start = time.perf_counter()
    curve = adapted(family, settings, band, mode, accuracy)
    chosen = curve.settings
    remarks = [f"automatic choice: {chosen.sentence()}, found in {time.perf_counter() - start:.2g} s"]
    richest = replace(chosen, modes=family.modes, points=None, damper=family.dampers[-1] if family.dampers else "rigid")
    omegas = frequencies([(p.omega, size(p)) for p in curve.points if p.converged])
    shared = _bench(lambda H: member(family, replace(richest, harmonics=H)).model, chosen.harmonics, omegas, budget / 4,
                    "models", remarks)
    models = _models(family, richest, chosen, shared, poorer or {}, remarks)
    simple = replace(richest, damper="mass") if "mass" in family.dampers else richest
    highest = LADDER[-1][0]
    model = member(family, replace(simple, harmonics=highest)).model
    reason = applicable(model) if model.directions != 1 else applicable(tangential(model))
    model = member(family, replace(richest, harmonics=highest)).model if reason else tangential(model)
    if reason:
        remarks.append(f"paper's iteration, exact events, direct integration and shooting do not apply: {reason}")
    elif family.dampers:
        remarks.append("methods are compared on the scene's tangential model: prescribed normal load, damper a mass; "
                       "what that model itself costs in accuracy stands among the models")
        omegas = _own_frequencies(model, omegas, mode)
    bench = shared if reason else _bench(lambda H: model, chosen.harmonics, omegas, budget / 4, "methods", remarks)
    return Chart(_methods(model, not reason, chosen, bench, remarks), models, remarks, chosen)


def frequencies(curve: Iterable[tuple[float, float]]) -> np.ndarray:
    """(k,) circular frequencies on both sides of the highest point of (omega, height), spaced by its half width."""
    omega, height = np.array(sorted(curve)).T
    top = int(height.argmax())
    high = omega[height > height[top] / np.sqrt(2)]
    half = max((high[-1] - high[0]) / 2, 1e-4 * omega[top])
    return np.array([w for w in omega[top] + half * np.array(WIDTHS) if w > 0])


def timed_model(model: ReducedModel, omegas: np.ndarray, run: Callable[[ReducedModel, float, object], Point],
                budget: float) -> tuple[list[Point], float, str]:
    """Points, seconds of CPU per frequency, and why it was left out, by solving the middle frequency first."""
    middle, points = omegas[len(omegas) // 2], []
    begun = time.process_time()
    run(model, middle, None)            # kernels compiled, caches warm
    spent = time.process_time() - begun
    if spent > budget:
        return points, spent, f"left out: {spent:.2g} s for the first frequency exceed its share of time"
    start, last = time.process_time(), None
    for k, omega in enumerate(omegas):
        points.append(run(model, omega, last))
        last = points[-1].start
        spent = time.process_time() - start
        if spent / (k + 1) * len(omegas) > 2 * budget and k < len(omegas) - 1:
            return points, spent / (k + 1), f"left out: {spent / (k + 1):.2g} s a frequency exceed its share of time"
    return points, (time.process_time() - start) / len(omegas), ""


def resonance(omegas: np.ndarray, first: np.ndarray) -> Peak:
    """The resonance by a parabola in 1/amplitude^2 over omega^2 through the highest point and its neighbours."""
    height = np.where(np.isfinite(first), abs(first), 0.0)
    top = int(height.argmax())
    if not 0 < top < len(omegas) - 1 or min(height[top - 1:top + 2]) == 0:
        return Peak(first, float(height[top]), float(omegas[top] / (2 * np.pi)), False)
    x = omegas[top - 1:top + 2]**2
    centre, width = x[1], x[2] - x[0]
    a, b, c = np.polyfit((x - centre) / width, 1 / height[top - 1:top + 2]**2, 2)
    if a <= 0:
        return Peak(first, float(height[top]), float(omegas[top] / (2 * np.pi)), True)
    vertex, low = -b / (2 * a), c - b**2 / (4 * a)
    amplitude = low**-0.5 if low > 0 else height[top]
    return Peak(first, float(amplitude), float(np.sqrt(centre + width * vertex) / (2 * np.pi)), True)


def errors(peak: Peak, truth: Peak) -> dict[str, float]:
    """Relative errors of resonance amplitude and frequency, and of the worst phasor over the highest one."""
    return {"error": abs(peak.amplitude / truth.amplitude - 1),
            "error_frequency": abs(peak.frequency / truth.frequency - 1),
            "error_phasor": float(np.max(abs(peak.first - truth.first)) / np.max(abs(truth.first)))}


def _bench(model: Callable[[int], ReducedModel], chosen: int, omegas: np.ndarray, budget: float, name: str,
           remarks: list[str]) -> Bench:
    """Climb the ladder past the chosen harmonics, and on while the next rung is expected to fit into the time."""
    least = 2 + next((k for k, (H, _) in enumerate(LADDER) if H >= chosen), len(LADDER))
    best, before, start, used = None, None, time.perf_counter(), 0.0
    for rung, (H, samples) in enumerate(LADDER):
        if rung >= least and used * 6 > budget - (time.perf_counter() - start):
            break
        begun = time.perf_counter()
        points, _, left_out = timed_model(model(H), omegas, balance(H, samples), np.inf if rung < least else budget)
        used = time.perf_counter() - begun
        if left_out or not all(p.converged for p in points):
            break
        before, best = best, (rung, resonance(omegas, np.array([p.first for p in points])))
    if best is None:
        raise NotSolvedError(f"the reference of the {name} did not converge: {points[-1].reason}")
    rung, truth = best
    doubt = errors(before[1], truth) if before else {f"error{end}": np.nan for end in ("", "_frequency", "_phasor")}
    remarks.append(f"reference of the {name}: H {LADDER[rung][0]}, {LADDER[rung][1]} samples, resonance "
                   f"{truth.frequency:.6g} Hz, {truth.amplitude:.6g} m, changed by {doubt['error']:.1e} on "
                   "its last rung")
    return Bench(omegas, truth, doubt, budget)


def _methods(model: ReducedModel, simple: bool, chosen: Settings, bench: Bench, remarks: list[str]) -> pd.DataFrame:
    listed = list(methods(simple))
    listed.append(Method(f"automatic: H {chosen.harmonics}, {chosen.samples} samples", "automatic choice",
                         balance(chosen.harmonics, chosen.samples)))
    return _finished(_rows([(m.name, m.family, model, m.run) for m in listed], bench), remarks)


def _models(family: Family, richest: Settings, chosen: Settings, bench: Bench, poorer: Mapping[str, Family],
            remarks: list[str]) -> pd.DataFrame:
    H, samples = max(chosen.harmonics, 3), max(chosen.samples, 256)
    rich = replace(richest, harmonics=H, samples=samples)
    listed = [*((family, *variant) for variant in _variants(family, rich)),
              *((other, name, "nodal diameters", rich) for name, other in poorer.items()),
              (family, "automatic", "automatic choice", chosen)]
    jobs = [(name, kind, member(whose, s).model, balance(s.harmonics, s.samples)) for whose, name, kind, s in listed]
    return _finished(_rows(jobs, bench), remarks)


def _variants(family: Family, rich: Settings) -> Iterator[tuple[str, str, Settings]]:
    """One choice poorer at a time."""
    yield "all of it", "rich model", rich
    for modes in (1, 2, 3, 5, 10, 20, 40, 80):
        if modes < family.modes:
            yield _counted(modes, "mode"), "modes", replace(rich, modes=modes)
    nodes = len(member(family, rich).groups) // 2
    for points in (1, 2, 4, 8, 16, 32, 64):
        if points < nodes:
            yield _counted(points, "point"), "contact points", replace(rich, points=points)
    for damper in DAMPERS:
        if damper in family.dampers and damper != rich.damper:
            yield f"{damper} damper", "damper model", replace(rich, damper=damper)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def _rows(jobs: list[tuple[str, str, ReducedModel, Callable]], bench: Bench) -> list[dict[str, object]]:
    """One row a job; what cheap ones leave of the time goes to the others."""
    rows, end, last = [], time.perf_counter() + bench.budget, {}
    for k, (name, kind, model, run) in enumerate(jobs):
        kinds = len({job[1] for job in jobs[k:]})
        share = max(end - time.perf_counter(), 0.1 * bench.budget) / (kinds + 1)
        expected = DEARER * last.get(kind, 0.0)
        if expected * len(bench.omegas) > 2 * share:      # a call cannot be cut short: do not even begin
            reason = f"left out: {expected:.2g} s a frequency are expected after the cheaper one of its kind"
            rows.append(_lost(name, kind, np.nan, reason, bench))
            continue
        rows.append(_row(name, kind, model, run, replace(bench, budget=share)))
        last[kind] = rows[-1]["time"]
    return rows


def _lost(name: str, kind: str, seconds: float, reason: str, bench: Bench) -> dict[str, object]:
    """The row of a variant without a result."""
    return {"name": name, "family": kind, "time": seconds, "chosen": kind == "automatic choice",
            "left_out": reason.startswith("left out"), "error": np.nan, "error_frequency": np.nan,
            "error_phasor": np.nan, "converged": False, "reference_error": bench.doubt["error"], "reason": reason}


def _row(name: str, kind: str, model: ReducedModel, run: Callable, bench: Bench) -> dict[str, object]:
    points, seconds, left_out = timed_model(model, bench.omegas, run, bench.budget)
    lost = [p.reason for p in points if not p.converged]
    if left_out or lost:
        return _lost(name, kind, seconds, left_out or f"{len(lost)} of {len(points)} frequencies: {lost[0]}", bench)
    peak = resonance(bench.omegas, np.array([p.first for p in points]))
    told = [p.reason for p in points if "false" in p.reason or "not periodic" in p.reason]
    reason = f"{len(told)} of {len(points)} frequencies: {told[0]}" if told else ""
    if not peak.inside:
        reason = "its resonance lies outside the compared frequencies"
    return _lost(name, kind, seconds, reason, bench) | errors(peak, bench.truth) | {"converged": True}


def _finished(rows: list[dict[str, object]], remarks: list[str]) -> pd.DataFrame:
    table = pd.DataFrame(rows)
    remarks += [f"{row['name']}: {row['reason']}" for row in rows if row["reason"]]
    return table


def _own_frequencies(model: ReducedModel, omegas: np.ndarray, mode: int) -> np.ndarray:
    """Frequencies round the resonance of the tangential model, which may lie elsewhere."""
    swept = covered(model, Settings(1, 3, 128, "mass"), None, mode, 0.05)
    good = [(p.omega, size(p)) for p in swept if p.converged]
    return frequencies(good) if good else omegas
