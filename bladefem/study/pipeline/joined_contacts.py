"""The model of a load case with as many contact points as its settings say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...contact.joined_points import element_labels, element_patch, joined_motion
from ...data import Patch
from ...hbm.model import ReducedModel
from ..adaptive.family import Member, coarsened_elements


def joined_member(
    model: ReducedModel,
    patches: Sequence[Patch],
    points: int | None,
    finest: int | None,
) -> Member:
    """The model with ``points`` contact points on each patch, which keep the stiffness of the seats
    against rotation.

    Args:
        points: None for all elements of the model.
        finest: elements that the model has on each patch (``contact.points`` of the scene), None
            for all nodes.
    """
    if points is None:
        return Member(model, np.arange(len(model.elements.kt)))
    groups = element_labels(patches, points, finest)
    seats = [element_patch(patch, finest) for patch in patches]
    pick = joined_motion(seats, groups, model.elements.kt)
    return Member(coarsened_elements(model, groups, pick), groups)
