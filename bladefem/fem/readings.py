"""Readings of a body along its modes: the coordinate of a mass-normalised shape is phi^T M u."""

from __future__ import annotations

import numpy as np

from .body import Body
from .gyroscopic import own_rows
from .linalg import apply

__all__ = ["modal_readings"]


def modal_readings(body: Body, shapes: np.ndarray) -> np.ndarray:
    """(n_points*dim, m) columns M phi in mesh numbering, the same on every rank.

    Args:
        shapes: (m, n_points, 2 or 3) mass-normalised fields on the nodes of the body's mesh.
    """
    own = apply(body.M, own_rows(body, shapes))
    rows = body.scalar_rows
    order = np.argsort(rows, kind="stable")[np.count_nonzero(rows < 0) :]
    found = np.zeros((len(rows), len(shapes)))
    found[order] = np.concatenate(body.comm.allgather(own))
    return found
