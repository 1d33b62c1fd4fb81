"""Bad input is refused before any work, in one sentence that names the field."""

from __future__ import annotations

from pathlib import Path

import pytest

from bladefem.errors import InputError
from bladefem.scene.fields import convert_value, field_at
from bladefem.scene.tables import Contact, Scene
from bladefem.scene.toml import load_scene, scene_of
from bladefem.scene.units import parse
from bladefem.scene.validate import validate

WEDGE = Path(__file__).with_name("wedge.toml")

REFUSED = [
    # unknown keys and tables
    ("aerofoil.twits=3 deg", "unknown key 'aerofoil.twits'; did you mean 'aerofoil.twist'?"),
    ("excitation.order=9", "did you mean 'excitation.engine_order'?"),
    ("blade.twist=3 deg", "unknown key 'blade.twist'; did you mean 'aerofoil.twist'?"),
    ("matrial.blade.E=3", "unknown key 'matrial.blade.E'; did you mean 'material.blade.E'?"),
    ("nonsense=3", "unknown key 'nonsense'; known are"),
    ("aerofoil=3", "aerofoil: expected a field of this table"),
    ("aerofoil", "expected key=value"),
    ("=3", "expected key=value"),
    # units, types, ranges
    ("damper.angle=20 mm", "'mm' is not a unit of this field, expected deg or rad"),
    ("operation.speed=133 Hz", "expected rpm or rad/s"),
    ("damper.angle=95 deg", "expected 15 deg to 90 deg"),
    ("contact.mu=nan", "finite"),
    ("aerofoil.span=inf", "finite"),
    ("contact.mu=-0.1", "expected 0 to 2"),
    ("excitation.engine_order=6.5", "excitation.engine_order = 6.5: expected a whole number"),
    ("disc.sectors=3.5", "disc.sectors = 3.5: expected a whole number from 6 to 200"),
    ("disc.sectors=36 mm", "disc.sectors = 36 mm: expected a whole number from 6 to 200"),
    ("study.loads=", "study.loads = '': expected at least one value"),
    ("excitation.engine_order=six", "engine_order = 'six': expected a whole number"),
    ("contact.mu=little", "contact.mu = 'little': expected a plain number or %"),
    ("mesh.order=3", "mesh.order = 3: expected 1 or 2"),
    ("temperature.uniform=-300 degC", "temperature.uniform = -300 degC: expected 0 K to 5000 K"),
    # a share is reported as it was written, and so are its limits
    ("operation.damping=200 %", "operation.damping = 200 %: expected 0 % to 50 %"),
    ("contact.mu=300percent", "contact.mu = 300percent: expected 0 % to 200 %"),
    ("model.harmonics=-300 %", "model.harmonics = -300 %: expected 100 % to 9900 %"),
    ("operation.stiffening=maybe", "expected true or false"),
    ("operation.coriolis=maybe", "operation.coriolis = maybe: expected true, false or auto"),
    ("contact.normal=couple", "did you mean 'coupled'?"),
    ("damper.axial=hold", "damper.axial = 'hold': expected one of free, held"),
    ("model.damper=stiff", "expected one of mass, rigid, elastic"),
    ("kind=wedge secter", "did you mean 'wedge sector'?"),
    ("excitation.direction=1, 0", "expected 3 values"),
    ("study.band=100 Hz", "expected 2 values"),
    ("study.loads=", "expected at least one value"),
    ("study.loads=-20 N", "expected 0 N to 100 MN"),
    ("study.loads=0, 20 N", "lifts off"),
    ("study.loads=20, nan N", "finite"),
    ("material.blade.nu=0.5", "material.blade.nu = 0.5"),
    ("aerofoil.span=auto", "expected a number"),
    # a unit forgotten
    ("damper.angle=65", "expected 15 deg to 90 deg; did you mean '65 deg'?"),
    ("aerofoil.twist=10", "did you mean '10 deg'?"),
    ("mesh.size=8", "did you mean '8 mm'?"),
    ("mesh.size=1_0", "did you mean '10 mm'?"),
    ("material.blade.E=210", "did you mean '210 GPa'?"),
    ("damper.mass=20", "did you mean '20 g'?"),
    # between fields
    (
        "disc.bore_radius=250 mm",
        "disc.bore_radius = 250 mm: expected less than 200 mm, disc.rim_radius",
    ),
    ("shank.width=60 mm", "the pitch at disc.rim_radius"),
    ("shank.length=50 mm", "disc.width"),
    ("disc.sectors=90", "shank.width"),
    # of what the count of sectors leaves no room for, both fields are named
    ("disc.sectors=70", "platform.seat_width = 6 mm"),
    ("disc.sectors=70", "with disc.sectors = 70"),
    ("disc.sectors=200", "the pitch at disc.rim_radius with disc.sectors = 200"),
    ("platform.seat_width=30 mm", "platform.seat_width"),
    ("damper.length=70 mm", "platform.length"),
    ("platform.length=45 mm", "aerofoil.chord_root"),
    ("aerofoil.chord_root=90 mm", "platform.length"),
    ("model.nodal_diameters=9, 0, 9", "9 is listed twice"),
    ("model.nodal_diameters=0, 19", "expected 0 to 18, half the number of sectors"),
    ("study.band=200, 100 Hz", "lower frequency first"),
    ("excitation.direction=0, 0, 0", "expected a direction, not all zero, such as 0, 1, 0"),
    ("plane.length=100 mm", "[plane]: a scene of kind 'wedge sector' does not use this table"),
]


