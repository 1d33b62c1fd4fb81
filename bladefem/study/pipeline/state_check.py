"""The paper's table of quasi-static contact states against the direct solve: is the table enough
for this scene?
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ...contact.seating import ContactProblem, solve_seating
from ...contact.state_table import interpolate_states, state_table
from ...errors import NotSolvedError
from ...scene.tables import Scene
from ...scene.units import newton_range
from ...util.percent import percent

# of each axis
STATES_PER_AXIS = 5
# of the largest nodal force
SUFFICIENT_ACCURACY = 0.01
# of the largest turn of a seat, below which a turn counts as none
NEGLIGIBLE_ROTATION_SHARE = 1e-6
# of the largest nodal force, below which an interpolation is off by rounding alone
ROUNDING = 1e-8


@dataclass(frozen=True)
class StateCheck:
    """Interpolated against directly solved contact forces in the middle of the table's cells."""

    # solved for the table
    states: int
    # largest, over the largest nodal force [1]
    error: float
    # largest that the table estimates of itself [1]
    indicator: float
    # time of a direct solve [s]
    direct: float

    @property
    def enough(self) -> bool:
        """The table may take the place of direct solves."""
        return max(self.error, self.indicator) <= SUFFICIENT_ACCURACY


def check_states(
    scene: Scene,
    problem: ContactProblem,
    loads: Sequence[float],
    travel: float,
) -> StateCheck:
    """Table over the normal load and a tilt of the platforms, for the paper's load and relative
    position.

    Args:
        loads: smallest and largest make the first axis [N].
        travel: approach at the ends of a seat [m]; the second axis runs from minus to plus this.

    Raises:
        NotSolvedError: a state has no solution.
    """
    tilt = platform_tilt(problem)

    def direct(load: float, approach: float) -> np.ndarray:
        maps = solve_seating(
            problem,
            scene.operation.speed,
            normal=load,
            approach=approach * tilt,
            bedded=scene.contact.bedded,
        )
        return np.concatenate([m.force for m in maps])

    low = min(loads)
    high = max(loads)
    axes = [
        np.linspace(low, high if high > low else 2 * low, STATES_PER_AXIS),
        np.linspace(-travel, travel, STATES_PER_AXIS),
    ]
    table = state_table(direct, axes)
    error = 0.0
    indicator = 0.0
    middles = list(product(*[(a[1:] + a[:-1]) / 2 for a in axes]))
    exact = []
    begin = time.perf_counter()
    for middle in middles:
        exact.append(direct(*middle))
    spent = (time.perf_counter() - begin) / len(middles)
    largest = float(np.abs(table.force).max())
    for middle, force in zip(middles, exact, strict=True):
        found, estimated = interpolate_states(table, middle)
        error = max(error, float(np.abs(found - force).max()) / largest)
        indicator = max(indicator, estimated)
    return StateCheck(table.force[..., 0].size, error, indicator, spent)


def platform_tilt(problem: ContactProblem) -> np.ndarray:
    """(n,) approach of a platform that turns about the engine axis: -1 to 1 on the first seat, none
    on the others.

    Taken from the ports' own rigid motions: means over what a port stands for, not values at its
    node, and linear in place. Both seats turned alike would be followed by the floating damper,
    which changes no pressure. A seat that faces the engine axis turns about the axis that moves it
    most; one without extent has no tilt.
    """
    own = len(problem.patches[0].area)
    turns = problem.rigid[:, -1 if problem.rigid.shape[1] < 6 else -3 :]
    spread = np.ptp(turns[:own], axis=0)
    axis = -1 if spread[-1] > NEGLIGIBLE_ROTATION_SHARE * spread.max() else int(np.argmax(spread))
    tilt = np.zeros(len(turns))
    moved = turns[:own, axis]
    if spread[axis] > 0:
        tilt[:own] = (2 * moved - moved.max() - moved.min()) / spread[axis]
    return tilt


def state_sentence(
    scene: Scene,
    problem: ContactProblem,
    loads: Sequence[float],
    travel: float,
) -> str:
    """For the report."""
    try:
        check = check_states(scene, problem, loads, travel)
    except NotSolvedError as error:
        return f"a table of contact states could not be made: {error}"
    verdict = "is enough" if check.enough else "is NOT enough"
    return (
        f"a table of {check.states} contact states over "
        f"{newton_range(min(loads), max(loads))} and ±{1e6 * travel:.3g} µm of tilt at the seats' "
        f"ends {verdict}: interpolation misses nodal forces by {_share(check.error)} of the "
        f"largest (estimated: {_share(check.indicator)}); the direct solve, used here, takes "
        f"{1e3 * check.direct:.2g} ms a state"
    )


def _share(error: float) -> str:
    """An error in words: what lies below ROUNDING has too many zeros to be read."""
    return f"up to {percent(error)}" if error > ROUNDING else "less than 0.000001 %"
