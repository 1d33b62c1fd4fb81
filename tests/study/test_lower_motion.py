"""Lower motions beside a resonance with lift-off, against a closed form."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import rebounding

from bladefem.hbm.solution import mostly_lifts_off, size
from bladefem.hbm.solve import solve
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline import loads as loads_module
from bladefem.study.pipeline import response_remarks as remarks_module
from bladefem.study.pipeline.stability_remarks import lower_sentence
from bladefem.study.stability import lower_motion as module
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.lower_motion import LowerMotion, lower_motion

SETTINGS = Settings(10, 15, 512, "rigid")
OMEGA, LOSS = 1.2, 0.04
# the mass without the stop it does not reach
LINEAR = 1 / abs(1 - OMEGA**2 + 1j * LOSS * OMEGA)


def bouncing_motion(gap):
    """A mass that bounces off a stiff stop, and its motion followed upwards from its resonance
    without that stop.
    """
    model = rebounding(10.0, gap, LOSS)
    point = solve(model, 1.0, 15, 512)
    for omega in np.arange(1.01, OMEGA + 1e-9, 0.01):
        point = solve(model, omega, 15, 512, start=point)
    assert point.converged
    return model, point


@pytest.fixture(scope="module")
def bounced():
    return bouncing_motion(1.2 * LINEAR)


def test_the_motion_short_of_the_stop_is_found_beside_the_one_that_bounces(bounced):
    model, high = bounced
    assert mostly_lifts_off(high) and size(high) > 1.5 * LINEAR
    found = lower_motion(family_of(model), SETTINGS, high, size(high), high.frequency)
    assert found.amplitude == pytest.approx(LINEAR, rel=1e-6)
    assert found.doubt == ""


def test_none_is_told_where_the_only_motion_reaches_the_stop():
    """Without a motion short of the stop Newton's method ends on one that bounces."""
    model, high = bouncing_motion(0.3 * LINEAR)
    assert lower_motion(family_of(model), SETTINGS, high, size(high), high.frequency) is None


def test_none_is_sought_without_lift_off(bounced, monkeypatch):
    model, high = bounced
    monkeypatch.setattr(module, "solve", None)
    closed = replace(high, states=high.states | {"lift": 0})
    assert lower_motion(family_of(model), SETTINGS, closed, size(high), high.frequency) is None
    softened = replace(SETTINGS, softened=True)
    assert lower_motion(family_of(model), softened, high, size(high), high.frequency) is None


@pytest.mark.parametrize(
    ("lowest", "highest", "reason", "told"),
    [
        # a ripple grows to a motion that is low as well
        (0.9, 1.1, "", (1.1, "")),
        # it leads to the resonance
        (0.9, 4.0, "", None),
        (np.nan, np.nan, "too long", (1.0, "too long")),
    ],
)
def test_a_low_motion_that_does_not_last_is_marched(
    bounced, monkeypatch, lowest, highest, reason, told
):
    model, high = bounced
    kept = KeptBand(1.0, lowest * LINEAR, highest * LINEAR, 100, reason)
    unstable = SimpleNamespace(verdict="unstable")
    monkeypatch.setattr(module, "stability_verdict", lambda *_: unstable)
    monkeypatch.setattr(module, "band_by_steps", lambda *_: kept)
    found = lower_motion(family_of(model), SETTINGS, high, size(high), high.frequency)
    if told is None:
        assert found is None
    else:
        assert found.amplitude == pytest.approx(told[0] * LINEAR, rel=1e-6)
        assert found.doubt == told[1]


@pytest.mark.parametrize(
    ("asked", "sought", "expected"),
    [
        (False, None, None),
        (True, None, (3.0, 60.0)),
        # marches have found it elsewhere
        (True, SimpleNamespace(highest=4.0, frequency=61.0), (4.0, 61.0)),
    ],
)
def test_it_is_sought_at_the_resonance_that_is_given(monkeypatch, asked, sought, expected):
    monkeypatch.setattr(loads_module, "lower_motion", lambda *args: args[3:])
    scene = SimpleNamespace(study=SimpleNamespace(stability=asked))
    judged = SimpleNamespace(amplitude=3.0, point=SimpleNamespace(frequency=60.0))
    curve = SimpleNamespace(settings=SETTINGS)
    assert loads_module._lower_motion(scene, None, curve, judged, sought) == expected


def test_the_report_tells_both_motions():
    def curve(load, lower):
        return SimpleNamespace(
            load=load, lower=lower, curve_amplitude=610e-6, peak_frequency=369.54
        )

    said = lower_sentence([curve(36.0, LowerMotion(131e-6)), curve(73.0, None)])
    assert "some 130 um in place of 610 um at 369.54 Hz under 36 N;" in said
    assert "73 N" not in said and "not known" not in said
    assert "not known: too long" in lower_sentence([curve(9.0, LowerMotion(1e-4, "too long"))])
    assert lower_sentence([curve(73.0, None)]) == ""


def test_the_remarks_on_responses_have_that_sentence(monkeypatch):
    for name in vars(remarks_module):
        if name.endswith("_sentence"):
            monkeypatch.setattr(remarks_module, name, lambda *_: "")
    for name in ("_of_settings", "history_remarks", "resonance_warnings"):
        monkeypatch.setattr(remarks_module, name, lambda *_: [])
    monkeypatch.setattr(remarks_module, "beyond_tolerance", lambda *_: "")
    monkeypatch.setattr(remarks_module, "lower_sentence", lambda _: "two motions")
    scene = SimpleNamespace(study=SimpleNamespace(stability=False), accuracy=0.05)
    judged = SimpleNamespace(reason="")
    (said,) = remarks_module.response_remarks(scene, SETTINGS, [], 8, judged)
    assert said == "two motions" and said.level == "warning"
