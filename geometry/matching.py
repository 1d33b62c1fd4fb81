"""Pairs of faces whose nodes match one to one under a rigid motion, and the snapping that makes the
match exact.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from bladefem.errors import InputError

from .mesh import Pair
from .topology import corner_count, face_word


def match_faces(
    points: np.ndarray,
    faces: dict[str, np.ndarray],
    names: tuple[str, str],
    dimension: int,
    rotation: np.ndarray | None = None,
    shift: np.ndarray | None = None,
    tolerance: float = 1e-6,
) -> Pair:
    """Pair all nodes of two faces, corner with corner and mid-side node with mid-side node.

    Args:
        points: (n, 3) [m].
        names: master and slave face.
        rotation, shift: motion from master to slave; identity and zero when left out.
        tolerance: largest distance, as a share of the size of the master face.

    Raises:
        InputError: the nodes do not match one to one.
    """
    rotation = np.eye(3) if rotation is None else rotation
    shift = np.zeros(3) if shift is None else shift
    kinds = [_split_nodes(faces[name], dimension) for name in names]
    scale = np.ptp(points[np.unique(faces[names[0]])], axis=0).max()
    columns = [
        _match_nodes(
            points,
            master,
            slave,
            rotation,
            shift,
            tolerance * scale,
            names,
        )
        for master, slave in zip(*kinds, strict=True)
    ]
    return Pair(*names, np.hstack(columns), rotation, shift)


def _split_nodes(faces: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Corner nodes and mid-side nodes of a face."""
    k = corner_count(face_word(faces.shape[1], dimension))
    return np.unique(faces[:, :k]), np.unique(faces[:, k:])


def _match_nodes(
    points: np.ndarray,
    master: np.ndarray,
    slave: np.ndarray,
    rotation: np.ndarray,
    shift: np.ndarray,
    tolerance: float,
    names: tuple[str, str],
) -> np.ndarray:
    """(2, m) matched node numbers."""
    if len(master) != len(slave):
        raise InputError(
            f"faces {names[0]} and {names[1]} do not match: {len(master)} against {len(slave)} "
            "nodes, expected a periodic mesh"
        )
    if len(master) == 0:
        return np.empty((2, 0), dtype=int)
    distance, index = cKDTree(points[slave]).query(points[master] @ rotation.T + shift)
    if distance.max() > tolerance or len(np.unique(index)) != len(index):
        raise InputError(
            f"faces {names[0]} and {names[1]} do not match: "
            f"{np.count_nonzero(distance > tolerance)} of {len(master)} nodes have no partner "
            f"(largest distance {distance.max():.3g} m), expected a periodic mesh"
        )
    return np.vstack([master, slave[index]])


def snap_slaves(points: np.ndarray, pairs: dict[str, Pair]) -> np.ndarray:
    """Points (n, 3) with every slave node moved onto its master's image, so that pairs match to
    rounding.
    """
    result = points.copy()
    for pair in pairs.values():
        master, slave = pair.nodes
        result[slave] = result[master] @ pair.rotation.T + pair.shift
    return result
