"""Mid-side nodes put onto curved CAD, by the parameters of the edge's ends: a few calls of gmsh,
not one a node.

gmsh's own way searches each point on the surface: 7 s for a sector of 11 700 cells, against 0.1 s
here.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from .topology import EDGES, FAMILY, GMSH_TYPES, NODES, corner_count

FLAT_ENTITIES = ("Line", "Plane")
# of the edge: a larger step off its middle means a seam or a pole of the parameters
MAX_MIDDLE_OFFSET = 0.4


def second_order(gmsh: ModuleType, curved: bool = True) -> None:
    """Raise the current first-order mesh to second order, mid-side nodes on curved surfaces and
    curves if wanted.

    An edge whose parameters jump (seam, pole) stays straight.
    """
    parameters = {
        (d, tag): gmsh.model.mesh.getNodes(d, tag, includeBoundary=True)
        for d in (2, 1)
        for _, tag in gmsh.model.getEntities(d)
        if curved and gmsh.model.getType(d, tag) not in FLAT_ENTITIES
    }
    gmsh.model.mesh.setOrder(2)
    if not curved:
        return
    moved: dict[int, np.ndarray] = {}
    # a curve bounds its surfaces and has the last word
    for (dimension, entity), nodes in parameters.items():
        moved.update(_of_entity(gmsh, dimension, entity, *nodes))
    for _, entity in gmsh.model.getEntities(1):
        if gmsh.model.getType(1, entity) in FLAT_ENTITIES:
            for middle, _ in _second_order_edges(gmsh, 1, entity):
                moved.pop(int(middle), None)
    for node, place in moved.items():
        gmsh.model.mesh.setNode(node, place, [])


def _second_order_edges(
    gmsh: ModuleType,
    dimension: int,
    entity: int,
) -> list[tuple[int, np.ndarray]]:
    """(middle node, (2,) ends) of each edge of the entity's second-order elements, once."""
    found: dict[int, np.ndarray] = {}
    types, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
    for kind, connectivity in zip(types, nodes, strict=True):
        word = GMSH_TYPES[int(kind)]
        cells = connectivity.reshape(-1, NODES[word]).astype(int)
        k = corner_count(word)
        for i, ends in enumerate(EDGES[FAMILY[word]]):
            found.update(zip(cells[:, k + i].tolist(), cells[:, list(ends)], strict=True))
    return list(found.items())


def _of_entity(
    gmsh: ModuleType,
    dimension: int,
    entity: int,
    tags: np.ndarray,
    xyz: np.ndarray,
    parameters: np.ndarray,
) -> dict[int, np.ndarray]:
    """Places (3,) [m] of the mid-side nodes of one curve or surface whose corner nodes and
    parameters are given.
    """
    edges = _second_order_edges(gmsh, dimension, entity)
    row = {int(tag): i for i, tag in enumerate(tags)}
    ends = np.array([[row[int(a)], row[int(b)]] for _, (a, b) in edges])
    xyz = xyz.reshape(-1, 3)
    parameters = parameters.reshape(-1, dimension)
    middle = parameters[ends].mean(axis=1)
    place = np.array(gmsh.model.getValue(dimension, entity, middle.ravel())).reshape(-1, 3)
    step = np.linalg.norm(place - xyz[ends].mean(axis=1), axis=1)
    length = np.linalg.norm(xyz[ends[:, 1]] - xyz[ends[:, 0]], axis=1)
    return {edges[i][0]: place[i] for i in np.flatnonzero(step < MAX_MIDDLE_OFFSET * length)}
