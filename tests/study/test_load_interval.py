"""The range of a load's resonance over loading histories: what is asked, found and said."""

import pytest
from models import wedge_between_masses

from bladefem.errors import InputError, NotSolvedError
from bladefem.hbm.linear_resonances import stuck_resonances
from bladefem.hbm.peak import find_peak
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline.load_interval import interval_sentence, load_interval

SETTINGS = Settings(modes=10, harmonics=3, samples=256, points=None, damper="elastic")


def test_every_load_says_how_sure_its_resonance_is():
    found = []
    for force, at, mode in ((2.0, 0, 0), (10.0, 1, 0), (20.0, 1, 0)):
        model = wedge_between_masses(force, at)
        top = find_peak(model, stuck_resonances(model)[mode], 3, 256).solution
        found.append(load_interval(model, SETTINGS, top, 0.02))
    assert [one.certificate for one in found] == ["point", "monotone", "sampled"]
    assert found[1].lowest < 0.95 * found[1].highest
    text = interval_sentence([1.0, 2.0, 3.0], found)
    assert "at 1 N the resonance does not depend on the loading history" in text
    assert "at 2 N 1 contact points never slip" in text and "certified monotone" in text
    assert "sampled, it may be wider" in text


def test_a_resonance_that_is_not_found_again_is_said(monkeypatch):
    model = wedge_between_masses(10.0, 1)
    top = find_peak(model, stuck_resonances(model)[0], 3, 256).solution

    def lost(*_, **__):
        raise NotSolvedError("peak search stopped at 40 Hz")

    monkeypatch.setattr("bladefem.study.pipeline.load_interval.find_peak", lost)
    found = load_interval(model, SETTINGS, top, 0.02)
    assert found.certificate == "unknown"
    assert "was not found: peak search stopped at 40 Hz" in interval_sentence([5.0], [found])


@pytest.mark.parametrize(
    ("field", "value"),
    [("contact.normal", "prescribed"), ("model.damper", "mass"), ("model.static", "uncoupled")],
)
def test_an_interval_that_can_only_be_a_point_is_refused_before_any_work(field, value):
    scene = vary(Scene(), "study.interval", True)
    with pytest.raises(InputError, match=f"study.interval = true: with {field} = '{value}'.*point"):
        vary(scene, field, value)
