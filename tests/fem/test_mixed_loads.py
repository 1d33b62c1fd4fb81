"""Loads, stresses, error estimates and halved meshes of cells of mixed shapes, of both orders:
closed forms, and CalculiX on the same nodes (ccx_decks.json, ``python benchmarks/fem_decks.py``).
"""

import json
from dataclasses import replace
from pathlib import Path

import decks
import numpy as np
import pytest
from mixed import chequered, cut, row, skew
from structured import box, face_areas, pair, sector, turn

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain, expand_to_mesh, in_step, restrict_load
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.loads import body_volume, surface_load
from bladefem.fem.modes import modes
from bladefem.fem.refinement import refine_uniformly
from bladefem.fem.shape_functions import reference_nodes
from bladefem.fem.stiffness_error import frequency_errors, stiffness_error
from bladefem.fem.stress import gauss_stress, nodal_stress, stress_jumps, von_mises
from bladefem.fem.stress_error import mesh_error
from bladefem.fem.supports import AreaSpring, supported
from bladefem.fem.temperature import Temperatures
from bladefem.scene.tables import Material
from geometry.imported import mesh_of_raw
from geometry.raw_mesh import RawMesh
from geometry.solid_cells import solid_cells
from geometry.whole_cells import own_cells, own_facets

GOLDEN = json.loads((Path(__file__).parent / "ccx_decks.json").read_text())["pressed"]
STEEL = Material(nu=0.3)
SIZE = (0.5, 0.1, 0.1)
FACES = ("x0", "x1", "y0", "y1", "z0", "z1")
NORMALS = dict(
    zip(FACES, np.repeat(np.eye(3), 2, axis=0) * np.tile([[-1.0], [1.0]], (3, 1)), strict=True)
)


def bend(points):
    """Curved faces."""
    x, y, z = points.T
    a = x / SIZE[0]
    return np.column_stack([x, y + 0.05 * a**2 + 0.2 * a * z, z * (1 + 0.2 * a) * (1 + 3 * y)])


def statically_held(body, load):
    """The displacements [m] of a body held at three nodes so that nothing resists its strain."""
    mesh = body.mesh
    x = mesh.points
    a = int(abs(x - x.min(axis=0)).sum(axis=1).argmin())
    b = int((x - x[a])[:, 0].argmax())
    line = (x[b] - x[a]) / np.linalg.norm(x[b] - x[a])
    off = x - x[a] - np.outer((x - x[a]) @ line, line)
    c = int(np.linalg.norm(off, axis=1).argmax())
    K = np.asarray(body.K.convert("dense").getDenseArray())[body.scalar_rows][:, body.scalar_rows]
    # six rigid motions are taken out by as many equations at three nodes
    turns = np.array([np.cross(np.eye(3)[i], x) for i in range(3)]).transpose(1, 2, 0)
    rigid = np.concatenate([np.tile(np.eye(3), (len(x), 1, 1)), turns], axis=2).reshape(-1, 6)
    at = np.concatenate([3 * node + np.arange(3) for node in (a, b, c)])
    held = np.zeros((len(rigid), 6))
    held[at] = rigid[at]
    whole = np.block([[K, held * 1e11], [held.T * 1e11, np.zeros((6, 6))]])
    return np.linalg.solve(whole, np.concatenate([load, np.zeros(6)]))[:-6].reshape(-1, 3)


