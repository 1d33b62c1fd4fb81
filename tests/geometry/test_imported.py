"""Users' own files: the same mesh back from every format, and clear words when something is
missing.
"""

import re
from dataclasses import replace

import meshio
import numpy as np
import pytest
from mesh_seating import solve_mesh_seating
from structured import box, sector
from writers import write_bdf, write_cdb, write_inp, write_step

import bladefem
from bladefem.cli.main import main
from bladefem.contact.resultants import resultant
from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.loads import body_volume
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material, Materials
from bladefem.study.pipeline import pipeline
from geometry.export import write_msh
from geometry.face_distance import distance_to_face
from geometry.imported import mesh_of_raw, read_mesh
from geometry.look import look_at, starting_scene
from geometry.parameters import Aerofoil, Disc, MeshSize, Plane, Platform, Shank, Wedge
from geometry.plane import plane_blades
from geometry.profile import turn_about_axis
from geometry.raw_mesh import RawMesh, from_gmsh_model
from geometry.renaming import renamed_raw
from geometry.sector import wedge_sector
from geometry.session import gmsh_session
from geometry.step_file import read_step, step_face_names
from geometry.step_unit import file_unit


def same(found, mesh, tolerance=1e-12):
    for name, pair in mesh.pairs.items():
        assert found.pairs[name].nodes.shape == pair.nodes.shape
        np.testing.assert_allclose(found.pairs[name].rotation, pair.rotation, atol=1e-12)
    assert {n: c.shape for n, c in found.bodies.items()} == {
        n: c.shape for n, c in mesh.bodies.items()
    }
    order, other = (np.lexsort(np.round(m.points, 9).T) for m in (found, mesh))
    np.testing.assert_allclose(found.points[order], mesh.points[other], atol=tolerance)
    assert found.report["min scaled jacobian"] == pytest.approx(
        mesh.report["min scaled jacobian"], rel=1e-6
    )


@pytest.mark.parametrize("version, binary", [(2.2, False), (4.1, False), (4.1, True)])
def test_a_mesh_of_gmsh_comes_back_as_it_was(coarse_sector, tmp_path, version, binary):
    write_msh(coarse_sector, tmp_path / "a.msh", version, binary)
    found = read_mesh(tmp_path / "a.msh", sectors=36)
    same(found, coarse_sector)
    assert {n: f.shape for n, f in found.faces.items()} == {
        n: f.shape for n, f in coarse_sector.faces.items()
    }
    for name, nodes in coarse_sector.nodes.items():
        np.testing.assert_allclose(
            found.points[found.nodes[name]], coarse_sector.points[nodes], atol=1e-12
        )


@pytest.mark.parametrize("suffix, write", [("inp", write_inp), ("cdb", write_cdb)])
def test_abaqus_and_ansys(coarse_sector, tmp_path, suffix, write):
    write(coarse_sector, tmp_path / f"a.{suffix}")
    same(read_mesh(tmp_path / f"a.{suffix}", sectors=36), coarse_sector)


def test_unit_axis_and_sense(coarse_sector, tmp_path):
    """A file in millimetres, engine axis along x, cyclic names the other way round."""
    swapped = {
        **coarse_sector.faces,
        "cyclic_low": coarse_sector.faces["cyclic_high"],
        "cyclic_high": coarse_sector.faces["cyclic_low"],
    }
    turned = 1e3 * coarse_sector.points[:, [2, 0, 1]]
    write_msh(replace(coarse_sector, points=turned, faces=swapped), tmp_path / "a.msh")
    found = read_mesh(tmp_path / "a.msh", 1e-3, 36, (1, 0, 0))
    pair = found.pairs["cyclic"]
    np.testing.assert_allclose(
        found.points[pair.nodes[1]], found.points[pair.nodes[0]] @ pair.rotation.T, atol=1e-14
    )
    middle = found.points[np.unique(found.bodies["blade"])].mean(axis=0)
    assert middle[0] > 0.2 and abs(middle[1]) < 0.01


def test_missing_group_is_named(coarse_sector, tmp_path):
    faces = {n: f for n, f in coarse_sector.faces.items() if n != "cyclic_high"} | {
        "cyclic_hihg": coarse_sector.faces["cyclic_high"]
    }
    write_msh(replace(coarse_sector, faces=faces), tmp_path / "a.msh")
    with pytest.raises(
        InputError, match=r"no face group 'cyclic_high'.*did you mean 'cyclic_hihg'"
    ):
        read_mesh(tmp_path / "a.msh", sectors=36)


