"""From the finite elements of the wedge to the verdict on a wave in every nodal diameter."""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.contact.seating import solve_seating as seat
from bladefem.hbm.other_diameters import class_angle, class_growth
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import stability_verdict
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.family import family_member
from bladefem.study.adaptive.settings import first_settings
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import family_of_case, load_cases, other_diameters
from bladefem.study.pipeline.damper_contact import seat_damper
from bladefem.study.pipeline.other_diameters import (
    ClassVerdict,
    class_verdicts,
    sentence_of_classes,
)
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.run_records import Seating
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.stability_remarks import Disturbances
from bladefem.study.pipeline.validate_mesh import found_patches

MODES = 20
LOAD = 580.0


@pytest.fixture(scope="module")
def wheel():
    """Scene, mesh, patches, and the sector reduced in the wave's diameters and in two others."""
    scene = load_scene(
        "scenes/wedge.toml", ["mesh.size=14 mm", "mesh.scale=1.5", "mesh.seat_elements=4"]
    )
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = found_patches(scene, mesh, excited=True)
    problem = seat_damper(bodies, patches)
    reduced = reduce_sector(bodies, patches, [0, 9, 18], MODES, spanned=True)
    own = reduce_sector(bodies, patches, [2, 12], MODES).sector
    maps = {LOAD: seat(problem, LOAD)}
    case = load_cases(scene, mesh, Seating(problem, maps, None))[0]
    family = family_of_case(scene, mesh, reduced, patches, case)
    return scene, reduced, own, family


def test_diameters_that_were_not_reduced(wheel):
    """Ten frequencies to 2 %, the first ones to 1e-4, and the flexibility at the contact to 1 %."""
    scene, reduced, own, _ = wheel
    found = other_diameters(scene, reduced)(MODES)
    assert sorted(found) == list(range(19))
    for n, body in own.items():
        assert found[n].omega[:10] == pytest.approx(body.omega[:10], rel=2e-2)
        assert found[n].omega[0] == pytest.approx(body.omega[0], rel=1e-4)
        exact, near = (
            b.residual + (b.shapes / b.omega**2) @ b.shapes.conj().T for b in (body, found[n])
        )
        assert np.linalg.norm(near - exact, 2) < 0.01 * np.linalg.norm(exact, 2)


def test_the_classes_of_a_wave(wheel):
    """The class that is the wave's own, shifted by one blade, has the multiplier of the verdict."""
    scene, _, _, family = wheel
    settings = replace(
        first_settings(scene), modes=10, harmonics=7, samples=64, damper="rigid", points=4
    )
    model = family_member(family, settings).model
    point = solve(model, 2 * np.pi * 385.0, 7, 64)
    assert point.converged
    own = stability_verdict(model, point).multiplier
    same = family.disturbed(settings, 9)
    assert class_growth(model, point, same, class_angle(9, 9, 36)).multiplier == pytest.approx(
        own, rel=1e-6
    )
    found = class_verdicts(family, settings, point, 9, 36)
    assert [v.diameters for v in found] == [
        (1, 8, 10, 17),
        (2, 7, 11, 16),
        (3, 6, 12, 15),
        (4, 5, 13, 14),
    ]
    assert all(np.isfinite(v.multiplier) for v in found)
    # without the diameters that nobody reduced there is nothing to look at
    assert class_verdicts(replace(family, disturbed=None), settings, point, 9, 36) == ()


def test_the_sentence_names_the_diameters():
    own = Disturbances(4, (0, 9, 18), 19)
    stable = ClassVerdict((1, 8, 10, 17), 0.98), ClassVerdict((2, 7, 11, 16), 1.0)
    said = sentence_of_classes("80 N", stable, own)
    assert "80 N" in said and "1, 2, 7, 8, 10, 11, 16, 17, and is stable" in said
    assert said.endswith("not considered: 3, 4, 5, 6, 12, 13, 14, 15")
    lost = sentence_of_classes("80 N", (*stable, ClassVerdict((3, 6, 12, 15), 1.2, 5000.0)), own)
    assert "is left by those of 3, 6, 12, 15 (multiplier 1.2, mostly in modes near 5000 Hz)" in lost
    assert sentence_of_classes("80 N", (), own) == ""
