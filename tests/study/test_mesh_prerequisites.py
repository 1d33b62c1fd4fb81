"""What is missing in a mesh is reported at once, before long work."""

from __future__ import annotations

from dataclasses import replace

import pytest
from wheels import ring

from bladefem.errors import InputError
from bladefem.hbm.model import Damping
from bladefem.scene.tables import Excitation, Operation, Scene, Support
from bladefem.study.modes import survey
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.validate_mesh import check_blade, found_patches, refuse_loads

NOSE = Scene(excitation=Excitation(at="nose"))


def test_node_set_and_pair_are_missed_together():
    with pytest.raises(
        InputError,
        match=r"no node set or face 'nose'.*; and the mesh has no contact pair on its right seat",
    ):
        found_patches(NOSE, ring(), excited=True)
    with pytest.raises(InputError, match=r"^the mesh has no contact pair on its right seat"):
        found_patches(NOSE, ring(), excited=False)


def test_a_clamp_that_the_mesh_does_not_have_names_its_field_and_what_there_is():
    scene = Scene(support=Support(clamp="clmap"))
    with pytest.raises(InputError, match=r"^support\.clamp = 'clmap': .*did you mean 'clamp'\?$"):
        check_blade(scene, ring())
    bare = replace(ring(), faces={}, nodes={})
    with pytest.raises(InputError, match=r"expected one that holds the blade; there are none$"):
        check_blade(scene, bare)


def test_faces_of_loads():
    refuse_loads(Scene(), ring(), [("excitation", 0.0), ("tip", 5.0)], None)
    with pytest.raises(InputError, match=r"^forced, tpi: .*did you mean 'tip'\?$"):
        refuse_loads(Scene(), ring(), [("tpi", 5.0)], None)
    with pytest.raises(
        InputError, match=r"excitation\.at.*; and forced, nose: the mesh has no such face"
    ):
        refuse_loads(NOSE, ring(), [("nose", 5.0)], None)
    still = Scene(operation=Operation(damping=0.0))
    with pytest.raises(InputError, match=r"operation\.damping = 0"):
        refuse_loads(still, ring(), [], None)
    refuse_loads(still, ring(), [], Damping(structural=0.002))


@pytest.fixture
def no_work(monkeypatch):
    """A mesh at hand, and nothing that would assemble it."""
    monkeypatch.setattr(pipeline, "build_mesh", lambda scene, comm: ring())

    def never(*_):
        raise AssertionError("long work")

    for module, name in ((pipeline, "find_modes"), (survey, "_all_modes")):
        monkeypatch.setattr(module, name, never)


def test_names_are_checked_before_the_modes(no_work):
    with pytest.raises(InputError, match="forced, nose"):
        survey.survey_modes(Scene(), None, survey.Wanted(loads=[("nose", 500.0)]))
    with pytest.raises(InputError, match=r"'nose'.*on its right seat"):
        pipeline.run(NOSE, None)


@pytest.mark.parametrize(
    "scene", [Scene(operation=Operation(damping=0.0)), Scene(excitation=Excitation(force=0.0))]
)
def test_a_response_without_damping_or_force_is_refused_before_the_mesh(scene, monkeypatch):
    monkeypatch.setattr(pipeline, "build_mesh", lambda *_: pytest.fail("long work"))
    for until in ("reduction", "response"):
        with pytest.raises(InputError, match="expected above 0"):
            pipeline.run(scene, None, until=until)