def test_contact_faces_of_a_wheel_need_the_number_of_sectors(coarse_sector, tmp_path):
    write_msh(coarse_sector, tmp_path / "a.msh")
    with pytest.raises(InputError, match=r"imported\.sectors must be given"):
        read_mesh(tmp_path / "a.msh")


def test_seats_with_other_nodes_than_the_damper(coarse_sector, tmp_path):
    """A damper meshed on its own: the pairs have no matched nodes, the seating by mortar carries
    the same loads.
    """
    body = np.unique(coarse_sector.bodies["damper"])
    points, z = coarse_sector.points.copy(), coarse_sector.points[body, 2]
    half = np.ptp(z) / 2
    # along the flanks, about the middle of the length, so that the ends stay in place
    middle = (z.max() + z.min()) / 2
    points[body, 2] += 0.08 * half * np.sin(np.pi * (z - middle) / half)
    write_msh(replace(coarse_sector, points=points), tmp_path / "a.msh")
    found = read_mesh(tmp_path / "a.msh", sectors=36)
    assert all(found.pairs[name].nodes.shape == (2, 0) for name in ("this", "next"))
    assert found.pairs["cyclic"].nodes.shape == coarse_sector.pairs["cyclic"].nodes.shape
    ours, theirs = (
        solve_mesh_seating(mesh, Materials(), 838.0, normal=100.0)
        for mesh in (found, coarse_sector)
    )
    for a, b in zip(ours, theirs, strict=True):
        assert a.force.sum() == pytest.approx(100.0, rel=1e-9) and a.complementarity < 1e-9
        assert a.patch.area.sum() == pytest.approx(
            b.patch.area.sum(), rel=1e-4
        )  # slivers of the overlap
        for one, other in zip(resultant(a).force, resultant(b).force, strict=True):
            assert one == pytest.approx(other, abs=0.02)


def test_seats_that_do_not_touch_the_damper_are_refused(coarse_sector, tmp_path):
    points = coarse_sector.points.copy()
    points[np.unique(coarse_sector.bodies["damper"]), 0] -= 0.03
    write_msh(replace(coarse_sector, points=points), tmp_path / "a.msh")
    with pytest.raises(InputError, match="seat_right and damper_left do not match"):
        read_mesh(tmp_path / "a.msh", sectors=36)


def test_unmatched_cyclic_faces_are_refused(coarse_sector, tmp_path):
    write_msh(coarse_sector, tmp_path / "a.msh")
    with pytest.raises(InputError, match=r"cyclic_low and cyclic_high do not match.*periodic"):
        read_mesh(tmp_path / "a.msh", sectors=35)


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("a.msh", "no mesh", "a.msh"),
        ("a.xyz", "", "unknown kind"),
        ("a.inp", "*NODE\n1, 0, 0, 0\n", "cells are missing"),
        ("a.cdb", "/PREP7\n", "NBLOCK"),
        ("a.step", "ISO-10303-21;", "a.step"),
    ],
)
def test_unusable_files(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_step(tmp_path / name, MeshSize()) if name.endswith("step") else read_mesh(
            tmp_path / name
        )
    assert "\n" not in str(caught.value)


def test_a_plane_row_comes_back_with_its_pitch(tmp_path):
    mesh = plane_blades(Plane(), MeshSize())
    write_msh(mesh, tmp_path / "a.msh")
    found = read_mesh(tmp_path / "a.msh")
    same(found, mesh)
    assert found.sector.count == 0 and found.sector.shift == pytest.approx([0, Plane().pitch, 0])


def test_no_such_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "none.msh")


def test_step_block_in_millimetres_with_named_faces(tmp_path):
    write_step(tmp_path / "a.step", "block", {"blade": ["clamp", "tip"]})
    mesh = read_step(tmp_path / "a.step", MeshSize(size=0.01))
    assert {"clamp", "tip", "face_3"} <= set(mesh.faces) and set(mesh.bodies) == {"blade"}
    assert np.ptp(mesh.points, axis=0) == pytest.approx([0.1, 0.02, 0.03], rel=1e-6)
    same_numbers = read_step(tmp_path / "a.step", MeshSize(size=0.01), scale=1e-3)
    assert np.ptp(same_numbers.points, axis=0) == pytest.approx([0.1, 0.02, 0.03], rel=1e-6)


