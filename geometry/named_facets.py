"""Facets of a mesh found by their corners, whatever a file says of their other nodes."""

from __future__ import annotations

import numpy as np

from bladefem.errors import InputError

from .topology import FACETS, FAMILY, facets_of


def named_facets(
    cells: np.ndarray,
    cell_type: str,
    corners: dict[str, list[np.ndarray]],
) -> dict[str, np.ndarray]:
    """Whole facets (nf, k) of the cells for each name.

    Args:
        corners: name -> corner nodes of facets, arrays (m, 2), (m, 3) or (m, 4). A quadrilateral
            that was split into triangles names both of them.

    Raises:
        InputError: a face of which no cell has a facet.
    """
    if not corners:
        return {}
    facets = facets_of(cells, cell_type)
    k = len(FACETS[FAMILY[cell_type]][0])
    key = np.sort(facets[:, :k], axis=1)
    _, first, _number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    distinct = key[first]
    found = {}
    for name, parts in corners.items():
        asked = np.unique(np.vstack([_facet_keys(part, k, name) for part in parts]), axis=0)
        both, count = np.unique(np.vstack([distinct, asked]), axis=0, return_counts=True)
        hit = np.isin(_as_rows(distinct), _as_rows(both[count == 2]))
        if not hit.any():
            raise InputError(f"imported.file: face {name} lies on no cell, expected facets of them")
        found[name] = facets[first[hit]]
    return found


def _facet_keys(
    corners: np.ndarray,
    k: int,
    name: str,
) -> np.ndarray:
    """Sorted corners (m, k) of the facets that are meant."""
    if corners.shape[1] == k:
        return np.sort(corners, axis=1)
    if corners.shape[1] == 4 and k == 3:
        triples = [corners[:, [i for i in range(4) if i != out]] for out in range(4)]
        return np.sort(np.vstack(triples), axis=1)
    raise InputError(
        f"imported.file: face {name} has facets of {corners.shape[1]} corners, the cells have "
        f"facets of {k}"
    )


def _as_rows(keys: np.ndarray) -> np.ndarray:
    """Rows as single items, for comparison."""
    keys = np.ascontiguousarray(keys)
    return keys.view([("", keys.dtype)] * keys.shape[1]).ravel()
