"""One sector of a wheel whose cut faces move in a known way, on a mesh of its own.

With the cut faces' motion u_b given, u = S u_b + v, S the static motions that follow them and v
zero there,

    (K - w^2 M) v = F + w^2 M S u_b.

Alone this would shift a resonance of the blade by what the wheel's model leaves out of it, and its
amplitude with it. So coordinates y of the blade's own modes are given too, and forces on their
readings R hold them, v + S u_b = ... + U lambda with R^T u = y; they are small where both models
agree.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import Mesh

from ..data import ModeSet
from ..errors import InputError
from .body import Body
from .constraint import clamped_nodes, constrain, expand_to_mesh, restrict_load
from .flexibility import Flexibility, compliance, flexible
from .forced_motion import forced_motion
from .gyroscopic import own_rows
from .linalg import apply_block

# name of the node set that is held: cut faces and clamp
HELD = "cut faces and clamp"


@dataclass(frozen=True)
class CutSector:
    """A sector held at its cut faces, factorised."""

    flex: Flexibility
    # (k,) numbers of the nodes of the cut faces
    cut: np.ndarray

    @property
    def body(self) -> Body:
        """The sector without what holds its cut faces."""
        return self.flex.con.body


@dataclass(frozen=True)
class SectorMotion:
    """Motion of a sector in some harmonics."""

    # (H, n_points, 3) complex [m]
    fields: np.ndarray
    # (H, q) complex forces on the readings that hold the coordinates
    forces: np.ndarray


def cut_face_numbers(mesh: Mesh) -> np.ndarray:
    """Numbers of the nodes of both cut faces.

    Raises:
        InputError: the mesh is no sector of a wheel.
    """
    if "cyclic" not in mesh.pairs:
        raise InputError("the mesh has no pair 'cyclic', expected a sector of a wheel")
    pair = mesh.pairs["cyclic"]
    sides = (pair.master, pair.slave)
    return np.unique(np.concatenate([mesh.faces[name].ravel() for name in sides]))


def cut_sector(body: Body) -> CutSector:
    """A sector with its cut faces held; on one rank.

    Raises:
        InputError: the body is no sector of a wheel, or is shared by ranks.
    """
    if body.comm.size > 1:
        raise InputError(f"{body.comm.size} ranks share the sector, expected one alone")
    cut = cut_face_numbers(body.mesh)
    cut = cut[body.rows[cut] >= 0]
    held = np.union1d(cut, clamped_nodes(body, "clamp"))
    mesh = replace(body.mesh, nodes={**body.mesh.nodes, HELD: held})
    return CutSector(flexible(constrain(replace(body, mesh=mesh, hold=HELD), HELD)), cut)


def static_motion(sector: CutSector, moved: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """(k, n_points, 3) static displacements [m].

    Args:
        moved: (k, n_points, 3) displacements of the cut faces [m]; what other nodes have does not
            count.
        loads: (k, n_points*3) [N].
    """
    given = np.zeros_like(moved)
    given[:, sector.cut] = moved[:, sector.cut]
    reaction = loads.T - _mesh_forces(sector.body, sector.body.K, given)
    found = compliance(sector.flex, restrict_load(sector.flex.con, reaction))
    return given + expand_to_mesh(sector.flex.con, found).transpose(2, 0, 1)


def harmonic_motion(
    sector: CutSector,
    modes: ModeSet,
    moved: np.ndarray,
    loads: np.ndarray,
    omega: np.ndarray,
    readings: np.ndarray,
    coordinates: np.ndarray,
) -> SectorMotion:
    """Motion under harmonic loads with the cut faces' motion and coordinates of the blade given.

    Args:
        modes: of the held sector, up to some frequency above omega.
        moved: (H, n_points, 3) complex displacements of the cut faces [m].
        loads: (H, n_points*3) complex [N].
        omega: (H,) circular frequencies [rad/s]; of damping proportional to mass, alpha [1/s], the
            complex root of w^2 - j w alpha.
        readings: (n_points*3, q) columns that read the blade's coordinates.
        coordinates: (H, q) complex, what they read.

    Raises:
        NotSolvedError: the modes do not cover a frequency.
    """
    H, q = coordinates.shape
    lift = static_motion(sector, moved, np.zeros((H, moved[0].size), complex))
    inertia = _mesh_forces(sector.body, sector.body.mass, lift)
    given = loads.T + omega**2 * inertia
    columns = np.concatenate([given, np.tile(readings, (1, H))], axis=1)
    at = np.concatenate([omega, np.repeat(omega, q)])
    found = forced_motion(sector.flex, modes, columns, at, np.zeros(len(modes.frequencies)))
    u = found.displacement.reshape(len(readings), -1).T
    own = lift + u[:H].reshape(lift.shape)
    by_force = u[H:].reshape(H, q, len(readings))
    forces = np.zeros((H, q), complex)
    for h in range(H):
        seen = by_force[h] @ readings
        forces[h] = np.linalg.solve(seen.T, coordinates[h] - own[h].ravel() @ readings)
    held = np.einsum("hq,hqn->hn", forces, by_force).reshape(own.shape)
    return SectorMotion(own + held, forces)


def _mesh_forces(body: Body, matrix: object, fields: np.ndarray) -> np.ndarray:
    """(n_points*3, k) of a matrix of the body and fields (k, n_points, 3), in mesh numbering."""
    rows = body.scalar_rows
    order = np.argsort(rows, kind="stable")[np.count_nonzero(rows < 0) :]
    found = np.zeros((len(rows), len(fields)), fields.dtype)
    found[order] = apply_block(matrix, own_rows(body, fields))
    return found