def test_solids_of_a_step_file_are_told_by_their_corners(tmp_path):
    """Its records may have numbers in any order: those that descend exchanged the names of blade
    and damper, and of their faces.
    """
    file = tmp_path / "a.step"
    write_step(file, "two", {"blade": [f"l{i}" for i in range(6)], "damper": ["s0"]})
    text = file.read_text()
    file.write_text(re.sub(r"#(\d+)", lambda found: f"#{5000 - int(found[1])}", text))
    mesh = read_step(file, MeshSize(size=0.05, order=1))
    extents = {name: np.ptp(mesh.points[np.unique(c)], axis=0) for name, c in mesh.bodies.items()}
    np.testing.assert_allclose(extents["blade"], [0.03, 0.04, 0.05], rtol=1e-6)
    np.testing.assert_allclose(extents["damper"], [0.01, 0.01, 0.02], rtol=1e-6)
    assert mesh.points[mesh.faces["l0"], 0].max() < 0.04 < mesh.points[mesh.faces["s0"], 0].min()


def test_the_unit_of_a_step_file_in_inches(tmp_path):
    """It is so many millimetres, whose record stands in the file too: with the right
    ``imported.scale`` a model was 25.4 times as large.
    """
    file = tmp_path / "a.step"
    write_step(file, "block", {})
    text = file.read_text()
    assert file_unit(text) == 1e-3
    inch = (
        r"#\1 = (CONVERSION_BASED_UNIT('INCH',#9001)LENGTH_UNIT()NAMED_UNIT(#9002));\n"
        "#9001 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#9003);\n"
        "#9002 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n"
        "#9003 = (LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));"
    )
    metric = r"#(\d+) = \( LENGTH_UNIT\(\) NAMED_UNIT\(\*\) SI_UNIT\(.MILLI.,.METRE.\) \);"
    text, changed = re.subn(metric, inch, text)
    file.write_text(text)
    assert changed == 1 and file_unit(text) == pytest.approx(0.0254, rel=1e-12)
    for scale in (1.0, 0.0254):
        mesh = read_step(file, MeshSize(size=2.0, order=1), scale=scale)
        np.testing.assert_allclose(np.ptp(mesh.points, axis=0), [2.54, 0.508, 0.762], rtol=1e-6)


def test_names_of_a_hollow_solid_are_read_with_their_letters(tmp_path):
    """As ISO 10303-21 writes a quotation mark and what is beyond ASCII."""
    file = tmp_path / "a.step"
    faces = ["Fl\\X2\\00FC\\X0\\gel 1", "7''", *[f"f{i}" for i in range(9)], "inside"]
    write_step(file, "hollow", {"blade": faces})
    names = step_face_names(file)
    assert names == {"Flügel 1", "7'", *[f"f{i}" for i in range(9)], "inside"}
    mesh = read_step(file, MeshSize(size=0.05, order=1), names=["clamp = Flügel 1"])
    assert "clamp" in mesh.faces and list(mesh.bodies) == ["blade"]
    assert mesh.points[mesh.faces["inside"]].max(axis=(0, 1))[0] < 0.021


def test_groups_get_the_users_names(coarse_sector, tmp_path):
    """STEP faces without a name, two to one; groups of a mesh file; old names that are not
    there.
    """
    write_step(tmp_path / "a.step", "block", {})
    size = MeshSize(size=0.01)
    plain = read_step(tmp_path / "a.step", size).faces
    mesh = read_step(tmp_path / "a.step", size, names=["clamp = face_1", "sides = face_3 + FACE_4"])
    assert len(mesh.faces["clamp"]) == len(plain["face_1"]) and "face_1" not in mesh.faces
    assert len(mesh.faces["sides"]) == len(plain["face_3"]) + len(plain["face_4"])
    write_msh(
        replace(coarse_sector, faces={**coarse_sector.faces, "bore": coarse_sector.faces["clamp"]}),
        tmp_path / "a.msh",
    )
    assert "foot" in read_mesh(tmp_path / "a.msh", sectors=36, names=["foot=bore"]).faces
    with pytest.raises(InputError, match=r"imported\.names: the file has no group 'face_9'"):
        read_step(tmp_path / "a.step", size, names=["clamp = face_9"])
    with pytest.raises(InputError, match='expected "new = old"'):
        read_mesh(tmp_path / "a.msh", sectors=36, names=["foot"])