@pytest.mark.parametrize("order", [1, 2])
def test_patch_test_of_forces(order):
    """Tractions of one stress on all faces of a skewed row: that stress everywhere."""
    body = assemble(row(map=skew, order=order), "blade", STEEL, MPI.COMM_SELF)
    rng = np.random.default_rng(3)
    stress = rng.normal(size=(3, 3))
    stress = 1e6 * (stress + stress.T)
    matrix = np.array([[1.0, 0.1, 0.05], [0.2, 1.0, 0.1], [0.1, 0.3, 1.0]])
    load = np.zeros(3 * len(body.mesh.points))
    for face, normal in NORMALS.items():
        outward = np.linalg.solve(matrix, normal)
        load += surface_load(body, face, traction=stress @ outward / np.linalg.norm(outward))
    u = statically_held(body, load)
    exact = stress[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
    recovered = nodal_stress(body, u)
    np.testing.assert_allclose(recovered, np.tile(exact, (len(u), 1)), atol=1e-8 * abs(exact).max())
    found = gauss_stress(body, u)
    assert found.stress.shape[0] == len(body.mesh.bodies["blade"])
    np.testing.assert_allclose(
        found.stress, np.broadcast_to(exact, found.stress.shape), atol=1e-8 * abs(exact).max()
    )
    assert found.volume.sum() == pytest.approx(5e-3 * np.linalg.det(matrix), rel=1e-10)
    # nothing is uncertain
    assert stress_jumps(body, u, recovered).max() < 1e-7 * abs(exact).max()
    # one value a cell of first order fits no more than a mean at a corner
    assert order == 1 or mesh_error(body, u, recovered, 5) < 1e-7
    # inside, where no traction of the faces counts
    skin = np.unique(np.concatenate([body.mesh.faces[face].ravel() for face in FACES]))
    held = replace(body.mesh, nodes={"skin": skin})
    body = replace(body, mesh=held, hold="skin")
    shape = u / np.sqrt((u**2).sum())
    energy = shape.ravel() @ dense(body) @ shape.ravel()
    assert stiffness_error(body, shape[None], np.zeros(1))[0, 0].real < 1e-12 * energy
    loaded = replace(body, hold="")
    assert stiffness_error(loaded, shape[None], np.zeros(1))[0, 0].real > 1e-3 * energy


def dense(body):
    rows = body.scalar_rows
    return np.asarray(body.K.convert("dense").getDenseArray())[rows][:, rows]


@pytest.mark.parametrize("order", [1, 2])
def test_pressure_on_all_faces_of_distorted_cells(order):
    """The stress is the pressure in all directions, whatever the shape of the faces."""
    mesh = row(order=order, corners_to=bend)
    body = assemble(mesh, "blade", STEEL, MPI.COMM_SELF)
    load = sum(surface_load(body, face, pressure=2e6) for face in FACES)
    assert abs(load.reshape(-1, 3).sum(axis=0)).max() < 1e-9 * abs(load).max()
    stress = nodal_stress(body, statically_held(body, load))
    exact = np.tile([-2e6] * 3 + [0.0] * 3, (len(stress), 1))
    np.testing.assert_allclose(stress, exact, atol=1e-7 * 2e6)


@pytest.mark.parametrize("order", [1, 2])
def test_linear_displacements_on_curved_cells(order):
    """The stress is Hooke's at all points and nodes; the closed surface has no resultant."""
    body = assemble(row(order=order, map=bend), "blade", STEEL, MPI.COMM_SELF)
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    u = body.mesh.points @ gradient.T
    strain = (gradient + gradient.T) / 2
    lam = STEEL.E * STEEL.nu / (1 + STEEL.nu) / (1 - 2 * STEEL.nu)
    stress = STEEL.E / (1 + STEEL.nu) * strain + lam * np.trace(strain) * np.eye(3)
    exact = np.tile(stress[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]], (len(u), 1))
    np.testing.assert_allclose(nodal_stress(body, u), exact, atol=1e-10 * abs(exact).max())
    load = sum(surface_load(body, face, pressure=1.0) for face in FACES).reshape(-1, 3)
    assert abs(load.sum(axis=0)).max() < 1e-12
    moment = np.cross(body.mesh.points, load).sum(axis=0)
    assert abs(moment).max() < 1e-12


def test_forces_are_those_of_the_quadrilaterals():
    """Four corners 1/36, edges 1/9, centre 4/9 of the force on a square; springs likewise hold
    what they should.
    """
    body = assemble(row(), "blade", STEEL, MPI.COMM_SELF)
    share = np.sort(face_areas(body, "x0"))[-9:] / 0.01
    np.testing.assert_allclose(share, [1 / 36] * 4 + [1 / 9] * 4 + [4 / 9], rtol=1e-12)
    on = supported(body, "", [AreaSpring("x0", 1e12, 4e11)])
    K = np.asarray(on.spring.convert("dense").getDenseArray())[on.scalar_rows][:, on.scalar_rows]
    for direction, stiffness in enumerate((1e12, 4e11, 4e11)):
        moved = np.zeros_like(body.mesh.points)
        moved[:, direction] = 1.0
        assert moved.ravel() @ K @ moved.ravel() == pytest.approx(0.01 * stiffness, rel=1e-12)


