"""The lowest and the highest resonance that the loading history can leave: extremes over all
admissible friction forces of the nodes that never slip.

From a resonance the derivative by these forces (`traction_gradient`) shows where to push each node.
The march of the friction law returns a force beyond the friction limit to it, so that every state
that is solved is admissible, and both ends are attained; the next resonance is climbed from the
last one. Where pushing gains no more, a linear programme gives what the best admissible change
promises to first order (the conditional gradient method, Frank and Wolfe 1956, DOI
10.1002/nav.3800030109). Whether nothing lies beyond the ends is certified only where that is
nothing and the response is monotone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import NotSolvedError
from .linear.condensation import condense
from .linear.contact_flexibility import flexibility_of_mean
from .model import ReducedModel
from .peak import Peak, find_peak
from .solver.newton import DEFAULT_OPTIONS, Options
from .traction_gradient import Tractions, admissible_tractions, farthest_start

POINT = "point"
MONOTONE = "monotone"
SAMPLED = "sampled"
# moves towards one end
MAX_MOVES = 15
# longest and shortest push of a node, over its friction limit
LONGEST_PUSH = 2.0
SHORTEST_PUSH = 0.1
# derivative below which a node is pushed less, over the mean of all nodes
WEAK_DERIVATIVE = 0.1
# start of the extreme loads, over the friction limit
EXTREME_LOAD_RATIO = 1.5


@dataclass(frozen=True)
class HistoryInterval:
    """Range of one resonance over the loading histories."""

    lowest: Peak
    highest: Peak
    # (n, tangents) `ReducedModel.start` that leads to them [N]
    lowest_start: np.ndarray
    highest_start: np.ndarray
    # POINT: no admissible force changes the resonance; MONOTONE: at every state solved the response
    # grows with the force of each node on its way from the lowest to the highest state, and no
    # admissible change at these promises more to first order; SAMPLED: otherwise, the range of the
    # states solved
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
    free: Tractions


@dataclass
class _Search:
    """What does not change on the way, and what was solved."""

    model: ReducedModel
    tolerance: float
    most: int
    options: Options
    places: list[_Place]
    points: int
    reasons: list[str]

    def solve(
        self,
        start: np.ndarray,
        near: Peak,
    ) -> _Place | None:
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
        place = _Place(peak, admissible_tractions(model, peak.solution, self.options.probe))
        self.places.append(place)
        return place


def history_interval(
    model: ReducedModel,
    peak: Peak,
    *,
    tolerance: float = 1e-4,
    most: int = 150,
) -> HistoryInterval:
    """The interval of a resonance over all loading histories.

    Args:
        peak: of this model (`find_peak`); its harmonics and samples are kept.
        tolerance: of the height, relative.
        most: points of the balance after which no further move begins: the range is then sampled.
    """
    here = _Place(peak, admissible_tractions(model, peak.solution, DEFAULT_OPTIONS.probe))
    search = _Search(model, tolerance, most, DEFAULT_OPTIONS, [here], 0, [])
    if model.loads_prescribed or not model.coupled:
        # a prescribed normal load or fixed mean displacements: nothing acts back
        return _interval(search, here, True)
    for pattern in _extreme_loads(model, peak):
        search.solve(pattern, peak)
    # one end may not take the other's share
    ended = [_climb(search, sign, part) for sign, part in ((-1.0, most / 2), (1.0, most))]
    return _interval(search, here, all(ended))


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
    mean = flexibility_of_mean(linear.condensed.flex)
    by_start = -(mean.T @ normal.ravel()).reshape(normal.shape)[:, first:]
    length = np.linalg.norm(by_start, axis=1, keepdims=True)
    if not length.max() > 0:
        return []
    along = np.divide(by_start, length, out=np.zeros_like(by_start), where=length > 0)
    limit = EXTREME_LOAD_RATIO * elements.mu * np.maximum(elements.n0, 0.0)
    return [sign * limit[:, None] * along for sign in (-1.0, 1.0)]


def _climb(
    search: _Search,
    sign: float,
    most: float,
) -> bool:
    """Push from the best place towards lower (-1) or higher (1) resonances, until that gains less
    than the tolerance; whether no admissible change promises more.
    """
    place = max(search.places, key=lambda one: sign * one.peak.height)
    share = 1.0
    for _ in range(MAX_MOVES):
        if search.points >= most:
            return False
        better = None
        while better is None and share >= SHORTEST_PUSH:
            better = _gaining(search, place, share * _push(search.model, place, sign), sign)
            share = share / 2 if better is None else min(2 * share, LONGEST_PUSH)
        small = better is None or _gain(better, place, sign) < search.tolerance
        place = place if better is None else better
        if not small:
            continue
        gradient = sign * place.free.gradient[place.free.nodes]
        move = farthest_start(search.model, place.free, gradient)
        if float(np.sum(gradient * move)) < search.tolerance * place.peak.height:
            return True
        change = np.zeros_like(place.free.start)
        change[place.free.nodes] = move
        better = _gaining(search, place, change, sign)
        if better is None or _gain(better, place, sign) < search.tolerance:
            return False
        place = better
        share = 1.0
    return False


def _push(
    model: ReducedModel,
    place: _Place,
    sign: float,
) -> np.ndarray:
    """(n, tangents) the friction limit of each node along its derivative [N]."""
    elements = model.elements
    gradient = place.free.gradient
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    least = max(WEAK_DERIVATIVE * float(length.mean()), float(np.finfo(float).tiny))
    limit = elements.mu * np.maximum(elements.n0, 0.0)
    return sign * limit[:, None] * gradient / np.maximum(length, least)


def _gain(
    better: _Place,
    place: _Place,
    sign: float,
) -> float:
    """Relative gain of the height."""
    return sign * (better.peak.height / place.peak.height - 1)


def _gaining(
    search: _Search,
    place: _Place,
    change: np.ndarray,
    sign: float,
) -> _Place | None:
    """The place after a change of the start, if it gains."""
    reached = search.solve(place.free.start + change, place.peak)
    return reached if reached is not None and _gain(reached, place, sign) > 0 else None


def _interval(
    search: _Search,
    here: _Place,
    ended: bool,
) -> HistoryInterval:
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
        lowest.free.start,
        highest.free.start,
        certificate,
        len(here.free.nodes),
        search.points,
        "; ".join(dict.fromkeys(search.reasons)),
    )


def _monotone(
    search: _Search,
    lowest: _Place,
    highest: _Place,
) -> bool:
    """No node whose derivative points back, at any state solved, on its way from the lowest to the
    highest state.
    """
    way = highest.free.start - lowest.free.start
    back = []
    for place in search.places:
        nodes = place.free.nodes
        along = np.sum(place.free.gradient[nodes] * way[nodes], axis=1)
        back.append(float(np.minimum(along, 0.0).sum()))
    return min(back) >= -search.tolerance * highest.peak.height