def test_groups_whose_names_differ_in_case_alone_are_one():
    """Shells that a group has besides its cells do not take these away."""
    points = np.array([[x, y, z] for z in (0, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    cells = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11]])
    skin = np.array([[0, 1, 2, 3], [8, 9, 10, 11]])
    one, two = np.array([0]), np.array([1])
    raw = RawMesh(
        0.1 * points,
        [("hexahedron", cells), ("quad", skin)],
        {"Fan": [(0, one)], "FAN": [(0, two), (1, one)], "Ends": [(1, one)], "ends": [(1, two)]},
        {"foot": np.array([0, 1]), "Foot": np.array([2, 3])},
    )
    mesh = mesh_of_raw(raw, 1.0, 0, (0, 0, 1), "two.inp")
    assert len(mesh.parts["fan"]) == 2
    assert len(mesh.faces["ends"]) == 2
    assert list(mesh.nodes["foot"]) == [0, 1, 2, 3]
    renamed = renamed_raw(raw, {"disc": ["fan"]})
    assert sum(len(rows) for b, rows in renamed.groups["disc"] if b == 0) == 2
    damper = replace(raw, groups={"Damper": [(0, one), (1, one)]})
    assert len(mesh_of_raw(damper, 1.0, 0, (0, 0, 1), "two.inp").bodies["damper"]) == 1


def test_a_mirrored_sector_says_what_to_change(coarse_sector, tmp_path):
    """With the names as they were the next blade is on the other side, with names that fit the
    mirrored sides the damper is; both remedies give all pairs.
    """
    mirrored = replace(coarse_sector, points=coarse_sector.points * [1, -1, 1])
    write_inp(mirrored, tmp_path / "a.inp")
    with pytest.raises(InputError, match="expected the axis in the opposite direction"):
        read_mesh(tmp_path / "a.inp", sectors=36)
    pairs = read_mesh(tmp_path / "a.inp", sectors=36, axis=(0, 0, -1)).pairs
    assert {n: p.nodes.shape for n, p in pairs.items()} == {
        n: p.nodes.shape for n, p in coarse_sector.pairs.items()
    }
    side = {"left": "right", "right": "left"}
    faces = {
        f"{part}_{side[word]}" if word in side else name: face
        for name, face in mirrored.faces.items()
        for part, _, word in [name.rpartition("_")]
    }
    write_inp(replace(mirrored, faces=faces), tmp_path / "b.inp")
    with pytest.raises(InputError, match="turned by 10 deg about imported.axis, between seat_righ"):
        read_mesh(tmp_path / "b.inp", sectors=36)
    points = mirrored.points.copy()
    damper = np.unique(mirrored.bodies["damper"])
    points[damper] = points[damper] @ turn_about_axis(np.radians(10)).T
    write_inp(replace(mirrored, faces=faces, points=points), tmp_path / "c.inp")
    found = read_mesh(tmp_path / "c.inp", sectors=36).pairs
    assert found["this"].nodes.size and found["next"].nodes.size


def test_groups_of_one_name_in_a_gmsh_file(tmp_path):
    """Two of one dimension are one; a face keeps its name beside the body of the same."""
    with gmsh_session() as gmsh:
        boxes = [gmsh.model.occ.addBox(0, 0, z, 0.1, 0.1, 0.1) for z in (0.0, 0.2)]
        gmsh.model.occ.synchronize()
        for tag, volume in enumerate(boxes, 1):
            gmsh.model.addPhysicalGroup(3, [volume], tag)
            gmsh.model.setPhysicalName(3, tag, "damper" if tag == 2 else "blade")
        face = gmsh.model.getBoundary([(3, boxes[1])], oriented=False)[0][1]
        gmsh.model.addPhysicalGroup(2, [face], 1)
        gmsh.model.setPhysicalName(2, 1, "damper")
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.1)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(3)
        raw = from_gmsh_model(gmsh)
    mesh = mesh_of_raw(raw, 1.0, 0, (0, 0, 1), "a.msh")
    assert len(mesh.bodies["damper"]) and len(mesh.faces["damper"]) > 1


