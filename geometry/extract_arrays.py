"""From a meshed gmsh model to arrays: compact node numbers, named bodies, faces that look outwards,
node sets.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from .mesh import Mesh
from .topology import GMSH_TYPES, NODES, outward_faces


@dataclass(frozen=True)
class Groups:
    """Which gmsh entities carry a name: volumes (surfaces in 2-D), surfaces (curves in 2-D),
    points.
    """

    bodies: dict[str, list[int]]
    faces: dict[str, list[int]]
    points: dict[str, list[int]] = field(default_factory=dict)


def extract_mesh(
    gmsh: ModuleType,
    groups: Groups,
    dimension: int,
) -> Mesh:
    """The current gmsh mesh as a Mesh without pairs; only nodes of the named bodies are kept.

    Raises:
        ValueError: a group holds elements of several types, or a face does not belong to a body.
    """
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    bodies = {
        name: _entity_elements(gmsh, dimension, entities)
        for name, entities in groups.bodies.items()
    }
    faces = {
        name: _entity_elements(gmsh, dimension - 1, entities)[1]
        for name, entities in groups.faces.items()
    }
    used = np.unique(np.concatenate([cells.ravel() for _, cells in bodies.values()]))
    number, place = np.full((2, int(tags.max()) + 1), -1)
    number[used] = np.arange(len(used))
    place[tags.astype(int)] = np.arange(len(tags))
    points = xyz.reshape(-1, 3)[place[used]]
    word = next(word for word, _ in bodies.values())
    cells = {name: number[c] for name, (_, c) in bodies.items()}
    every = np.vstack(list(cells.values()))
    return Mesh(
        points,
        word,
        cells,
        {name: outward_faces(points, every, word, number[f]) for name, f in faces.items()},
        {name: number[_point_nodes(gmsh, p)] for name, p in groups.points.items()},
    )


def _entity_elements(
    gmsh: ModuleType,
    dimension: int,
    entities: list[int],
) -> tuple[str, np.ndarray]:
    """Word and node tags (n, k) of the elements of the entities, all of one type."""
    blocks: dict[str, list[np.ndarray]] = {}
    for entity in entities:
        types, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        for kind, connectivity in zip(types, nodes, strict=True):
            word = GMSH_TYPES[int(kind)]
            blocks.setdefault(word, []).append(connectivity.reshape(-1, NODES[word]).astype(int))
    if len(blocks) != 1:
        raise ValueError(
            f"one element type was expected in a group, found {sorted(blocks) or 'none'}"
        )
    word, parts = blocks.popitem()
    return word, np.vstack(parts)


def _point_nodes(gmsh: ModuleType, entities: list[int]) -> np.ndarray:
    return np.concatenate([gmsh.model.mesh.getNodes(0, point)[0].astype(int) for point in entities])
