"""Contact nodes joined into fewer points, which keep the stiffness of their seat.

m points across a seat that see the mean motion of their nodes stand at the centroids of its parts
and carry 1 - 1/m^2 of its stiffness against rotation: the stiffness of each part against its own is
lost. A damper that rolls on its seats then resonates too low and at a wrong amplitude. Points that
stand further out carry all of it, as those of Gauss' rule do with two across; they read the motion
there with the gradient of the seat's mean motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from ..data import Patch

# of the width of a group of nodes: below it they have one place along a side
SAME_PLACE = 1e-6
# of a seat's second moment of stiffness along an axis: where the points carry less of it there are
# not two of them along that axis, and no place for them gives the rest
CARRIED_SHARE = 0.5


def aggregation_matrix(patch: Patch, points: int | None) -> sp.csr_matrix:
    """G (n, m): share of each node in its element by area; the columns sum to 1. The identity when
    points is None.

    Nodes are grouped by halving the patch again and again into parts of equal area: its shorter
    side first, then in turns, so that the parts have the proportions of the patch. A force leaves
    the middle sixth of the shorter side first: a damper that rolls lifts off there, and with one
    point across it would roll freely.
    """
    n = len(patch.area)
    if points is None or points >= n:
        return sp.identity(n, format="csr")
    frame = patch.frame.mean(axis=0)
    label = np.zeros(n, dtype=int)
    x = (patch.points - patch.points.mean(axis=0)) @ frame[1:].T
    # a little more for the shorter side, which is split first
    sides = np.where(np.ptp(x, axis=0) < np.ptp(x, axis=0).max(), 1.01, 1.0)
    _halve(x, sides, patch.area, np.arange(n), points, 0, label)
    share = patch.area / np.bincount(label, patch.area)[label]
    return sp.csr_matrix((share, (np.arange(n), label)), shape=(n, points))


def element_labels(
    patches: Sequence[Patch],
    points: int | None,
    finest: int | None = None,
) -> np.ndarray:
    """(finest elements of all patches,) number of the element that each belongs to, ``points``
    elements on each patch.

    Args:
        finest: elements on each patch that are joined, those of the scene (``contact.points``);
            None for the nodes.
    """
    parts = [aggregation_matrix(element_patch(patch, finest), points) for patch in patches]
    starts = np.cumsum([0] + [part.shape[1] for part in parts])
    return np.concatenate(
        [start + part.indices for start, part in zip(starts, parts, strict=False)]
    )


def element_patch(patch: Patch, points: int | None) -> Patch:
    """The patch with its elements in place of its nodes, as far as ``aggregation_matrix`` and
    ``joined_motion`` look at it: places and areas.
    """
    if points is None or points >= len(patch.area):
        return patch
    groups = aggregation_matrix(patch, points).indices
    pick = joined_motion([patch], groups, patch.area)
    return replace(
        patch,
        points=pick @ patch.points,
        places=pick @ _places(patch),
        area=np.bincount(groups, patch.area).astype(float),
    )


def joined_motion(
    patches: Sequence[Patch],
    groups: np.ndarray,
    stiffness: np.ndarray,
) -> np.ndarray:
    """(m, n) from the motion of contact nodes to that of the points that join them.

    Each point reads the mean motion of its nodes, weighted by their stiffness, and moves from
    their centroid c by (S - 1) c with the seat's mean gradient. S makes the second moment of the
    points' stiffness that of all nodes: points of a seat that moves as a rigid body take the forces
    and moments that all its nodes would. Forces go the other way with the transpose.

    Args:
        patches: seats, one after the other.
        groups: (n,) number of the point of each node, 0 .. m-1.
        stiffness: (n,) of the nodes, in any unit; points whose nodes have none weigh them alike.
    """
    total = np.bincount(groups, stiffness)
    weight = np.where(total[groups] > 0, stiffness, 1.0)
    total = np.bincount(groups, weight)
    pick = np.zeros((len(total), len(groups)))
    pick[groups, np.arange(len(groups))] = weight / total[groups]
    starts = np.cumsum([0] + [len(patch.area) for patch in patches])
    for patch, (begin, end) in zip(patches, pairwise(starts), strict=True):
        nodes = slice(begin, end)
        points = slice(groups[nodes].min(), groups[nodes].max() + 1)
        if points.stop - points.start < end - begin:
            x = _unit_coordinates(patch, weight[nodes])
            centroid = pick[points, nodes] @ x
            moved = _moved_points(centroid, total[points]) - centroid
            pick[points, nodes] += moved @ (x * weight[nodes, None]).T
    return pick


def _unit_coordinates(patch: Patch, weight: np.ndarray) -> np.ndarray:
    """(n, k) coordinates of the nodes in the plane of the seat in which their first moment is zero
    and their second moment the identity; k directions in which the seat has an extent.
    """
    places = _places(patch)
    x = (places - np.average(places, axis=0, weights=weight)) @ patch.frame.mean(axis=0)[1:].T
    moments, axes = np.linalg.eigh((x * weight[:, None]).T @ x)
    extended = moments > SAME_PLACE**2 * moments.max()
    return x @ axes[:, extended] / np.sqrt(moments[extended])


def _moved_points(centroid: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """(m, k) unit coordinates of the points, from those of their centroids: their second moment is
    the identity along all axes along which there are several.
    """
    carried, axes = np.linalg.eigh((centroid * stiffness[:, None]).T @ centroid)
    scale = np.where(carried > CARRIED_SHARE, 1.0 / np.sqrt(np.maximum(carried, 1e-30)), 1.0)
    return centroid @ (axes * scale) @ axes.T


def _places(patch: Patch) -> np.ndarray:
    """(n, 3) where the forces of the nodes act [m]."""
    return patch.points if patch.places is None else patch.places


def _halve(
    x: np.ndarray,
    sides: np.ndarray,
    area: np.ndarray,
    nodes: np.ndarray,
    parts: int,
    first: int,
    label: np.ndarray,
) -> None:
    """Label some nodes first .. first + parts - 1.

    Args:
        x: (n, sides) places in the patch [m].
        sides: of these nodes, over those of the patch.
    """
    if parts == 1:
        label[nodes] = first
        return
    widths = np.ptp(x[nodes], axis=0)
    axis = int(np.argmax(np.where(widths > SAME_PLACE * widths.max(), sides, 0.0)))
    nodes = nodes[np.lexsort((x[nodes, 1 - axis], x[nodes, axis].round(9)))]
    low = parts // 2
    below = np.cumsum(area[nodes]) - area[nodes] / 2
    cut = int(np.searchsorted(below, area[nodes].sum() * low / parts))
    cut = min(max(cut, low), len(nodes) - (parts - low))
    shares = np.array([low / parts, 1 - low / parts])
    for share, chosen, count, start in (
        (shares[0], nodes[:cut], low, first),
        (shares[1], nodes[cut:], parts - low, first + low),
    ):
        own = sides.copy()
        own[axis] *= share
        _halve(x, own, area, chosen, count, start, label)
