"""The last steps of every build: raise the order, extract, pair, snap, check and straighten,
report.
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.units import show

from .curving import second_order
from .extract_arrays import Groups, extract_mesh
from .matching import FaceMotion, match_faces, snap_slaves
from .mesh import Mesh, Sector
from .parameters import MAX_CELLS, MeshSize
from .quality import edge_of_middle, quality_report, shape_quality, straighten_cells

# shape quality that asks for a second round of optimisation
POOR_QUALITY = 0.1
# the same that asks for the other algorithm: between the teeth of a root with three lobes Delaunay
# leaves 0.02 where HXT leaves 0.04
DOUBTFUL_QUALITY = 0.05
# shape quality of a tetrahedron that is refused
REFUSED_QUALITY = 0.02
# of the element size, one after the other while flat cells are left
SIZE_FACTORS = (1.0, 0.8, 0.65)
ALGORITHMS = {"hxt": 10, "delaunay": 1}


def mesh_model(
    gmsh: ModuleType,
    groups: Groups,
    dimension: int,
    size: MeshSize,
) -> Mesh:
    """Generate the mesh of the current model, raise its order, and extract it.

    Where flat cells are left, solids are meshed anew by another algorithm, then with smaller
    elements, and notes say so.

    Raises:
        InputError: the elements are far too many, or flat ones are left whatever is tried.
    """
    if size.size:
        check_count(gmsh, dimension, size.scale * size.size)
    smaller = SIZE_FACTORS if dimension == 3 else SIZE_FACTORS[:1]
    notes: tuple[str, ...] = ()
    for factor in smaller:
        gmsh.option.setNumber("Mesh.MeshSizeFactor", factor * size.scale)
        gmsh.model.mesh.generate(2)
        if dimension == 3:
            notes = fill_with_tetrahedra(gmsh, groups, size.algorithm)
        first_order = _first_order_mesh(gmsh, groups, dimension)
        if _worst_shape(first_order) > REFUSED_QUALITY or factor == smaller[-1]:
            break
        gmsh.model.mesh.clear()
    refuse_flat(first_order)
    if size.order == 2:
        second_order(gmsh, size.curved)
    mesh = extract_mesh(gmsh, groups, dimension)
    if factor != 1.0:
        notes += (
            f"elements are {factor:g} times as large as asked for: parts that nearly coincide left "
            "flat ones otherwise",
        )
    return replace(mesh, report={**mesh.report, "notes": notes}) if notes else mesh


def fill_with_tetrahedra(
    gmsh: ModuleType,
    groups: Groups,
    first: str,
) -> tuple[str, ...]:
    """Fill the volumes with tetrahedra by one algorithm; by the other when the first fails or
    leaves poor cells, if those of the other are better.

    Returns:
        A note where it was the other.

    Raises:
        Exception: gmsh's own, when both algorithms fail.
    """
    (other,) = ALGORITHMS.keys() - {first}
    failure, worst = "", 0.0
    try:
        worst = _filled(gmsh, groups, first)
    # gmsh raises the bare class
    except Exception as error:
        failure = f"failed ({' '.join(str(error).split()) or 'no reason given'})"
    if worst > DOUBTFUL_QUALITY:
        return ()
    try:
        better = _filled(gmsh, groups, other) > worst
    except Exception:
        if failure:
            raise
        better = False
    if better or failure:
        failure = failure or f"left cells of shape quality {worst:.1g}"
        return (f"gmsh {failure} with mesh.algorithm = '{first}': meshed with '{other}'",)
    _filled(gmsh, groups, first)
    return ()


def _filled(gmsh: ModuleType, groups: Groups, algorithm: str) -> float:
    """Fill the volumes by one algorithm; the worst shape quality."""
    gmsh.option.setNumber("Mesh.Algorithm3D", ALGORITHMS[algorithm])
    gmsh.model.mesh.generate(3)
    return improve_tetrahedra(gmsh, groups)


def refuse_flat(mesh: Mesh) -> None:
    """Refuse a mesh with flat cells, and say where they are.

    Raises:
        InputError: a cell's shape quality is not above REFUSED_QUALITY.
    """
    cells = np.vstack(list(mesh.bodies.values()))
    shape = shape_quality(mesh.points, cells, mesh.cell_type)
    if shape.min() > REFUSED_QUALITY:
        return
    x, y, z = 1e3 * mesh.points[cells[shape.argmin()]].mean(axis=0)
    raise InputError(
        f"mesh.size: {np.count_nonzero(shape <= REFUSED_QUALITY)} flat cells are left (the worst "
        f"has shape quality {shape.min():.1g} at x, y, z = {x:.4g}, {y:.4g}, {z:.4g} mm, expected "
        f"above {REFUSED_QUALITY}); choose a smaller mesh.size, or change the parts that nearly "
        "coincide there"
    )


def check_count(gmsh: ModuleType, dimension: int, size: float) -> None:
    """Refuse a mesh that would never end.

    Raises:
        InputError: elements of this size [m] in all bodies would be more than MAX_CELLS.
    """
    low, high = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    mass = sum(gmsh.model.occ.getMass(d, tag) for d, tag in gmsh.model.getEntities(dimension))
    count = min(mass, np.prod((high - low)[:dimension])) / (
        0.12 * size**3 if dimension == 3 else 0.43 * size**2
    )
    if count > MAX_CELLS:
        raise InputError(
            f"mesh.size = {show(size, 'm')} gives about {count:.1g} cells, expected at most "
            f"{MAX_CELLS:.0e}; choose larger elements, or check the length unit"
        )


def improve_tetrahedra(gmsh: ModuleType, groups: Groups) -> float:
    """Let Netgen and then gmsh rework the tetrahedra when some are poor; the worst shape quality
    that is left.

    Either alone leaves more of them.
    """
    for method in ("Netgen", ""):
        if (worst := _worst_shape(_first_order_mesh(gmsh, groups, 3))) > POOR_QUALITY:
            return worst
        gmsh.model.mesh.optimize(method, True)
    return _worst_shape(_first_order_mesh(gmsh, groups, 3))


def _first_order_mesh(
    gmsh: ModuleType,
    groups: Groups,
    dimension: int,
) -> Mesh:
    """The present first-order mesh, without its faces."""
    return extract_mesh(gmsh, Groups(groups.bodies, {}), dimension)


def _worst_shape(mesh: Mesh) -> float:
    return min(
        shape_quality(mesh.points, cells, mesh.cell_type).min() for cells in mesh.bodies.values()
    )


def complete_mesh(
    mesh: Mesh,
    motions: dict[str, FaceMotion],
    size: float,
    sector: Sector | None = None,
    flat: tuple[str, ...] = (),
) -> Mesh:
    """Pair the faces, make the pairs exact, straighten doubtful cells, and write the report.

    Args:
        motions: by the name of the pair.
        size: element size [m], for the report.
        flat: plane faces, whose mid-side nodes go to the middle of their edges exactly (contact
            needs it).
    """
    mesh = replace(mesh, points=_flatten_faces(mesh, flat))
    pairs = {
        name: match_faces(mesh.points, mesh.faces, motion, mesh.dimension)
        for name, motion in motions.items()
    }
    mesh = replace(mesh, points=snap_slaves(mesh.points, pairs), pairs=pairs, sector=sector)
    points, straightened = straighten_cells(mesh)
    mesh = replace(mesh, points=snap_slaves(points, pairs))
    notes = {name: mesh.report[name] for name in ("notes",) if name in mesh.report}
    return replace(mesh, report={**quality_report(mesh, straightened, size), **notes})


def _flatten_faces(mesh: Mesh, names: tuple[str, ...]) -> np.ndarray:
    points = mesh.points.copy()
    ends = edge_of_middle(mesh)
    for name in names:
        nodes = np.unique(mesh.faces[name])
        middle = nodes[ends[nodes, 0] >= 0]
        points[middle] = points[ends[middle]].mean(axis=1)
    return points
