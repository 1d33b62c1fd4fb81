"""A blade of a file without a speed turns at a default one, which its frequencies show: that is
told.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from bladefem.cli.main import main
from bladefem.scene.assumed import assumed_physics
from bladefem.scene.tables import Scene
from bladefem.scene.toml import given_keys, read_tables, scene_of, vary
from geometry.session import gmsh_session

LENGTH, WIDTH, HEIGHT = 100.0, 20.0, 5.0


@pytest.fixture
def cantilever(tmp_path):
    """A bar of hexahedra along x, in millimetres, with its root as a named face."""
    with gmsh_session() as gmsh:
        base = gmsh.model.occ.addRectangle(0, 0, 0, LENGTH, WIDTH)
        gmsh.model.occ.extrude([(2, base)], 0, 0, HEIGHT)
        gmsh.model.occ.synchronize()
        for _, edge in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(edge, 5)
        for _, face in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(face)
            gmsh.model.mesh.setRecombine(2, face)
        gmsh.model.mesh.setTransfiniteVolume(1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        root = gmsh.model.getEntitiesInBoundingBox(-1, -1, -1, 1, WIDTH + 1, HEIGHT + 1, 2)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in root], name="clamp")
        gmsh.model.addPhysicalGroup(3, [1], name="blade")
        gmsh.write(str(tmp_path / "bar.msh"))
    return tmp_path / "bar.msh"


def first_frequency(folder):
    """[Hz] of the table that the command leaves."""
    lines = (folder / "frequencies.csv").read_text().splitlines()
    head, first = lines[0].split(","), lines[1].split(",")
    return float(first[head.index("frequency [Hz]")])


def test_the_default_speed_of_a_blade_is_told_where_frequencies_are(cantilever, tmp_path, capsys):
    """At rest an Euler-Bernoulli beam has 0.5596 sqrt(E / rho) h / sqrt(12) / L^2, a broad one up
    to 1 / sqrt(1 - nu^2) times that.
    """
    scene = tmp_path / "bar.toml"
    kind = 'kind = "imported"\n[imported]\nfile = "bar.msh"\nscale = 1e-3\nsectors = 0\n'
    scene.write_text(kind, encoding="utf-8")
    common = [str(scene), "--pictures", "1", "-o"]
    assert main(["modes", *common, str(tmp_path / "turning")]) == 0
    told = capsys.readouterr().out
    assert "not given, and taken by default: operation.speed = 8000 rpm, " in told
    assert "material.blade.E = 210 GPa, material.blade.nu = 0.3" in told
    page = (tmp_path / "turning" / "report_modes.md").read_text(encoding="utf-8")
    assert "(at 8000 rpm; residual" in page
    # at rest as a closed form has it, which the default speed is not
    still = ["--set", "operation.speed=0 rpm", "--set", "material.blade.rho=7850 kg/m^3"]
    assert main(["modes", *common, str(tmp_path / "still"), *still]) == 0
    told = capsys.readouterr().out
    assert "operation.speed =" not in told and "material.blade.rho =" not in told
    assert "(at rest; residual" in (tmp_path / "still" / "report_modes.md").read_text()
    beam = 0.55959 * (210e9 / 7850) ** 0.5 * 1e-3 * HEIGHT / 12**0.5 / (1e-3 * LENGTH) ** 2
    assert beam < first_frequency(tmp_path / "still") < beam / (1 - 0.3**2) ** 0.5
    assert first_frequency(tmp_path / "turning") > 1.04 * first_frequency(tmp_path / "still")


def test_shipped_scenes_leave_none_of_them_out():
    for name in ("wedge", "wedge_ground", "plane", "own_blade"):
        written = read_tables(f"scenes/{name}.toml")
        assert assumed_physics(scene_of(written, "scenes"), given_keys(written)) == []


def test_what_takes_the_place_of_a_constant_is_no_assumption():
    given = {"operation.speed", "material.blade.rho"}
    assert "material.blade.E" in assumed_physics(Scene(), given)[0]
    row = "20 degC: E=210 GPa; nu=0.3"
    heated = vary(Scene(), "material.blade.table", [row])
    assert assumed_physics(heated, given) == []
    # a program's own scene: nobody knows what was given
    assert assumed_physics(Scene(), None) == []


def test_the_scene_to_start_from_says_what_no_mesh_tells(cantilever):
    assert main(["look", str(cantilever), "--scene"]) == 0
    text = cantilever.with_suffix(".toml").read_text(encoding="utf-8")
    written = tomllib.loads(text)
    assert written["operation"]["speed"] == "0 rpm"
    assert set(written["material"]["blade"]) == {"E", "nu", "rho"}
    assert assumed_physics(scene_of(written, cantilever.parent), given_keys(written)) == []


@pytest.mark.parametrize("file", sorted(Path("scenes").glob("*.toml")), ids=lambda file: file.stem)
def test_shipped_scenes_give_speed_and_material(file):
    tables = read_tables(file)
    assert assumed_physics(scene_of(tables, "scenes"), given_keys(tables)) == []


def test_a_table_names_what_it_gives_alone():
    """A table of E leaves nu and rho to their defaults."""
    tables = {
        "kind": "plane blades",
        "operation": {"speed": 0.0},
        "material": {"blade": {"table": ["20 degC: E=210 GPa", "600 degC: E=180 GPa"]}},
    }
    (said,) = assumed_physics(scene_of(tables), given_keys(tables))
    assert "material.blade.nu = 0.3" in said and "material.blade.rho" in said
    assert "material.blade.E" not in said