def ring(divisions, pattern, pressed=True):
    """An eighth of a thick ring, 0.1 to 0.2 m: the mesh, and Lame's stresses of a pressure of 10
    MPa in its bore (n, 2): hoop, radial.
    """
    cubes = sector(8, divisions, "hexahedron27", inner=0.1, outer=0.2, width=0.01)
    mesh = cut(cubes, divisions, pattern)
    r = np.hypot(*mesh.points[:, :2].T)
    part = 1e7 * 0.01 / (0.04 - 0.01)
    return mesh, np.column_stack([part * (1 + 0.04 / r**2), part * (1 - 0.04 / r**2)])


def solved(mesh, load):
    """Displacements of nodal diameter 0, nothing clamped."""
    body = assemble(mesh, "blade", STEEL, MPI.COMM_SELF)
    con = in_step(body, None)
    force = restrict_load(con, load(body).reshape(-1, 1))
    return body, expand_to_mesh(con, compliance(flexible(con), force))[:, :, 0]


@pytest.mark.parametrize("pattern", [lambda i, j: "w", lambda i, j: "p", chequered])
def test_thick_ring_under_pressure(pattern):
    """Lame. Stresses at the nodes by half the size of the cells: a third of the error or less;
    measured 1.5 % of the largest at 6 by 4 cells, and displacements 4e-5 at 12 by 8.
    """
    errors = []
    for divisions in ((6, 4, 1), (12, 8, 1)):
        mesh, exact = ring(divisions, pattern)
        body, u = solved(mesh, lambda body: surface_load(body, "x0", pressure=1e7))
        stress = nodal_stress(body, u)
        x, y = mesh.points[:, 0], mesh.points[:, 1]
        r = np.hypot(x, y)
        c, s = x / r, y / r
        hoop = s**2 * stress[:, 0] + c**2 * stress[:, 1] - 2 * s * c * stress[:, 3]
        radial = c**2 * stress[:, 0] + s**2 * stress[:, 1] + 2 * s * c * stress[:, 3]
        errors.append(abs(np.column_stack([hoop, radial]) - exact).max() / exact.max())
    assert errors[0] < 0.02 and errors[1] < errors[0] / 3
    E, nu = STEEL.E, STEEL.nu
    outward = 1e7 * 0.01 / (0.04 - 0.01) / E * ((1 - nu) * r + (1 + nu) * 0.04 / r)
    moved = np.einsum("nd,nd->n", u[:, :2], np.column_stack([c, s]))
    np.testing.assert_allclose(moved, outward, atol=1e-4 * outward.max())
    # the estimate of a stress at the outside, where nothing presses
    angle = np.arctan2(y, x)
    free = np.flatnonzero((abs(r - 0.2) < 1e-9) & (angle > 0.1) & (angle < np.pi / 4 - 0.1))
    for node in free[:: len(free) // 4]:
        found = mesh_error(body, u, stress, node, r < 0.1999)
        true = abs(von_mises(stress[node]) / exact[node, 0] - 1)
        assert 0.5 * true <= found <= 0.05


@pytest.mark.parametrize("shapes", ["mixed", "hexahedra", "wedges", "pyramids"])
def test_error_of_frequencies(shapes):
    """Estimated at 1 to 2 times the true one, two elements across a clamped bar."""
    fine = modes(constrain(assemble(box((20, 4, 4), SIZE, "hexahedron27"), "blade", STEEL)), 4)
    mesh = box((10, 2, 2), SIZE, "hexahedron27")
    if shapes == "mixed":
        mesh = refine_uniformly(row())
    elif shapes != "hexahedra":
        mesh = cut(mesh, (10, 2, 2), lambda i, j: shapes[0])
    body = assemble(mesh, "blade", STEEL)
    found = modes(constrain(body), 4)
    estimate = frequency_errors(body, found)
    true = found.frequencies / fine.frequencies - 1
    assert (estimate > 0.9 * true).all() and (estimate < 2.1 * true).all()


@pytest.mark.parametrize("order", [1, 2])
def test_halved_meshes(order):
    """The same volume and faces, children of the right shapes, faces that still belong to cells."""
    mesh = row(map=bend, order=order)
    mesh = replace(
        mesh,
        parts={"first": np.flatnonzero(mesh.points[mesh.bodies["blade"], 0].max(axis=1) < 0.11)},
    )
    fine = refine_uniformly(refine_uniformly(mesh))
    words = ["tetra", "pyramid", "wedge", "hexahedron"]
    count = {own.word.rstrip("0123456789"): len(own.cells) for own in own_cells(fine, ("blade",))}
    # pyramids: 5, 30, 180; tetrahedra: 2, 2 * 8 + 5 * 4, 36 * 8 + 30 * 4
    assert [count[word] for word in words] == [408, 180, 4 * 64, 2 * 64]
    assert body_volume(fine, "blade") == pytest.approx(body_volume(mesh, "blade"), rel=1e-12)
    coarse, body = (assemble(some, "blade", STEEL) for some in (mesh, fine))
    for face in FACES:
        areas = [face_areas(some, face).sum() for some in (coarse, body)]
        assert areas[1] == pytest.approx(areas[0], rel=1e-9)
        assert not len(own_facets(fine, ("blade",), fine.faces[face])[1])
    np.testing.assert_array_equal(np.sort(fine.nodes["clamp"]), np.unique(fine.faces["x0"]))
    inside = fine.points[fine.bodies["blade"][fine.parts["first"]]].max(axis=(0, 1))[0]
    assert inside == pytest.approx(0.1) and len(fine.parts["first"]) == 64 * len(
        mesh.parts["first"]
    )
    ours, theirs = (modes(constrain(some), 4).frequencies for some in (body, coarse))
    assert (ours < theirs).all()


@pytest.mark.parametrize("order", [1, 2])
def test_order_of_frequencies(order):
    """Stretching of a bar without lateral strain, c / 4 l: the error falls by 2^(2 p) each time."""
    material = Material(nu=0.0)
    exact = np.sqrt(material.E / material.rho) / (4 * SIZE[0])
    mesh = row(order=order)
    errors = []
    for _ in range(3 if order == 1 else 2):
        body = assemble(mesh, "blade", material)
        on = supported(
            body, "clamp", directions=[("y0", "y"), ("y1", "y"), ("z0", "z"), ("z1", "z")]
        )
        found = modes(constrain(on), 8).frequencies
        errors.append(abs(found / exact - 1).min())
        mesh = refine_uniformly(mesh)
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert abs(rates[-1] - 2 * order) < 0.35, rates


def test_cyclic_sector_in_halves():
    """Pairs are found again, and frequencies fall towards those of a fine mesh of hexahedra."""
    cubes = sector(9, (3, 3, 1), "hexahedron27", bump=0.2)
    mesh = cut(cubes, (3, 3, 1), chequered)
    mesh = replace(
        mesh, pairs={"cyclic": pair(mesh, "cyclic_low", "cyclic_high", mesh.sector.rotation)}
    )
    fine = refine_uniformly(mesh)
    assert fine.pairs["cyclic"].nodes.shape[1] == len(np.unique(fine.faces["cyclic_low"]))
    right = assemble(sector(9, (12, 12, 4), "hexahedron27", bump=0.2), "blade", STEEL)
    ours, theirs, exact = (
        modes(constrain(body, "clamp", 2), 4).frequencies
        for body in (assemble(fine, "blade", STEEL), assemble(mesh, "blade", STEEL), right)
    )
    assert (ours < theirs).all() and (ours > exact * (1 - 2e-4)).all()
    assert ((ours - exact) < 0.4 * (theirs - exact)).all()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("face", ["x0", "z0"])
@pytest.mark.parametrize("number", [0, 1])
def test_half_a_quadrilateral_in_halves(number, face, order):
    """Force and moments of a pressure on the half stay, on a skewed row."""
    mesh = row(map=skew, order=order)
    half = mesh.faces[face][number : number + 1]
    mesh = replace(mesh, faces={"seat": half})
    assert len(own_facets(mesh, ("blade",), half)[1]) == 1
    fine = mesh
    found = []
    for level in range(3):
        seat = fine.faces["seat"]
        assert len(seat) == 4**level
        body = assemble(fine, "blade", STEEL)
        load = surface_load(body, "seat", pressure=1.0).reshape(-1, 3)
        found.append([load.sum(axis=0), np.cross(fine.points, load).sum(axis=0)])
        fine = refine_uniformly(fine)
    assert 4e-3 < np.linalg.norm(found[0][0]) < 7e-3
    np.testing.assert_allclose(found[1:], found[:1] * 2, rtol=1e-10, atol=1e-14)


def test_three_corners_of_a_quadrilateral_are_no_face(tmp_path):
    """Of a node set over two sides of a box of hexahedra and wedges: the side that it holds, whole,
    and on no other one the half of an element.
    """
    divisions = (2, 2, 2)
    cubes = cut(box(divisions, (0.2, 0.2, 0.2), "hexahedron27"), divisions, lambda i, j: "hw"[i])
    low = np.flatnonzero(cubes.points[:, 0] < 1e-9)
    beside = np.flatnonzero(abs(cubes.points - [0.1, 0.0, 0.1]).max(axis=1) < 1e-9)
    held = np.union1d(low, beside)
    blocks = [(own.word, own.cells) for own in own_cells(cubes, ("blade",))]
    raw = RawMesh(cubes.points, blocks, {}, {"held": held})
    mesh = mesh_of_raw(raw, 1.0, 0, (0.0, 0.0, 1.0), "box")
    body = assemble(mesh, "blade", STEEL)
    assert not len(own_facets(mesh, ("blade",), mesh.faces["held"])[1])
    assert face_areas(body, "held").sum() == pytest.approx(0.04)
    assert set(held) <= set(mesh.nodes["held"])
    assert face_areas(assemble(refine_uniformly(mesh), "blade", STEEL), "held").sum() == (
        pytest.approx(0.04)
    )


@pytest.mark.parametrize("halvings", [0, 1])
def test_pressure_against_calculix(halvings):
    """C3D15 and C3D20 on the same nodes, which have no nodes in their faces: both tend to one
    state. Measured 2.1e-3 and 6e-4 of the largest displacement, 0.6 and 0.3 % of the stress as root
    mean square (by tetrahedra in the same nodes 8.5e-3 and 3e-3 of the displacement).
    """
    mesh = decks.pressed_mesh(halvings)
    body = assemble(mesh, "blade", Material(E=2.1e11, nu=0.3), MPI.COMM_SELF)
    con = constrain(body, "clamp")
    load = surface_load(body, "x1", pressure=decks.PRESSURE)
    force = restrict_load(con, load.reshape(-1, 1))
    u = expand_to_mesh(con, compliance(flexible(con), force))[:, :, 0]
    golden = GOLDEN[halvings]
    points = np.array(golden["points"])
    nodes = [int(abs(mesh.points - x).sum(axis=1).argmin()) for x in points]
    np.testing.assert_allclose(mesh.points[nodes], points, atol=1e-12)
    theirs = np.array(golden["displacements"])
    assert abs(u[nodes] - theirs).max() < (3e-3, 8e-4)[halvings] * abs(theirs).max()
    stress = np.array(golden["stresses"])
    apart = von_mises(nodal_stress(body, u)[nodes] - stress)
    assert np.sqrt((apart**2).mean()) < (2e-2, 1e-2)[halvings] * von_mises(stress).max()


def test_a_quadrilateral_of_first_order_that_faces_triangles_is_refused():
    cube = np.array([[0, 1, 2, 3, 4, 5, 6, 7]])
    points = np.vstack([reference_nodes("hexahedron"), (0.5, 0.5, 2)])
    roof = np.array([[4, 5, 6, 8], [4, 6, 7, 8]])
    raw = RawMesh(points, [("hexahedron", cube), ("tetra", roof)], {}, {})
    for how in ("keep", "promote"):
        with pytest.raises(InputError, match="quadrilateral faces .*triangles"):
            solid_cells(raw, "a.inp", how, np.array([0, 0, 1.0]))


@pytest.mark.parametrize("order", [1, 2])
def test_free_expansion_and_rotation_have_no_stress(order):
    """Of hot curved cells, and after a large rigid rotation; complex fields are real ones turned."""
    mesh = row(order=order, map=bend)
    warm = replace(STEEL, expansion=1e-5)
    hot = Temperatures(np.full(len(mesh.points), 400.0), 300.0)
    body = assemble(mesh, "blade", warm, MPI.COMM_SELF, heat=hot)
    free = 1e-3 * mesh.points
    assert abs(gauss_stress(body, free, heated=True).stress).max() < 1e-9 * warm.E * 1e-3
    vibrating = nodal_stress(body, free)
    expected = warm.E / (1 - 2 * warm.nu) * 1e-3
    np.testing.assert_allclose(vibrating[:, :3], expected, rtol=1e-9)
    np.testing.assert_allclose(nodal_stress(body, 1j * free), 1j * vibrating, atol=1e-12 * expected)
    turned = mesh.points @ turn(1.0) - mesh.points
    assert abs(nodal_stress(body, turned, large=True)).max() < 1e-9 * warm.E
