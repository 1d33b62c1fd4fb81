"""The ports of a blade: where it meets its dampers, where the gas pushes, where the engineer
looks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh

from ...contact.patch import port_matrix
from ...data import Patch
from ...errors import InputError, suggestion
from ...scene.tables import Excitation


@dataclass(frozen=True)
class Ports:
    """Port vectors in mesh numbering: displacement at a port = column . u, a unit force at it = the
    column.
    """

    # (dim n_points, p)
    matrix: sp.csc_matrix
    # "contact" ("this" before "next"), "load", "probe"
    names: dict[str, slice]


def named_nodes(mesh: Mesh, name: str) -> np.ndarray:
    """Node numbers of a named node set or face.

    Raises:
        InputError: the mesh has neither.
    """
    if name in mesh.nodes:
        return np.asarray(mesh.nodes[name])
    if name in mesh.faces:
        return np.unique(mesh.faces[name])
    raise InputError(
        f"excitation.at: the mesh has no node set or face '{name}'"
        + suggestion(name, [*mesh.nodes, *mesh.faces])
    )


def blade_ports(
    mesh: Mesh,
    patches: list[Patch],
    excitation: Excitation,
    readings: np.ndarray | None = None,
) -> Ports:
    """Contact ports of all patches on the blade side, one load and one probe port along the
    excitation.

    Args:
        readings: (n_points*dim, q) columns of one more port, "blade".
    """
    contact = port_matrix(patches, mesh, "blade") if patches else None
    nodes = named_nodes(mesh, excitation.at)
    load = _mean_displacement(mesh, nodes, np.asarray(excitation.direction, dtype=float))
    blade = None if readings is None else sp.csc_matrix(readings)
    blocks = {"contact": contact, "load": load, "probe": load}
    return _stack(blocks if blade is None else {**blocks, "blade": blade})


def damper_ports(mesh: Mesh, patches: list[Patch]) -> Ports:
    """Contact ports on the damper's side, in the same order and frames as the blade's."""
    return _stack({"contact": port_matrix(patches, mesh, "damper")})


def _stack(blocks: dict[str, sp.spmatrix | None]) -> Ports:
    names = {}
    start = 0
    for name, block in blocks.items():
        width = 0 if block is None else block.shape[1]
        names[name] = slice(start, start + width)
        start += width
    return Ports(sp.csc_matrix(sp.hstack([b for b in blocks.values() if b is not None])), names)


def _mean_displacement(
    mesh: Mesh,
    nodes: np.ndarray,
    direction: np.ndarray,
) -> sp.csc_matrix:
    """(dim n_points, 1): mean displacement of some nodes along a direction; as a load, one newton
    shared by them.
    """
    dim = mesh.dimension
    size = np.linalg.norm(direction[: mesh.dimension])
    if size == 0:
        raise InputError(
            f"excitation.direction: {direction.tolist()} is zero in the {dim} dimensions of the "
            "model, expected a direction"
        )
    rows = (np.asarray(nodes)[:, None] * dim + np.arange(dim)).ravel()
    values = np.tile(direction[:dim] / size, len(nodes)) / len(nodes)
    return sp.csc_matrix((values, (rows, np.zeros_like(rows))), shape=(dim * len(mesh.points), 1))
