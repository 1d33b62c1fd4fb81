"""What a mesh file says of itself, and a run of the scene that comes of it."""

import tomllib
from dataclasses import replace
from pathlib import Path

import decks
import numpy as np
import pytest
from scipy.spatial import cKDTree
from structured import box

import bladefem
from bladefem.cli.look import describe_look
from bladefem.cli.main import main
from bladefem.errors import InputError
from bladefem.scene.toml import load_scene
from bladefem.study.pipeline.validate_mesh import check_blade
from geometry.imported import read_mesh
from geometry.look import look_at, starting_scene
from geometry.numbered_faces import face_corners, numbered_faces
from geometry.raw_mesh import read_raw
from geometry.session import gmsh_session


@pytest.fixture
def deck(tmp_path):
    """Wedges and hexahedra in millimetres, the bore alone has a name."""
    m = decks.model("c3d15_c3d20")
    m = decks.Model(1e3 * m.points, m.blocks, {"ROOT": m.node_sets["clamp"]}, {})
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(m, {})))
    return tmp_path / "a.inp"


def test_faces_are_cut_along_edges_and_numbered_from_the_largest(deck):
    """Two flat sides, two cut faces, outside and bore."""
    look = look_at(deck)
    assert [face.facets for face in look.faces] == [81, 81, 36, 36, 24, 24]
    # equal areas (to six digits of the largest) are ordered by place
    ordered = zip(look.faces, look.faces[1:], strict=False)
    assert all(a.area > b.area - 1e-6 * look.faces[0].area for a, b in ordered)
    assert look.cells == {"hexahedron20": 108, "wedge15": 216}
    assert look.bodies == (324,)
    assert look.sets["ROOT"].endswith("nodes")


def test_cut_faces_and_unit_are_guessed(deck):
    look = look_at(deck)
    assert (look.cut.axis, look.cut.sectors) == ("z", decks.SECTORS)
    assert (look.cut.low, look.cut.high) == (("face_3",), ("face_4",))
    assert look.bore == ("face_6",) and look.scale == 1e-3
    assert not any(sentence.startswith(("clamp", "cyclic")) for sentence in look.missing)
    # of the face whose centre is farthest from the axis
    radius = {face.name: np.hypot(*face.centre[:2]) for face in look.faces}
    farthest = max(radius, key=radius.get)
    (tip,) = (sentence for sentence in look.missing if sentence.startswith("tip_mid"))
    assert tip.endswith(f"'tip_mid = {farthest}' is the face farthest out")


def test_the_scene_runs_as_it_is_written(deck):
    """Faces by number have the nodes of faces by name."""
    table = tomllib.loads(starting_scene(look_at(deck)))["imported"]
    mesh = read_mesh(deck, table["scale"], table["sectors"], table["axis"], table["names"])
    assert mesh.pairs["cyclic"].nodes.shape[1] == len(np.unique(mesh.faces["cyclic_low"]))
    assert np.array_equal(np.unique(mesh.faces["clamp"]), np.unique(mesh.faces["root"]))


def test_sets_with_alike_names_are_taken(tmp_path):
    """Named as the writing program does it; two candidates are none."""
    m = decks.model("c3d15_c3d20")
    clamp = m.node_sets["clamp"]
    sets = {"PART-1.CLAMP": clamp, "N_SEAT_LEFT": clamp, "TIP-MID": clamp, "TIP-MID-2": clamp}
    deck = tmp_path / "a.inp"
    deck.write_text("\n".join(decks.flat_deck(decks.Model(m.points, m.blocks, sets, {}), {})))
    look = look_at(deck)
    assert look.alike == {"clamp": "PART-1.CLAMP", "seat_left": "N_SEAT_LEFT"}
    names = tomllib.loads(starting_scene(look))["imported"]["names"]
    assert names[:2] == ["clamp = PART-1.CLAMP", "seat_left = N_SEAT_LEFT"]
    assert [name.split(" ")[0] for name in names[2:]] == ["cyclic_low", "cyclic_high"]
    missing = [sentence.split(":")[0] for sentence in look.missing]
    assert missing == ["tip_mid", "seat_right", "damper"]


