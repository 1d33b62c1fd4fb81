"""Which motions a slow sweep visits where a response has several pieces between folds.

At the end of a piece the motion jumps to the nearest one that leads further; a jump may in truth
end elsewhere, which only a march in time shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

UP = "up"
DOWN = "down"
ISOLATED = "isolated"

# number of a piece and the frequency at which the sweep comes onto it
Visit = tuple[int, float]


def visited_pieces(
    frequencies: Sequence[np.ndarray],
    first: int | None,
    way: str,
    distance: Callable[[int, int, int, int], float],
) -> list[Visit]:
    """Pieces in the order of the sweep, each with the frequency at which it is entered.

    Args:
        frequencies: of the points of each piece, in any unit and order.
        first: piece at which the sweep begins; nothing is visited without one.
        way: UP or DOWN.
        distance: of the motions at (piece, point) and (other piece, its point).
    """
    if first is None:
        return []
    sign = 1.0 if way == UP else -1.0
    begin = [int(np.argmin(sign * piece)) for piece in frequencies]
    last = [int(np.argmax(sign * piece)) for piece in frequencies]
    visited = [(first, float(frequencies[first][begin[first]]))]
    while len(visited) <= len(frequencies):
        here = visited[-1][0]
        at = float(frequencies[here][last[here]])
        onward = {
            n: int(np.abs(piece - at).argmin())
            for n, piece in enumerate(frequencies)
            if sign * piece[last[n]] > sign * at + 1e-9 * at and sign * piece[begin[n]] <= sign * at
        }
        if not onward:
            break
        nearest = min(onward, key=lambda n: distance(n, onward[n], here, last[here]))
        visited.append((nearest, at))
    return visited


def reached_by(
    visited: Mapping[str, Sequence[Visit]],
    piece: int,
    frequency: float,
) -> str:
    """ "up and down", "up" or "down": the sweeps that come to a motion of a piece; or ISOLATED.

    Args:
        visited: UP and DOWN to what these sweeps visit.
    """
    ways = [
        way
        for way, visits in visited.items()
        for number, entry in visits
        if number == piece and (frequency - entry) * (1 if way == UP else -1) >= 0
    ]
    return " and ".join(dict.fromkeys(ways)) or ISOLATED
