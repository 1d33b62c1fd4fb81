"""The highest motion of a curve that lasts, with few verdicts: bisection along each piece of the
curve, between motions known to be unstable and lower ones.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ...hbm.stability import STABLE, UNIQUE, UNSTABLE
from ...util.arrays import IntegerArray, RealArray


def highest_lasting(heights: RealArray, verdicts: np.ndarray) -> int | None:
    """Number of the highest motion that was judged and is not unstable; None without one.

    Args:
        heights: (points,) [m]; 0 where no motion was found.
        verdicts: (points,) of `bladefem.hbm.stability`.
    """
    lasting = np.flatnonzero(np.isin(verdicts, (STABLE, UNIQUE)) & (heights > 0))
    return int(lasting[heights[lasting].argmax()]) if len(lasting) else None


def next_to_judge(
    heights: RealArray,
    branch: IntegerArray,
    verdicts: np.ndarray,
    judged: Collection[int],
    least: float = 0.0,
) -> int | None:
    """Number of the motion whose verdict tells most of where the highest one lies that lasts; None
    where no motion that may be it is left.

    Motions between two unstable ones of a piece of the curve are taken to be unstable as well.

    Args:
        heights: (points,) [m]; 0 where no motion was found.
        branch: (points,) piece of the curve; points of a piece are in the order of the curve.
        verdicts: (points,) of `bladefem.hbm.stability`.
        judged: numbers of points that have a verdict, "unknown" where none could be had.
        least: amplitude up to which no motion is of interest [m].
    """
    lasting = highest_lasting(heights, verdicts)
    if lasting is not None:
        least = max(least, float(heights[lasting]))
    runs: list[list[int]] = []
    for number in np.unique(branch):
        piece = np.flatnonzero((branch == number) & (heights > 0))
        runs += _open_runs(piece, heights > least, verdicts == UNSTABLE, judged)
    if not runs:
        return None
    highest = max(runs, key=lambda run: heights[run].max())
    beside = [i for i in (highest[0] - 1, highest[-1] + 1) if 0 <= i < len(verdicts)]
    if any(verdicts[i] == UNSTABLE and branch[i] == branch[highest[0]] for i in beside):
        return highest[len(highest) // 2]
    return max(highest, key=lambda i: float(heights[i]))


def _open_runs(
    piece: IntegerArray,
    high: np.ndarray,
    unstable: np.ndarray,
    judged: Collection[int],
) -> list[list[int]]:
    """Motions next to each other that were not judged, are high enough and do not lie between two
    unstable ones.

    Args:
        piece: numbers of the points of one piece, in order.
        high, unstable: (points,) bool.
    """
    runs: list[list[int]] = []
    run: list[int] = []
    before = False
    for i in [*piece.tolist(), -1]:
        if i in judged or i < 0:
            after = i >= 0 and bool(unstable[i])
            if not (before and after):
                runs.append([k for k in run if high[k]])
            run, before = [], after
        else:
            run.append(i)
    return [run for run in runs if run]