def test_usual_names_of_a_single_blade_are_taken(tmp_path):
    """The scene that is written has modes as it is; a body called so is no clamp, and two sets are
    none.
    """
    bar = box((4, 1, 2), (0.1, 0.01, 0.015), "tetra10", origin=(0.0, 0.02, 0.05))
    ends = [np.flatnonzero(np.isclose(bar.points[:, 0], x)) for x in (0.0, 0.1)]

    def deck_of(name, sets):
        m = decks.Model(bar.points, [("tetra10", bar.bodies["blade"])], sets, {})
        (tmp_path / name).write_text("\n".join(decks.flat_deck(m, {})))
        return tmp_path / name

    deck = deck_of("a.inp", {"BLADE_ROOT": ends[0], "Tip": ends[1]})
    look = look_at(deck)
    assert look.alike == {"clamp": "BLADE_ROOT", "tip_mid": "Tip"}
    assert look.missing[0].startswith("cyclic_low")
    assert "clamp = BLADE_ROOT, tip_mid = Tip (guessed)" in describe_look(look)
    scene = tmp_path / "a.toml"
    scene.write_text(starting_scene(look))
    read = load_scene(scene)
    mesh = bladefem.build_mesh(read)
    held = np.unique(mesh.faces["clamp"])
    np.testing.assert_allclose(mesh.points[held, 0], 0.0, atol=1e-12)
    assert len(held) == len(ends[0])
    two = look_at(deck_of("b.inp", {"ROOT_1": ends[0], "ROOT_2": ends[1], "RootCause": ends[1]}))
    assert "clamp" not in two.alike


def test_a_clamp_by_another_name_is_suggested(tmp_path):
    """Names of a file are known in lower case."""
    bar = box((4, 1, 2), (0.1, 0.01, 0.015), "tetra10", origin=(0.0, 0.02, 0.05))
    sets = {"GROUND": np.flatnonzero(np.isclose(bar.points[:, 0], 0.0))}
    m = decks.Model(bar.points, [("tetra10", bar.bodies["blade"])], sets, {})
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(m, {})))
    scene = tmp_path / "a.toml"
    scene.write_text(starting_scene(look_at(tmp_path / "a.inp")))
    for override, said in (
        (
            [],
            r'known are ground, nall; or name one, such as imported.names = \["clamp = face_1"\]$',
        ),
        (["support.clamp=GROUND"], "did you mean 'ground'"),
    ):
        read = load_scene(scene, override)
        with pytest.raises(InputError, match=said):
            check_blade(read, bladefem.build_mesh(read))


def test_sets_named_like_numbered_faces_are_not_mixed_up_with_them(tmp_path):
    """A drawing's faces come in a mesh as sets face_1, ... in another order than the numbers, which
    the scene to start from must not take for each other.
    """
    m = decks.model("c3d10")
    sets = {"Face_6": m.node_sets["cyclic_low"]}
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(replace(m, node_sets=sets), {})))
    look = look_at(tmp_path / "a.inp")
    assert look.bore == ("outer_face_6",)
    table = tomllib.loads(starting_scene(look))["imported"]
    mesh = read_mesh(tmp_path / "a.inp", 1.0, table["sectors"], table["axis"], table["names"])
    bore = np.unique(mesh.faces["clamp"])
    radius = np.linalg.norm(mesh.points[:, :2], axis=1)
    np.testing.assert_allclose(radius[bore], radius.min(), rtol=1e-3)


