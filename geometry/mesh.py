"""What a geometry hands to the finite elements: arrays and names, nothing of gmsh."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bladefem.errors import InputError
from bladefem.util.arrays import IntegerArray, RealArray

# of a node that a user's file does not have
NO_NUMBER = -1


@dataclass(frozen=True)
class Sector:
    """How the next blade is reached: x_next = rotation @ x + shift."""

    # number of blades on the wheel; 0 when the row has no end (plane blades)
    count: int
    # (3, 3)
    rotation: RealArray
    # (3,) [m]
    shift: RealArray


@dataclass(frozen=True)
class Pair:
    """Two faces whose nodes match one to one under a rigid motion: x_slave = rotation @ x_master +
    shift.
    """

    # name of a face
    master: str
    # name of a face
    slave: str
    # (2, m) node numbers, row 0 on the master, row 1 on the slave
    nodes: IntegerArray
    # (3, 3)
    rotation: RealArray
    # (3,) [m]
    shift: RealArray


@dataclass(frozen=True, repr=False)
class Mesh:
    """A mesh with named bodies, faces, node sets and matched pairs. Node order inside an element is
    gmsh's.

    Names that the finite elements look for (each optional unless the task needs it): bodies
    "blade", "damper"; faces "clamp", "cyclic_low", "cyclic_high", "seat_left", "seat_right"
    (platform undersides towards -y and +y), "damper_left" (flank on this blade's seat_right),
    "damper_right" (flank on the next blade's seat_left), "pressure_side", "suction_side", "tip";
    node sets "tip_leading", "tip_trailing", "tip_mid"; pairs "cyclic" (cyclic_low -> cyclic_high),
    "this" (seat_right -> damper_left, identity), "next" (seat_left -> damper_right, the motion to
    the next sector).
    """

    # (n, 3) [m]
    points: RealArray
    # meshio's word: "tetra", "tetra10", "triangle", "triangle6", "hexahedron", ...
    cell_type: str
    # name -> (nc, k) node numbers of its cells
    bodies: dict[str, IntegerArray]
    # name -> (nf, kf) node numbers (edges in 2-D)
    faces: dict[str, IntegerArray] = field(default_factory=dict)
    # name -> (k,) node numbers
    nodes: dict[str, IntegerArray] = field(default_factory=dict)
    pairs: dict[str, Pair] = field(default_factory=dict)
    sector: Sector | None = None
    # out-of-plane thickness of a plane mesh [m]
    depth: float = 1.0
    # quality: cells, worst Jacobian, straightened, ...
    report: dict[str, Any] = field(default_factory=dict)
    # named volumes of the blade -> rows of bodies["blade"]
    parts: dict[str, IntegerArray] = field(default_factory=dict)
    # (n,) numbers of the nodes in the user's file, NO_NUMBER of added ones; None without such
    numbers: IntegerArray | None = None
    # name of a body -> (nc, 27) nodes of the cell of another shape that each of its tetrahedra, or
    # triangles of a plane mesh, is a piece of, gmsh's order, -1 beyond its own (4, 5, 6 or 8 of
    # first order, 10, 14, 18 or 27 of second; 3 and 4, 6 and 9 in a plane). Such a body is solved
    # with the cells themselves, and so are its loads, stresses and halved meshes (`whole_cells`);
    # contacts and pictures see the pieces.
    whole: dict[str, IntegerArray] = field(default_factory=dict)
    # (3, 3) from the axes of the user's file to those of the mesh: points = file's @ turn.T; None
    # where they are the same
    turn: RealArray | None = None

    def __repr__(self) -> str:
        bodies = ", ".join(f"{name} {len(cells)} cells" for name, cells in self.bodies.items())
        return (
            f"<mesh of {self.cell_type}: {len(self.points)} points, {bodies}; {len(self.faces)} "
            "named faces>"
        )

    @property
    def dimension(self) -> int:
        """2 for plane meshes, 3 for solids."""
        return 2 if self.cell_type.startswith(("triangle", "quad")) else 3


def cut_face_nodes(mesh: Mesh, cells: IntegerArray | None = None) -> int:
    """Number of nodes on both cut faces of a sector together; 0 without them.

    Args:
        cells: whose nodes count; those of all bodies when None.
    """
    if "cyclic" not in mesh.pairs:
        return 0
    nodes = np.unique(mesh.pairs["cyclic"].nodes)
    return len(nodes) if cells is None else int(np.isin(nodes, cells).sum())


def chosen_whole(mesh: Mesh, rows: dict[str, tuple[str, IntegerArray]]) -> dict[str, IntegerArray]:
    """What `Mesh.whole` is of bodies made of rows of others.

    Args:
        rows: name of a new body -> name of the old one, and which of its cells (numbers, or true).
    """
    return {
        name: mesh.whole[old][chosen] for name, (old, chosen) in rows.items() if old in mesh.whole
    }


def padded_numbers(numbers: IntegerArray | None, count: int) -> IntegerArray | None:
    """(count,) numbers of nodes of which the last have none."""
    if numbers is None:
        return None
    return np.concatenate([numbers, np.full(count - len(numbers), NO_NUMBER)])


def sector_of(mesh: Mesh) -> Sector:
    """How the next blade is reached.

    Raises:
        InputError: the mesh is of a single blade.
    """
    if mesh.sector is None:
        raise InputError("the mesh is of a single blade, expected the sector of a wheel")
    return mesh.sector


def spin_axis(mesh: Mesh) -> tuple[float, float, float]:
    """The engine axis z; for an endless row of plane blades the y axis, so that the pull is along x
    only.
    """
    endless = mesh.sector is not None and mesh.sector.count == 0
    return (
        (0.0, 1.0, 0.0)
        if endless or (mesh.dimension == 2 and mesh.sector is None)
        else (0.0, 0.0, 1.0)
    )


def counting_sense(mesh: Mesh) -> int:
    """+1 where sectors are counted in the sense of a positive rotation about z, else -1."""
    if mesh.sector is None or not mesh.sector.count:
        return 1
    return 1 if mesh.sector.rotation[1, 0] >= 0 else -1
