"""Distance of points from a face made of elements, for faces whose nodes do not match."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

# flat triangles that an element's nodes span, by its number of nodes
TRIANGLES = {
    3: [(0, 1, 2)],
    4: [(0, 1, 2), (0, 2, 3)],
    6: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
    8: [(0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)],
}
TRIANGLES[9] = TRIANGLES[8]
# triangles near a point that are looked at
CANDIDATES = 24


def distance_to_face(
    places: np.ndarray,
    points: np.ndarray,
    facets: np.ndarray,
) -> np.ndarray:
    """(n,) distances [m] of places (n, 3) from the nearest triangle of a face.

    Args:
        points: (m, 3) nodes [m].
        facets: (nf, k) the face's elements, of a solid mesh.
    """
    split = TRIANGLES[facets.shape[1]]
    corners = points[np.concatenate([facets[:, list(part)] for part in split])]
    few = min(CANDIDATES, len(corners))
    _, near = cKDTree(corners.mean(axis=1)).query(places, k=few)
    candidates = corners[near.reshape(len(places), few)]
    return np.asarray(_distance_to_triangles(places[:, None], candidates).min(axis=1))


def _distance_to_triangles(places: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n, c) distances of places (n, 1, 3) from triangles (n, c, 3, 3)."""
    sides = np.roll(corners, -1, axis=2) - corners
    arms = places[:, :, None] - corners
    normal = np.cross(sides[..., 0, :], -sides[..., 2, :])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
    # inside where the place is on the inner side of all three sides
    inner = np.cross(normal[..., None, :], sides)
    inside = (np.einsum("nctd,nctd->nct", inner, arms) >= 0).all(axis=-1)
    above = np.abs(np.einsum("ncd,ncd->nc", normal, arms[..., 0, :]))
    along = np.einsum("nctd,nctd->nct", arms, sides)
    share = (along / np.maximum((sides**2).sum(axis=-1), 1e-300)).clip(0, 1)
    beside = np.linalg.norm(arms - share[..., None] * sides, axis=-1).min(axis=-1)
    return np.asarray(np.where(inside, above, beside))
