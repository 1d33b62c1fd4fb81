"""Pairs of faces whose nodes match one to one under a rigid motion, and the snapping that makes the
match exact.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from bladefem.errors import InputError
from bladefem.util.arrays import RealArray

from .mesh import Pair
from .topology import corner_count, face_word


@dataclass(frozen=True)
class FaceMotion:
    """Two faces and the rigid motion from one to the other: x_slave = rotation @ x_master +
    shift.
    """

    # names of the faces
    master: str
    slave: str
    # (3, 3)
    rotation: RealArray = field(default_factory=lambda: np.eye(3))
    # (3,) [m]
    shift: RealArray = field(default_factory=lambda: np.zeros(3))

    @property
    def names(self) -> tuple[str, str]:
        """Master and slave."""
        return self.master, self.slave

    def image(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) near the master, moved to the slave."""
        return points @ self.rotation.T + self.shift

    def image_back(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) near the slave, moved to the master."""
        return (points - self.shift) @ self.rotation

    def pair(self, nodes: np.ndarray | None = None) -> Pair:
        """The pair with matched nodes (2, m), or with none."""
        nodes = np.zeros((2, 0), dtype=int) if nodes is None else nodes
        return Pair(self.master, self.slave, nodes, self.rotation, self.shift)


def match_faces(
    points: np.ndarray,
    faces: dict[str, np.ndarray],
    motion: FaceMotion,
    dimension: int,
    tolerance: float = 1e-6,
) -> Pair:
    """Pair all nodes of two faces, corner with corner and mid-side node with mid-side node.

    Args:
        points: (n, 3) [m].
        tolerance: largest distance, as a share of the size of the master face.

    Raises:
        InputError: the nodes do not match one to one.
    """
    kinds = [_split_nodes(faces[name], dimension) for name in motion.names]
    scale = np.ptp(points[np.unique(faces[motion.master])], axis=0).max()
    columns = [
        _match_nodes(points, master, slave, motion, tolerance * scale)
        for master, slave in zip(*kinds, strict=True)
    ]
    return motion.pair(np.hstack(columns))


def _split_nodes(faces: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Corner nodes and mid-side nodes of a face."""
    k = corner_count(face_word(faces.shape[1], dimension))
    return np.unique(faces[:, :k]), np.unique(faces[:, k:])


def _match_nodes(
    points: np.ndarray,
    master: np.ndarray,
    slave: np.ndarray,
    motion: FaceMotion,
    tolerance: float,
) -> np.ndarray:
    """(2, m) matched node numbers.

    Args:
        tolerance: largest distance [m].
    """
    if len(master) != len(slave):
        raise InputError(
            f"faces {motion.master} and {motion.slave} do not match: {len(master)} against "
            f"{len(slave)} nodes, expected a periodic mesh"
        )
    if len(master) == 0:
        return np.empty((2, 0), dtype=int)
    distance, index = cKDTree(points[slave]).query(motion.image(points[master]))
    if distance.max() > tolerance or len(np.unique(index)) != len(index):
        raise InputError(
            f"faces {motion.master} and {motion.slave} do not match: "
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
