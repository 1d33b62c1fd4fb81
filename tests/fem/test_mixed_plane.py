"""Plane meshes of triangles and quadrilaterals together: closed forms that second-order cells hold
exactly, and the same frequencies as meshes of quadrilaterals alone.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, pair, sector

from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain, expand_to_mesh, restrict_load
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.loads import body_mass, centrifugal, surface_load
from bladefem.fem.modes import modes
from bladefem.fem.refinement import refine_uniformly
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.stiffness_error import frequency_errors
from bladefem.fem.stress import nodal_stress
from bladefem.scene.tables import Material
from geometry.imported import read_mesh
from geometry.raw_mesh import RawMesh
from geometry.session import gmsh_session
from geometry.solid_cells import solid_cells
from geometry.whole_cells import own_cells

STEEL = Material(nu=0.3)
SIZE = (0.5, 0.1)
DEPTH = 0.02
# of a unit of quad9 cut along its first diagonal
HALVES = ([0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7])


def mixed(mesh, order=2):
    """Every second quadrilateral of a mesh of quad9 cut into two triangles."""
    cells = mesh.bodies["blade"]
    cut = np.arange(len(cells)) % 2 == 0
    triangles = np.vstack([cells[cut][:, half] for half in HALVES])
    blocks = [("quad9", cells[~cut]), ("triangle6", triangles)]
    if order == 1:
        blocks = [("quad", cells[~cut][:, :4]), ("triangle", triangles[:, :3])]
    how = "refuse" if order == 2 else "keep"
    solids = solid_cells(RawMesh(mesh.points, blocks, {}, {}), "cut", how, np.array([0, 0, 1.0]))
    faces = {name: f if order == 2 else f[:, :2] for name, f in mesh.faces.items()}
    return replace(
        mesh,
        cell_type=solids.cell_type,
        bodies={"blade": solids.cells},
        faces=faces,
        whole={"blade": solids.whole},
    )


def as_triangles(mesh):
    """All quadrilaterals of a mesh of quad9 cut into two triangles."""
    halves = np.vstack([mesh.bodies["blade"][:, half] for half in HALVES])
    return replace(mesh, cell_type="triangle6", bodies={"blade": halves})


def strip(divisions=(5, 3), order=2):
    """A bar of odd numbers of cells, so that neighbours differ."""
    return mixed(box(divisions, SIZE, "quad9", depth=DEPTH), order)


def test_both_shapes_are_there():
    mesh = strip()
    count = {own.word: len(own.cells) for own in own_cells(mesh, ("blade",))}
    assert count == {"quad9": 7, "triangle6": 16}
    assert len(mesh.bodies["blade"]) == 30 and mesh.dimension == 2
    body = assemble(mesh, "blade", STEEL)
    assert [piece.body.mesh.cell_type for piece in body.pieces] == ["triangle6", "quad9"]
    assert body_mass(body) == pytest.approx(STEEL.rho * SIZE[0] * SIZE[1] * DEPTH)


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_bending_is_exact(plane):
    """Pure bending of a bar: M L^2 / (2 E I) at its end, E / (1 - nu^2) in plane strain."""
    body = assemble(strip(), "blade", STEEL, plane=plane)
    points = body.mesh.points
    curvature = 0.1
    nu = STEEL.nu if plane == "stress" else STEEL.nu / (1 - STEEL.nu)
    E = STEEL.E if plane == "stress" else STEEL.E / (1 - STEEL.nu**2)
    x, y = points[:, 0], points[:, 1] - SIZE[1] / 2
    u = curvature * np.column_stack([-x * y, (x**2 + nu * y**2) / 2])
    stress = nodal_stress(body, u)
    np.testing.assert_allclose(stress[:, 0], -E * curvature * y, atol=1e-9 * E * curvature)
    rows = body.scalar_rows
    K = np.asarray(body.K.convert("dense").getDenseArray())[rows][:, rows]
    inertia = DEPTH * SIZE[1] ** 3 / 12
    assert u.ravel() @ K @ u.ravel() == pytest.approx(E * inertia * curvature**2 * SIZE[0])
    force = (K @ u.ravel()).reshape(-1, 2)
    inner = (x > 1e-9) & (x < SIZE[0] - 1e-9)
    assert abs(force[inner]).max() < 1e-9 * abs(force).max()


@pytest.mark.parametrize("order", [1, 2])
def test_even_strain_and_pressure(order):
    """Pulled at its end: one stress everywhere, in cells of first order too."""
    body = assemble(strip(order=order), "blade", replace(STEEL, nu=0.0))
    con = constrain(body, "clamp")
    load = surface_load(body, "x1", pressure=-1e6)
    force = restrict_load(con, load.reshape(-1, 1))
    u = expand_to_mesh(con, compliance(flexible(con), force))[:, :, 0]
    stretch = 1e6 / STEEL.E
    nodes = np.unique(body.mesh.bodies["blade"])
    exact = body.mesh.points[nodes, 0] * stretch
    np.testing.assert_allclose(u[nodes, 0], exact, atol=1e-9 * stretch)


def test_frequencies_lie_between_those_of_both_shapes():
    """Of the same nodes as quadrilaterals and as triangles alone, and tend to their limit."""
    quads = box((9, 3), SIZE, "quad9", depth=DEPTH)
    mesh = mixed(quads)
    low, high, found, fine = (
        modes(constrain(assemble(some, "blade", STEEL)), 6).frequencies
        for some in (quads, as_triangles(quads), mesh, refine_uniformly(refine_uniformly(quads)))
    )
    assert (found > low).all() and (found < high).all()
    halved = modes(constrain(assemble(refine_uniformly(mesh), "blade", STEEL)), 6).frequencies
    assert (halved > fine).all() and (halved < found).all()
    # the corners of the clamp are singular: an order of 1 to 4
    assert ((halved - fine) < 0.6 * (found - fine)).all()


def test_a_wheel_of_both_shapes():
    """Cyclic frequencies, still and turning, near those of quadrilaterals; one centrifugal force."""
    cubes = sector(9, (7, 5), "quad9", bump=0.0)
    mesh = mixed(cubes)
    mesh = replace(
        mesh, pairs={"cyclic": pair(mesh, "cyclic_low", "cyclic_high", mesh.sector.rotation)}
    )
    for speed in (0.0, 500.0):
        found, right = (
            modes(constrain(turning(assemble(some, "blade", STEEL), speed), "x0", 2), 4)
            for some in (mesh, cubes)
        )
        np.testing.assert_allclose(found.frequencies, right.frequencies, rtol=7e-4)
    force, right = (centrifugal(assemble(some, "blade", STEEL), 500.0) for some in (mesh, cubes))
    np.testing.assert_allclose(
        force.reshape(-1, 2).sum(axis=0), right.reshape(-1, 2).sum(axis=0), rtol=1e-9
    )
    fine = refine_uniformly(mesh)
    assert fine.pairs["cyclic"].nodes.shape[1] == len(np.unique(fine.faces["cyclic_low"]))


def turning(body, speed):
    return body_under_rotation(body, speed, "x0") if speed else body


def test_error_of_frequencies():
    """As large a share of the true one as with triangles alone; the clamp's corners are singular."""
    quads = box((11, 3), SIZE, "quad9", depth=DEPTH)
    fine = assemble(refine_uniformly(refine_uniformly(quads)), "blade", STEEL)
    right = modes(constrain(fine), 4).frequencies
    for mesh in (mixed(quads), as_triangles(quads)):
        body = assemble(mesh, "blade", STEEL)
        found = modes(constrain(body), 4)
        share = frequency_errors(body, found) / (found.frequencies / right - 1)
        assert (share > 0.9).all() and (share < 2).all()


