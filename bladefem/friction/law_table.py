"""The table of friction laws, and which element follows which of them.

`Elements.law` is a name of the table, an object of one's own made from `FrictionLaw`, or a tuple
with one of these a node; None is Coulomb's law, for which there are compiled kernels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bladefem.data import Elements
from bladefem.errors import InputError, suggestion
from bladefem.friction.law import FrictionLaw


class Dahl(FrictionLaw):
    """df/dw = kt (1 - f sign(dw) / (mu N)), exact along a straight increment (Dahl 1976,
    doi:10.2514/3.61511).
    """

    def step(
        self,
        state: np.ndarray,
        increment: np.ndarray,
        before: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """The force (n, t) after the increment, direction by direction [N]."""
        limit = (elements.mu * load)[:, None]
        way = np.sign(increment)
        fade = np.exp(-elements.kt[:, None] * abs(increment) / limit)
        return way * limit + (state - way * limit) * fade


@dataclass(frozen=True)
class BoucWen(FrictionLaw):
    """f = elastic kt w + (1 - elastic) z,  dz/dw = kt (1 - |z / (mu N)|^n (1 + sign(z dw)) / 2), by
    one step of Runge and Kutta's method an increment (Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249).
    """

    # share of the stiffness that stays in slip [1]
    elastic: float = 0.1
    # n, sharpness of the transition to slip [1]
    exponent: float = 2.0

    def step(
        self,
        state: np.ndarray,
        increment: np.ndarray,
        before: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """z (n, t) after the increment [N]."""
        stiffness = elements.kt[:, None]
        limit = (elements.mu * load)[:, None]
        way = np.sign(increment)

        def slope(z: np.ndarray) -> np.ndarray:
            share = abs(z / limit) ** self.exponent
            return stiffness * (1 - share * (1 + np.sign(z * way)) / 2)

        first = slope(state)
        second = slope(state + increment / 2 * first)
        third = slope(state + increment / 2 * second)
        last = slope(state + increment * third)
        return state + increment / 6 * (first + 2 * second + 2 * third + last)

    def force(
        self,
        state: np.ndarray,
        motion: np.ndarray,
        load: np.ndarray,
        elements: Elements,
    ) -> np.ndarray:
        """(n, t) [N]."""
        spring = elements.kt[:, None] * motion
        return self.elastic * spring + (1 - self.elastic) * state


# names to laws; a law that is added here is known everywhere
LAWS: dict[str, FrictionLaw | None] = {
    "coulomb": None,
    "dahl": Dahl(),
    "bouc-wen": BoucWen(),
}


def laws_of_nodes(elements: Elements) -> tuple[FrictionLaw | None, ...]:
    """(n,) the law of each node; None is Coulomb's.

    Raises:
        InputError: as many laws as nodes are expected, each an object with the method step.
    """
    law: Any = elements.law
    n = len(elements.kt)
    given = tuple(law) if isinstance(law, tuple | list) else (law,) * n
    laws = tuple(_named_law(one) if isinstance(one, str) else one for one in given)
    if len(laws) != n:
        raise InputError(f"elements.law: {len(laws)} laws for {n} elements, expected one a node")
    for one in laws:
        if one is not None and not (
            callable(getattr(one, "step", None)) and not isinstance(one, type)
        ):
            raise InputError(
                f"elements.law: {one!r}, expected an object made from FrictionLaw, or None for "
                "Coulomb's law"
            )
    return laws


def _named_law(name: str) -> FrictionLaw | None:
    """The law of this name in the table."""
    if name not in LAWS:
        raise InputError(
            f"elements.law {name!r}: expected one of {', '.join(LAWS)}, or an object made from "
            f"FrictionLaw{suggestion(name, LAWS)}"
        )
    return LAWS[name]


def groups_by_law(elements: Elements) -> list[tuple[FrictionLaw | None, np.ndarray]]:
    """Each law with the numbers of its nodes."""
    if elements.law is None:
        return [(None, np.arange(len(elements.kt)))]
    laws = laws_of_nodes(elements)
    different = {id(law): law for law in laws}
    return [
        (law, np.array([i for i, other in enumerate(laws) if other is law]))
        for law in different.values()
    ]


def forgets_position(elements: Elements) -> bool:
    """True if no force depends on the position, but on increments alone: such contacts can walk."""
    laws = (law for law, _ in groups_by_law(elements))
    return all(law is None or type(law).force is FrictionLaw.force for law in laws)


def select_elements(elements: Elements, rows: np.ndarray) -> Elements:
    """Some of the elements, or some of them more than once."""
    law = elements.law
    if isinstance(law, tuple | list):
        law = tuple(law[i] for i in rows)
    parts = {name: np.asarray(getattr(elements, name))[rows] for name in ("kt", "kn", "mu", "n0")}
    t0 = None if elements.t0 is None else np.asarray(elements.t0)[rows]
    return replace(elements, **parts, law=law, t0=t0)


def merged_laws(elements: Elements, groups: np.ndarray) -> Any:
    """The law of elements that are joined in groups (n,) numbered 0 .. m-1.

    Raises:
        InputError: nodes of different laws in one group.
    """
    if not isinstance(elements.law, tuple | list):
        return elements.law
    laws = laws_of_nodes(elements)
    merged = [laws[int(np.argmax(groups == group))] for group in range(int(groups.max()) + 1)]
    for node, group in enumerate(groups):
        if laws[node] is not merged[group]:
            raise InputError(
                f"elements.law: nodes of different laws in element {group}, expected one law for "
                "the nodes that are joined"
            )
    return tuple(merged)


def require_coulomb(elements: Elements, what: str) -> None:
    """Raise InputError, with what asks for it, where an element follows another law."""
    if elements.law is None:
        return
    others = [type(law).__name__ for law in laws_of_nodes(elements) if law is not None]
    if others:
        raise InputError(
            f"elements.law: {what} is written for Coulomb's law, {len(others)} elements follow "
            f"{', '.join(sorted(set(others)))}"
        )