def test_files_of_one_model_are_numbered_alone(tmp_path):
    """The second file's faces are larger, and would come first in a numbering of all."""
    for name, factor in (("a", 1.0), ("b", 2.0)):
        m = decks.model("c3d10")
        m = decks.Model(factor * m.points + [factor, 0, 0], m.blocks, {}, {})
        (tmp_path / f"{name}.inp").write_text("\n".join(decks.flat_deck(m, {})))
    names = ["tip = face_2", "seat = damper.face_2"]
    files = [read_mesh(tmp_path / "a.inp", names=names[:1])]
    more = [f"damper = {tmp_path / 'b.inp'}"]
    files.append(read_mesh(tmp_path / "a.inp", names=names, more=more))
    assert np.array_equal(files[0].faces["tip"], files[1].faces["tip"])
    centres = [files[1].points[files[1].faces[name]].mean(axis=(0, 1)) for name in ("tip", "seat")]
    assert np.allclose(centres[1], 2 * centres[0])
    with pytest.raises(InputError, match=r"no group 'other\.face_2'"):
        read_mesh(tmp_path / "a.inp", names=["tip = other.face_2"], more=more)


def test_facets_keep_their_face_when_cells_change(deck):
    raw = read_raw(deck)
    faces = numbered_faces(raw)
    corners = [face_corners(faces, number) for number in range(faces.count)]
    assert sum(len(part) for parts in corners for part in parts) == len(faces.corners)


def test_faces_that_a_second_turn_carries_on_are_no_cut_faces(tmp_path):
    """A square bar about its own axis; a quarter of a disc would match by the same turn."""
    bar = box((3, 2, 2), (0.3, 0.04, 0.04), "tetra10", origin=(0.0, -0.02, -0.02))
    m = decks.Model(bar.points, [("tetra10", bar.bodies["blade"])], {}, {})
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(m, {})))
    assert look_at(tmp_path / "a.inp").cut is None


def test_the_command_prints_draws_and_writes_a_scene_once(deck, capsys):
    picture = deck.with_name("a.png")
    assert main(["look", str(deck), "--view", str(picture), "--scene"]) == 0
    said = capsys.readouterr().out
    assert "12 sectors about z" in said and "not in the file" in said
    assert picture.stat().st_size > 10_000
    assert tomllib.loads(deck.with_suffix(".toml").read_text())["kind"] == "imported"
    assert main(["look", str(deck), "--scene"]) == 2
    assert "is there already" in capsys.readouterr().err


def test_a_scene_in_another_folder_finds_the_file(deck, tmp_path):
    scene = tmp_path / "scenes" / 'of "blade".toml'
    assert main(["look", str(deck), "--scene", str(scene)]) == 0
    assert Path(load_scene(scene).imported.file).samefile(deck)


def test_a_name_with_quotes_comes_back(deck, tmp_path):
    quoted = tmp_path / 'blade "A".inp'
    quoted.write_bytes(deck.read_bytes())
    table = tomllib.loads(starting_scene(look_at(quoted)))
    assert table["title"] == 'blade "A"' and table["imported"]["file"] == 'blade "A".inp'


@pytest.mark.parametrize("option", ["--view", "--scene"])
def test_a_target_that_cannot_be_written_is_refused_before_the_work(option, deck, capsys):
    target = deck / "no folder" / "a.png"
    assert main(["look", str(deck), option, str(target)]) == 2
    said = capsys.readouterr()
    assert "cannot be made" in said.err and said.err.count("\n") == 1 and not said.out


def test_a_file_without_solids(tmp_path):
    (tmp_path / "a.inp").write_text("*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n")
    with pytest.raises(InputError, match="no solid cells"):
        look_at(tmp_path / "a.inp")


def test_a_drawing_is_looked_at_by_its_own_faces():
    """The numbers are those that imported.names and imported.seats take."""
    found = look_at("scenes/own_blade.step")
    assert [face.name for face in found.faces] == [f"face_{i}" for i in range(1, 25)]
    assert found.scale == 1.0
    right, left = (next(f for f in found.faces if f.name == n) for n in ("face_14", "face_11"))
    assert right.plane
    assert left.plane
    assert np.allclose(right.centre, left.centre * [1, -1, 1], atol=1e-9)
    assert right.centre[1] > 0.01
    assert any("imported.seats" in sentence for sentence in found.missing)


