"""Input that was made to break the program: each ends in one sentence, at once."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from bladefem.cli.main import main
from bladefem.errors import InputError
from bladefem.scene.kinds import kind_named
from bladefem.scene.toml import load_scene, read_tables, scene_of
from bladefem.scene.units import parse
from bladefem.study.modes.campbell import MAX_SPEEDS, read_speeds
from bladefem.view.style import canvas

WEDGE = Path(__file__).with_name("wedge.toml")
SHIPPED = WEDGE.parents[2] / "scenes" / "wedge.toml"


def refused(call, *arguments) -> str:
    """The one sentence of a refusal."""
    with pytest.raises(InputError) as caught:
        call(*arguments)
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 400
    return text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("120 mm^99999999", "unknown unit 'mm^99999999'"),
        ("120 mm^" + "9" * 5000, "unknown unit"),
        ("120 " + "GPa^9 " * 8, "expected a unit of this world"),
        ("120 " + "mm " * 100000, "unknown unit 'mm mm mm"),
        ("9" * 400, "expected a finite number"),
        ("1e400 mm", "expected a finite number"),
        (10**400, "expected a finite number"),
        ("x" * 100000, "expected a number with a unit"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_units_end_at_once(text, said):
    assert said in refused(parse, text, "m", "aerofoil.span")


def test_powers_that_exist_are_still_read():
    assert parse("1 mm^4", "m^4") == pytest.approx(1e-12)
    assert parse("1 N/mm^3", "N/m^3") == pytest.approx(1e9)


FILES = {
    "nested lists": (b"kind = " + b"[" * 2000 + b"]" * 2000, "nested too deep"),
    "nested tables": (b"kind = " + b"{a=" * 2000 + b"1" + b"}" * 2000, "nested too deep"),
    "dotted tables": (b'kind = "hertz"\n[' + b"a." * 2000 + b"a]\n", "unknown table"),
    "digits": (b'kind = "hertz"\naccuracy = ' + b"9" * 5000, "not valid TOML"),
    "empty": (b"", "expected kind = one of 'wedge sector'"),
    "a table alone": (b"[aerofoil]\ntwist = 0.2\n", "expected kind = one of"),
    "utf-16": ('kind = "hertz"'.encode("utf-16"), "cannot be read as a scene file"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_are_refused(tmp_path, name):
    content, said = FILES[name]
    file = tmp_path / "scene.toml"
    file.write_bytes(content)
    assert said in refused(load_scene, file)


def test_byte_order_mark_is_no_mistake(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_bytes(b"\xef\xbb\xbf" + WEDGE.read_bytes())
    assert load_scene(file) == load_scene(WEDGE)


# what only the mesher, the seating or the balance refused before
WITHOUT_A_MESH = [
    ("mesh.scale=0.02", "mesh.scale = 0.02: gives about"),
    ("mesh.size=0.1 mm", "mesh.size = 100 um: gives about"),
    ("mesh.contact_size=1 um", "mesh.contact_size = 1 um: gives about"),
    ("support.clamp=rooot", "support.clamp = 'rooot': a scene of kind 'wedge sector' has no face"),
    (
        'support.directions=["rim: z"]',
        "support.directions = 'rim': a scene of kind 'wedge sector' has no",
    ),
    ("excitation.at=nowhere", "excitation.at = 'nowhere': a scene of kind 'wedge sector' has"),
    ("excitation.at=tip_midd", "did you mean 'tip_mid'?"),
    ("disc.bore_radius=195 mm", "95 % of disc.rim_radius"),
    ("shank.length=44.9 mm", "before disc.width, expected the same"),
    ("damper.length=59.9 mm", "before platform.length, expected the same"),
    ("damper.base=44 mm", "95 % of shank.height"),
    ("aerofoil.camber=0.5", "aerofoil.camber"),
    ("aerofoil.stagger=60 deg", "overhangs the platform circumferentially"),
    ("study.loads=" + ", ".join(["1"] * 2000) + " N", "2000 values given, expected at most 1000"),
]


# what passed once and failed, or gave nonsense, later
LATE = [
    ("title=" + "x" * 201, "201 letters, expected at most 200"),
    ("title=\x1b[31mred", "expected one line of text"),
    ("study.loads=50 N, 50 N", "study.loads = 50 N: given twice"),
    ("study.masses=12 g, 12 g", "study.masses = 12 g: given twice"),
    ("study.loads=[50 N", "study.loads = '[50 N': expected a number"),
    ("excitation.direction=1e-300, 0, 0", "expected a direction"),
    (
        'material.blade.table=["600 degC: E=210"]',
        "material.blade.table, row '600 degC: E=210', E = 210 Pa: expected 1 MPa",
    ),
    ('material.damper.table=["600 degC"]', "material.damper.table, row '600 degC': expected"),
    ('material.blade.table=["600 degC: E=9 GPa"]', "material.blade.table: it has no properties at"),
]


@pytest.mark.parametrize(("override", "said"), LATE, ids=lambda v: str(v)[:40])
def test_late_failures_are_refused_early(override, said):
    assert said in refused(load_scene, WEDGE, [override])


@pytest.mark.parametrize("sectors", [70, 80, 92, 100, 104])
def test_the_seat_width_that_a_message_names_is_taken(sectors):
    """The number is copied out of the first message; what is refused after it is neither the seat
    nor a damper that does not fit under it, but another part.
    """
    many = f"disc.sectors={sectors}"
    said = refused(_draw, SHIPPED, [many])
    limit = re.search(r"^platform.seat_width = .* expected at most (\S+ mm)", said)[1]
    try:
        _draw(SHIPPED, [many, f"platform.seat_width={limit}"])
    except InputError as other:
        assert str(other).startswith("aerofoil.chord_root")
    wider = f"platform.seat_width={1.0001 * parse(limit, 'm')}"
    assert refused(_draw, SHIPPED, [many, wider]).startswith(("platform.seat_width", "damper.base"))


@pytest.mark.parametrize("sectors", [107, 110, 115])
def test_where_no_seat_fits_it_is_said(sectors):
    """The widest one is narrower than the least that the field takes."""
    said = refused(_draw, SHIPPED, [f"disc.sectors={sectors}"])
    assert said.startswith("platform.seat_width = 6 mm: no seat fits")
    assert "a seat has 2 mm or more; choose fewer disc.sectors, or a smaller shank.width" in said
    assert "expected at most" not in said


def test_a_bar_of_the_named_width_is_taken():
    """0.95 * 45 mm / 2 is 21.375 mm but for round-off."""
    sizes = ["z_mass.height=45 mm", "z_mass.width=38 mm"]
    file = SHIPPED.with_name("zmass.toml")
    said = refused(_draw, file, [*sizes, "z_mass.bar=22 mm"])
    assert "expected at most 21.375 mm" in said
    _draw(file, [*sizes, "z_mass.bar=21.375 mm"])


def _draw(file, overrides):
    scene = load_scene(file, overrides)
    kind_named(scene.kind).check(scene)


COMMANDS = [
    (["check", "x" * 5000], "File name too long"),
    (["run", str(WEDGE), "-o", ""], "--output '': expected the name of a folder"),
    (["study", str(WEDGE), "--vary", "damper.angle=50, 55 deg", "-o", ""], "--output ''"),
    (["modes", str(WEDGE), "--campbell", "-5, 100 rpm"], "expected 0 rpm to 954930 rpm"),
    (["modes", str(WEDGE), "--converge", "6 mm, 6 mm, 4 mm"], "a size is given twice"),
    (["look", str(WEDGE.parents[2] / "scenes" / "own_blade.step"), "--view", "x.doc"], "x.doc"),
    (
        ["look", str(WEDGE.parents[2] / "scenes" / "own_blade.step"), "--view", "/proc/x.png"],
        "--view /proc/x.png: folder /proc cannot be written",
    ),
    (
        ["look", str(WEDGE)],
        "wedge.toml: unknown kind of mesh; known are .bdf, .cdb, .inp, .med, .msh, .nas, .step",
    ),
    (["look", "nowhere.inp"], "bladefem: nowhere.inp: there is no such file"),
    (["look", "."], "bladefem: .: a folder, expected a file"),
]


OWN = WEDGE.parents[2] / "scenes" / "own_blade.toml"


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("imported.seats=face_14, face_14", "face_14, face_14: expected two faces"),
        ("imported.names=tip = face_21, tip = face_20", "'tip = face_21 + face_20' for one group"),
    ],
)
def test_an_own_blade_is_refused_without_a_mesh(override, said):
    assert said in refused(load_scene, OWN, [override])


def test_a_wrong_scale_is_named(tmp_path, capsys):
    words = ["mesh", str(OWN), "--set", "imported.scale=1e9", "-o", str(tmp_path)]
    assert main(words) == 2
    assert "imported.scale = 1e+09: the model would be 2.4" in capsys.readouterr().err


def test_a_full_disk_is_one_sentence(tmp_path):
    """A limit of the shell on the size of files stands in for the disk."""
    code = "import numpy as np; from bladefem.io.stage_cache import cached_stage; from pathlib "
    code += f"import Path; cached_stage(Path({str(tmp_path)!r}), 'a', 'k', lambda: np.zeros(10**6))"
    command = f"ulimit -f 100; exec {sys.executable} -c {shlex.quote(code)}"
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False
    )
    assert "cannot be written (File too large)" in done.stderr.splitlines()[-1]
    assert "Exception ignored" not in done.stderr


@pytest.mark.parametrize(("words", "said"), COMMANDS, ids=lambda v: " ".join(v)[:30])
def test_commands_refuse_at_once(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    text = capsys.readouterr().err
    assert said in text
    assert text.count("\n") == 1


def test_what_a_reader_prints_is_its_reason(tmp_path, capsys):
    """meshio writes its error to the terminal and exits."""
    file = tmp_path / "sector.vtu"
    file.write_text("<VTKFile>")
    assert main(["look", str(file)]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert "(1)" not in text


@pytest.mark.parametrize(("override", "said"), WITHOUT_A_MESH, ids=lambda v: str(v)[:40])
def test_check_refuses_without_a_mesh(override, said):
    assert said in refused(load_scene, WEDGE, [override])


def test_of_two_sizes_the_smaller_one_is_to_blame():
    sizes = ["mesh.size=5 mm", "mesh.contact_size=1 um"]
    assert "mesh.contact_size = 1 um: gives about" in refused(load_scene, WEDGE, sizes)


def test_a_force_on_the_fillet_needs_one():
    """Drawn by default; elements of 8 mm are too large for it."""
    at = "excitation.at=fillet"
    assert load_scene(WEDGE, [at]).excitation.at == "fillet"
    for none in ("aerofoil.fillet=0 mm", "mesh.size=8 mm"):
        assert "has no face or node set" in refused(load_scene, WEDGE, [at, none])


OTHER_KINDS = [
    ({"kind": "plane blades", "plane": {"seat_width": "21.8 mm"}}, "98 % of the platform"),
    (
        {"kind": "plane blades", "excitation": {"at": "trailing_edge"}},
        "of kind 'plane blades' has no",
    ),
    ({"kind": "plane blades", "mesh": {"scale": 0.02, "size": "0.1 mm"}}, "mesh.scale"),
    ({"kind": "z mass", "z_mass": {"bar": "29 mm"}}, "z_mass.bar"),
    ({"kind": "z mass", "mesh": {"scale": 0.02}}, "mesh.scale"),
    ({"kind": "hertz", "hertz": {"contact_radius": "5 mm"}}, "hertz.half_width / 2.5"),
    ({"kind": "hertz", "mesh": {"contact_size": "1 um"}}, "mesh.contact_size"),
    ({"kind": "punch", "punch": {"radius": "15 mm"}}, "half of punch.half_width"),
    ({"kind": "punch", "mesh": {"scale": 0.02, "contact_size": "0.1 mm"}}, "mesh.scale"),
    ({"kind": "hertz", "material": {"damper": {"G": "130 GPa"}}}, "material.damper.G"),
    ({"kind": "punch", "material": {"blade": {"G": "130 GPa"}}}, "material.blade.G"),
    ({"kind": "punch", "material": {"damper": {"E": "1 GPa"}}}, "material.damper.E"),
    ({"kind": "imported", "imported": {"file": __file__}}, "unknown kind of mesh"),
]


@pytest.mark.parametrize(("tables", "said"), OTHER_KINDS, ids=lambda v: str(v)[:50])
def test_other_kinds_are_refused_without_a_mesh(tables, said):
    assert said in refused(scene_of, tables)


@pytest.mark.parametrize(
    ("scene", "overrides", "said"),
    [
        ("wedge", ["study.own_load=true", "operation.speed=0 rpm"], "study.own_load = true"),
        ("wedge", ["contact.kn=0 N/m"], "contact.kn = 0 N/m: expected 1 N/m"),
        ("wedge", ["contact.left.kn=0 N/m"], "contact.left.kn = 0 N/m"),
        ("hertz", ["study.loads=1 MN"], "the contact radius would be"),
    ],
)
def test_check_refuses_what_a_run_would(scene, overrides, said, capsys):
    file = Path(__file__).parents[2] / "scenes" / f"{scene}.toml"
    words = [word for override in overrides for word in ("--set", override)]
    assert main(["check", str(file), *words]) == 2
    assert said in capsys.readouterr().err


def test_campbell_range_has_a_limit():
    said = refused(read_speeds, "0, 0.001, ..., 12000 rpm")
    assert f"1.2e+07 speeds, expected at most {MAX_SPEEDS}" in said
    assert len(read_speeds("0, 10, ..., 12000 rpm")) == 1201


def test_dollar_signs_in_a_title_are_dollar_signs(tmp_path):
    title = r"cost $\frac{1}{$ and $5"
    with canvas(tmp_path / "title.png") as ax:
        ax.semilogy([1, 2], [1e-5, 1e3], label=title)
        ax.set_title(title)
        ax.set_xlabel(title)
        ax.legend()
        ax.figure.suptitle(title)
        figure = ax.figure
    # the numbers along the axis are still set as powers
    assert all(label.get_parse_math() for label in figure.axes[0].get_yticklabels())
    assert not figure.axes[0].xaxis.label.get_parse_math()
    assert (tmp_path / "title.png").stat().st_size > 1000


COARSE_MESH = {"size": "20 mm", "order": 1, "algorithm": "delaunay"}


def test_names_are_those_of_the_meshes(mesh_of):
    """The table of names is what the builders make; the damper's own faces carry no force."""
    for name in ("wedge sector", "plane blades"):
        mesh = mesh_of(name)
        made = {face for face in (*mesh.faces, *mesh.nodes) if not face.startswith("damper_")}
        scene = scene_of({"kind": name, "mesh": COARSE_MESH})
        assert set(kind_named(name).face_names(scene)) == made


@pytest.fixture
def mesh_of():
    from geometry.builders import build_here

    return lambda kind: build_here(scene_of({"kind": kind, "mesh": COARSE_MESH}))


def test_demos_find_their_scenes_from_another_folder(tmp_path):
    demos = Path(__file__).parents[2] / "demos"
    for file in demos.glob("*.py"):
        assert '"scenes/' not in file.read_text(encoding="utf-8"), file


def test_check_of_a_hostile_file_is_a_sentence_and_exit_code_2(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text('kind = "wedge sector"\n[aerofoil]\nspan = "120 mm^99999999"\n')
    command = [sys.executable, "-m", "bladefem.cli.main", "check", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("bladefem: aerofoil.span = 120 mm^99999999: unknown unit")
    assert done.stderr.count("\n") == 1


def test_tables_of_a_file_can_still_be_read():
    assert read_tables(WEDGE)["kind"] == "wedge sector"
