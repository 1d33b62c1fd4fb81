"""A friction law of one's own: what it has to say.

Without a law of their own elements follow Coulomb's, for which there are compiled kernels; see
`bladefem.friction.law_table`. Any other rate-independent law is an object with the method `step`,
see `FrictionLaw`; `bladefem.friction.periodic_law` finds its periodic state, and every path of the
balance, its derivatives and the sweeps then use it. `docs/extending.md` shows Dahl's and Bouc and
Wen's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from bladefem.data import Elements

# Step of the differences over the size of the variable: rounding leaves 1e-10 of the derivative,
# and an increment that is shorter than the step, where laws have a kink, 1e-6.
DIFFERENCE_STEP = 1e-6


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the new state (n, s) of a step."""

    # (n, s, s) with the state before
    state: np.ndarray
    # (n, s, t) with the increment of the displacement [1/m times the state]
    increment: np.ndarray
    # (n, s) with the normal load before [1/N times the state]
    before: np.ndarray
    # (n, s) with the normal load now [1/N times the state]
    load: np.ndarray


class FrictionLaw:
    """A rate-independent law for n nodes of t tangents; inherit from it and write `step`.

    The state of a node is s numbers, by default its tangential force [N], and starts from zero.
    Where the contact is open the state is zero and `step` is not called; in a step in which it
    closes, the increment is the part after the contact and the load before is zero.
    """

    # s; None: as many as tangents
    variables: int | None = None

    def step(
        self,
        state: np.ndarray,
        increment: np.ndarray,
        before: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """The state (n, s) after a straight increment (n, t) [m] under loads (n,) before and now
        [N].

        Args:
            elements: the n elements of this law, with kt, mu, n0 as parameters.
        """
        raise NotImplementedError(f"{type(self).__name__}: expected a method step")

    def force(
        self,
        state: np.ndarray,
        motion: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """(n, t) tangential force [N] in a state at the displacement (n, t) [m] and load (n,)
        [N].
        """
        return state[:, : motion.shape[1]]

    def slopes(
        self,
        state: np.ndarray,
        increment: np.ndarray,
        before: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> Slopes | None:
        """Derivatives of `step`; None: they are found by differences."""
        return None

    def slipping(
        self,
        old: np.ndarray,
        state: np.ndarray,
        increment: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """(n,) True where the step from the old state slipped; a law without a stick state always
        does.
        """
        return np.ones(len(state), dtype=bool)


@dataclass(frozen=True)
class NodeLaw(FrictionLaw):
    """A law from a function of one node, plain or compiled by numba.njit.

    The function is called as function(state, increment, before, load, kt, mu, new) with arrays (s,)
    and (t,), and fills new (s,). The derivative, where given, is called likewise and fills
    (s, s + t + 2): by state, increment, load before, load now.
    """

    function: Callable[..., None]
    derivative: Callable[..., None] | None = None
    variables: int | None = None

    def step(
        self,
        state: np.ndarray,
        increment: np.ndarray,
        before: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """The function, node after node."""
        new = np.empty_like(state)
        loop = _loop_of(self.function)
        loop(self.function, state, increment, before, load, elements.kt, elements.mu, new)
        return new

    def slopes(
        self,
        state: np.ndarray,
        increment: np.ndarray,
        before: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> Slopes | None:
        """The derivative, node after node."""
        if self.derivative is None:
            return None
        n, s = state.shape
        t = increment.shape[1]
        out = np.zeros((n, s, s + t + 2))
        loop = _loop_of(self.derivative)
        loop(self.derivative, state, increment, before, load, elements.kt, elements.mu, out)
        return Slopes(out[:, :, :s], out[:, :, s : s + t], out[:, :, s + t], out[:, :, s + t + 1])


def _each_node(function, state, increment, before, load, kt, mu, out):
    """Call the function of one node for all of them."""
    for i in range(state.shape[0]):
        function(state[i], increment[i], before[i], load[i], kt[i], mu[i], out[i])


_each_node_compiled = njit(_each_node)


def _loop_of(function: Callable[..., None]) -> Callable[..., None]:
    """The loop over nodes, compiled where the function is."""
    return _each_node_compiled if hasattr(function, "py_func") else _each_node


def slopes_of(
    law: FrictionLaw,
    state: np.ndarray,
    increment: np.ndarray,
    before: np.ndarray,
    load: np.ndarray,
    elements: Elements,
    sizes: np.ndarray,
) -> Slopes:
    """The law's own derivatives, else central differences.

    Args:
        sizes: (n,) displacement [m] that the law resolves; states and loads follow from it and the
            stiffness.
    """
    own = law.slopes(state, increment, before, load, elements)
    if own is not None:
        return own
    s = state.shape[1]
    t = increment.shape[1]
    move = DIFFERENCE_STEP * sizes
    push = DIFFERENCE_STEP * np.maximum(abs(state).max(axis=1), elements.kt * sizes)
    args = (state, increment, before, load)

    def change(
        which: int,
        column: int | None,
        step: np.ndarray,
    ) -> np.ndarray:
        """(n, s) derivative with one column of an argument."""
        ends = []
        for sign in (1.0, -1.0):
            moved = [x.copy() for x in args]
            part = moved[which] if column is None else moved[which][:, column]
            part += sign * step
            ends.append(law.step(moved[0], moved[1], moved[2], moved[3], elements))
        return (ends[0] - ends[1]) / (2 * np.where(step > 0, step, 1.0))[:, None]

    by_state = np.stack([change(0, c, push) for c in range(s)], axis=2)
    by_increment = np.stack([change(1, c, move) for c in range(t)], axis=2)
    return Slopes(
        by_state,
        by_increment,
        change(2, None, DIFFERENCE_STEP * before),
        change(3, None, DIFFERENCE_STEP * load),
    )
