"""Stability of the points of a curve: where the load follows the motion, where not, and where no
verdict is had.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from bladefem.damper.branch import inclined_contact
from bladefem.errors import InputError
from bladefem.hbm.continuation import follow
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.response import response
from bladefem.hbm.solve import solve
from bladefem.io.stage_cache import cached_stage
from bladefem.report.tables import readable_texts, units_of
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import first_for
from bladefem.study.pipeline import loads
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.load_remarks import load_warnings
from bladefem.study.pipeline.loads import curve_of
from bladefem.study.pipeline.motion_warnings import unstable_resonances
from bladefem.study.pipeline.stability_remarks import (
    ripple_sentence,
    stability_sentence,
)
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.resonance_in_time import ResonanceInTime
from bladefem.study.stability.verdicts import (
    MODES_IN_TIME,
    in_one_body,
    settings_in_time,
    stability_of,
)
from bladefem.view.response import draw_responses

HZ = 2 * np.pi


@pytest.fixture(scope="module")
def near():
    """The three motions of the inclined contact nearest to 150 Hz: rocking, between, stuck."""
    model, _ = inclined_contact()
    path = [
        p.solution
        for p in follow(
            model,
            "omega",
            solve(model, HZ * 200, 15, 512),
            (HZ * 110, HZ * 200),
            forward=False,
            steps=(0.005, 0.02),
        )
    ]
    size = [abs(p.probe[1, 0]) for p in path]
    wanted = (40.15e-6, 23.16e-6, 9.316e-6)  # see tests/damper/test_branch.py
    return model, [
        path[
            min(
                (i for i in range(len(path)) if abs(path[i].frequency - 150) < 1.5),
                key=lambda i, a=a: abs(size[i] - a),
            )
        ]
        for a in wanted
    ]


def test_the_middle_one_of_three_motions_is_unstable(near):
    model, points = near
    found = stability_of(model, points)
    assert list(found.verdict) == ["stable", "unstable", "stable"]
    assert found.multiplier[1] > 1.02
    assert found.bifurcation[1] == "fold"
    # the slider of a contact that sticks, whose multiplier is one, is left out
    assert 0.9 < found.multiplier[2] < 1.0


def test_prescribed_loads_need_no_computing():
    model = reference_model(load=3.0, harmonics=3)
    found = stability_of(model, list(response(model, HZ * np.array([1200.0, 1300.0]), 3, 64)))
    assert list(found.verdict) == ["unique", "unique"] and np.isnan(found.multiplier).all()
    assert "the only one" in stability_sentence([(found.verdict, found.multiplier)])


def test_no_verdict_without_a_form_in_time(near):
    model, points = near
    side = model.side(1)
    wave = replace(model, sides=(side, replace(side, shapes=side.shapes * np.exp(0.3j))))
    with pytest.raises(InputError, match="travelling wave"):
        in_one_body(wave)
    found = stability_of(wave, points)
    assert set(found.verdict) == {"unknown"} and "travelling wave" in found.reason
    assert "unknown" in stability_sentence([(found.verdict, found.multiplier)])
    lost = stability_of(model, [replace(points[0], converged=False)])
    assert list(lost.verdict) == ["unknown"]


def test_tables_and_pictures_show_it():
    points = pd.DataFrame(
        {
            "load": 20.0,
            "frequency": [100.0, 101.0, 102.0],
            "amplitude": [1e-6, 2e-6, 1e-6],
            "converged": True,
            "stability": ["stable", "unstable", "unknown"],
            "multiplier": [1.0, 1.2, np.nan],
        }
    )
    assert "largest Floquet multiplier" in " ".join(readable_texts(points).columns)
    assert "multiplier" not in units_of(points)
    axes = draw_responses(points).axes[0]
    marks = [line for line in axes.get_lines() if line.get_label() == "unstable (1)"]
    assert len(marks) == 1 and list(marks[0].get_xdata()) == [101.0]


def test_a_motion_that_a_march_alone_leaves_has_no_multiplier():
    said = stability_sentence([(np.array(["unstable", "stable"]), np.full(2, np.nan))])
    assert "1 unstable," in said and "nan" not in said


def rippling(kept):
    """A curve of one unstable point of 1 mm."""
    top = SimpleNamespace(frequency=100.0, probe=np.array([[0.0], [1e-3]]), harmonics=1)
    return SimpleNamespace(
        load=50.0, mass=None, frequency=np.array([100.0]), amplitude=np.array([1e-3]), bifurcation=np.array(["torus"]), peak=top,
        unstable_peak=top, march_at_peak=kept, peak_amplitude=1e-3, peak_frequency=100.0,
        keeps_unstable=True, march_replaces_balance=False,
    )  # fmt: skip


def test_a_ripple_is_told_apart_from_another_amplitude():
    near, far = (KeptBand(100.0, 0.99e-3, high, 200) for high in (1.02e-3, 1.2e-3))
    assert "within 2.0 %" in ripple_sentence([rippling(near), rippling(far)], 0.05)
    assert not list(unstable_resonances([rippling(near)], 0.05))
    (said,) = load_warnings(unstable_resonances([rippling(far), rippling(far)], 0.05))
    assert "the resonance given is an unstable motion" in said and "its error" in said.advice
    assert said.detail.count("keeps between 990 and 1200 um") == 2
    assert ripple_sentence([rippling(far)], 0.05) == ""
    # given in place of the balance where the mesh leaves little of the accuracy
    instead = SimpleNamespace(**vars(rippling(near)) | {"march_replaces_balance": True})
    assert ripple_sentence([instead], 0.05) == ""
    marched = SimpleNamespace(
        **vars(rippling(far)) | {"march_replaces_balance": True, "peak_amplitude": 1.2e-3}
    )
    for one in (instead, marched):
        (said,) = load_warnings(unstable_resonances([one], 0.05))
        assert said.startswith("under 50 N the amplitude given is that of an integration in time")
        assert "50 N: unstable motion of 1000 um at 100 Hz (torus); marched in time" in said.detail


def test_an_unstable_resonance_that_no_march_follows_says_so():
    lost = rippling(KeptBand(100.0, np.nan, np.nan, 0, "too long"))
    (said,) = load_warnings(unstable_resonances([lost], 0.05))
    assert "what the blade comes to after it is not known" in said
    assert "is not known: too long" in said.detail and "contact.points" in said.advice
    below = SimpleNamespace(**vars(lost) | {"keeps_unstable": False, "peak_amplitude": 0.9e-3})
    (said,) = load_warnings(unstable_resonances([below], 0.05))
    assert "is the highest motion that is not unstable" in said
    assert "given 900 um at 100 Hz" in said.detail


@pytest.mark.parametrize("by_law", [True, False])
def test_a_march_with_the_law_of_the_layer_leaves_no_error_by_it(monkeypatch, by_law):
    """What the law changes is part of the error of marches of its tangent alone."""
    scene = load_scene("scenes/plane.toml", ["accuracy=20 %", "study.band=1150 Hz, 1600 Hz"])
    model = reference_model(load=30.0, points=2, modes=4, harmonics=3)
    case = LoadCase(30.0, model.elements, np.eye(4))
    seen = loads.curve_with_room

    def with_unknown_law(*given):
        curve, unseen, room = seen(*given)
        return curve, replace(unseen, layer_law=np.inf), room

    sought = ResonanceInTime(1300.0, 1e-6, 1e-6, 0.03, 2, 5, 300, by_law=by_law)
    monkeypatch.setattr(loads, "curve_with_room", with_unknown_law)
    monkeypatch.setattr(loads, "_sought_in_time", lambda *_: sought)
    curve = curve_of(scene, case, lambda _: family_of(model), first_for(4))
    assert np.isnan(curve.layer_law) if by_law else np.isinf(curve.layer_law)
    assert np.isfinite(curve.error) == by_law


def test_a_curve_from_the_folder_says_what_the_fresh_one_said(tmp_path):
    """What is read again are copies of the fresh curve's points."""
    scene = load_scene("scenes/plane.toml", ["accuracy=2 %", "study.band=1150 Hz, 1600 Hz"])
    model = reference_model(load=3.0, points=2, modes=10, harmonics=31)
    case = LoadCase(3.0, model.elements, np.eye(4))
    curve = curve_of(scene, case, lambda _: family_of(model), first_for(10))
    band = KeptBand(curve.peak_frequency, *(share * curve.peak_amplitude for share in (0.99, 1)), 9)
    fresh = replace(curve, unstable_peak=curve.peak, march_at_peak=band)
    cached_stage(tmp_path, "curve", "key", lambda: fresh)
    again, seconds = cached_stage(tmp_path, "curve", "key", lambda: None)
    assert seconds is not None and fresh.keeps_unstable and again.keeps_unstable
    assert ripple_sentence([again], 0.05) == ripple_sentence([fresh], 0.05) != ""
    said = list(unstable_resonances([fresh], 0.001))
    assert list(unstable_resonances([again], 0.001)) == said != []
    above = replace(band, lowest=2e-3, highest=2.5e-3)
    marched = replace(again, march_at_peak=above, march_replaces_balance=True)
    assert marched.peak_amplitude == 2.5e-3 and marched.balance_amplitude == again.peak_amplitude
    assert marched.error == pytest.approx(replace(again, march_at_peak=None).error + 0.2)
    assert not replace(again, unstable_peak=None).keeps_unstable
    assert not replace(again, unstable_peak=replace(again.peak, omega=1.0)).keeps_unstable


@pytest.mark.parametrize(
    ("chosen", "now", "known", "expected"),
    [
        (("modes",), 10, 60, MODES_IN_TIME),
        (("modes",), 10, 12, 12),
        (("modes",), 40, 60, 40),
        ((), 3, 60, 3),
    ],
)
def test_marches_have_modes_that_the_resonance_does_not_need(chosen, now, known, expected):
    """As many as there are, and never other than a scene says."""
    settings = replace(first_for(known), modes=now, chosen=chosen)
    assert settings_in_time(SimpleNamespace(modes=known), settings).modes == expected
