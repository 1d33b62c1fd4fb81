"""An elastic body on a distributed mesh: stiffness and mass as PETSc matrices, nodes known by the
mesh's numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh, cut_face_nodes

from ..errors import InputError, suggestion
from ..scene.tables import Material
from . import shape_functions as shape
from .compat import (
    CELLS,
    MPI,
    PETSc,
    assemble_matrix,
    build_mesh,
    cell_dofs,
    dolfinx,
    one_component,
    ufl,
    vector_space,
)
from .elasticity import Law, elastic_law
from .mass import Mass
from .memory import MemoryPlan, check_memory
from .mixed_cells import pieces_of_one_shape, spread_matrix
from .temperature import (
    Temperatures,
    cell_temperatures,
    density_at,
    evaluate_materials,
    form_coefficient,
    material_numbers,
)

if TYPE_CHECKING:
    from .steady_state import SteadyState

# degrees of quadrature for properties that vary in an element
EXTRA_DEGREE = 2
IN_MEMORY = MemoryPlan(0.0)


@dataclass(frozen=True)
class Body:
    """A body assembled; the matrices know no constraint yet."""

    mesh: Mesh
    # bodies of the mesh, joined by " + "
    name: str
    # one a body
    material: dict[str, Material]
    # displacement components of a node
    dim: int
    # (dim*n, dim*n) [N/m], n nodes of this body, distributed, block size dim
    K: PETSc.Mat
    # see ``M``
    mass: Mass
    # (n_points,) PETSc block row of each mesh node, -1 outside; same on every rank
    rows: np.ndarray
    # dolfinx function space of the displacements
    space: Any
    # "stress" or "strain", for plane meshes
    plane: str
    comm: MPI.Comm
    # face or node set that a clamp named "clamp" refers to; "" for none
    hold: str = "clamp"
    # that K is about; None at rest
    state: SteadyState | None = None
    # [N/m] springs to the ground, in K already
    spring: PETSc.Mat | None = None
    # face or node set, and the letters of the displacements held on it
    directions: tuple[tuple[str, str], ...] = ()
    # None: properties are the constants of the materials
    heat: Temperatures | None = None
    # where factors are kept
    plan: MemoryPlan = IN_MEMORY
    # of a mesh of mixed shapes: what its integrals are over; none where ``space`` has the cells
    pieces: tuple[Piece, ...] = ()

    @property
    def M(self) -> PETSc.Mat:
        """(dim*n, dim*n) [kg], made when it is asked for first (collective)."""
        return self.mass.matrix()

    @property
    def scalar_rows(self) -> np.ndarray:
        """(n_points*dim,) PETSc row of each displacement in mesh numbering, -1 outside the body."""
        rows = self.dim * self.rows[:, None] + np.arange(self.dim)
        return np.where(self.rows[:, None] < 0, -1, rows).ravel()


@dataclass(frozen=True)
class Piece:
    """Cells of one shape of a body of mixed shapes."""

    # each cell on nodes of its own; its matrices are given back, their sum is in the whole body's
    body: Body
    # (points of its mesh, points of the whole mesh) interpolates fields onto its nodes
    spread: sp.csr_matrix

    def onto(self, u: np.ndarray) -> np.ndarray:
        """(points of its mesh, dim) of a field (n_points, dim)."""
        return np.asarray(self.spread @ u)

    def back(self, force: np.ndarray) -> np.ndarray:
        """(n_points*dim,) of nodal forces (points of its mesh * dim,)."""
        return np.asarray(self.spread.T @ force.reshape(-1, self.body.dim)).ravel()


@dataclass(frozen=True)
class Formulation:
    """How the matrices of a body are integrated."""

    # "stress" or "strain", of plane meshes
    plane: str
    # "exact", or "ccx" as CalculiX does
    quadrature: str
    # temperatures of the mesh, which decide on properties; None: those of the materials
    heat: Temperatures | None


def assemble(
    mesh: Mesh,
    name: str | tuple[str, ...],
    material: Material | dict[str, Material],
    comm: MPI.Comm | None = None,
    plane: str = "stress",
    quadrature: str = "exact",
    heat: Temperatures | None = None,
) -> Body:
    """Stiffness and mass of one body, or of several that share nodes.

    Args:
        name: a body of the mesh, or several.
        material: one for all, or one a body.
        comm: ranks that share the mesh; all of them when left out.
        plane: "stress" or "strain" (plane meshes only); the mesh's depth multiplies both matrices.
        quadrature: "exact" (up to the curvature of elements), or "ccx": degree 2 for both matrices,
            as CalculiX integrates C3D10.
        heat: temperatures of the mesh, which decide on properties; their thermal stress is no part
            of the matrices, see `rotation.body_under_rotation`.

    Raises:
        InputError: unknown body, unknown element type, turned-over elements, more than memory can
            hold.
    """
    names = (name,) if isinstance(name, str) else tuple(name)
    materials = material if isinstance(material, dict) else dict.fromkeys(names, material)
    comm = comm or MPI.COMM_WORLD
    own = _check_materials(mesh, names, materials)
    if heat is not None and plane == "strain":
        raise InputError("temperature: not known in plane strain, expected plane stress or a solid")
    _check_cell_type(mesh)
    nodes = np.unique(np.concatenate([mesh.bodies[n] for n in names]))
    cut = cut_face_nodes(mesh, nodes)
    plan = check_memory(mesh.dimension * len(nodes), comm, cut=mesh.dimension * cut)
    formulation = Formulation(plane, quadrature, heat)
    return replace(_assemble_bodies(mesh, own, comm, formulation), plan=plan)


def _assemble_bodies(
    mesh: Mesh,
    materials: dict[str, Material],
    comm: MPI.Comm,
    formulation: Formulation,
    piece: bool = False,
) -> Body:
    """The bodies that have materials.

    Args:
        piece: the mesh is a piece of one of mixed shapes, whose cells share no nodes.
    """
    cells, used, local = _check_cells(mesh, tuple(materials))
    places = mesh.points[used, : mesh.dimension]
    domain, origin = build_mesh(comm, mesh.cell_type, local, places, cut=not piece)
    space = vector_space(domain, CELLS[mesh.cell_type][1])
    rows = _block_rows(mesh, space, used[local], origin, comm)
    pieces: tuple[Piece, ...] = ()
    if any(n in mesh.whole for n in materials):
        K, mass, pieces = _sum_of_pieces(mesh, materials, space, rows, formulation)
    else:
        K, mass = _matrices(mesh, materials, space, cells, formulation)
    return Body(
        mesh,
        " + ".join(materials),
        materials,
        mesh.dimension,
        K,
        mass,
        rows,
        space,
        formulation.plane,
        comm,
        heat=formulation.heat,
        pieces=pieces,
    )


def _matrices(
    mesh: Mesh,
    materials: dict[str, Material],
    space: Any,
    cells: np.ndarray,
    formulation: Formulation,
) -> tuple[PETSc.Mat, Mass]:
    """Stiffness and mass of cells of one shape.

    Args:
        space: of the displacements.
        cells: (nc, k) all of them.
    """
    heat = formulation.heat
    stiff, mass = degrees(mesh, cells, formulation.quadrature, heat)
    law, rho, depth = properties(
        mesh, materials, space.mesh, formulation.plane, heat, (stiff, mass)
    )
    u = ufl.TrialFunction(space)
    v = ufl.TestFunction(space)
    energy = depth * ufl.inner(law(ufl.sym(ufl.grad(u))), ufl.sym(ufl.grad(v)))
    K = assemble_matrix(energy * ufl.dx(metadata={"quadrature_degree": stiff}))
    return K, _mass_matrix(space, CELLS[mesh.cell_type][1], depth * rho, mass)


def _sum_of_pieces(
    mesh: Mesh,
    materials: dict[str, Material],
    space: Any,
    rows: np.ndarray,
    formulation: Formulation,
) -> tuple[PETSc.Mat, Mass, tuple[Piece, ...]]:
    """Stiffness and mass of a body of mixed shapes, and what they were summed from.

    Args:
        space: whose rows the matrices have.
        rows: (n_points,) the row of each point.
    """
    heat = formulation.heat
    pieces = []
    total: list[PETSc.Mat] = []
    for part, spread in pieces_of_one_shape(mesh, tuple(materials)):
        own = {name: materials[name] for name in part.bodies}
        warm = None if heat is None else replace(heat, nodal=np.asarray(spread @ heat.nodal))
        body = _assemble_bodies(
            part, own, space.mesh.comm, replace(formulation, heat=warm), piece=True
        )
        piece = Piece(body, spread)
        gathered = [_gathered(piece, (space, rows), matrix) for matrix in (body.K, body.M)]
        total = (
            gathered if not total else [_added(*both) for both in zip(total, gathered, strict=True)]
        )
        pieces.append(piece)
    K, M = total
    return K, Mass(space.mesh.geometry.dim, whole=M), tuple(pieces)


def sum_matrices(body: Body, matrices: Iterable[PETSc.Mat]) -> PETSc.Mat:
    """The matrix of a body of mixed shapes from those of its pieces, which are destroyed."""
    total = None
    for piece, matrix in zip(body.pieces, matrices, strict=True):
        part = _gathered(piece, (body.space, body.rows), matrix)
        total = part if total is None else _added(total, part)
    return total


def _gathered(piece: Piece, layout: tuple[Any, np.ndarray], matrix: PETSc.Mat) -> PETSc.Mat:
    """A piece's matrix on the rows of the whole body; the given one is destroyed."""
    space, rows = layout
    index_map = space.dofmap.index_map
    dim = piece.body.dim
    size = (dim * index_map.size_local, dim * index_map.size_global)
    spread = spread_matrix(piece.spread, rows, piece.body.rows, matrix, size)
    out = matrix.ptap(spread)
    out.setBlockSize(dim)
    spread.destroy()
    matrix.destroy()
    return out


