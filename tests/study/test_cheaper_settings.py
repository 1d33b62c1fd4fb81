"""A choice that goes down: what is not needed is given up again, and nothing that is needed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.data import PortModel, RigidBody
from bladefem.hbm.linear_resonances import stuck_resonances
from bladefem.hbm.model import Damping
from bladefem.hbm.peak import Peak, find_peak
from bladefem.hbm.reference_blade import reference_model
from bladefem.study.adaptive import cheaper_settings as cheaper_module
from bladefem.study.adaptive.cheaper_settings import cheaper_settings
from bladefem.study.adaptive.family import Family, Member, family_member, family_of
from bladefem.study.adaptive.peak_errors import peak_from
from bladefem.study.adaptive.resonance_choice import choose_at_peak
from bladefem.study.adaptive.settings import Settings

ACCURACY = 0.05
RICH = Settings(
    modes=10,
    harmonics=15,
    samples=1024,
    damper="rigid",
    points=None,
    chosen=("harmonics", "samples"),
)


@pytest.fixture(scope="module")
def slipping():
    """The reference blade near its second mode, with slip, and its truth."""
    model = reference_model(1e6, 0.06, 3.0, phase=0.0, points=6, modes=10, harmonics=63)
    omega = float(stuck_resonances(model)[1])
    return model, find_peak(model, omega, 31, 4096)


def chosen(family, settings, truth):
    """Settings that hold, climbing only."""
    start = peak_from(family, settings, truth.solution, settings, ACCURACY)
    return choose_at_peak(family, settings, start, ACCURACY, fixed=("modes",))


def test_harmonics_and_samples_are_given_up_as_far_as_the_accuracy_allows(slipping):
    model, truth = slipping
    family = family_of(model)
    enough = chosen(family, RICH, truth)
    assert (enough[0].harmonics, enough[0].samples) == (15, 1024)
    settings, peak, errors = cheaper_settings(family, *enough, ACCURACY)
    assert settings.harmonics < 15 and settings.samples < 1024
    assert abs(peak.height / truth.height - 1) < ACCURACY
    assert errors.total >= abs(peak.height / truth.height - 1) / 2
    assert settings.error == errors.total <= ACCURACY


def test_what_the_user_gave_stays(slipping):
    model, truth = slipping
    family = family_of(model)
    given = replace(RICH, chosen=("samples",))
    settings, *_ = cheaper_settings(family, *chosen(family, given, truth), ACCURACY)
    assert settings.harmonics == 15 and settings.samples < 1024


def test_a_step_back_that_costs_more_than_it_saves_is_not_tried(slipping, monkeypatch):
    model, truth = slipping
    family = family_of(model)
    enough = chosen(family, RICH, truth)
    monkeypatch.setattr(cheaper_module, "CURVE_POINTS", 0)
    monkeypatch.setattr(cheaper_module, "peak_from", None)
    assert cheaper_settings(family, *enough, ACCURACY)[0] == enough[0]


def test_a_damper_that_lifts_off_keeps_the_contact_points_that_it_needs():
    eight = replace(RICH, points=8, chosen=("points",))
    for lift, few in ((0, False), (1, True)):
        solution = SimpleNamespace(states={"lift": lift})
        peak = Peak(solution, 1.0, 1)
        assert cheaper_module._too_few_points(replace(eight, points=4), peak) == few
        assert not cheaper_module._too_few_points(eight, peak)


@pytest.mark.parametrize(("stiffness", "kept"), [(1e10, "rigid"), (3e5, "elastic")])
def test_an_elastic_damper_of_another_load_gives_way_to_a_rigid_one(slipping, stiffness, kept):
    """A damper with modes of its own: stiff it is as good as rigid, soft it is not."""
    model, truth = slipping
    body = model.damper
    assert isinstance(body, RigidBody)
    points = len(body.B)
    bend = np.linspace(-1.0, 1.0, points)[:, None] ** np.arange(1, 31)
    elastic = PortModel(
        np.sqrt(stiffness / body.mass[0, 0]) * np.arange(31.0),
        np.hstack([body.B, bend]) / np.sqrt(body.mass[0, 0]),
        np.zeros((points, points)),
        {"contact": slice(0, points)},
    )
    flexible = replace(model, damper=(elastic,), damper_damping=Damping(ratio=0.01))
    nodes = np.arange(len(model.elements.kt))
    family = Family(
        lambda s: Member(flexible if s.damper == "elastic" else model, nodes),
        10,
        dampers=("rigid", "elastic"),
    )
    start = replace(RICH, harmonics=3, samples=128, damper="elastic", chosen=("damper",))
    enough = chosen(family, start, truth)
    assert enough[0].damper == "elastic"
    settings, peak, _ = cheaper_settings(family, *enough, ACCURACY)
    assert settings.damper == kept
    rich = find_peak(flexible, enough[1].omega, 15, 1024, near=enough[1])
    assert peak.height == pytest.approx(rich.height, rel=ACCURACY)
    assert family_member(family, settings).model is (flexible if kept == "elastic" else model)


def test_fewer_harmonics_have_to_save_enough_to_risk_a_second_curve(slipping):
    """A flank of a small model with lift-off asked for the harmonics again, and the curve that was
    swept twice took longer than the richest one (seed 59 of benchmarks/choice_random.py).
    """
    model, _ = slipping
    family = family_of(model)
    seven = replace(RICH, harmonics=7, samples=128)
    assert cheaper_module._saves(family, RICH, replace(seven, samples=1024))
    assert not cheaper_module._saves(family, seven, replace(seven, harmonics=3))
    # samples are not asked for by flanks
    assert cheaper_module._saves(family, seven, replace(seven, samples=64))
