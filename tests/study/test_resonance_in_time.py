"""Resonances sought by marching: against all motions of the balance, and against closed forms."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import folding_pair, rebounding, single_mass

from bladefem.hbm.branches import find_branches
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.report.response_points import points_of
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline import loads as loads_module
from bladefem.study.stability import resonance_in_time as module
from bladefem.study.stability import settled_march, uphill_climb
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.lower_motion import LowerMotion
from bladefem.study.stability.resonance_in_time import ResonanceInTime, resonance_in_time
from bladefem.view.response import FOLLOWED, MARCHED

BAND = (249.0, 431.0)
SETTINGS = Settings(10, 15, 512, "rigid")


@pytest.fixture(scope="module")
def folding():
    """The model whose resonance a sweep misses, and the highest of all its motions [m]."""
    model = folding_pair()
    sweep = [p for p in response(model, np.linspace(*BAND, 40), 7, 256) if p.converged]
    found = find_branches(model, BAND, sweep, 7, 256, peak=1e-4)
    return SimpleNamespace(model=model, truth=max(map(size, found.points)))


@pytest.mark.parametrize("omega", [380.0, 360.0, 330.0, 300.0, 280.0])
def test_the_peak_of_a_fold_is_found_from_a_motion_far_below(folding, omega):
    """From the top of what a sweep sees, and from motions at which nothing points to it."""
    start = solve(folding.model, omega, 15, 512)
    assert start.converged and size(start) < folding.truth / 3
    found = resonance_in_time(family_of(folding.model), SETTINGS, start)
    off = abs(found.highest / folding.truth - 1)
    assert off < 0.02
    assert off / 2 < found.error < 0.05
    assert found.lowest > 0.95 * found.highest
    assert found.frequency == pytest.approx(52.6, rel=5e-3)


def test_where_no_period_is_like_another_the_end_is_marched_on(folding, monkeypatch):
    """As if the band of a steady motion were wide: it keeps what it is."""
    start = solve(folding.model, 360.0, 15, 512)
    found = resonance_in_time(family_of(folding.model), SETTINGS, start)
    monkeypatch.setattr(settled_march, "WIDE_BAND", -1.0)
    longer = resonance_in_time(family_of(folding.model), SETTINGS, start)
    assert longer.periods == found.periods + settled_march.CALMING_PERIODS
    assert longer.highest == pytest.approx(found.highest, rel=2e-3)
    # less is left to its limit
    assert 0.9 * found.error < longer.error < found.error


def test_a_search_that_is_not_closed_in_says_so(folding):
    """From far below the resonance, where the low amplitude makes the steps far too long."""
    start = solve(folding.model, 250.0, 15, 512)
    found = resonance_in_time(family_of(folding.model), SETTINGS, start)
    assert found.highest < 0.9 * folding.truth and found.error == np.inf


def test_an_error_as_large_as_the_amplitude_is_unknown(folding, monkeypatch):
    start = solve(folding.model, 360.0, 15, 512)
    monkeypatch.setattr(module, "LARGEST_ERROR", 1e-3)
    found = resonance_in_time(family_of(folding.model), SETTINGS, start)
    assert found.highest == pytest.approx(folding.truth, rel=0.02)
    assert found.error == np.inf


def test_a_response_that_falls_smoothly_has_its_linear_peak():
    """A contact so far open that it never closes: the peak of one mass, force / (2 zeta k)."""
    model = rebounding(1.0, 1e3, 0.04)
    start = solve(model, 0.985, 1, 64)
    found = resonance_in_time(family_of(model), replace(SETTINGS, harmonics=1), start)
    assert found.highest == pytest.approx(1 / 0.04, rel=1e-2)
    assert 2 * np.pi * found.frequency == pytest.approx(1.0, rel=5e-3)
    assert found.error < 0.05


def settled_at(mean):
    """What a blade keeps to at 1 rad/s, every period alike."""
    state = SimpleNamespace(drive=SimpleNamespace(omega=1.0))
    return settled_march.SettledMotion(1.0, mean, mean, mean, state, True, 0.0, 0.0)


@pytest.mark.parametrize("change", [0.03, -0.03])
def test_what_shorter_steps_change_is_part_of_the_error(monkeypatch, change):
    """Of a layer that stiffens; steps of the linear one are short enough by themselves."""
    top = uphill_climb.Top(settled_at(1.0), settled_at(0.9), 1.0)
    shorter = {
        settled_march.INSTANTS_PER_PERIOD: 1.0,
        2 * settled_march.INSTANTS_PER_PERIOD: 1 + change,
    }
    monkeypatch.setattr(module, "state_of_solution", lambda *_: None)
    monkeypatch.setattr(module, "highest_uphill", lambda *_: top)
    monkeypatch.setattr(module, "_error", lambda *_: 0.01)
    monkeypatch.setattr(
        module, "settle", lambda model, state, work, instants: settled_at(shorter[instants])
    )
    for decay, error in ((np.ones(1), 0.01 + abs(change)), (None, 0.01)):
        found, reported = module._by_short_steps(
            SimpleNamespace(decay=decay), None, settled_march.MarchBudget()
        )
        assert found.best.mean == 1.0
        assert reported == pytest.approx(error)


@pytest.mark.parametrize(
    ("heights", "settled"),
    [
        (np.ones(36), True),
        # too short
        (np.ones(24), False),
        # a thousandth in twelve periods, which goes on
        (1 + 1e-3 * np.arange(36) / 12, False),
        # the same from one third to the next, and half of it back
        (1 + 1e-3 * np.repeat([0.0, 1.0, 0.5], 12), True),
        # comes to rest: nine tenths of the way are behind it
        (1 + 1e-2 * np.exp(-np.arange(72) / 10), True),
        # swells, its mean resting
        (1 + 2e-2 * (np.arange(36) > 24) * (-1.0) ** np.arange(36), False),
    ],
)
def test_a_march_has_settled_where_its_mean_and_its_band_have(heights, settled):
    motion = heights[:, None, None] * np.cos(2 * np.pi * np.arange(64) / 64)
    assert settled_march._has_settled(motion) == settled


def test_where_nothing_can_be_marched_there_is_no_resonance(folding):
    """Normal loads that are prescribed."""
    model = single_mass()
    point = solve(model, 0.9, 3, 64)
    assert resonance_in_time(family_of(model), SETTINGS, point) is None


def one_point(**given):
    """A curve of one point, 1 mm at 100 Hz."""
    names = (
        "frequency amplitude first converged method route residual iterations slipping drift "
        "dissipated imbalance estimated tolerated checked"
    )
    peak = SimpleNamespace(
        frequency=100.0,
        omega=200 * np.pi,
        probe=np.array([[0.0], [1e-3]]),
        harmonics=1,
        states={"slip": 0, "lift": 3},
        drift=1e-6,
        work=SimpleNamespace(dissipated=4e-3, input=5e-3),
    )
    columns = {name: np.ones(1) for name in names.split()}
    marks = {"stability": np.array(["stable"]), "bifurcation": np.array([""])}
    columns |= marks | {"multiplier": np.ones(1), "branch": np.zeros(1, int)}
    return loads_module.Curve(load=9.0, mass=None, **{"peak": peak, **columns, **given})


def test_a_resonance_sought_in_time_is_the_one_of_the_curve():
    sought = ResonanceInTime(101.0, 1.9e-3, 2e-3, 0.07, 8, 5, 900, friction_work=6e-3)
    curve = one_point(
        settings=replace(SETTINGS, error=np.inf), resonance_by_march=sought, halved=0.3
    )
    assert (curve.peak_frequency, curve.peak_amplitude) == (101.0, 2e-3)
    assert curve.balance_amplitude == 1e-3 and curve.error == pytest.approx(0.07)
    # a balance of the same resonance tells what contact points change of it
    near = replace(curve, resonance_by_march=replace(sought, highest=1.06e-3))
    assert near.error == pytest.approx(0.07 + 0.3)
    row = points_of(curve).iloc[-1]
    assert (row["method"], row["frequency"], row["amplitude"]) == (MARCHED, 101.0, 2e-3)
    assert row["dissipated"] == curve.friction_work == 6e-3
    assert curve.input_work == pytest.approx(10e-3)
    # the row of the resonance has the lower motion beside it
    lower = points_of(replace(curve, lower=LowerMotion(1.16e-4)))["lower_amplitude"]
    assert lower.tolist() == [pytest.approx(np.nan, nan_ok=True), 1.2e-4]
    assert "lower_amplitude" not in points_of(curve)
    # of the march neither is known
    assert np.isnan([row["slipping"], row["drift"]]).all()
    assert points_of(replace(curve, resonance_by_march=None))["method"].tolist() == [1.0]
    assert sought.sentence.startswith("the blade keeps between 1900 and 2000 um at 101 Hz (")


def test_the_resonance_of_a_stiff_layer_is_the_one_of_the_curve():
    """Where it was reached; what a march from the curve's own motion keeps to is scaled with it."""
    curve = one_point(
        settings=replace(SETTINGS, error=0.04), halved=np.nan, layer_law=0.01, layer_shift=0.02
    )
    assert (curve.peak_frequency, curve.peak_amplitude) == (100.0, 1e-3)
    reached = replace(curve, layer_height=-0.1)
    assert reached.peak_frequency == pytest.approx(102.0)
    assert reached.peak_amplitude == pytest.approx(0.9e-3)
    assert reached.over_balance == pytest.approx(0.9)
    assert reached.error == curve.error == pytest.approx(0.05)
    row = points_of(reached).iloc[-1]
    assert row["method"] == FOLLOWED and row["amplitude"] == pytest.approx(0.9e-3)
    assert row["dissipated"] == pytest.approx(3.6e-3) and row["slipping"] == 3
    band = KeptBand(100.0, 0.8e-3, 1.1e-3, 200)
    # from the resonance itself, to both of its sides
    higher = replace(reached, march_at_peak=band)
    assert higher.marched == pytest.approx(0.2)
    # from another motion, above the resonance alone
    elsewhere = SimpleNamespace(**(vars(curve.peak) | {"omega": 190 * np.pi}))
    assert replace(higher, unstable_peak=elsewhere).marched == pytest.approx(0.1)
    instead = replace(
        higher, march_replaces_balance=True, march_at_peak=replace(band, friction_work=3e-3)
    )
    assert instead.peak_amplitude == pytest.approx(0.99e-3)
    assert instead.friction_work == pytest.approx(2.7e-3)