def test_a_file_in_millimetres_is_not_taken_for_metres(coarse_sector, tmp_path):
    write_msh(replace(coarse_sector, points=1e3 * coarse_sector.points), tmp_path / "a.msh")
    with pytest.raises(InputError, match=r"imported\.scale = 1: the model would be .* m across"):
        read_mesh(tmp_path / "a.msh", sectors=36)


def test_step_is_finer_on_contact_faces(tmp_path):
    """mesh.contact_size holds on a face that is called after a seat; far from it the elements are
    as large as ever.
    """
    write_step(tmp_path / "a.step", "block", {"blade": ["clamp", "seat_left"]})
    size = MeshSize(size=0.01, contact_size=0.003)
    mesh, plain = (
        read_step(tmp_path / "a.step", size),
        read_step(tmp_path / "a.step", MeshSize(size=0.01)),
    )
    fine, coarse = (len(found.faces["seat_left"]) for found in (mesh, plain))
    assert fine > 6 * coarse
    clamp = [len(found.faces["clamp"]) for found in (mesh, plain)]
    assert clamp[0] < 3 * clamp[1]
    scaled = read_step(tmp_path / "a.step", replace(size, scale=2.0))
    assert 2.5 < fine / len(scaled.faces["seat_left"]) < 6


def test_step_with_a_wrong_scale_is_refused_before_it_is_meshed(tmp_path):
    write_step(tmp_path / "a.step", "block", {})
    with pytest.raises(InputError, match=r"imported\.scale = 1: the model would be 100 m across"):
        read_step(tmp_path / "a.step", MeshSize(size=1e-3), scale=1.0 + 1e-9)
    with pytest.raises(InputError, match=r"mesh\.size.*cells"):
        read_step(tmp_path / "a.step", MeshSize(size=1e-3), scale=0.1)


def test_step_sector_finds_its_cyclic_faces_and_its_bore(tmp_path):
    disc = Disc()
    write_step(tmp_path / "a.step", "disc", {})
    mesh = read_step(tmp_path / "a.step", MeshSize(size=0.012), sectors=disc.sectors)
    pair = mesh.pairs["cyclic"]
    np.testing.assert_allclose(
        mesh.points[pair.nodes[1]], mesh.points[pair.nodes[0]] @ pair.rotation.T, atol=1e-14
    )
    radius = np.hypot(*mesh.points[np.unique(mesh.faces["clamp"])].T[:2])
    np.testing.assert_allclose(radius, disc.bore_radius, rtol=1e-6)


def test_half_a_wheel_has_two_cut_faces(tmp_path):
    """Half a turn carries each of them onto the other, and both were taken for both."""
    file = tmp_path / "a.step"
    write_step(file, "half", {})
    mesh = read_step(file, MeshSize(size=0.06, order=1), sectors=2)
    low, high = (mesh.points[np.unique(mesh.faces[n])] for n in ("cyclic_low", "cyclic_high"))
    assert np.ptp(low[:, 2]) == pytest.approx(0.05) and len(low) == len(high)
    x = np.concatenate([low @ low[0], -high @ low[0]])
    assert (x > 0).all(), "each on one side of the axis"


def test_all_pieces_of_a_bore_are_held(tmp_path):
    """One of two was, 20 of 50 mm: the first frequency was 1702 in place of 2487 Hz."""
    file = tmp_path / "a.step"
    write_step(file, "split", {})
    mesh = read_step(file, MeshSize(size=0.06, order=1), sectors=12)
    held = mesh.points[np.unique(mesh.faces["clamp"])]
    np.testing.assert_allclose(np.hypot(held[:, 0], held[:, 1]), 0.08, rtol=1e-6)
    assert np.ptp(held[:, 2]) == pytest.approx(0.05, rel=1e-6)
    seen = look_at(file)
    assert len(seen.bore) == 2 and f"clamp = {' + '.join(seen.bore)}" in starting_scene(seen)