def test_a_mesh_of_gmsh_with_one_half_recombined(tmp_path):
    """Serendipity quadrilaterals next to triangles from a file, named edges, against a fine
    mesh.
    """
    file = tmp_path / "plate.msh"
    recombined_plate(file)
    mesh = read_mesh(file, linear="refuse")
    words = {own.word for own in own_cells(mesh, ("blade",))}
    assert words == {"triangle6", "quad9"}
    assert any("split into triangles" in note for note in mesh.report["notes"])
    found = modes(constrain(assemble(mesh, "blade", STEEL), "clamp"), 4).frequencies
    quads = refine_uniformly(box((10, 5), (0.2, 0.1), "quad9"))
    right = modes(constrain(assemble(quads, "blade", STEEL), "clamp"), 4).frequencies
    np.testing.assert_allclose(found, right, rtol=2e-3)


def recombined_plate(file):
    """Two squares side by side, the second of quadrilaterals, clamped at x = 0."""
    with gmsh_session() as gmsh:
        left = gmsh.model.occ.addRectangle(0, 0, 0, 0.1, 0.1)
        right = gmsh.model.occ.addRectangle(0.1, 0, 0, 0.1, 0.1)
        gmsh.model.occ.fragment([(2, left)], [(2, right)])
        gmsh.model.occ.synchronize()
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
        edges = gmsh.model.getEntitiesInBoundingBox(-1e-6, -1, -1, 1e-6, 1, 1, 1)
        gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, surfaces), "blade")
        clamp = gmsh.model.addPhysicalGroup(1, [tag for _, tag in edges])
        gmsh.model.setPhysicalName(1, clamp, "clamp")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.02)
        gmsh.model.mesh.setTransfiniteSurface(surfaces[-1])
        gmsh.model.mesh.setRecombine(2, surfaces[-1])
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(file))
