"""The damper's own load among those that are studied."""

import pytest

from bladefem.errors import InputError
from bladefem.scene.tables import Operation, Scene, Study
from bladefem.study.pipeline.seated_loads import studied_loads


def test_own_load_takes_its_place_among_the_others():
    scene = Scene(study=Study(loads=(60.0, 200.0), own_load=True))
    assert studied_loads(scene, 121.38246) == [60.0, 121.4, 200.0]
    assert studied_loads(scene, 200.0) == [60.0, 200.0]
    assert studied_loads(Scene(study=Study(loads=(200.0, 60.0))), 121.4) == [200.0, 60.0]


def test_own_load_at_rest_is_refused():
    with pytest.raises(
        InputError, match=r"study.own_load = true: nothing presses .* operation.speed = 0"
    ):
        studied_loads(Scene(operation=Operation(speed=0.0), study=Study(own_load=True)), None)