@pytest.mark.parametrize("kind", ["hexahedron20", "hexahedron27", "hexahedron", "tetra", "tetra10"])
@pytest.mark.parametrize("suffix", ["msh", "med"])
def test_every_kind_of_cell_gives_the_same_mesh_back(kind, suffix, tmp_path):
    """Hexahedra of 20 nodes get those in the middle of faces and cells, where a mesh of 27 has them
    on flat faces.
    """
    whole = sector(6, (3, 2, 1), kind.replace("20", "27"), inner=0.1, outer=0.3, straight=True)
    written = without_centres(whole) if kind.endswith("20") else whole
    write_msh(written, tmp_path / "a.msh")
    if suffix == "med":
        with gmsh_session() as gmsh:
            gmsh.merge(str(tmp_path / "a.msh"))
            gmsh.write(str(tmp_path / "a.med"))
    found = read_mesh(tmp_path / f"a.{suffix}", sectors=6, linear="keep")
    assert (
        found.cell_type == whole.cell_type
        and found.pairs["cyclic"].nodes.shape == whole.pairs["cyclic"].nodes.shape
    )
    assert found.faces["clamp"].shape == whole.faces["clamp"].shape
    order, other = (np.lexsort(np.round(x, 9).T) for x in (found.points, turned_home(whole)))
    np.testing.assert_allclose(found.points[order], turned_home(whole)[other], atol=1e-12)
    assert body_volume(found, "blade") == pytest.approx(body_volume(whole, "blade"), rel=1e-12)


def without_centres(mesh):
    """The same mesh with the 20- and 8-node cells that older programs have."""
    return replace(
        mesh,
        cell_type="hexahedron20",
        bodies={n: c[:, :20] for n, c in mesh.bodies.items()},
        faces={n: f[:, :8] for n, f in mesh.faces.items()},
    )


def turned_home(mesh):
    """Points turned as the reader turns them, +x midway between the cyclic faces."""
    low, high = (
        mesh.points[np.unique(mesh.faces[f"cyclic_{name}"])].mean(axis=0)[:2]
        for name in ("low", "high")
    )
    return (
        mesh.points
        @ turn_about_axis(
            -np.arctan2(*(low / np.linalg.norm(low) + high / np.linalg.norm(high))[::-1])
        ).T
    )


