"""A stage reads no other field of the scene than those that its key is made of."""

from __future__ import annotations

import os
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from bladefem.contact.patch import make_patch
from bladefem.scene.kinds import kind_named
from bladefem.scene.toml import load_scene
from bladefem.study.modes.campbell import campbell_tables
from bladefem.study.modes.clamped_aerofoil import clamped_blade
from bladefem.study.modes.stress import mode_strength
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.body_mesh import mode_errors
from bladefem.study.pipeline.damper_contact import condense_contact
from bladefem.study.pipeline.normal_modes import excited_modes, find_modes
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.stage_inputs import all_declared, declared_fields, stage_key
from geometry.builders import build_here

SCENES = Path(__file__).parents[2] / "scenes"


def watched(value, read, path=""):
    """A stand-in for a scene or one of its tables that notes the fields read from it."""

    class Watched(type(value)):
        def __getattribute__(self, name):
            found = object.__getattribute__(value, name)
            if name not in {f.name for f in fields(value)}:
                return found
            dotted = f"{path}.{name}" if path else name
            if is_dataclass(found):
                return watched(found, read, dotted)
            read.add(dotted)
            return found

    return object.__new__(Watched)


def covered(field, declared):
    """A declared name is the field itself or a table that holds it."""
    return any(field == name or field.startswith(f"{name}.") for name in declared)


@pytest.fixture(scope="module")
def plane():
    scene = load_scene(SCENES / "plane.toml", ["mesh.scale=3"])
    mesh = build_here(scene)
    bodies = Bodies(scene, mesh)
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    modes = find_modes(bodies)
    return SimpleNamespace(scene=scene, mesh=mesh, bodies=bodies, patches=patches, modes=modes)


STAGES = {
    "mode errors": lambda scene, known: mode_errors(
        Bodies(scene, known.mesh), known.patches, excited_modes(scene, known.mesh, known.modes)
    ),
    "mesh": lambda scene, known: build_here(scene),
    "modes": lambda scene, known: (
        find_modes(Bodies(scene, known.mesh)),
        clamped_blade(Bodies(scene, known.mesh)),
    ),
    "campbell": lambda scene, known: campbell_tables(
        Bodies(scene, known.mesh), [0.0, 100.0], [scene.excitation.engine_order]
    ),
    "stress": lambda scene, known: mode_strength(
        Bodies(scene, known.mesh), excited_modes(scene, known.mesh, known.modes)
    ),
    "contact": lambda scene, known: condense_contact(Bodies(scene, known.mesh), known.patches),
    "reduction": lambda scene, known: reduce_sector(
        Bodies(scene, known.mesh), known.patches, [0], 5
    ),
}


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_reads_what_it_declares(stage, plane):
    read = set()
    STAGES[stage](watched(plane.scene, read), plane)
    assert read, "nothing was read: the stand-in does not watch"
    undeclared = [field for field in read if not covered(field, all_declared(stage, plane.scene))]
    assert sorted(undeclared) == []


@pytest.mark.parametrize(
    ("stage", "change"),
    [
        ("modes", "excitation.engine_order=3"),
        ("contact", "damper.mass=20 g"),
        ("campbell", "excitation.engine_order=3"),
        ("campbell", "operation.speed=2000 rpm"),
        ("response", "contact.mu=0.11"),
        ("mesh", "aerofoil.twist=7 deg"),
        ("mode errors", "excitation.engine_order=3"),
        ("damped motion", "model.nodal_diameters=0, 1, 6"),
    ],
)
def test_a_declared_field_changes_the_key(stage, change):
    scene = load_scene(SCENES / "wedge.toml")
    other = load_scene(SCENES / "wedge.toml", [change])
    assert stage_key(stage, scene) != stage_key(stage, other)


@pytest.mark.parametrize(
    ("stage", "change"),
    [
        ("mesh", "contact.mu=0.11"),
        ("mesh", "damper.mass=20 g"),
        ("contact", "excitation.engine_order=3"),
        ("response", "study.loads=90 N"),
    ],
)
def test_another_field_does_not(stage, change):
    scene = load_scene(SCENES / "wedge.toml")
    other = load_scene(SCENES / "wedge.toml", [change])
    assert stage_key(stage, scene) == stage_key(stage, other)


def test_every_mesh_depends_on_its_own_tables():
    scene = load_scene(SCENES / "wedge.toml")
    assert set(kind_named(scene.kind).shape) < set(declared_fields("mesh", scene))


def test_files_that_a_deck_includes_count_by_their_change(tmp_path):
    """Two levels of *INCLUDE, one on two lines; what a comment names does not."""
    deck = ["*HEADING", "** *INCLUDE, INPUT=remark.inc", "*Include,", '  input="inner.inc"']
    texts = {"a.inp": deck, "inner.inc": ["*INCLUDE, INPUT=nodes.inc"], "nodes.inc": ["*NODE"]}
    for name, lines in texts.items():
        (tmp_path / name).write_text("\n".join(lines))
    (tmp_path / "remark.inc").write_text("")
    scene = load_scene(SCENES / "plane.toml", ["mesh.scale=3"])
    scene = replace(
        scene, kind="imported", imported=replace(scene.imported, file=str(tmp_path / "a.inp"))
    )
    before = stage_key("mesh", scene)
    for name in texts:
        os.utime(tmp_path / name, (1e9, 1e9))
        after = stage_key("mesh", scene)
        assert after != before, name
        before = after
    os.utime(tmp_path / "remark.inc", (1e9, 1e9))
    assert stage_key("mesh", scene) == before
