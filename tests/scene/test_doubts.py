"""What is allowed and improbable."""

from __future__ import annotations

from pathlib import Path

import pytest

from bladefem.scene.toml import load_scene
from bladefem.scene.warnings import implausible_values

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "file", sorted((ROOT / "scenes").glob("*.toml")), ids=lambda file: file.stem
)
def test_shipped_scenes_raise_none(file):
    assert implausible_values(load_scene(file)) == []


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        (
            "material.blade.E=210 MPa",
            "material.blade.E = 210 MPa: solids for machines have 1 to 1000 GPa",
        ),
        (
            "material.damper.rho=7.85 kg/m^3",
            "material.damper.rho = 7.85 kg/m^3: solids for machines have 500 to 25000",
        ),
        ("damper.mass=3 kg", "damper.mass = 3 kg: underplatform dampers have 0.1 g to 1 kg"),
        (
            "study.masses=20 g, 3 kg",
            "study.masses = 3 kg: underplatform dampers have 0.1 g to 1 kg",
        ),
        ("operation.speed=8000 rad/s", "the rim at 200 mm moves with 1600 m/s"),
        ("operation.speed=30000 rpm", "the tip at 365 mm moves with 1147 m/s"),
        (
            "operation.damping=0",
            "operation.damping = 0: enough for modes, responses need more than 0",
        ),
        (
            "mesh.size=8 mm",
            "mesh.size = 8 mm: larger than the thinnest part, the aerofoil halfway up with 5.18 mm",
        ),
        ("mesh.size=1 m", "mesh.size = 1 m: larger than"),
        ("contact.mu=0", "contact.mu = 0: the seats dissipate nothing, the damper adds its mass"),
        (
            "damper.angle=16 deg",
            "friction alone holds the damper between its seats (self-locking up to 16.6992 deg), "
            "which a seating without friction does not know",
        ),
    ],
)
def test_of_the_wedge(override, sentence):
    (said,) = implausible_values(load_scene(ROOT / "scenes" / "wedge.toml", [override]))
    assert sentence in said


def test_stiffnesses_that_nothing_reads_are_named():
    """A stiffness of a whole seat takes the place of that of each unit of area, in its own table."""
    scene = ROOT / "scenes" / "wedge.toml"
    own = ["contact.left.kn=2e7 N/m", "contact.left.kn_area=9 N/mm^3"]
    assert implausible_values(load_scene(scene, ["contact.kt=4e6 N/m", *own])) == [
        "contact.kt_area = 40 N/mm^3 is not used: contact.kt = 4e+06 N/m, the stiffness of the "
        "whole seat, takes its place",
        "contact.left.kn_area = 9 N/mm^3 is not used: contact.left.kn = 2e+07 N/m, the stiffness "
        "of the whole seat, takes its place",
    ]
    assert implausible_values(load_scene(scene, ["contact.kt_area=auto", "contact.kt=4e6"])) == []
    assert implausible_values(load_scene(scene, ["contact.left.kt=4e6 N/m"])) == []


def test_fields_that_nothing_reads_are_named():
    """The phase of plane blades on a wheel, and SLEPc's fields beside the other eigensolver."""
    scene = ROOT / "scenes" / "wedge.toml"
    fields = ["solver.vectors=40", "solver.petsc=-eps_monitor", "excitation.phase=30 deg"]
    assert implausible_values(load_scene(scene, ["solver.eigensolver=lanczos", *fields])) == [
        "solver.vectors = 40 is not used: it is SLEPc's, and solver.eigensolver = lanczos",
        "solver.petsc = -eps_monitor is not used: it is SLEPc's, and solver.eigensolver = lanczos",
        "excitation.phase = 30 deg is not used: on a wheel excitation.engine_order = 9 and "
        "disc.sectors = 36 give the phase between blades",
    ]
    plane = ROOT / "scenes" / "plane.toml"
    assert implausible_values(load_scene(plane, fields)) == []


def test_limits_themselves_raise_none():
    text = [
        "material.blade.E=1 GPa",
        "material.damper.E=1000 GPa",
        "material.blade.rho=500 kg/m^3",
        "mesh.size=5 mm",
    ]
    assert implausible_values(load_scene(ROOT / "scenes" / "wedge.toml", text)) == []


def test_nodal_diameters_of_a_single_blade_are_not_used():
    given = ["model.nodal_diameters=0, 3"]
    assert implausible_values(load_scene(ROOT / "scenes" / "plane.toml", given)) == [
        "model.nodal_diameters = 0, 3 is not used: this scene has a single blade, no wheel"
    ]
    assert implausible_values(load_scene(ROOT / "scenes" / "wedge.toml", given)) == []