def test_more_contact_points_that_change_much_have_their_own_resonance(monkeypatch):
    """The shipped wedge under 9 N: 8 points a seat have it at 367.9 Hz, 32 keep 1.45 mm there and
    1.7 mm at 367.6 Hz. Here it moves from 100 to 95 rad/s and becomes 10 % lower.
    """
    bend, height = 0.02, 0.9
    marched = []

    def settled(omega, top, most):
        """1 / height^2 is a parabola, as that of one mode."""
        mean = (most**-2 + bend / 2 * (omega - top) ** 2) ** -0.5
        return settled_march.SettledMotion(omega, mean, mean, mean, None, True, 0.0, 0.0)

    def moved(model, before, omega, work):
        marched.append(omega)
        return settled(omega, 95.0, height)

    for one in (module, uphill_climb):
        monkeypatch.setattr(one, "settle_at", moved)
    monkeypatch.setattr(module, "_marched_model", lambda *_: None)
    monkeypatch.setattr(module, "_most_points", lambda *_: 63)
    monkeypatch.setattr(module, "_error", lambda *_: 0.02)
    top = uphill_climb.Top(settled(100.0, 100.0, 1.0), settled(97.0, 100.0, 1.0), bend)
    few = module._Reported(top.best, 8, 0.3)
    work = settled_march.MarchBudget()
    reported = module._with_more_points(None, replace(SETTINGS, points=8), None, few, top, work)
    assert reported.best.omega == pytest.approx(95.0, abs=1.5)
    assert reported.best.mean == pytest.approx(height, rel=uphill_climb.WORTH_A_MARCH)
    assert reported.points == 32
    assert reported.error == pytest.approx(0.02 + 0.1, abs=uphill_climb.WORTH_A_MARCH)
    # towards the higher neighbour first, and no further to the other side
    assert max(marched) == 100.0
    # without room for a search the change at the frequency of fewer points is all that is known
    work.operations = np.inf
    reported = module._with_more_points(None, replace(SETTINGS, points=8), None, few, top, work)
    assert reported.best.omega == 100.0
    assert reported.error == pytest.approx(0.3 + 1 - reported.best.mean)
