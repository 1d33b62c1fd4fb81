"""What friction may do to the load of the seats: bounds over all friction forces that equilibrium
and Coulomb's limit admit, whatever the history.

Every node carries a force within its friction cone (a pyramid of FRICTION_CONE_EDGES edges, which
lies inside); the bounds of the mean normal load for a given pull are linear programmes. A wedge of
half angle a gives F / (2 (sin a + mu cos a)) to F / (2 (sin a - mu cos a)).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from ..errors import NotSolvedError

FRICTION_CONE_EDGES = 16
# of a damper
SEATS = 2
# share of the forces' sum that may stay unbalanced in seats that jam
UNBALANCED_FORCE_SHARE = 1e-9


def normal_load_bounds(
    rigid: np.ndarray,
    load: np.ndarray,
    mu: np.ndarray,
) -> tuple[float, float]:
    """Lowest and highest mean normal load of a seat [N] under a load on the damper; the highest is
    infinite where the seats can jam.

    Args:
        rigid: (m, d) motions of the ports, node-major (normal, tangents), by unit rigid motions.
        load: (d,) on these motions [N].
        mu: (n,) friction coefficient.

    Raises:
        NotSolvedError: no admissible forces balance the load.
    """
    balance = _cone_edges(rigid, mu)
    size = float(np.abs(load).max())
    bounds = []
    for sign in (1.0, -1.0):
        found = linprog(
            sign * np.ones(balance.shape[1]), A_eq=balance, b_eq=-load / size, method="highs"
        )
        if found.status == 3:
            bounds.append(np.inf)
        elif found.status == 0:
            bounds.append(sign * found.fun * size / SEATS)
        else:
            raise NotSolvedError(
                f"no pressing forces with friction balance the load on the damper: {found.message}"
            )
    return bounds[0], bounds[1]


def holds_itself(rigid: np.ndarray, mu: np.ndarray) -> bool:
    """Whether friction alone can hold the damper between its seats, without any load."""
    balance = _cone_edges(rigid, mu)
    balance = balance / np.abs(balance).max(axis=1, keepdims=True)
    ones = np.ones((1, balance.shape[1]))
    rows = np.vstack([balance, ones])
    wanted = np.r_[np.zeros(len(balance)), 1.0]
    found = linprog(np.zeros(balance.shape[1]), A_eq=rows, b_eq=wanted, method="highs")
    return (
        found.status == 0 and float(np.abs(rows @ found.x - wanted).max()) < UNBALANCED_FORCE_SHARE
    )


def _cone_edges(rigid: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """(d, columns) what a unit normal force along each edge of each friction cone adds to the
    balance.
    """
    n = len(mu)
    ports = rigid.reshape(n, -1, rigid.shape[1])
    if ports.shape[1] == 2:
        directions = np.array([[1.0], [-1.0]])
    else:
        angle = 2 * np.pi * np.arange(FRICTION_CONE_EDGES) / FRICTION_CONE_EDGES
        directions = np.column_stack([np.cos(angle), np.sin(angle)])
    friction = mu[:, None, None] * np.einsum("et,ntd->ned", directions, ports[:, 1:])
    return (ports[:, None, 0] + friction).reshape(-1, rigid.shape[1]).T