@pytest.mark.parametrize(
    ("scene", "override"),
    [
        ("hertz", "accuracy=0.1"),
        ("hertz", "mesh.fillet_elements=9"),
        ("hertz", "mesh.curved=false"),
        ("hertz", "material.blade.expansion=1.2e-5 1/K"),
        ("hertz", "material.damper.rho=4430 kg/m^3"),
        ("punch", "mesh.fillet_elements=9"),
        ("plane", "mesh.fillet_elements=9"),
        ("plane", "mesh.curved=false"),
        ("plane", "mesh.algorithm=hxt"),
        ("wedge", "root.pitch=10 mm"),
        ("wedge", "root.neck=50 mm"),
        ("wedge", "shroud.width=8 mm"),
        ("wedge", "shroud.at=0.5"),
        ("zmass", "mesh.curved=false"),
        ("zmass", "contact.kn=1e6 N/m"),
        ("zmass", "foundation.phase=10 deg"),
    ],
)
def test_fields_that_a_kind_does_not_read_are_told(scene, override):
    (said,) = implausible_values(load_scene(ROOT / "scenes" / f"{scene}.toml", [override]))
    assert said.startswith(f"{override.partition('=')[0]} = ") and " is not used: " in said


@pytest.mark.parametrize("kind", ["hertz", "punch"])
def test_pairs_without_volumes_do_not_read_how_volumes_are_filled(kind):
    given = [f"{kind}.dimension=2", "mesh.algorithm=hxt"]
    (said,) = implausible_values(load_scene(ROOT / "scenes" / f"{kind}.toml", given))
    assert said.startswith("mesh.algorithm = hxt is not used: ")


@pytest.mark.parametrize(
    "override", ["imported.tolerance=0.01", "mesh.fillet_elements=9", "damper.angle=41 deg"]
)
def test_a_drawing_is_not_matched_and_its_platforms_have_the_angles(override):
    (said,) = implausible_values(load_scene(ROOT / "scenes" / "own_blade.toml", [override]))
    assert said.startswith(f"{override.partition('=')[0]} = ") and " is not used: " in said


@pytest.mark.parametrize(
    "override",
    ["mesh.size=1 mm", "mesh.scale=2", "mesh.algorithm=hxt", "damper.angle=41 deg"]
    + ["damper.length=10 mm"],
)
def test_a_mesh_of_a_file_is_not_meshed_nor_its_damper_drawn(tmp_path, override):
    (tmp_path / "sector.msh").touch()
    scene = tmp_path / "scene.toml"
    scene.write_text('kind = "imported"\n[imported]\nfile = "sector.msh"\nsectors = 36\n')
    (said,) = implausible_values(load_scene(scene, [override]))
    assert said.startswith(f"{override.partition('=')[0]} = ") and " is not used: " in said
    assert implausible_values(load_scene(scene, ["damper.mass=20 g", "damper.axial=held"])) == []


def test_a_row_of_plane_blades_is_told_to_turn_without_spin_softening():
    """In-plane motion of a blade of 150 mm with its platform, hub radius 0, 6000 rpm: 245.3 Hz in the
    row, 224.6 about the axis z, apart by the 100 Hz of the speed.
    """
    plane = ROOT / "scenes" / "plane.toml"
    (said,) = implausible_values(load_scene(plane, ["operation.speed=6000 rpm"]))
    assert said.startswith("operation.speed = 6000 rpm: ") and "(100 Hz)^2" in said
    still = ["operation.speed=6000 rpm", "operation.stiffening=false"]
    assert implausible_values(load_scene(plane, still)) == []


def test_parts_that_a_blade_has_are_read():
    root = ["root.lobes=2", "root.pitch=7 mm", "root.taper=10 deg"]
    shroud = ["shroud.thickness=3 mm", "shroud.gap=2 mm"]
    for given in (root, shroud):
        assert implausible_values(load_scene(ROOT / "scenes" / "wedge.toml", given)) == []
    one = load_scene(ROOT / "scenes" / "wedge.toml", ["root.lobes=1", "root.taper=10 deg"])
    assert "root.taper = 10 deg is not used" in implausible_values(one)[0]


def test_directions_of_what_is_alike_in_all_are_not_used():
    turned = "material.blade.angles=10 deg, 0 deg, 0 deg"
    (said,) = implausible_values(load_scene(ROOT / "scenes" / "wedge.toml", [turned]))
    assert said.startswith("material.blade.angles is not used")
    crystal = ["material.blade.E=130 GPa", "material.blade.G=125 GPa", turned]
    assert implausible_values(load_scene(ROOT / "scenes" / "wedge.toml", crystal)) == []


@pytest.mark.parametrize(
    ("scene", "override"),
    [
        ("zmass", "foundation.amplitude=3 mm, 1 mm"),
        ("zmass", "material.damper.rho=4430 kg/m^3"),
        ("punch", "mesh.curved=false"),
        ("hertz", "mesh.algorithm=hxt"),
    ],
)
def test_fields_that_a_kind_reads_are_not(scene, override):
    assert implausible_values(load_scene(ROOT / "scenes" / f"{scene}.toml", [override])) == []
