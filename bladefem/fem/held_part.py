"""The part of a body beyond its root: its modes held there, and what the root's motions move in it.

What such a part does to the rest of the body goes through its root. With the root's section moving
in some shapes, u = Phi y + Psi r on the part, Psi the static motions that follow the root (Craig
and Bampton), and its mass and stiffness in (y, r) are small matrices that another part on the same
root can be compared with, whatever its mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import Mesh, chosen_whole

from ..errors import InputError
from .body import Body
from .constraint import constrain, expand_to_mesh, restrict_load
from .flexibility import Flexibility, compliance, flexible
from .gyroscopic import own_rows
from .linalg import Matrix, apply_block, inner_products
from .mass import Mass
from .modes import modes

# motions of a section beyond the rigid ones, and the least one over the strongest: fourteen bring
# six families of the stubby blades of the test as near to the complete mesh as all displacements of
# the foot do, where eight are enough for three
MAX_WARPS = 14
SMALLEST_WARP = 1e-3
# name of the node set that is held
ROOT = "held root"


@dataclass(frozen=True)
class HeldPart:
    """q modes of a part held at its root, of mass 1, and the static motions by p of its root."""

    # (n, 3) nodes of the part, the root's included [m]
    points: np.ndarray
    # (q,) [rad/s]
    omega: np.ndarray
    # (q, n, 3), zero at the root [kg^-1/2]
    shapes: np.ndarray
    # (p, n, 3) static motions that follow the root
    static: np.ndarray
    # (q, p) mass between modes and static motions
    coupling: np.ndarray
    # (p, p) mass of the static motions, and their stiffness
    inertia: np.ndarray
    stiffness: np.ndarray
    # assembled from the cells of the part alone
    body: Body
    # (n,) numbers of the points in the mesh
    numbers: np.ndarray

    def mass_products(self, fields: np.ndarray) -> np.ndarray:
        """(k, k) products of fields (k, n, 3) of the part with its mass."""
        return _products(self.body, self.body.mass, self.on_mesh(fields))

    def on_mesh(self, fields: np.ndarray) -> np.ndarray:
        """(k, n_points, 3) fields (k, n, 3) of the part on its mesh, zero elsewhere."""
        whole = np.zeros((len(fields), len(self.body.mesh.points), 3), dtype=fields.dtype)
        whole[:, self.numbers] = fields
        return whole


def part_above(mesh: Mesh, root: float) -> tuple[Mesh, np.ndarray]:
    """The mesh with only those cells of the blade that reach above a height x [m], and the numbers
    of their nodes on that height or below.

    Raises:
        InputError: no cell reaches above it.
    """
    tolerance = 1e-9
    cells = mesh.bodies["blade"]
    # of a cell that is there in pieces all of them or none
    reach = mesh.whole.get("blade", cells)
    above = ((mesh.points[reach, 0] > root + tolerance) & (reach >= 0)).any(axis=1)
    part = cells[above]
    if not len(part):
        raise InputError(f"the mesh has no part above its root at x = {root:.6g} m")
    nodes = np.unique(part)
    held = nodes[mesh.points[nodes, 0] <= root + tolerance]
    row = np.cumsum(above) - 1
    volumes = {name: row[rows[above[rows]]] for name, rows in mesh.parts.items()}
    whole = chosen_whole(mesh, {"blade": ("blade", above)})
    return replace(mesh, bodies={"blade": part}, parts=volumes, whole=whole), held


def held_part(
    body: Body,
    root: np.ndarray,
    motions: np.ndarray,
    count: int,
    shapes: np.ndarray | None = None,
    omega: np.ndarray | None = None,
) -> HeldPart:
    """The modes of an assembled part held at its root.

    Args:
        root: numbers of the held nodes.
        motions: (p, k, 3) of these nodes.
        count: modes.
        shapes: (count, n_points, 3) modes that are known already, with omega; solved otherwise.
    """
    mesh = body.mesh
    named = replace(body, mesh=replace(mesh, nodes={**mesh.nodes, ROOT: root}))
    flex = flexible(constrain(named, ROOT))
    if shapes is None or omega is None:
        found = modes(flex.con, count, flex)
        shapes = found.shapes[:count]
        omega = 2 * np.pi * found.frequencies[:count]
    numbers = np.flatnonzero(body.rows >= 0)
    static = _static_motions(flex, root, motions)
    mass = _products(body, body.mass, np.concatenate([shapes, static]))
    q = len(shapes)
    return HeldPart(
        mesh.points[numbers],
        np.asarray(omega),
        shapes[:, numbers],
        static[:, numbers],
        mass[:q, q:],
        mass[q:, q:],
        _products(body, body.K, static),
        body,
        numbers,
    )


def section_motions(points: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """(p, k, 3) motions of the nodes of a section: the 6 rigid ones, and what fields (m, k, 3) make
    beyond these, the strongest first.
    """
    x = points - points.mean(axis=0)
    x = x / abs(x).max()
    axes = np.eye(3)
    rigid = [*(np.broadcast_to(axis, x.shape) for axis in axes), *(np.cross(a, x) for a in axes)]
    basis = np.linalg.qr(np.array(rigid).reshape(len(rigid), -1).T)[0]
    beyond = fields.reshape(len(fields), -1).T
    beyond = beyond - basis @ (basis.T @ beyond)
    warps, size, _ = np.linalg.svd(beyond, full_matrices=False)
    kept = min(MAX_WARPS, np.count_nonzero(size > SMALLEST_WARP * size.max(initial=0.0)))
    return np.concatenate([basis, warps[:, :kept]], axis=1).T.reshape(-1, *points.shape)


def section_readings(mesh: Mesh, nodes: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """(n_points*3, p) columns that read how much of each motion (p, k, 3) some nodes make, by least
    squares. A force on such a reading spreads over the nodes and leaves them flexible.
    """
    R = motions.reshape(len(motions), -1).T
    columns = np.zeros((mesh.points.size, len(motions)))
    rows = (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()
    columns[rows] = np.linalg.pinv(R).T
    return columns


def _static_motions(flex: Flexibility, root: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """(p, n_points, 3) displacements of the part without other loads where its root moves."""
    body = flex.con.body
    moved = np.zeros((len(motions), len(body.mesh.points), 3))
    moved[:, root] = motions
    reaction = np.zeros((moved[0].size, len(moved)))
    reaction[_mesh_rows(body)] = apply_block(body.K, own_rows(body, moved))
    found = compliance(flex, restrict_load(flex.con, reaction))
    return moved - expand_to_mesh(flex.con, found).transpose(2, 0, 1)


def _mesh_rows(body: Body) -> np.ndarray:
    """Displacement in mesh numbering of each row of the body, on one rank."""
    rows = body.scalar_rows
    return np.argsort(rows, kind="stable")[np.count_nonzero(rows < 0) :]


def _products(body: Body, matrix: Matrix | Mass, fields: np.ndarray) -> np.ndarray:
    rows = own_rows(body, fields)
    return np.asarray(inner_products(body.comm, rows, apply_block(matrix, rows)))