def test_cut_faces_of_a_drawing_are_guessed():
    """No nodes match on faces that are meshed one by one: their outlines do."""
    found = look_at("scenes/own_blade.step")
    assert (found.cut.axis, found.cut.sectors) == ("z", 36)
    assert (found.cut.low, found.cut.high) == (("face_1",), ("face_6",))
    assert found.bore == ("face_2",)
    assert not any("imported.sectors" in sentence for sentence in found.missing)


def test_the_tip_of_a_drawing_is_guessed():
    """As scenes/own_blade.toml names it."""
    assert any(
        "'tip = face_24'" in sentence for sentence in look_at("scenes/own_blade.step").missing
    )


def test_the_scene_of_a_drawing_is_meshed_as_it_is_written(tmp_path, capsys):
    """With what is still missing: the face that is excited."""
    step = tmp_path / "blade.step"
    step.write_bytes(Path("scenes/own_blade.step").read_bytes())
    assert main(["look", str(step), "--scene"]) == 0
    said = capsys.readouterr().out
    assert "1 solid, 243.992 x 43.3592 x 60 mm" in said
    assert "scale" not in said
    table = tomllib.loads(step.with_suffix(".toml").read_text())["imported"]
    assert (table["sectors"], table["axis"]) == (36, [0.0, 0.0, 1.0])
    assert not {"scale", "linear"} & set(table)
    options = ["-o", str(tmp_path / "run"), "--set", "mesh.size=20 mm", "-q"]
    assert main(["mesh", str(step.with_suffix(".toml")), *options]) == 0
    mesh = bladefem.open(tmp_path / "run").mesh
    assert mesh.sector.count == 36
    assert len(mesh.pairs["cyclic"].nodes[0]) > 20
    radius = np.hypot(*mesh.points[np.unique(mesh.faces["clamp"])][:, :2].T)
    assert np.allclose(radius, 0.12, rtol=1e-3)


def test_a_drawing_without_cut_faces_asks_for_the_number_of_blades(tmp_path):
    """A box has no faces that a turn about an axis of the file carries onto each other."""
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0.1, 0.2, 0.3, 0.02, 0.03, 0.05)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "box.step"))
    found = look_at(tmp_path / "box.step")
    assert found.cut is None
    assert found.missing[0].startswith("imported.sectors")
    assert "# no cut faces were found" in starting_scene(found)


def test_cut_faces_are_found_where_nodes_inside_do_not_match(tmp_path):
    """Free triangles on both sides of a sector of 24, as most meshes of others have them."""
    angle = 2 * np.pi / 24
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        disc = occ.addCylinder(0, 0, 0, 0, 0, 30, 200, angle=angle)
        bore = occ.addCylinder(0, 0, -1, 0, 0, 32, 100)
        sector, _ = occ.cut([(3, disc)], [(3, bore)])
        occ.rotate(sector, 0, 0, 0, 0, 0, 1, -angle / 2)
        blade = occ.addBox(195, -4, 5, 80, 8, 20)
        occ.fuse(sector, [(3, blade)])
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 15)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 8)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="all")
        gmsh.write(str(tmp_path / "sector.msh"))
    found = look_at(tmp_path / "sector.msh")
    assert found.cut is not None and (found.cut.axis, found.cut.sectors) == ("z", 24)
    # nodes inside are elsewhere, by polar coordinates of all nodes on the two planes
    x = found.raw.points
    radius, turn = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    low, high = (
        np.stack([radius, x[:, 2]], axis=1)[np.abs(turn - side * angle / 2) < 1e-6]
        for side in (-1, 1)
    )
    assert cKDTree(low).query(high)[0].max() > 0.5
    names = tomllib.loads(starting_scene(found))["imported"]["names"]
    assert [name.split(" ")[0] for name in names] == ["cyclic_low", "cyclic_high", "clamp"]
