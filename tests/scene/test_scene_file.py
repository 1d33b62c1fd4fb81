"""Scenes: read, varied, listed and written back."""

from __future__ import annotations

import tomllib
from math import pi
from pathlib import Path

import pytest

from bladefem.errors import InputError
from bladefem.scene.fields import each_field
from bladefem.scene.kinds import KINDS
from bladefem.scene.tables import Material, Scene
from bladefem.scene.toml import (
    dump_scene,
    given_keys,
    load_scene,
    read_tables,
    resolved_rows,
    scene_of,
    vary,
)

SCENES = sorted(Path("scenes").glob("*.toml"))
WEDGE = Path(__file__).with_name("wedge.toml")  # does not follow the shipped one


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_shipped_scenes_load_and_come_back_from_their_own_text(path, tmp_path):
    scene = load_scene(path)
    (tmp_path / "scene.toml").write_text(dump_scene(scene), encoding="utf-8")
    assert load_scene(tmp_path / "scene.toml") == scene


def test_every_kind_has_a_shipped_scene():
    assert {load_scene(p).kind for p in SCENES} == set(KINDS)


def test_wedge_scene_says_what_it_means():
    scene = load_scene(WEDGE)
    assert scene.operation.speed == pytest.approx(8000 * 2 * pi / 60)
    assert scene.disc.sectors == 36 and len(scene.study.loads) == 8
    assert scene.excitation.engine_order == 6 and isinstance(scene.excitation.engine_order, int)
    assert scene.accuracy == pytest.approx(0.02)


def test_overrides_win_over_the_file():
    scene = load_scene(
        WEDGE,
        [
            "aerofoil.twist=25 deg",
            "study.loads=20, 30 kN",
            "operation.stiffening=no",
            "damper.mass='12 g'",
            "material.blade.E=70 GPa",
            "excitation.direction=1,0,0",
        ],
    )
    assert scene.aerofoil.twist == pytest.approx(25 * pi / 180)
    assert scene.study.loads == (2e4, 3e4) and scene.operation.stiffening is False
    assert scene.damper.mass == pytest.approx(0.012) and scene.material.blade.E == 7e10
    assert scene.excitation.direction == (1.0, 0.0, 0.0)
    assert load_scene(WEDGE, ["study.loads=auto"]).study.loads is None


def test_vary_makes_a_checked_copy():
    scene = Scene()
    assert vary(scene, aerofoil__twist="25 deg").aerofoil.twist == pytest.approx(25 * pi / 180)
    assert vary(scene, "aerofoil.twist", "25 deg", "contact.mu", 0.2) == vary(
        scene, aerofoil__twist="25 deg", contact__mu="20 %"
    )
    assert vary(scene, material__blade=Material(E=7e10)).material.blade.E == 7e10
    assert vary(vary(scene, damper__mass=0.02), damper__mass=None) == scene
    assert scene == Scene()
    for wrong in (
        {"aerofoil__twits": 1},
        {"contact__mu": -1},
        {"plane__length": 0.1},
        {"disc__bore_radius": 0.5},
    ):
        with pytest.raises(InputError):
            vary(scene, **wrong)
    with pytest.raises(InputError, match="name and value in turn"):
        vary(scene, "aerofoil.twist")


def test_vary_checks_values_that_were_made_in_python():
    with pytest.raises(InputError, match=r"material\.blade\.nu"):
        vary(Scene(), material__blade=Material(nu=0.5))


def test_resolved_table_marks_defaults():
    written = read_tables(WEDGE, ["contact.points=12"])
    rows = {r.name: r for r in resolved_rows(scene_of(written), given_keys(written))}
    assert not rows["aerofoil.twist"].is_default and rows["aerofoil.twist"].value == "20 deg"
    assert rows["aerofoil.camber"].is_default and rows["damper.mass"].value == "auto"
    assert rows["contact.points"].value == "12" and not rows["contact.points"].is_default
    assert not any(name.startswith("plane.") for name in rows)
    assert all(r.help for r in rows.values())
    assert {
        r.name for r in resolved_rows(Scene(contact=Scene().contact)) if not r.is_default
    } == set()


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "imported"])
def test_defaults_of_every_kind_are_a_valid_scene(kind):
    scene = scene_of({"kind": kind})
    assert scene_of(tomllib.loads(dump_scene(scene))) == scene


def test_relative_mesh_file_starts_at_the_scene(tmp_path):
    (tmp_path / "blade.msh").write_text("")
    (tmp_path / "scene.toml").write_text('kind = "imported"\n[imported]\nfile = "blade.msh"\n')
    scene = load_scene(tmp_path / "scene.toml")
    assert scene.imported.file == str(tmp_path / "blade.msh")


def test_text_with_quotes_and_letters_of_other_languages_comes_back():
    scene = Scene(title='a "quoted" \\ title, µ, 叶片')
    assert scene_of(tomllib.loads(dump_scene(scene))) == scene


def test_every_field_has_a_help_and_a_range_that_holds_its_default():
    for field in each_field():
        low, high = field.meta.get("low"), field.meta.get("high")
        assert field.meta.get("help"), field.name
        for value in field.default if isinstance(field.default, tuple) else (field.default,):
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                assert (low is None or value >= low) and (high is None or value <= high), field.name
