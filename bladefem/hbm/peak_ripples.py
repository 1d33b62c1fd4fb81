"""Maxima that the sampling of friction makes on a flat peak, told from the peak.

Between samples a contact changes its state a little too late, by up to a period over their number.
The response is a chain of smooth pieces, one for each number of slipping samples; where it is flat,
as between the first slip and full slip, each piece may have a maximum of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..util.curve_extremum import parabola_at_middle
from .model import ReducedModel
from .solution import Solution, moving_contacts, size
from .solve import solve
from .solver.newton import Options

# second derivative of 1/height^2, over that of the mode alone, beyond which a maximum may be that
# of a ripple, or a true corner
SHARP_RATIO = 4.0
# how much lower the mode alone would be where a sharp maximum is compared with its surroundings:
# many ripples away
COMPARED_FALL = 0.01
# of the frequency: how far away that may be. The top of a low flank is no top of the mode, which
# seems flat there: 1 % lower by itself only at 2.2 times the frequency, and below zero (seed 308 of
# benchmarks/verdicts.py)
MAX_STEP_SHARE = 0.05
# gain of height beyond which the way uphill has left the peak for another one: ripples of 64
# samples are up to 3.5 % high
MAX_GAIN = 0.1
# steps uphill, and parabolas through the highest three points
MAX_STEPS = 12
MAX_PARABOLAS = 3


@dataclass(frozen=True)
class Top:
    """The highest point of a peak with ripples."""

    solution: Solution
    # second derivative of 1/height^2 with the frequency, over its surroundings [1/(m^2 (rad/s)^2)]
    bend: float
    # solved on the way
    points: int


def may_be_ripple(model: ReducedModel, top: Solution, sharpness: float, probe: int = 0) -> bool:
    """Whether a maximum is sharper than a mode makes it, where sampled contacts slip or lift off.

    Args:
        sharpness: second derivative of 1/height^2 with the circular frequency.
    """
    if top.samples == 0 or moving_contacts(top) == 0:
        return False
    expected = bend_of_mode(model, top.omega, probe)
    return bool(expected > 0 and sharpness > SHARP_RATIO * expected)


def bend_of_mode(model: ReducedModel, omega: float, probe: int = 0) -> float:
    """Second derivative of 1/height^2 at the resonance of the mode that moves the probe most; 0
    where none is excited.

    With the amplitude A / |w_0^2 - (h w)^2 + ...| it is 8 h^4 w^2 / A^2, whatever the damping.
    """
    moving = [h for h in model.excitation if h > 0]
    if not moving:
        return 0.0
    h = min(moving)
    side = model.side(h)
    load = side.shapes[side.ports["load"]].conj().T @ model.excitation[h]
    gain = abs(side.shapes[side.ports["probe"]][probe] * load)
    distance = np.maximum(abs(side.omega**2 - (h * omega) ** 2), 1e-9 * (h * omega) ** 2)
    if not gain.size or not gain.any():
        return 0.0
    strongest = gain[np.argmax(gain / distance)]
    return float(8 * h**4 * omega**2 / strongest**2)


def above_ripples(
    model: ReducedModel,
    top: Solution,
    tolerance: float,
    options: Options,
) -> Top:
    """The highest point uphill of a sharp maximum, by heights many ripples apart; the maximum
    itself where they lead to another peak, or where the mode alone makes no top there.

    Args:
        tolerance: relative gain of height that is not looked for.
    """
    probe = options.probe
    bend = bend_of_mode(model, top.omega, probe)
    step = float(np.sqrt(4 * COMPARED_FALL / bend)) / size(top, probe)
    if step > MAX_STEP_SHARE * top.omega:
        return Top(top, 0.0, 0)
    simply = replace(options, fallbacks=False)
    solved = {top.omega: top}

    def height(omega: float, start: Solution) -> float:
        # steps uphill grow twofold
        if omega <= 0:
            return 0.0
        point = solve(model, omega, top.harmonics, top.samples, start=start, options=simply)
        if not point.converged:
            return 0.0
        solved[point.omega] = point
        return size(point, probe)

    middle, best = top.omega, size(top, probe)
    down, up = (height(middle + side * step, top) for side in (-1, 1))
    left = right = step
    for _ in range(MAX_STEPS):
        if not (1 + tolerance) * best < max(down, up) <= (1 + MAX_GAIN) * size(top, probe):
            break
        # on: the point in the middle becomes a neighbour, the next one lies twice as far
        if up > down:
            left, down, middle, best, right = right, best, middle + right, up, 2 * right
            up = height(middle + right, solved[middle])
        else:
            right, up, middle, best, left = left, best, middle - left, down, 2 * left
            down = height(middle - left, solved[middle])
    bend = 0.0
    for _ in range(MAX_PARABOLAS):
        if not (0 < down <= best and 0 < up <= best):
            break
        bend, shift, gain = _vertex((left, right), (down, best, up))
        # no closer than the distance over which ripples even out
        if gain < tolerance or abs(shift) < step / 4:
            break
        found = height(middle + shift, solved[middle])
        if found <= best:
            break
        middle, best, left, right = middle + shift, found, left + shift, right - shift
    highest = max(solved.values(), key=lambda point: size(point, probe))
    if size(highest, probe) > (1 + MAX_GAIN) * size(top, probe):
        return Top(top, 0.0, len(solved) - 1)
    return Top(highest, float(max(bend, 0.0)), len(solved) - 1)


def _vertex(
    distances: tuple[float, float], heights: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Second derivative of the parabola of 1/height^2, the distance of its vertex from the middle
    point, and the relative gain of height there; the latter two 0 where it has no maximum.

    Args:
        distances: of the neighbours, below and above; heights: of all three from there up.
    """
    down, best, up = heights
    level = best**-2
    slope, half = parabola_at_middle(*distances, down**-2 - level, up**-2 - level)
    bend = 2 * half
    if bend <= 0:
        return bend, 0.0, 0.0
    return bend, -slope / bend, slope * slope / (2 * bend) / level