def test_nastran_with_faces_as_shells(tmp_path):
    """Bulk data of 10-node tetrahedra; shells of the property 7 are the clamped face."""
    block = box((4, 2, 2), (0.1, 0.02, 0.03), "tetra10")
    cells = block.bodies["blade"][:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    meshio.write(
        tmp_path / "a.bdf",
        meshio.Mesh(
            block.points,
            [("tetra10", cells), ("triangle6", block.faces["clamp"])],
            cell_data={
                "nastran:ref": [np.ones(len(cells), int), np.full(len(block.faces["clamp"]), 7)]
            },
        ),
    )
    found = read_mesh(tmp_path / "a.bdf")
    assert (
        set(found.parts) == {"pid_1"} and found.faces["pid_7"].shape == block.faces["clamp"].shape
    )
    assert body_volume(found, "blade") == pytest.approx(0.1 * 0.02 * 0.03, rel=1e-6)


@pytest.mark.parametrize(
    ("begins", "ends"), [("", ""), ("", "ENDDATA\nafter it"), ("SOL 103\nbegin bulk", "enddata")]
)
def test_bulk_data_without_its_statements(tmp_path, begins, ends):
    """A file to be included has none of them, as gmsh writes bulk data; small letters are legal.
    Without an end meshio refuses them.
    """
    block = box((4, 2, 2), (0.1, 0.02, 0.03), "tetra10")
    cells = block.bodies["blade"][:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    reference = {"nastran:ref": [np.ones(len(cells), int)]}
    whole = tmp_path / "whole.bdf"
    meshio.write(whole, meshio.Mesh(block.points, [("tetra10", cells)], cell_data=reference))
    bulk = whole.read_text().partition("BEGIN BULK\n")[2].partition("ENDDATA")[0]
    (tmp_path / "a.bdf").write_text("\n".join(filter(None, (begins, bulk.strip(), ends))))
    found = read_mesh(tmp_path / "a.bdf")
    assert body_volume(found, "blade") == pytest.approx(0.1 * 0.02 * 0.03, rel=1e-6)


def test_a_nastran_deck_of_blade_and_damper_runs_to_the_report(tmp_path, capsys):
    """Looked at, named by its properties, and run: what the same mesh gives from gmsh's file, but
    for the ten digits of a node.
    """
    mesh = wedge_sector(
        Aerofoil(fillet=0.0), Platform(), Shank(), Disc(), Wedge(), MeshSize(size=20e-3, scale=1.5)
    )
    write_msh(mesh, tmp_path / "a.msh")
    properties = write_bdf(mesh, tmp_path / "a.bdf")
    assert main(["look", str(tmp_path / "a.bdf")]) == 0
    said = capsys.readouterr().out
    assert "bodies: 2" in said and "36 sectors about z" in said and "pid_1 " in said
    names = [f"{name} = pid_{number}" for name, number in properties.items()]
    settings = {
        "study.loads": 100,
        "study.influences": "false",
        "study.stability": "false",
        "contact.points": 4,
        "model.harmonics": 1,
        "model.samples": 32,
        "model.modes": 6,
        "model.nodal_diameters": 9,
        "accuracy": 0.5,
    }
    overrides = [f"{key}={value}" for key, value in settings.items()]
    scenes = {}
    for suffix in ("bdf", "msh"):
        given = f"names = {names}\n" if suffix == "bdf" else ""
        scenes[suffix] = tmp_path / f"{suffix}.toml"
        scenes[suffix].write_text(
            f'kind = "imported"\nexcitation.at = "tip"\n'
            f'[imported]\nfile = "a.{suffix}"\nsectors = 36\n{given}'
        )
    options = [word for override in overrides for word in ("--set", override)]
    assert main(["run", str(scenes["bdf"]), "-o", str(tmp_path / "bdf"), "-q", *options]) == 0
    assert (tmp_path / "bdf" / "report.html").stat().st_size > 100_000
    ours = bladefem.open(tmp_path / "bdf").summary
    scene = bladefem.load_scene(scenes["msh"], overrides)
    theirs = pipeline.run(scene, tmp_path / "msh", until="response").response.curves[0]
    for name in ("peak_frequency", "peak_amplitude"):
        found = np.asarray(ours[name])[1]
        assert found == pytest.approx(getattr(theirs, name), rel=1e-6)


def test_cut_faces_with_other_nodes_are_tied(tmp_path):
    """Nodes that slide in the plane of one cut face, written and read again: a pair without nodes,
    a note, and frequencies as near to the matching mesh's as its error; the names may be swapped.
    """
    found = {}
    for slide in (0.0, 0.15):
        mesh = sector(9, (6, 3, 2), "tetra10", slide=slide, straight=True)
        write_msh(mesh, tmp_path / "a.msh")
        found[slide] = read_mesh(tmp_path / "a.msh", sectors=9)
    tied = found[0.15]
    assert tied.pairs["cyclic"].nodes.shape == (2, 0)
    assert "tied in the mean by a mortar" in tied.report["notes"][-1]
    assert not found[0.0].report["notes"]
    ours, theirs = (
        modes(constrain(assemble(some, "blade", Material()), "clamp", 2), 4).frequencies
        for some in (tied, found[0.0])
    )
    np.testing.assert_allclose(ours, theirs, rtol=0.02)
    swap = {"cyclic_low": tied.faces["cyclic_high"], "cyclic_high": tied.faces["cyclic_low"]}
    write_msh(replace(tied, faces={**tied.faces, **swap}), tmp_path / "b.msh")
    again = read_mesh(tmp_path / "b.msh", sectors=9)
    assert set(np.unique(again.faces["cyclic_low"])) == set(np.unique(tied.faces["cyclic_low"]))
    with pytest.raises(InputError, match=r"imported\.cut_gap = 0\.001.*apart"):
        read_mesh(tmp_path / "a.msh", sectors=10)


def test_distance_from_a_face():
    """Above the middle, beyond an edge and beyond a corner of a square of two triangles."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    places = np.array([[0.5, 0.4, 0.2], [0.5, -0.3, 0.4], [-0.3, -0.4, 0.0], [0.2, 0.9, -0.1]])
    for facets in (np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 1, 2, 3]])):
        found = distance_to_face(places, points, facets)
        np.testing.assert_allclose(found, [0.2, 0.5, 0.5, 0.1], atol=1e-14)