@pytest.mark.parametrize(("override", "message"), REFUSED, ids=lambda v: str(v)[:40])
def test_wedge_scene_refuses(override, message):
    with pytest.raises(InputError) as refused:
        load_scene(WEDGE, [override])
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


TOGETHER = [
    ({"model": {"harmonics": 20, "samples": 32}}, "model.samples = 32: expected more than 40"),
    (
        {"model": {"modes": 3}, "excitation": {"mode": 5}},
        "excitation.mode = 5: expected at most model.modes = 3",
    ),
    ({"mesh": {"size": 0.001, "contact_size": 0.002}}, "mesh.contact_size"),
    ({"kind": "plane blades", "plane": {"pitch": "40 mm"}}, "plane.platform_width"),
    ({"kind": "plane blades", "plane": {"seat_width": "30 mm"}}, "plane.seat_width"),
    ({"kind": "plane blades", "plane": {"platform_height": "145 mm"}}, "plane.platform_height"),
    ({"kind": "z mass", "z_mass": {"bar": "31 mm"}}, "z_mass.bar"),
    ({"kind": "hertz", "hertz": {"contact_radius": "20 mm"}}, "hertz.contact_radius"),
    ({"kind": "hertz", "mesh": {"contact_size": "5 mm"}}, "mesh.contact_size"),
    ({"kind": "plane blades", "mesh": {"seat_elements": 8}}, "mesh.seat_elements"),
    (
        {"kind": "plane blades", "excitation": {"direction": [0, 0, 1]}},
        "excitation.direction: plane blades do not move along z",
    ),
    ({"kind": "punch", "punch": {"radius": "30 mm"}}, "punch.radius"),
    (
        {"kind": "punch", "study": {"loads": [0]}},
        "study.loads = 0 N: nothing presses the two bodies together",
    ),
    ({"kind": "hertz", "operation": {"speed": 1}}, "does not use this table"),
    ({"kind": "imported"}, "needs this table with file"),
    ({"kind": "imported", "imported": {"file": "nowhere.msh"}}, "there is no such file"),
    (
        {"kind": "imported", "imported": {"file": "nowhere.msh", "axis": [0, 0, 0]}},
        "there is no such file",
    ),
    ({"kind": "imported", "imported": {"file": __file__, "axis": [0, 0, 0]}}, "imported.axis"),
    ({"kind": "imported", "imported": {"file": __file__, "sectors": 1}}, "imported.sectors"),
    (
        {
            "kind": "imported",
            "imported": {"file": __file__, "sectors": 8},
            "model": {"nodal_diameters": [5]},
        },
        "0 to 4",
    ),
    ({"aerofoil": 3}, "aerofoil = 3: expected a table [aerofoil]"),
    ({"title": {"a": 1}}, "[title]: expected a single value"),
    ({"title": 3}, "expected text"),
    ({"aerofol": {"twist": 1}}, "unknown table [aerofol]; did you mean 'aerofoil'?"),
    (
        {"material": {"blad": {"E": 1}}},
        "unknown table [material.blad]; did you mean 'material.blade'?",
    ),
    ({"study": {"loads": []}}, "expected at least one value"),
    ({"study": {"loads": [[1]]}}, "expected a number"),
    ({"contact": {"mu": True}}, "expected a number"),
    ({"operation": {"stiffening": 1}}, "expected true or false"),
]


@pytest.mark.parametrize(("tables", "message"), TOGETHER, ids=lambda v: str(v)[:60])
def test_tables_are_refused(tables, message):
    with pytest.raises(InputError) as refused:
        scene_of(tables)
    assert message in str(refused.value)


def test_scene_made_in_python_is_checked_as_well():
    with pytest.raises(InputError, match=r"contact\.mu"):
        validate(Scene(contact=Contact(mu=float("nan"))))


