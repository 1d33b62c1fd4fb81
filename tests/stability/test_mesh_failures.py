"""Where the contact mesh is too coarse for any indicator (F27), and what tells it."""

from __future__ import annotations

import numpy as np

from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.contact_mesh import MIN_NODES
from bladefem.study.pipeline import pipeline
from verification.paper.blades import peak
from verification.paper.plane_row import paper_model, row_of_blades

SCENE = load_scene(
    "scenes/plane.toml",
    [
        "contact.kt=1e6 N/m",
        "contact.normal=prescribed",
        # pressure between rigid faces, as in the paper
        "contact.stiffness=map",
        "study.loads=63 N",
        "study.band=1150 Hz, 1200 Hz",
    ],
)
TENTH = vary(SCENE, mesh__contact_size=SCENE.plane.seat_width / 10)


def run(scene):
    """Curve of the load, and what is said about the contact mesh."""
    result = pipeline.run(scene, None)
    return result.response.curves[0], [m for m in result.messages if m.startswith("contact mesh")]


def test_F27_the_finest_patch_is_itself_too_coarse():
    """63 N, ten elements on each seat: 0.15 % reported, 30 % off, since 6 nodes press; with forty 21
    press, and 0.7 %.

    Half as many contact points change the amplitude by 9.8 and 2.9 %.
    """
    (coarse, warned), (default, silent) = run(TENTH), run(SCENE)
    true = run(vary(SCENE, mesh__contact_size=SCENE.plane.seat_width / 80))[0].peak_amplitude
    assert coarse.settings.error < 0.02 < coarse.error
    assert coarse.peak_amplitude < 0.72 * true
    assert "only 6 of 11 nodes" in warned[0]
    assert coarse.halved > 0.05 > default.halved
    assert abs(default.peak_amplitude / true - 1) < 0.02
    assert not any("pressed" in text for text in silent)


def test_F27_one_interface_law_has_no_such_error():
    """The same seats on the layer of their springs: all nodes press, and ten elements differ from
    forty by 0.08 %.
    """
    consistent = [vary(scene, contact__stiffness="given") for scene in (TENTH, SCENE)]
    (coarse, warned), (default, _) = (run(scene) for scene in consistent)
    assert warned == []
    assert abs(coarse.peak_amplitude / default.peak_amplitude - 1) < min(0.02, 2 * coarse.error)


def test_F27_few_pressed_nodes_are_what_matters():
    """Between stick and slip (100 N) the error falls with the number that press: 37 % at 6, 14 % at
    11, 1.3 % at 21.
    """
    amplitude, pressed = [], []
    for parts in (10, 20, 40, 80):
        scene = vary(SCENE, mesh__contact_size=SCENE.plane.seat_width / parts)
        model = paper_model(scene, row_of_blades(scene), 100.0)
        amplitude.append(peak(model, (1150, 1200), 3, 128).amplitude)
        pressed.append(np.count_nonzero(model.elements.n0) // 2)
    error = np.abs(np.array(amplitude) / amplitude[-1] - 1)
    assert pressed == [6, 11, 21, 42]
    assert error[0] > 0.3 and error[1] > 0.1 and error[2] < 0.03
    assert pressed[1] < MIN_NODES <= pressed[2]
