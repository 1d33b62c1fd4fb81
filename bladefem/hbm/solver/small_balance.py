"""A small balance of Coulomb elements as compiled loops take it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...friction.trigonometric_tables import Patterns, derivative_patterns
from ..linear.packed_bodies import Bodies, prepared_bodies
from ..model import ReducedModel
from .residual import contact_table


class SmallBalance(NamedTuple):
    """What does not depend on the frequency."""

    bodies: Bodies
    # (m,) [N/m]
    springs: np.ndarray
    # as `contact_table` has it
    contact: tuple
    # of the derivative with two tangents, in double precision; None with one
    patterns: Patterns | None


def small_balance(model: ReducedModel, H: int, samples: int) -> SmallBalance:
    """The balance of a model with harmonics 0..H."""
    two = model.elements.tangents == 2
    return SmallBalance(
        prepared_bodies(model, H),
        model.springs.ravel(),
        contact_table(model, H, samples),
        derivative_patterns(H, samples, np.float64) if two else None,
    )
