"""A Mesh written as a .msh file (version 4.1, binary or text) with its names as physical groups."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np

from .mesh import Mesh
from .session import gmsh_path, gmsh_session
from .topology import GMSH_TYPES, face_word

GMSH_NUMBER = {word: number for number, word in GMSH_TYPES.items()}


def write_msh(
    mesh: Mesh,
    file: str | Path,
    version: float = 4.1,
    binary: bool = False,
) -> None:
    """Write bodies, faces and node sets under their names; `geometry.imported.read_mesh` reads them
    back.

    Args:
        version: 4.1, or 2.2 for older programs.
    """
    dimension = mesh.dimension
    with gmsh_session() as gmsh:
        first = next(iter(mesh.bodies))
        entities = {name: gmsh.model.addDiscreteEntity(dimension) for name in mesh.bodies}
        tags = np.arange(1, len(mesh.points) + 1)
        gmsh.model.mesh.addNodes(dimension, entities[first], tags, mesh.points.ravel())
        groups = [
            *((dimension, name, mesh.cell_type, cells) for name, cells in mesh.bodies.items()),
            *(
                (dimension - 1, name, face_word(faces.shape[1], dimension), faces)
                for name, faces in mesh.faces.items()
            ),
            *((0, name, "vertex", nodes[:, None]) for name, nodes in mesh.nodes.items()),
        ]
        for dim, name, word, cells in groups:
            # bodies have their entities already, as the nodes lie on the first of them
            own = dim == dimension
            entity = entities[name] if own else gmsh.model.addDiscreteEntity(dim)
            _add_group(gmsh, dim, entity, name, word, cells)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", int(binary))
        gmsh.write(gmsh_path(file))


def _add_group(
    gmsh: ModuleType,
    dimension: int,
    entity: int,
    name: str,
    word: str,
    cells: np.ndarray,
) -> None:
    gmsh.model.mesh.addElementsByType(entity, GMSH_NUMBER[word], [], (cells + 1).ravel())
    gmsh.model.setPhysicalName(dimension, gmsh.model.addPhysicalGroup(dimension, [entity]), name)
