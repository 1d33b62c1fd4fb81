"""A scene with a loading history: what is refused, how seats are pressed, and what reaches the
friction elements.
"""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.contact.interface_elements import friction_elements
from bladefem.errors import InputError
from bladefem.report.opened import _patches
from bladefem.scene.tables import Scene
from bladefem.scene.toml import dump_scene, load_scene, vary
from bladefem.study.pipeline.damper_contact import contact_patches
from bladefem.study.pipeline.history import history_sentence, refuse_jamming
from bladefem.study.pipeline.pipeline import run
from bladefem.study.pipeline.scene_mesh import build_mesh

PLANE = "scenes/plane.toml"


def test_histories_are_words_or_speeds_and_survive_writing(tmp_path):
    scene = vary(Scene(), "contact.history", ["9000 rpm", "8000 rpm"])
    assert scene.contact.history == pytest.approx([300 * np.pi, 800 * np.pi / 3])
    assert vary(scene, "contact.history", "9000, 8000 rpm").contact.history == pytest.approx(
        scene.contact.history
    )
    for one in (scene, vary(Scene(), "contact.history", "spin-up")):
        file = tmp_path / "scene.toml"
        file.write_text(dump_scene(one))
        assert load_scene(file).contact.history == one.contact.history


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact.history": "spinup"}, "expected one of frictionless, spin-up.*did you mean"),
        ({"contact.history": ["8000 rpm", "0 rpm"]}, "speed of 0 rpm lifts the damper off"),
        ({"contact.history": ["-5 rpm"]}, "contact.history = -5 rpm: expected 0"),
        (
            {"contact.mu": 0.9, "contact.history": "spin-up"},
            r"damper.angle = 40 deg.*self-locking up to 41.98",
        ),
        ({"contact.mu": 0.0, "contact.history": "spin-up"}, "leaves no friction"),
        ({"contact.stiffness": "map", "contact.history": "spin-up"}, "stiffness = 'given'"),
    ],
)
def test_what_no_history_can_seat_is_refused_before_any_work(changes, message):
    with pytest.raises(InputError, match=message):
        scene = Scene()
        for name, value in changes.items():
            scene = vary(scene, name, value)


@pytest.fixture(scope="module")
def seated(tmp_path_factory):
    """The plane scene up to its seats, without friction and after spinning up."""
    scene = vary(load_scene(PLANE), "study.loads", "50 N", "operation.speed", "3000 rpm")
    spun = vary(scene, "contact.history", "spin-up")
    folder = tmp_path_factory.mktemp("seats")
    return (
        run(scene, folder / "plain", until="contact"),
        run(spun, folder / "spun", until="contact"),
    )


def test_flat_seats_are_loaded_alike_with_and_without_friction(seated):
    """Flat dampers are pressed straight into their seats: friction carries nothing."""
    plain, spun = seated
    assert spun.contact.own == pytest.approx(plain.contact.own, rel=1e-6)
    mass = spun.contact.masses[0]
    assert mass.share == pytest.approx(0.0, abs=1e-6)
    assert mass.mass == pytest.approx(mass.frictionless, rel=1e-6)
    assert mass.lightest == pytest.approx(mass.heaviest, rel=1e-6)
    assert "friction, which carries" in history_sentence(spun.contact.masses)


def test_patches_are_found_in_the_folder_after_a_history(seated):
    for one in seated:
        stored = _patches(one.scene, one.folder)
        assert [patch.name for patch in stored] == ["this", "next"]


def test_elements_carry_what_the_seating_left_and_rest_there(seated):
    _, spun = seated
    maps = spun.contact.maps[50.0]
    elements, _ = friction_elements(spun.contact.problem, maps, spun.scene.contact, 0.8, tangents=1)
    assert elements.t0 == pytest.approx(np.vstack([m.traction for m in maps]))
    limit = elements.mu * np.maximum(elements.n0, 0.0)
    assert (np.abs(elements.t0[:, 0]) <= limit * (1 + 1e-7) + 1e-9).all()
    few = replace(spun.scene.contact, points=2)
    joined, _ = friction_elements(spun.contact.problem, maps, few, 0.8, tangents=1)
    assert joined.t0.sum() == pytest.approx(elements.t0.sum(), abs=1e-9)


def test_seats_of_any_mesh_that_jam_are_refused_from_the_mesh_alone():
    scene = vary(load_scene("scenes/wedge.toml"), "mesh.size", "12 mm")
    scene = vary(scene, "contact.history", "spin-up")
    mesh = build_mesh(scene)
    patches = contact_patches(mesh)
    refuse_jamming(scene, mesh, patches)
    # beyond what the scene's own check lets through: tan 65 deg is 2.14
    jammed = replace(scene, contact=replace(scene.contact, mu=2.3))
    with pytest.raises(InputError, match="friction alone holds the damper"):
        refuse_jamming(jammed, mesh, patches)