def _added(total: PETSc.Mat, more: PETSc.Mat) -> PETSc.Mat:
    """The sum, in the place of both."""
    total.axpy(1.0, more, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    more.destroy()
    return total


def _mass_matrix(
    space: Any,
    degree: int,
    density: Any,
    quadrature: int,
) -> Mass:
    """The mass, assembled for one direction where its nodes can be numbered as those of all are: a
    ninth of the work.
    """
    one = one_component(space, degree)
    u = ufl.TrialFunction(one or space)
    v = ufl.TestFunction(one or space)
    measure = ufl.dx(metadata={"quadrature_degree": quadrature})
    M = assemble_matrix(density * ufl.inner(u, v) * measure)
    dim = space.mesh.geometry.dim
    if one is None:
        return Mass(dim, whole=M)
    mass = Mass(dim, of_one_direction=M)
    if space.mesh.comm.size > 1:
        # no rank may find itself alone in making it
        mass.matrix()
    return mass


def properties(
    mesh: Mesh,
    materials: dict[str, Material],
    domain: Any,
    plane: str,
    heat: Temperatures | None,
    degree: tuple[int, int],
) -> tuple[Law, Any, Any]:
    """Stress from strain, density [kg/m^3] of the cells of this rank, and the depth [m], for forms.

    Args:
        degree: of the quadratures in which stress and density stand.
    """
    stiff, mass = degree
    temperature = cell_temperatures(mesh, materials, domain, heat, mass)
    owner = material_numbers(mesh, materials, domain)
    rho = form_coefficient(
        domain, evaluate_materials(materials, owner, temperature, density_at), mass
    )
    depth = dolfinx.fem.Constant(domain, float(mesh.depth if mesh.dimension == 2 else 1.0))
    return elastic_law(mesh, materials, domain, plane, heat, stiff), rho, depth


def body_properties(body: Body, degree: tuple[int, int]) -> tuple[Law, Any, Any]:
    """``properties`` of a body."""
    return properties(body.mesh, body.material, body.space.mesh, body.plane, body.heat, degree)


def cells_of(body: Body) -> np.ndarray:
    """(nc, k) mesh node numbers of all cells of the body, gmsh's order."""
    return np.concatenate([body.mesh.bodies[n] for n in body.material])


def rigid_modes(body: Body) -> np.ndarray:
    """(n_points, dim, d) translations and rotations about the body's centre; zero on other nodes. d
    is 3 or 6.
    """
    inside = body.rows >= 0
    x = np.where(inside[:, None], body.mesh.points - body.mesh.points[inside].mean(0), 0.0)[
        :, : body.dim
    ]
    moves = [np.where(inside[:, None], np.eye(body.dim)[i], 0.0) for i in range(body.dim)]
    planes = [(0, 1)] if body.dim == 2 else [(1, 2), (2, 0), (0, 1)]
    for a, b in planes:
        turn = np.zeros_like(x)
        turn[:, a], turn[:, b] = -x[:, b], x[:, a]
        moves.append(turn / abs(x).max())
    return np.stack(moves, axis=2)


def _check_materials(
    mesh: Mesh,
    names: tuple[str, ...],
    materials: dict[str, Material],
) -> dict[str, Material]:
    """The material of each body named."""
    for n in names:
        if n not in mesh.bodies:
            raise InputError(f"the mesh has no body '{n}'{suggestion(n, mesh.bodies)}")
        if n not in materials:
            raise InputError(f"body '{n}' has no material{suggestion(n, materials)}")
    return {n: materials[n] for n in names}


def _check_cell_type(mesh: Mesh) -> None:
    if mesh.cell_type not in CELLS:
        raise InputError(
            f"elements of type '{mesh.cell_type}' are not "
            f"supported{suggestion(mesh.cell_type, CELLS)}"
        )


def _check_cells(
    mesh: Mesh,
    names: tuple[str, ...],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells, their node numbers without gaps, and the cells in these; everything that can be wrong
    with them is found here.
    """
    cells = np.concatenate([mesh.bodies[n] for n in names])
    if not np.isfinite(mesh.points[cells]).all():
        raise InputError("the mesh has nodes whose coordinates are not finite numbers")
    _check_jacobians(mesh, cells)
    used, local = np.unique(cells, return_inverse=True)
    return cells, used, local.reshape(cells.shape)


def _check_jacobians(mesh: Mesh, cells: np.ndarray) -> None:
    """dolfinx takes elements that are turned over in part without a word; this does not."""
    d = mesh.dimension
    bad = []
    for block in np.array_split(np.arange(len(cells)), len(cells) // 5000 + 1):
        _, tangents, _ = shape.geometry(mesh.cell_type, mesh.points[cells[block], :d], 4)
        det = np.linalg.det(tangents)
        bad.append(block[det.min(1) * det.max(1) <= 0])
    bad = np.concatenate(bad)
    if len(bad):
        at = np.array2string(mesh.points[cells[bad[0]]].mean(0), precision=4)
        raise InputError(
            f"{len(bad)} of {len(cells)} elements are turned over (the first near {at} m), "
            "expected positive Jacobians; straighten their edges or refine the mesh there"
        )


def degrees(
    mesh: Mesh,
    cells: np.ndarray,
    quadrature: str,
    heat: Temperatures | None = None,
) -> tuple[int, int]:
    """Quadrature degrees of stiffness and mass; elements with straight sides need less, properties
    that vary with a temperature need more.
    """
    if quadrature not in ("exact", "ccx"):
        raise InputError(f"quadrature is '{quadrature}'{suggestion(quadrature, ('exact', 'ccx'))}")
    _, degree = CELLS[mesh.cell_type]
    if quadrature == "ccx":
        return 2, 2
    more = EXTRA_DEGREE if heat is not None and heat.varies else 0
    simplex = mesh.cell_type.startswith(("tri", "tet"))
    if not simplex:
        return 2 * degree + more, 2 * degree + 2 + more
    if degree == 1 or _has_straight_cells(mesh, cells):
        return 2 * degree - 2 + more, 2 * degree + more
    return 4 + more, 2 * degree + mesh.dimension * (degree - 1) + more


def _has_straight_cells(mesh: Mesh, cells: np.ndarray) -> bool:
    """True where every node lies where the corners put it."""
    k = shape.corner_count(mesh.cell_type)
    linear, _ = shape.tabulate(
        mesh.cell_type.rstrip("0123456789"), shape.reference_nodes(mesh.cell_type)
    )
    x = mesh.points[cells]
    return bool(
        abs(x - np.einsum("qk,ckg->cqg", linear, x[:, :k])).max()
        < 1e-10 * np.ptp(mesh.points, axis=0).max()
    )


def _block_rows(
    mesh: Mesh,
    space: Any,
    cells: np.ndarray,
    origin: np.ndarray,
    comm: MPI.Comm,
) -> np.ndarray:
    """PETSc block row of each mesh node, found through the cells: dofmap and input list the same
    nodes.
    """
    permutation = dolfinx.cpp.io.perm_gmsh(
        dolfinx.cpp.mesh.to_type(CELLS[mesh.cell_type][0]), cells.shape[1]
    )
    blocks = cell_dofs(space).astype(np.int32)
    rows = np.full(len(mesh.points), -1, np.int64)
    rows[cells[origin][:, permutation].ravel()] = space.dofmap.index_map.local_to_global(
        blocks.ravel()
    )
    comm.Allreduce(MPI.IN_PLACE, rows, MPI.MAX)
    return rows
