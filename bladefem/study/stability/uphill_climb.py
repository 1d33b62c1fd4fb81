"""The highest motion uphill of a start: the frequency is moved step by step, the motion taken
along, until the amplitude falls on both sides or the blade jumps to a lower motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...hbm.model import ReducedModel
from ...hbm.peak_ripples import bend_of_mode
from ...hbm.ring_march import RingState
from ...util.curve_extremum import parabola_at_middle
from .settled_march import (
    MarchBudget,
    MarchFailedError,
    SettledMotion,
    settle_after_overdrive,
    settle_at,
)

# Figures behind these limits: docs/verification.md, "Limits of marches and balances".
# step of the frequency, over the half width of the resonance
STEP_SHARE = 0.5
MOST_STEPS = 10
# share of the amplitude before, below which a step has led to another motion: along one it falls by
# some 11 %
JUMP_SHARE = 0.7
# relative gain of height by the vertex of a parabola that is marched as well
WORTH_A_MARCH = 0.01


@dataclass(frozen=True)
class Top:
    """Where a climb ended."""

    best: SettledMotion
    # a lower motion next to it
    neighbour: SettledMotion
    # second derivative of 1 / height^2 by the circular frequency, of the blade alone
    bend: float
    # circular frequency on the other side, from that of the best motion on, at which the blade has
    # jumped to a lower one; 0 where the amplitude falls smoothly on both sides
    jump: float = 0.0
    # nothing higher is expected next to it
    closed_in: bool = True

    @property
    def rise_ahead(self) -> float:
        """Relative rise that is possible before the jump, by the slope up to here."""
        run = abs(self.best.omega - self.neighbour.omega)
        return (self.best.mean / self.neighbour.mean - 1) * abs(self.jump) / run

    @property
    def rise_behind(self) -> float:
        """Relative rise that is possible towards the neighbour, by a parabola of 1 / height^2
        through both, bent as that of the blade alone: the blade may have come from above.
        """
        run = abs(self.best.omega - self.neighbour.omega)
        higher = self.neighbour.mean**-2 - self.best.mean**-2
        vertex = run / 2 - higher / (self.bend * run)
        return self.bend / 4 * (max(vertex, 0.0) * self.best.mean) ** 2 if self.jump else 0.0

    @property
    def left(self) -> float:
        """Relative rise that may have been missed."""
        return max(self.rise_ahead, self.rise_behind)


def highest_uphill(model: ReducedModel, state: RingState, work: MarchBudget) -> Top:
    """The highest motion uphill of a start; driven hard once more where that has led far away.

    Raises:
        MarchFailedError: it was not closed in.
    """
    omega = state.drive.omega
    bend = bend_of_mode(model, omega)
    if bend <= 0:
        raise MarchFailedError
    here = settle_after_overdrive(model, state, omega, work)
    width = np.sqrt(2 / bend)
    top = climb(model, here, bend, work)
    if abs(top.best.omega - here.omega) * here.mean < width:
        return top
    again = settle_after_overdrive(model, top.best.state, top.best.omega, work)
    if JUMP_SHARE * again.mean < top.best.mean:
        return top
    return climb(model, again, bend, work)


def climb(
    model: ReducedModel, start: SettledMotion, bend: float, work: MarchBudget, upwards: bool = True
) -> Top:
    """The highest motion uphill of a start, by steps of the circular frequency.

    Args:
        upwards: higher frequencies are tried first; uphill there, lower ones are not.

    Raises:
        MarchFailedError: it was not closed in.
    """
    step = STEP_SHARE * np.sqrt(2 / bend) / start.mean
    known = {0: start}
    for side in (1, -1) if upwards else (-1, 1):
        place = side
        while abs(place) <= MOST_STEPS and not work.exhausted:
            omega = start.omega + place * step
            known[place] = settle_at(model, known[place - side], omega, work)
            if known[place].mean < known[place - side].mean:
                break
            place += side
        if abs(place) > 1:
            # uphill on this side: the other one is known
            break
    place = max(known, key=lambda k: known[k].mean)
    if place - 1 not in known or place + 1 not in known:
        raise MarchFailedError
    best = known[place]
    lower, neighbour = sorted((known[place - 1], known[place + 1]), key=lambda one: one.mean)
    if lower.expected > JUMP_SHARE * best.mean:
        return _with_vertex(model, best, (lower, neighbour), bend, work)
    return refine_top(model, Top(best, neighbour, bend, lower.omega - best.omega), work)


def _with_vertex(
    model: ReducedModel,
    best: SettledMotion,
    beside: tuple[SettledMotion, SettledMotion],
    bend: float,
    work: MarchBudget,
) -> Top:
    """The top where the amplitude falls smoothly from the best motion on both sides."""
    low, high = sorted(beside, key=lambda one: one.omega)
    found = _at_vertex(model, best, low, high, work)
    top = max(best, found, key=lambda one: one.mean)
    neighbour = max(beside, key=lambda one: one.mean)
    # one that is far higher than its neighbours has a resonance of its own
    return Top(top, neighbour, bend, closed_in=neighbour.mean > JUMP_SHARE * top.mean)


def _at_vertex(
    model: ReducedModel,
    best: SettledMotion,
    low: SettledMotion,
    high: SettledMotion,
    work: MarchBudget,
) -> SettledMotion:
    """The motion at the vertex of 1 / height^2 through three; the best of these where that is not
    expected to be higher.
    """
    left, right = best.omega - low.omega, high.omega - best.omega
    level = best.mean**-2
    slope, half = parabola_at_middle(left, right, low.mean**-2 - level, high.mean**-2 - level)
    if half <= 0 or slope**2 / (4 * half) < 2 * WORTH_A_MARCH * level or work.exhausted:
        return best
    return settle_at(model, best, best.omega - slope / (2 * half), work)


def refine_top(model: ReducedModel, top: Top, work: MarchBudget, most: int = MOST_STEPS) -> Top:
    """The highest motion before the blade jumps to a lower one: the ways to the jump and to the
    neighbour are halved, the one that promises more, until neither promises much.

    A blade that has jumped after a large step may follow in a small one: in the end the frequency
    of the jump is marched again, and what is beyond it where the blade follows.
    """
    for _ in range(most):
        best = top.best
        if work.exhausted:
            return replace(top, closed_in=False)
        if top.left < WORTH_A_MARCH:
            found = settle_at(model, best, best.omega + top.jump, work)
            if found.mean <= best.mean:
                return replace(top, closed_in=True)
            top = Top(found, best, top.bend, 2 * top.jump)
            continue
        ahead = top.rise_ahead >= top.rise_behind
        way = top.jump if ahead else top.neighbour.omega - best.omega
        found = settle_at(model, best, best.omega + way / 2, work)
        if found.mean > best.mean:
            # the one left behind becomes the end of the other way
            jump, beside = (way / 2, best) if ahead else (-way / 2, top.neighbour)
            top = Top(found, beside, top.bend, jump)
        elif not ahead:
            top = replace(top, neighbour=found)
        elif found.expected > JUMP_SHARE * best.mean:
            # what fell far below was a steep flank
            return _with_vertex(model, best, (found, top.neighbour), top.bend, work)
        else:
            top = replace(top, jump=way / 2)
    return replace(top, closed_in=False)


def follow_uphill(
    model: ReducedModel,
    start: SettledMotion,
    step: float,
    work: MarchBudget,
    most: int,
) -> SettledMotion:
    """The highest motion of so many steps of the circular frequency at most, up to the first that
    falls.
    """
    best = start
    for _ in range(most):
        found = settle_at(model, best, best.omega + step, work)
        if found.mean <= best.mean:
            break
        best = found
    return best
