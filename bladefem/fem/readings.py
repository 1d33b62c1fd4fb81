"""Readings of a body along the modes of a part of it that is held at its root."""

from __future__ import annotations

import numpy as np

from .body import Body
from .gyroscopic import own_rows
from .linalg import apply_block


def modal_readings(
    body: Body,
    shapes: np.ndarray,
    omega: np.ndarray,
) -> np.ndarray:
    """(n_points*dim, m) columns K phi / omega^2 in mesh numbering, the same on every rank.

    They read the strain of each mode: K phi is M phi omega^2 on the part and the reactions at its
    root, so that a rigid motion of root and part together reads zero. M phi alone would count it.

    Args:
        shapes: (m, n_points, 2 or 3) mass-normalised fields on the nodes of the body's mesh, zero
            at the root and below.
        omega: (m,) circular frequencies of the held part [rad/s].
    """
    own = apply_block(body.K, own_rows(body, shapes)) / omega**2
    rows = body.scalar_rows
    order = np.argsort(rows, kind="stable")[np.count_nonzero(rows < 0) :]
    found = np.zeros((len(rows), len(shapes)))
    found[order] = np.concatenate(body.comm.allgather(own))
    return found
