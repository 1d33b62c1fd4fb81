"""Lower motions beside a resonance with lift-off, against a closed form."""

from __future__ import annotations

import inspect
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import rebounding

from bladefem.hbm.solution import mostly_lifts_off, size
from bladefem.hbm.solve import solve
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline import accuracy_warnings, motion_warnings
from bladefem.study.pipeline import loads as loads_module
from bladefem.study.pipeline import response_remarks as remarks_module
from bladefem.study.pipeline.load_remarks import LoadRemark, Reason, load_warnings
from bladefem.study.pipeline.motion_warnings import lower_motions
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
            load=load, mass=None, lower=lower, curve_amplitude=610e-6, peak_frequency=369.54
        )

    (said,) = load_warnings(lower_motions([curve(36.0, LowerMotion(131e-6)), curve(73.0, None)]))
    assert said.endswith("under 36 N (some 130 um in place of 610 um)")
    assert "36 N: some 130 um in place of 610 um at 369.54 Hz" in said.detail
    assert "73 N" not in said.detail and "not known" not in said.detail
    (said,) = load_warnings(lower_motions([curve(9.0, LowerMotion(1e-4, "too long"))]))
    assert "not known: too long" in said.detail
    assert not list(lower_motions([curve(73.0, None)]))


def test_every_warning_on_curves_reaches_the_remarks(monkeypatch):
    """Each of the two modules of warnings, whatever functions they have."""
    given = []
    for part in (motion_warnings, accuracy_warnings):
        own = {k: v for k, v in vars(part).items() if getattr(v, "__module__", "") == part.__name__}
        for name in own:
            if inspect.isfunction(own[name]) and not name.startswith("_"):
                given.append(name)
                remark = LoadRemark(Reason(f"{name} under {{loads}}", "wait"), "9 N")
                monkeypatch.setattr(part, name, lambda *_, remark=remark: [remark])
    for name in ("ripple_sentence", "undriven_sentence"):
        monkeypatch.setattr(remarks_module, name, lambda *_: "")
    for name in ("_of_settings", "history_remarks"):
        monkeypatch.setattr(remarks_module, name, lambda *_: [])
    scene = SimpleNamespace(study=SimpleNamespace(stability=False), accuracy=0.05)
    judged = SimpleNamespace(reason="")
    said = remarks_module.response_remarks(scene, SETTINGS, [], 8, judged)
    assert len(given) == 17 and {f"{name} under 9 N" for name in given} == set(said)
    assert all(one.level == "warning" and one.advice for one in said)
