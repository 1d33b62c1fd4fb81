"""The resonance peak itself: found by the slope of the response, followed against a parameter.

The slope with the frequency is exact (`bladefem.hbm.sensitivity`). For one mode 1/size^2 is a
parabola in omega, so its derivative is a straight line, and the secant finds its zero in a few
points. Friction sampled in time makes a flat peak ripple, and slopes lead to the nearest ripple: a
maximum that is sharper than one mode's is compared with its surroundings (`hbm.peak_ripples`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..errors import NotSolvedError
from ..util.curve_extremum import cubic_minimum, tangents_meet
from .frequency_walk import walk_in_frequency
from .model import ReducedModel
from .parameters import vary
from .peak_ripples import above_ripples, may_be_ripple
from .sensitivity import sensitivities
from .solution import Solution, size
from .solve import solve
from .solver.newton import DEFAULT_OPTIONS, Options
from .validate_model import check_probe

# points spent on one peak before giving up
MAX_PEAK_POINTS = 40
# first step, as a share of the frequency
FIRST_STEP = 1e-3
# share of a predicted step that is taken, so that the maximum is soon enclosed
OVERSHOOT_FACTOR = 1.3
# longest step, as a share of the frequency
MAX_STEP = 0.05
# of the heights of two points that enclose a maximum, beyond which the higher one is not taken for
# a corner: between 54 um and 198 um a response jumped up to 263 um
MAX_HEIGHT_RATIO = 2.0
# of the frequency: two points that are no farther apart enclose the jump itself, whose higher end
# is the peak
JUMP_WIDTH = 1e-4
# of the largest rise of 1/height^2 that slopes may leave out, beyond which there is a jump: 1 at
# the limit of a corner next to the peak, 18 and 37 at the peaks of a bouncing mass
JUMP_RISE_SHARE = 0.75
# of the tolerance: difference of height up to which one point judges a peak: beyond it an overtone
# may have split the resonance, with a lower maximum next to that point
ALIKE = 5.0
# of the frequency: where a search begins instead when its first point is not solved
RETRY_RATIOS = (1.005, 1.01, 1.02, 0.99)
# the same first, of a search that only judges another peak, which has a solution nearby: on the
# shipped wedge under 73 N 23 harmonics were found from 15 in 1 s of CPU, from 1.005 on in 11 s
NEARBY_RATIOS = (1.001, 0.999)
# of the way to a point that is not solved at once: what a search that only judges another peak
# walks of it, since the maximum may lie before that point. On flat tops of the shipped wedge with a
# layer of 4e4 N/mm^3 and 80 N the walk through the maximum and on took 10 s
JUDGED_WALK_SHARE = 0.1


@dataclass(frozen=True)
class Peak:
    """A local maximum of the response."""

    solution: Solution
    # root of the sum of squares of the moving harmonics at the probe [m]
    height: float
    # solved on the way
    points: int
    # of the parameter that is followed
    value: float = 1.0
    # of the height with the parameter, at this peak [m per unit of
    # `bladefem.hbm.parameter_derivatives`]
    slope: float = 0.0
    # second derivative of 1/height^2 with the frequency [1/(m^2 (rad/s)^2)]; 0: unknown
    bend: float = 0.0
    # from the solution to the maximum, by its slope and the bend [rad/s]; 0: unknown
    ahead: float = 0.0

    @property
    def omega(self) -> float:
        """[rad/s]"""
        return self.solution.omega

    @property
    def vertex(self) -> float:
        """Where the maximum is, as far as its slope tells [rad/s]."""
        return self.omega + self.ahead


def find_peak(
    model: ReducedModel,
    omega: float,
    H: int = 3,
    samples: int = 128,
    *,
    near: Peak | Solution | None = None,
    tolerance: float = 1e-4,
    enough: float = 0.0,
    judged: Peak | None = None,
    options: Options = DEFAULT_OPTIONS,
) -> Peak:
    """The local maximum uphill of omega [rad/s].

    Args:
        samples: time samples a period; their ripples are no maxima.
        near: a peak of a similar model, which spares the first steps, or a solution to start from.
        tolerance: relative accuracy of the height; the frequency follows with its square root.
        enough: relative gain that is given up where the point that promises it is not solved at
            once.
        judged: the peak that this one judges, from whose solution `near` it starts: one point of
            about its height is enough where its slope promises no gain with that peak's bend. For
            searches without fallbacks.

    Raises:
        InputError: no such probe.
        NotSolvedError: a point was not solved, or no maximum was closed in.
    """
    check_probe(model, options.probe)
    found, sharpness = _closed_in(
        model,
        omega,
        H,
        samples,
        near=near,
        tolerance=tolerance,
        enough=enough,
        judged=judged,
        options=options,
    )
    # what only judges another peak (without fallbacks) is not worth more where its slope is zero
    if np.isinf(sharpness) and not options.fallbacks:
        return found
    if not may_be_ripple(model, found.solution, sharpness, options.probe):
        return found
    top = above_ripples(model, found.solution, tolerance, options)
    return replace(
        found,
        solution=top.solution,
        height=size(top.solution, options.probe),
        points=found.points + top.points,
        bend=top.bend or found.bend,
        ahead=0.0,
    )


def _closed_in(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    *,
    near: Peak | Solution | None,
    tolerance: float,
    enough: float,
    judged: Peak | None,
    options: Options,
) -> tuple[Peak, float]:
    """The maximum that slopes lead to, and the largest second derivative of 1/height^2 by which
    it was closed in; infinite where it was from one side only.
    """
    low: _Look | None = None
    high: _Look | None = None
    last: _Look | None = None
    best: _Look | None = None
    gain = np.inf
    bend, start = (near.bend, near.solution) if isinstance(near, Peak) else (0.0, near)
    trusted = judged and start and _trusted_bend(model, start, judged.bend, options.probe)
    reach = FIRST_STEP * omega
    frequency = omega / (2 * np.pi)
    for count in range(1, MAX_PEAK_POINTS + 1):
        # where the gain is not worth a walk, one try is enough
        near_enough = best is not None and gain <= enough
        known = last if best is None else _start_look(last, low, high, omega)
        point = _solved_near(model, omega, H, samples, start, known, options, near_enough)
        if near_enough and not point.converged and best is not None:
            return _as_peak(model, best, count, bend, low, high)
        frequency = point.frequency
        _require_motion(point, options.probe)
        omega = point.omega
        now = _look_at(model, point, options.probe)
        at_once = _judging_point(now, judged, tolerance) if trusted and count == 1 else None
        if at_once:
            return at_once, np.inf
        low, high = (now, high) if now.slope > 0 else (low, now)
        if last is not None:
            bend = (now.line - last.line) / (omega - last.solution.omega)
        if low and high:
            best = max(low, high, key=lambda look: look.height)
            target, gain = _vertex_between(low, high, corner=count % 2 == 1)
        else:
            best = now
            step = -now.line / bend if bend > 0 else np.sign(now.slope) * reach
            gain = abs(now.slope * step) / now.height if bend > 0 and count > 1 else np.inf
            target = omega + float(
                np.clip(OVERSHOOT_FACTOR * step, -MAX_STEP * omega, MAX_STEP * omega)
            )
            reach = 2 * reach
        if gain < tolerance / 4:
            return _as_peak(model, best, count, bend, low, high)
        last = now
        omega = target
    raise NotSolvedError(
        f"peak search found no maximum in {MAX_PEAK_POINTS} points, last at {frequency:.6g} Hz"
    )


def _judging_point(now: _Look, judged: Peak | None, tolerance: float) -> Peak | None:
    """A point as the peak that judges another one, whose bend is good for a gain, and would mislead
    a step; None where its height is another, or its slope promises a gain.
    """
    if judged is None or abs(now.height / judged.height - 1) >= ALIKE * tolerance:
        return None
    ahead = -now.line / judged.bend
    if abs(now.slope * ahead) / now.height >= tolerance / 4:
        return None
    return Peak(now.solution, now.height, 1, bend=judged.bend, ahead=ahead)


def _trusted_bend(model: ReducedModel, top: Solution, bend: float, probe: int) -> bool:
    """No ripple has made the bend of a peak, and no normal load follows the motion, which makes
    folds.
    """
    trusted = model.loads_prescribed and bend > 0
    return trusted and not may_be_ripple(model, top, bend, probe)


def _start_look(
    last: _Look | None,
    low: _Look | None,
    high: _Look | None,
    omega: float,
) -> _Look | None:
    """Where the search for a point at a frequency starts: the nearer one of two that enclose the
    maximum, the higher one where the response jumps between them, which would lead to the foot of
    the peak again; the last one where none is enclosed.
    """
    if low is None or high is None:
        return last
    if _jumps_between(low, high):
        return max(low, high, key=lambda look: look.height)
    return min(low, high, key=lambda look: abs(look.solution.omega - omega))


def _as_peak(
    model: ReducedModel,
    best: _Look,
    points: int,
    bend: float,
    low: _Look | None,
    high: _Look | None,
) -> tuple[Peak, float]:
    """The peak, and how sharp it is between the points that enclose it."""
    # a bend may be that of a fold where normal loads follow the motion
    ahead = -best.line / bend if bend > 0 and model.loads_prescribed else 0.0
    if low and high:
        # no farther than the other side of the maximum
        below, above = (look.solution.omega - best.solution.omega for look in (low, high))
        ahead = float(np.clip(ahead, below, above))
    peak = Peak(best.solution, best.height, points, bend=float(max(bend, 0.0)), ahead=ahead)
    if low is None or high is None:
        return peak, np.inf
    if low.solution.omega == high.solution.omega:
        return peak, peak.bend
    enclosed = (high.line - low.line) / (high.solution.omega - low.solution.omega)
    return peak, max(peak.bend, float(enclosed))


def _require_motion(point: Solution, probe: int) -> None:
    """The point was solved, and the probe moves there."""
    if not point.converged:
        raise NotSolvedError(f"peak search stopped at {point.frequency:.6g} Hz: {point.reason}")
    if size(point, probe) == 0:
        raise NotSolvedError(
            f"peak search at {point.frequency:.6g} Hz: probe {probe} does not move"
        )


def _solved_near(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: Solution | None,
    known: _Look | None,
    options: Options,
    once: bool = False,
) -> Solution:
    """The point at a frequency, or the nearest to it that a solved one leads to.

    In small steps before all fallbacks, which take far longer: 50 of 250 ms for one point of a
    random model (seed 53 of benchmarks/choice_random.py).

    Args:
        start: of the first point of a search, from a similar model: where it leads nowhere, the
            same is tried at RETRY_RATIOS times the frequency, away from folds.
        known: a point of this model, from whose tangent every other point starts.
        once: no more than one try.
    """
    if known is None:
        point = solve(model, omega, H, samples, start=start, options=options)
        if point.converged or start is None:
            return point
        return _solved_beside(model, omega, H, samples, start, options) or point
    ahead = _on_tangent(known, omega)
    if once:
        return solve(model, omega, H, samples, start=ahead, options=options)
    simply = replace(options, fallbacks=False)
    point = solve(model, omega, H, samples, start=ahead, options=simply)
    if point.converged:
        return point
    enough = 1.0 if options.fallbacks else JUDGED_WALK_SHARE
    way = walk_in_frequency(model, omega, H, samples, known.solution, options, enough)
    if options.fallbacks and not (way and way[-1].omega == omega):
        point = solve(model, omega, H, samples, start=known.solution, options=options)
    return way[-1] if way and not point.converged else point


def _on_tangent(known: _Look, omega: float) -> Solution:
    """A start at another frequency."""
    point = known.solution
    return replace(point, w=point.w + (omega - point.omega) * known.rate)


def _solved_beside(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: Solution,
    options: Options,
) -> Solution | None:
    """The first converged point at RETRY_RATIOS times the frequency, without fallbacks, or nearer
    where the search has none.
    """
    simply = replace(options, fallbacks=False)
    ratios = RETRY_RATIOS if options.fallbacks else (*NEARBY_RATIOS, *RETRY_RATIOS)
    tries = (
        solve(model, omega * ratio, H, samples, start=start, options=simply) for ratio in ratios
    )
    return next((other for other in tries if other.converged), None)


@dataclass(frozen=True)
class _Look:
    """A solution seen by the height of its response and the slope of that with the frequency."""

    solution: Solution
    height: float
    slope: float
    # (n, d, K) of the displacements with the circular frequency
    rate: np.ndarray

    @property
    def line(self) -> float:
        """Slope of 1/height^2."""
        return -2 * self.slope / self.height**3


def _look_at(model: ReducedModel, point: Solution, probe: int) -> _Look:
    """A solved point with its derivatives by the circular frequency."""
    try:
        found = sensitivities(model, point, ["omega"])["omega"]
    except np.linalg.LinAlgError as error:
        raise NotSolvedError(f"slope at {point.frequency:.6g} Hz: {error}") from error
    return _Look(point, size(point, probe), float(found.size[probe]), found.w)


def _jumps_between(low: _Look, high: _Look) -> bool:
    """The response jumps between two points of unlike heights: 1/height^2 rises from the higher one
    by more than its slopes at both ends tell, and they are farther apart than the jump itself.

    For one mode the rise is the mean of both slopes times the width; for two straight lines that
    meet next to the higher point it exceeds that by the mean of their absolute values.
    """
    width = high.solution.omega - low.solution.omega
    heights = sorted((low.height, high.height))
    wide = abs(width) > JUMP_WIDTH * low.solution.omega
    if not wide or heights[1] <= MAX_HEIGHT_RATIO * heights[0]:
        return False
    sign = 1.0 if low.height > high.height else -1.0
    mean = sign * (low.line + high.line) * width / 2
    most = (abs(low.line) + abs(high.line)) * abs(width) / 2
    rise = heights[0] ** -2 - heights[1] ** -2
    return bool(rise - mean > JUMP_RISE_SHARE * most)


def _vertex_between(
    low: _Look,
    high: _Look,
    corner: bool,
) -> tuple[float, float]:
    """Where 1/height^2 is lowest between a rising and a falling point, and the relative gain of
    height there.

    By the cubic through values and slopes; for a corner, where a contact begins to slip, where the
    tangents meet. Outside of the two they say that the higher one is the corner itself, which is
    believed where the heights are alike: where the response jumps up between them it is not so,
    unless they are as near as that jump. At a jump the cubic would lead to the higher end, and
    promise nothing: the gap is halved there, until the slope of that end gains too little in it.
    """
    width = high.solution.omega - low.solution.omega
    if _jumps_between(low, high):
        top = max(low, high, key=lambda look: look.height)
        return low.solution.omega + width / 2, abs(top.slope * width) / top.height
    down = low.line * width
    up = high.line * width
    rise = high.height**-2 - low.height**-2
    share, depth = tangents_meet(down, up, rise) if corner else cubic_minimum(down, up, rise)
    unlike = max(low.height, high.height) > MAX_HEIGHT_RATIO * min(low.height, high.height)
    wide = abs(width) > JUMP_WIDTH * abs(low.solution.omega)
    if corner and unlike and wide and not 0 < share < 1:
        # halved: the cubic leads to its higher end alone
        share, depth = 0.5, cubic_minimum(down, up, rise)[1]
    bottom = low.height**-2 + depth
    gain = max(low.height, high.height) ** -2 / bottom - 1 if bottom > 0 else np.inf
    target = low.solution.omega + float(np.clip(share, 0.02, 0.98)) * width
    return target, float(gain) if width > 1e-9 * target else 0.0


def track_peak(
    model: ReducedModel,
    name: str,
    values: Iterable[float],
    omega: float,
    H: int = 3,
    samples: int = 128,
    *,
    options: Options = DEFAULT_OPTIONS,
) -> Iterator[Peak]:
    """Follow one peak while a parameter of `bladefem.hbm.parameters` takes the given values: no
    frequency sweeps.

    Args:
        omega: where to look for the first peak [rad/s].
    """
    path: list[Peak] = []
    for value in values:
        guess = omega
        if path:
            guess = path[-1].omega
        if len(path) > 1 and path[-1].value != path[-2].value:
            ahead = (value - path[-1].value) / (path[-1].value - path[-2].value)
            guess += float(
                np.clip(ahead * (guess - path[-2].omega), -MAX_STEP * guess, MAX_STEP * guess)
            )
        changed = vary(model, name, value)
        peak = find_peak(
            changed, guess, H, samples, near=path[-1] if path else None, options=options
        )
        path = [*path[-1:], with_slope(changed, peak, name, value, options.probe)]
        yield path[-1]


def with_slope(
    model: ReducedModel,
    peak: Peak,
    name: str,
    value: float,
    probe: int = 0,
) -> Peak:
    """The peak with the derivative of its height by a parameter that has this value."""
    slope = sensitivities(model, peak.solution, [name])[name].size[probe]
    return replace(peak, value=value, slope=float(slope))
