"""Variants of a chart solved on common frequencies, timed, and compared with the reference; the
cheap ones first.

What a variant costs is known only when it was tried. Each first gets a small share of the time; one
that would take more is put back with the time of the frequency that it solved, and has its turn
when all cheaper ones are done.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...hbm.model import ReducedModel
from ...util.curve_extremum import parabola_minimum
from .cpu_clock import Clock
from .methods import Point

# times that a variant may cost more than the cheaper one of its kind before it
MAX_COST_STEP = 3.0
# of the time that is left, for a variant of unknown cost
UNKNOWN_COST_SHARE = 0.1
# times that the first frequencies, from rest or at the resonance, may cost more than the mean
FIRST_CALL_FACTOR = 2.0
MIN_FREQUENCIES = 3
# shorter runs [s] are repeated so often at the most; the fastest counts
BRIEF_SECONDS = 0.02
MAX_REPEATS = 5

# model, circular frequency, where the last one ended
Solve = Callable[[ReducedModel, float, object], Point]


@dataclass(frozen=True)
class ChartPeak:
    """Responses on the common frequencies and the resonance that they show."""

    # (k,) complex [m]
    first: np.ndarray
    # of the resonance [m]
    amplitude: float
    # [Hz]
    frequency: float
    # the highest point is not at the end of the frequencies
    inside: bool


@dataclass(frozen=True)
class Bench:
    """What all variants of one table share."""

    # (k,) [rad/s]
    omegas: np.ndarray
    truth: ChartPeak
    # the reference's own error
    doubt: dict[str, float]


@dataclass(frozen=True)
class Job:
    """A variant."""

    name: str
    kind: str
    model: ReducedModel
    run: Solve
    bench: Bench
    # it costs more than those of its kind before it
    ordered: bool = False
    # it is run whatever it costs
    needed: bool = False
    # by the automatic choice
    chosen: bool = False


@dataclass(frozen=True)
class Timing:
    """Solved points and their cost; fewer points than frequencies where the allowed time would not
    do.
    """

    points: list[Point]
    # of CPU a frequency, compilation apart
    seconds: float


@dataclass(frozen=True)
class _Known:
    """What was learnt so far: seconds a frequency of jobs put back, and of the last solved one of
    each kind.
    """

    own: dict[int, float] = field(default_factory=dict)
    kind: dict[str, float] = field(default_factory=dict)

    def expected(
        self,
        number: int,
        job: Job,
    ) -> float:
        """Seconds a frequency; zero when nothing is known."""
        cheaper = MAX_COST_STEP * self.kind.get(job.kind, 0.0) if job.ordered else 0.0
        return self.own.get(number, cheaper)


def timed_sweep(
    model: ReducedModel,
    run: Solve,
    omegas: np.ndarray,
    allowed: tuple[float, float],
    clock: Clock,
) -> Timing:
    """All frequencies, or as many as show that they would take more than is allowed; the middle one
    first.

    Args:
        allowed: seconds for all, as the first frequencies show, and as more than MIN_FREQUENCIES of
            them show.
    """
    begun = clock.now()
    # caches warm
    run(model, omegas[len(omegas) // 2], None)
    spent = clock.now() - begun
    if spent * len(omegas) > allowed[0]:
        return Timing([], spent)
    best = np.inf
    for _ in range(MAX_REPEATS):
        points = []
        last = None
        begun = clock.now()
        for k, omega in enumerate(omegas, start=1):
            points.append(run(model, omega, last))
            last = points[-1].start
            spent = clock.now() - begun
            if spent / k * len(omegas) > allowed[k > MIN_FREQUENCIES] and k < len(omegas):
                return Timing(points, spent / k)
        best = min(best, spent / len(omegas))
        if spent > BRIEF_SECONDS:
            break
    return Timing(points, best)


def chart_rows(
    jobs: Sequence[Job],
    end: float,
    clock: Clock,
) -> list[dict[str, object]]:
    """One row a job, in their order, solved as long as the clock has not come to the end, cheap
    ones first.
    """
    known = _Known()
    waiting = dict(enumerate(jobs))
    done = {}
    while waiting:
        k = min(
            _eligible(waiting), key=lambda i: (not waiting[i].needed, known.expected(i, waiting[i]))
        )
        job = waiting[k]
        left = end - clock.now()
        measured = k in known.own
        reason = _too_dear(known.expected(k, job), measured, left, job)
        if reason and not job.needed:
            done[k] = _lost(waiting.pop(k), known.own.get(k, np.nan), reason)
            continue
        allowed = (np.inf, np.inf) if job.needed else _allowed_seconds(left, measured)
        timing = timed_sweep(job.model, job.run, job.bench.omegas, allowed, clock)
        if len(timing.points) < len(job.bench.omegas) and not measured:
            known.own[k] = timing.seconds
            continue
        done[k] = _row(waiting.pop(k), timing)
        if done[k]["converged"]:
            known.kind[job.kind] = timing.seconds
    return [done[k] for k in range(len(jobs))]


def _allowed_seconds(left: float, measured: bool) -> tuple[float, float]:
    """What one job may take of the time that is left, as :func:`timed_sweep` has it: little of it
    where its cost was never measured.
    """
    share = (FIRST_CALL_FACTOR if measured else UNKNOWN_COST_SHARE) * left
    return share, min(left, FIRST_CALL_FACTOR * share)


def _eligible(waiting: dict[int, Job]) -> list[int]:
    """Jobs that wait for no cheaper one of their kind."""
    firsts: dict[str, int] = {}
    for k, job in waiting.items():
        firsts.setdefault(job.kind, k)
    return [k for k, job in waiting.items() if not job.ordered or firsts[job.kind] == k]


def _too_dear(
    seconds: float,
    measured: bool,
    left: float,
    job: Job,
) -> str:
    """Why a job is not begun: a call cannot be cut short."""
    if measured and seconds * len(job.bench.omegas) > FIRST_CALL_FACTOR * left:
        return (
            f"left out: {seconds:.2g} s a frequency, {max(left, 0.0):.2g} s of the budget were left"
        )
    if left <= 0:
        return "left out: the budget was used up"
    if seconds > left:
        return (
            f"left out: {seconds:.2g} s a frequency are expected after the cheaper one of its "
            f"kind, {left:.2g} s of the budget were left"
        )
    return ""


def _row(job: Job, timing: Timing) -> dict[str, object]:
    points = timing.points
    bench = job.bench
    lost = [p.reason for p in points if not p.converged]
    if len(points) < len(bench.omegas):
        return _lost(
            job,
            timing.seconds,
            f"left out: {timing.seconds:.2g} s a frequency exceed what was left",
        )
    if lost:
        return _lost(job, timing.seconds, f"{len(lost)} of {len(points)} frequencies: {lost[0]}")
    peak = parabola_resonance(bench.omegas, np.array([p.first for p in points]))
    reasons = [p.reason for p in points if "false" in p.reason or "not periodic" in p.reason]
    reason = f"{len(reasons)} of {len(points)} frequencies: {reasons[0]}" if reasons else ""
    if not peak.inside:
        reason = "its resonance lies outside the compared frequencies"
    return (
        _lost(job, timing.seconds, reason)
        | relative_errors(peak, bench.truth)
        | {"converged": True}
    )


def _lost(
    job: Job,
    seconds: float,
    reason: str,
) -> dict[str, object]:
    """The row of a variant without a result."""
    return {
        "name": job.name,
        "family": job.kind,
        "time": seconds,
        "chosen": job.chosen,
        "left_out": reason.startswith("left out"),
        "error": np.nan,
        "error_frequency": np.nan,
        "error_phasor": np.nan,
        "converged": False,
        "reference_error": job.bench.doubt["error"],
        "reason": reason,
    }


def parabola_resonance(omegas: np.ndarray, first: np.ndarray) -> ChartPeak:
    """The resonance by a parabola in 1/amplitude^2 over omega^2 through the highest point and its
    neighbours.
    """
    height = np.where(np.isfinite(first), abs(first), 0.0)
    top = int(height.argmax())
    if not 0 < top < len(omegas) - 1 or min(height[top - 1 : top + 2]) == 0:
        return ChartPeak(first, float(height[top]), float(omegas[top] / (2 * np.pi)), False)
    x = omegas[top - 1 : top + 2] ** 2
    vertex = parabola_minimum(x, 1 / height[top - 1 : top + 2] ** 2)
    if vertex is None:
        return ChartPeak(first, float(height[top]), float(omegas[top] / (2 * np.pi)), True)
    place, low = vertex
    amplitude = low**-0.5 if low > 0 else height[top]
    return ChartPeak(first, float(amplitude), float(np.sqrt(place) / (2 * np.pi)), True)


def relative_errors(peak: ChartPeak, truth: ChartPeak) -> dict[str, float]:
    """Relative errors of resonance amplitude and frequency, and of the worst phasor over the
    highest one.
    """
    return {
        "error": abs(peak.amplitude / truth.amplitude - 1),
        "error_frequency": abs(peak.frequency / truth.frequency - 1),
        "error_phasor": float(np.max(abs(peak.first - truth.first)) / np.max(abs(truth.first))),
    }