@pytest.mark.parametrize(
    "limit",
    ["mesh.size=10 um", "disc.sectors=200", "damper.angle=75 deg", "contact.kt_area=1e6 N/mm^3"],
)
def test_limits_themselves_are_allowed(limit):
    """As text too: 10 um is 9.999999999999999e-06 m."""
    name, _, text = limit.partition("=")
    convert_value(text, field_at(name))


def test_files_that_are_no_scenes(tmp_path):
    (tmp_path / "wedge.toml").write_text("kind = \n")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    for name, message in (
        ("wedge.toml", "not valid TOML: .*line 1"),
        ("binary.toml", "cannot be read"),
        (".", "cannot be read"),
        ("nowhere/x.toml", "no such scene file$"),
        ("project.toml", "no such scene file$"),
        ("runs/nowhere", "no such scene file or run folder$"),
    ):
        with pytest.raises(InputError, match=message):
            load_scene(tmp_path / name)


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("span = 95 mm", 'span = 95 mm: a value with a unit is written in quotes, "95 mm"'),
        ("span = 95,5 mm  # new", 'a value with a unit is written in quotes, "95.5 mm"'),
        ("fillet = 0,002", "fillet = 0,002: decimals have a point, 0.002"),
        ("fillet = .002", "fillet = .002: expected 0.002"),
        ("span = 1,000 mm", '"1000 mm" or "1.000 mm"'),
        ("span = \u201c95 mm\u201d", "expected straight quotation marks"),
        ("loads = [9 N, 18 N]", "each value with a unit is written in quotes"),
        ("span = = 3", "(at line 4, column 8)"),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_lines_that_are_no_toml_say_how_they_are_meant(tmp_path, line, meant, end):
    """As they are typed by those who have not read what TOML is."""
    file = tmp_path / "a.toml"
    lines = ['kind = "wedge sector"', "", "[aerofoil]", line, ""]
    file.write_bytes(end.join(lines).encode())
    with pytest.raises(InputError) as refused:
        load_scene(file)
    assert "at line 4" in str(refused.value) and str(refused.value).endswith(meant) == (
        "straight" not in meant
    )
    assert meant in str(refused.value) and "\n" not in str(refused.value)


def test_a_decimal_comma_is_told():
    for text, meant in (("140,5 mm", "140.5 mm"), ("1,5", "1.5"), ("-0,5e-3 m", "-0.5e-3 m")):
        with pytest.raises(InputError, match=f"; decimals have a point, '{meant}'$"):
            parse(text, "m", "aerofoil.span")
    with pytest.raises(InputError) as refused:
        parse("1,2,3 mm", "m")
    assert "decimals" not in str(refused.value)


def test_a_list_that_may_be_a_decimal_comma_is_refused():
    """Two masses of 1 g and 5 g were studied for "1,5 g"."""
    for name, text, meant in (
        ("study.masses", "1,5 g", "expected '1.5 g' or '1, 5 g'"),
        ("study.loads", "69,7N", "expected '69.7N' or '69, 7N'"),
    ):
        with pytest.raises(InputError) as refused:
            convert_value(text, field_at(name))
        assert str(refused.value).startswith(f"{name} = ") and str(refused.value).endswith(meant)
    loads = field_at("study.loads")
    assert convert_value("20, 50 N", loads) == convert_value("20 N,50 N", loads) == (20.0, 50.0)
    assert convert_value("20,50,80 N", loads) == (20.0, 50.0, 80.0)
    assert convert_value("300,500 Hz", field_at("study.band")) == (300.0, 500.0)


def test_scenes_with_a_byte_order_mark_are_offered(tmp_path):
    (tmp_path / "first.toml").write_text('kind = "punch"\n', encoding="utf-8-sig")
    with pytest.raises(InputError, match="did you mean '.*first.toml'"):
        load_scene(tmp_path / "frist.toml")


def test_scenes_of_a_similar_name_are_offered(tmp_path):
    """Also from the folder scenes beside; files without a kind are no scenes."""
    (tmp_path / "scenes").mkdir()
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    for name in ("rim.toml", "scenes/wedge.toml"):
        (tmp_path / name).write_text('kind = "punch"\n')
    for name, message in (
        ("wegde.toml", f"did you mean '{tmp_path}/scenes/wedge.toml'?"),
        ("nope.toml", f"known are {tmp_path}/rim.toml, {tmp_path}/scenes/wedge.toml"),
    ):
        with pytest.raises(InputError) as refused:
            load_scene(tmp_path / name)
        assert str(refused.value).endswith(message)


def test_a_number_that_fits_no_usual_unit_gets_no_advice():
    with pytest.raises(InputError) as refused:
        load_scene(WEDGE, ["damper.angle=100"])
    assert "did you mean" not in str(refused.value)
