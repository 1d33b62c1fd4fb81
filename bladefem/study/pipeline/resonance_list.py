"""Every local maximum of a response: its height, the motions at its frequency, and by which slow
sweep it is reached.

A curve keeps its points in ascending frequency with the number of their piece between folds; the
paths are put together again from the ends of the pieces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...hbm.slow_sweep import DOWN, ISOLATED, UP, Visit, reached_by, visited_pieces
from ..stability.lower_motion import OTHER_MOTION
from .curve import Curve

# distance of the first harmonics of two ends over the largest one, up to which pieces are joined
MAX_JOINED_DISTANCE = 0.2
# distance of a motion from the line through another piece, over its own size, up to which it lies
# on that: the climb to a peak leaves points beside the path that was followed
SAME_MOTION = 0.05
# relative difference of two heights that are the same
SAME_HEIGHT = 1e-6
# relative difference of two frequencies that are the same
SAME_FREQUENCY = 1e-9


@dataclass(frozen=True)
class LocalResonance:
    """A local maximum along a path of motions, or the highest of motions that no path leads to."""

    # [Hz]
    frequency: float
    # root of the sum of squares of the harmonics at the probe [m]
    amplitude: float
    # verdict, or "" where it was not asked for
    stability: str
    # of an unstable motion, else ""
    bifurcation: str
    # motions found at this frequency
    motions: int
    # "up and down", "up", "down": by a slow sweep in that direction; "isolated": by neither; or how
    # a motion is reached that is none of the balance's
    reached: str


@dataclass(frozen=True)
class _Piece:
    """Points between two folds, by ascending frequency."""

    number: int
    # of the points in the curve
    rows: np.ndarray
    frequency: np.ndarray
    first: np.ndarray

    def end(self, high: bool) -> int:
        """Place of one end among its points."""
        return len(self.rows) - 1 if high else 0


def local_resonances(curve: Curve) -> list[LocalResonance]:
    """The local maxima of a curve by falling height, and the highest motion of each path apart from
    the others that no slow sweep visits, where that is at an end of it: single motions, and loops
    that were begun at the top.
    """
    pieces = _pieces_of(curve)
    visited = _swept(pieces)
    places = {piece.number: place for place, piece in enumerate(pieces)}
    found = []
    for path in _paths_of(pieces):
        rows = np.concatenate([piece.rows[order] for piece, order in path])
        owners = np.concatenate([np.full(len(order), piece.number) for piece, order in path])
        heights = curve.amplitude[rows]
        tops = [i for i in range(1, len(rows) - 1) if heights[i - 1] < heights[i] >= heights[i + 1]]
        highest = int(np.argmax(heights))
        if highest not in tops and _is_apart(pieces, path, visited, places):
            tops.append(highest)
        for i in tops:
            row = rows[i]
            frequency = float(curve.frequency[row])
            found.append(
                LocalResonance(
                    frequency,
                    float(heights[i]),
                    str(curve.stability[row]),
                    str(curve.bifurcation[row]),
                    _crossing(curve, pieces, frequency),
                    reached_by(visited, places[int(owners[i])], frequency),
                )
            )
    return sorted(found, key=lambda resonance: -resonance.amplitude)


def _is_apart(
    pieces: Sequence[_Piece],
    path: Sequence[tuple[_Piece, np.ndarray]],
    visited: Mapping[str, Sequence[Visit]],
    places: Mapping[int, int],
) -> bool:
    """No slow sweep visits a path, and its motions do not lie on another one."""
    own = {piece.number for piece, _ in path}
    swept = {place for visits in visited.values() for place, _ in visits}
    if any(places[number] in swept for number in own):
        return False
    others = [piece for piece in pieces if piece.number not in own]
    return not any(_lies_on(one, other) for one, _ in path for other in others)


def _lies_on(one: _Piece, other: _Piece) -> bool:
    """All motions of a piece lie on the line through those of another."""
    inside = (other.frequency[0] <= one.frequency) & (one.frequency <= other.frequency[-1])
    if not inside.all():
        return False
    line = np.interp(one.frequency, other.frequency, other.first)
    return bool((abs(one.first - line) <= SAME_MOTION * abs(one.first)).all())


def motions_at(curve: Curve, frequency: float) -> int:
    """Motions found at a frequency [Hz]."""
    return _crossing(curve, _pieces_of(curve), frequency)


def _crossing(curve: Curve, pieces: Sequence[_Piece], frequency: float) -> int:
    """Motions of the pieces at a frequency, and the lower one of the resonance if none is that."""
    there = [p for p in pieces if p.frequency[0] <= frequency <= p.frequency[-1]]
    if curve.lower is None or not np.isclose(frequency, curve.peak_frequency, SAME_FREQUENCY, 0):
        return len(there)
    heights = [np.interp(frequency, p.frequency, abs(p.first)) for p in there]
    known = min(heights, default=np.inf) <= OTHER_MOTION * curve.peak_amplitude
    return len(there) + (not known)


def reach_of_resonance(curve: Curve) -> tuple[str, str]:
    """Which slow sweep alone reaches the resonance that is given, UP, DOWN or ISOLATED (neither),
    and what the others keep to, in words; "" where all come to it, and where marches have found it.
    """
    if curve.resonance_by_march is not None:
        return "", ""
    listed = local_resonances(curve)
    given = [r for r in listed if abs(r.amplitude / curve.balance_amplitude - 1) < SAME_HEIGHT]
    if not given or given[0].reached == f"{UP} and {DOWN}":
        return "", ""
    reached = given[0].reached
    other = [r.amplitude for r in listed if reached != r.reached and r.reached != ISOLATED]
    return reached, f"{1e6 * max(other):.4g} um and less" if other else "lower motions"


def _pieces_of(curve: Curve) -> list[_Piece]:
    pieces = []
    for number in np.unique(curve.branch[curve.converged]):
        rows = np.flatnonzero(curve.converged & (curve.branch == number))
        rows = rows[np.argsort(curve.frequency[rows], kind="stable")]
        pieces.append(_Piece(int(number), rows, curve.frequency[rows], curve.first[rows]))
    return pieces


def _paths_of(pieces: Sequence[_Piece]) -> list[list[tuple[_Piece, np.ndarray]]]:
    """Pieces in the order along their paths, each with the order of its points."""
    paths: list[list[tuple[_Piece, np.ndarray]]] = []
    # the end by which the last piece is left; None where either is open
    left_high: bool | None = None
    for piece in pieces:
        order = np.arange(len(piece.rows))
        joint = None
        if paths and paths[-1][-1][0].number == piece.number - 1:
            joint = _joint(paths[-1][-1][0], piece, left_high)
        if joint is None:
            paths.append([(piece, order)])
            left_high = None
            continue
        if left_high is None:
            before, along = paths[-1][-1]
            paths[-1][-1] = (before, along if joint else along[::-1])
        paths[-1].append((piece, order[::-1] if joint else order))
        left_high = not joint
    return paths


def _joint(
    before: _Piece,
    piece: _Piece,
    left_high: bool | None,
) -> bool | None:
    """Whether two pieces meet at their high ends (True) or at their low ones; None: at neither."""
    sides = (True, False) if left_high is None else (left_high,)
    size = max(np.abs(before.first).max(), np.abs(piece.first).max())
    away = {
        side: abs(before.first[before.end(side)] - piece.first[piece.end(side)]) for side in sides
    }
    nearest = min(away, key=lambda side: away[side])
    return nearest if away[nearest] <= MAX_JOINED_DISTANCE * size else None


def _swept(pieces: Sequence[_Piece]) -> dict[str, list[Visit]]:
    """What slow sweeps from both ends of the band visit, by place in the list of pieces."""
    if not pieces:
        return {}
    frequencies = [piece.frequency for piece in pieces]
    starts = {
        UP: min(range(len(pieces)), key=lambda n: frequencies[n][0]),
        DOWN: max(range(len(pieces)), key=lambda n: frequencies[n][-1]),
    }

    def apart(n: int, i: int, other: int, j: int) -> float:
        return float(abs(pieces[n].first[i] - pieces[other].first[j]))

    return {way: visited_pieces(frequencies, start, way, apart) for way, start in starts.items()}
