"""The lowest and the highest resonance that the loading history can leave: extremes over all
admissible friction forces of the nodes that never slip.

From a resonance the derivative by these forces (`traction_gradient`) tells where to move within
their convex set; the farthest admissible point is the next state, whose resonance is climbed from
the last one (the conditional gradient method, Frank and Wolfe 1956, DOI 10.1002/nav.3800030109).
Ends where no move promises more than the tolerance. Every state that is solved is admissible, so
both ends are attained; whether nothing lies beyond them is certified only where the response is
monotone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import NotSolvedError
from .linear.condensation import condense
from .model import ReducedModel
from .peak import Peak, find_peak
from .solver.newton import DEFAULTS, Options
from .traction_gradient import Tractions, farthest, tractions

__all__ = ["MONOTONE", "POINT", "SAMPLED", "HistoryInterval", "history_interval"]

POINT = "point"
MONOTONE = "monotone"
SAMPLED = "sampled"
# moves towards one end, and halvings of a move that does not gain
MOVES = 6
HALVINGS = 2
# start beyond the friction limit, over mu N: the march brings it back to the limit
BEYOND = 1.5


@dataclass(frozen=True)
class HistoryInterval:
    """Range of one resonance over the loading histories."""

    lowest: Peak
    highest: Peak
    # (n, tangents) `ReducedModel.start` that leads to them [N]
    lowest_start: np.ndarray
    highest_start: np.ndarray
    # POINT: no admissible force changes the resonance; MONOTONE: at every state solved on the way
    # the response grows along the way from the lowest to the highest state of each node, and no
    # move at the ends promises more; SAMPLED: otherwise, the range of the states solved
    certificate: str
    # nodes that never slip at the resonance given
    sticking: int
    # solved altogether
    points: int
    # searches that found no resonance, or did not end within their moves; "" when none
    reason: str


@dataclass(frozen=True)
class _Place:
    """A resonance of one history."""

    peak: Peak
    # (n, tangents)
    start: np.ndarray
    free: Tractions


@dataclass
class _Search:
    """What does not change on the way, and what was solved."""

    model: ReducedModel
    tolerance: float
    options: Options
    places: list[_Place]
    points: int
    reasons: list[str]

    def solve(self, start: np.ndarray, near: Peak) -> _Place | None:
        """The resonance with another start, climbed from a known one; None where it is not
        found.
        """
        model = replace(self.model, start=start)
        solution = near.solution
        try:
            peak = find_peak(
                model,
                near.omega,
                solution.harmonics,
                solution.samples,
                near=near,
                tolerance=self.tolerance,
                options=self.options,
            )
        except NotSolvedError as error:
            self.reasons.append(str(error))
            return None
        self.points += peak.points
        place = _place(model, peak, start, self.options.probe)
        self.places.append(place)
        return place


def history_interval(
    model: ReducedModel, peak: Peak, *, tolerance: float = 1e-4, options: Options = DEFAULTS
) -> HistoryInterval:
    """The interval of a resonance over all loading histories.

    Args:
        peak: of this model (`find_peak`); its harmonics and samples are kept.
        tolerance: of the height, relative.
    """
    start = model.elements.traction if model.start is None else model.start
    here = _place(model, peak, np.array(start, dtype=float), options.probe)
    search = _Search(model, tolerance, options, [here], 0, [])
    if model.directions == model.elements.tangents or not model.coupled:
        # a prescribed normal load or fixed mean displacements: nothing acts back
        return _interval(search, here, True)
    for pattern in _extreme_loads(model, peak):
        search.solve(pattern, peak)
    ended = [_climb(search, sign) for sign in (-1.0, 1.0)]
    return _interval(search, here, all(ended))


def _place(model: ReducedModel, peak: Peak, start: np.ndarray, probe: int) -> _Place:
    """With the start put to where the friction forces of the sticking nodes have come to."""
    free = tractions(model, peak.solution, probe)
    start = start.copy()
    start[free.nodes] = free.start
    return _Place(peak, start, free)


def _extreme_loads(model: ReducedModel, peak: Peak) -> Sequence[np.ndarray]:
    """Two starts (n, tangents): friction that unloads the seats most, and that loads them most.

    They are needed where everything sticks, since the derivative of the response vanishes there
    although another history may let nodes slip. The derivative of the total normal force by the
    start is that of full stick.
    """
    elements = model.elements
    first = model.directions - elements.tangents
    linear = condense(model, peak.omega, 1)
    normal = np.zeros(model.springs.shape)
    normal[:, 0] = elements.kn
    by_start = -(linear.A[0].real.T @ normal.ravel()).reshape(normal.shape)[:, first:]
    length = np.linalg.norm(by_start, axis=1, keepdims=True)
    if not length.max() > 0:
        return []
    along = np.divide(by_start, length, out=np.zeros_like(by_start), where=length > 0)
    limit = BEYOND * elements.mu * np.maximum(elements.n0, 0.0)
    return [sign * limit[:, None] * along for sign in (-1.0, 1.0)]


def _climb(search: _Search, sign: float) -> bool:
    """Move from the best place towards lower (-1) or higher (1) resonances; whether the end was
    reached.
    """
    place = max(search.places, key=lambda one: sign * one.peak.height)
    for _ in range(MOVES):
        free = place.free
        gradient = sign * free.gradient
        move = farthest(free, gradient) - free.mean
        promised = float(np.sum(gradient * move))
        if promised < search.tolerance * place.peak.height:
            return True
        better = _gaining(search, place, move, sign)
        if better is None:
            return False
        place = better
    return False


def _gaining(search: _Search, place: _Place, move: np.ndarray, sign: float) -> _Place | None:
    """The first of the shorter and shorter moves that gains."""
    share = 1.0
    for _ in range(1 + HALVINGS):
        start = place.start.copy()
        start[place.free.nodes] += share * move
        reached = search.solve(start, place.peak)
        if reached is not None and sign * (reached.peak.height - place.peak.height) > 0:
            return reached
        share /= 2
    return None


def _interval(search: _Search, here: _Place, ended: bool) -> HistoryInterval:
    lowest = min(search.places, key=lambda one: one.peak.height)
    highest = max(search.places, key=lambda one: one.peak.height)
    spread = highest.peak.height - lowest.peak.height
    if ended and spread < search.tolerance * highest.peak.height:
        certificate = POINT
    elif ended and not search.reasons and _monotone(search, lowest, highest):
        certificate = MONOTONE
    else:
        certificate = SAMPLED
    return HistoryInterval(
        lowest.peak,
        highest.peak,
        lowest.start,
        highest.start,
        certificate,
        len(here.free.nodes),
        search.points,
        "; ".join(dict.fromkeys(search.reasons)),
    )


def _monotone(search: _Search, lowest: _Place, highest: _Place) -> bool:
    """No node whose derivative points back, at any state solved, on its way from the lowest to the
    highest state.
    """
    way = highest.start - lowest.start
    back = [
        np.minimum(np.sum(place.free.gradient * way[place.free.nodes], axis=1), 0.0).sum()
        for place in search.places
    ]
    return min(back) >= -search.tolerance * highest.peak.height
