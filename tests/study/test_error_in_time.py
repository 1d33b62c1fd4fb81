"""The error of a resonance with lift-off from a march, against balances with many harmonics."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import bouncing

from bladefem.data import Elements
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.study.adaptive.checked_curve import CheckedCurve
from bladefem.study.adaptive.family import Family, Member, family_member, family_of
from bladefem.study.adaptive.settings import first_for
from bladefem.study.stability import error_in_time as error_module
from bladefem.study.stability import judged_resonance as judged_module
from bladefem.study.stability.error_in_time import (
    LIFTING_POINTS,
    ErrorInTime,
    Marches,
    carried_motion,
    error_in_time,
    error_of_doubt,
)
from bladefem.study.stability.judged_resonance import JudgedResonance, judged_in_time
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.march_from_motion import FEWEST_POINTS
from bladefem.study.stability.verdicts import Stability

OMEGA = 0.9
# of the excitation of `bouncing`: three harmonics are 3.1 % off there
STRONGER = 4.0
PARTS = {"harmonics": 0.3, "samples": 0.1, "points": 0.01, "modes": 0.002}


def hopping():
    """`bouncing` under a force that lifts it off."""
    model = bouncing()
    return replace(model, excitation={1: STRONGER * model.excitation[1]})


def in_parts(count):
    """`hopping` with its contact in so many equal parts at one place."""
    K = np.array([[2.0, -0.3, 0.1], [-0.3, 1.5, 0.2], [0.1, 0.2, 1.2]])
    ports = {"contact": [0, 1, 2] * count, "load": [0, 1], "probe": [0]}
    body = port_model_from_matrices(np.eye(3), K, ports, C=0.02 * K)
    kt, kn, mu, n0 = 1.0 / count, 2.0 / count, 0.4, 0.15 / count
    parts = Elements(*(np.full(count, x) for x in (kt, kn, mu, n0)), tangents=2)
    return ReducedModel((body,), parts, {1: STRONGER * np.array([0.1, 0.08j])})


def settings_of(error, **given):
    return replace(first_for(3), harmonics=3, samples=64, error=error, **given)


def test_a_march_tells_what_harmonics_leave_out():
    model = hopping()
    family = Family(lambda s: Member(model, np.arange(1)), 3)
    top = solve(model, OMEGA, 3, 64)
    truth = abs(size(top) / size(solve(model, OMEGA, 31, 512)) - 1)
    assert top.states["lift"] == 1
    curve = CheckedCurve(settings_of(0.412), [], {}, parts=PARTS)
    marches = Marches(family)
    found = error_in_time(marches, curve, top, 0.05)
    assert found.error == pytest.approx(0.012 + truth, abs=2e-3)
    assert found.band.points is None
    # a march from this very point that was done before is not done again
    (motion,) = marches.done
    marches.done[motion] = replace(found.band, lowest=0.9 * size(top))
    again = error_in_time(marches, curve, top, 0.05)
    assert again.error == pytest.approx(0.012 + 1 / 0.9 - 1)


@pytest.mark.parametrize("error", [None, 0.01, 0.013])
def test_an_error_that_balances_tell_as_well_is_left(error):
    model = hopping()
    family = Family(lambda s: Member(model, np.arange(1)), 3)
    top = solve(model, OMEGA, 3, 64)
    parts = PARTS | {"points": 0.02}
    curve = CheckedCurve(settings_of(error), [], {}, parts=parts)
    assert error_in_time(Marches(family), curve, top, 0.012) is None


@pytest.mark.parametrize(("nodes", "counted"), [(2, 1.0), (4, 2.0)])
def test_an_error_that_is_unknown_is_told_by_twice_the_contact_points(nodes, counted):
    """Which counts twice where there are more of them still."""
    family = family_of(in_parts(nodes), [nodes])
    coarse = settings_of(np.inf, points=1)
    top = solve(family_member(family, coarse).model, OMEGA, 3, 64)
    truth = abs(size(top) / size(solve(hopping(), OMEGA, 31, 512)) - 1)
    moved = carried_motion(family, coarse, top, replace(coarse, points=2))
    assert size(moved) == pytest.approx(size(top), rel=1e-6)
    assert moved.f.shape[0] == 2 and not moved.converged
    found = error_in_time(Marches(family), CheckedCurve(coarse, [], {}), top, 0.05)
    assert found.band.points == 2
    assert found.error == pytest.approx(counted * truth, abs=counted * 2e-3)
    every = replace(coarse, points=nodes)
    assert error_in_time(Marches(family), CheckedCurve(every, [], {}), moved, 0.05) is None


def test_a_doubtful_motion_is_marched_with_fewer_contact_points():
    """Sixteen parts of one contact, of which eight are marched, have the motion of the whole."""
    family = family_of(in_parts(2 * LIFTING_POINTS), [2 * LIFTING_POINTS])
    fine = settings_of(0.01, points=2 * LIFTING_POINTS)
    top = solve(family_member(family, fine).model, OMEGA, 3, 64)
    truth = abs(size(top) / size(solve(hopping(), OMEGA, 31, 512)) - 1)
    found = error_of_doubt(Marches(family), CheckedCurve(fine, [top], {}), top)
    assert found.error == pytest.approx(truth, abs=2e-3) and found.error > 0.02
    assert found.band.points == LIFTING_POINTS
    # balances tell more
    curve = CheckedCurve(replace(fine, error=0.05), [top], {})
    assert error_of_doubt(Marches(family), curve, top) is None


@pytest.mark.parametrize(
    "given", [{"chosen": ()}, {"points": LIFTING_POINTS}, {"points": LIFTING_POINTS - 2}]
)
def test_so_are_points_of_the_user_and_no_more_than_these(given):
    family = family_of(in_parts(2 * LIFTING_POINTS), [2 * LIFTING_POINTS])
    fine = replace(settings_of(0.01, points=2 * LIFTING_POINTS), **given)
    top = solve(family_member(family, fine).model, OMEGA, 3, 64)
    truth = abs(size(top) / size(solve(hopping(), OMEGA, 31, 512)) - 1)
    found = error_of_doubt(Marches(family), CheckedCurve(fine, [top], {}), top)
    assert found.error == pytest.approx(truth, abs=2e-3) and found.error > 0.02
    assert found.band.points == min(fine.points, LIFTING_POINTS)


@pytest.mark.parametrize(("lifting", "unknown"), [(1.0, True), (0.5, True), (0.25, False)])
@pytest.mark.parametrize("points", [2 * LIFTING_POINTS, FEWEST_POINTS])
def test_the_error_is_unknown_where_most_contacts_lift_off_and_no_march_is_possible(
    monkeypatch, points, lifting, unknown
):
    family = family_of(in_parts(2 * LIFTING_POINTS), [2 * LIFTING_POINTS])
    fine = settings_of(0.01, points=points)
    top = solve(family_member(family, fine).model, OMEGA, 3, 64)
    top = replace(top, states=top.states | {"lift": int(lifting * len(top.w))})
    failed = KeptBand(1.0, np.nan, np.nan, 0, "too long", too_long=True)
    monkeypatch.setattr(error_module, "kept_band", lambda *_: failed)
    found = error_of_doubt(Marches(family), CheckedCurve(fine, [top], {}), top)
    assert found == (ErrorInTime(np.inf, None) if unknown else None)


@pytest.mark.parametrize(
    ("verdict", "reason", "error"),
    [
        ("stable", "too long", 0.08),
        ("stable", "too long", np.inf),
        ("unstable", "too long", 0.03),
        ("stable", "", 0.03),
    ],
)
def test_the_error_of_a_resonance_in_doubt_is_told_by_that_march(
    monkeypatch, verdict, reason, error
):
    """An unstable one whose march is not known has an unknown error, see `Curve.marched`."""
    top = solve(hopping(), OMEGA, 3, 64)
    curve = CheckedCurve(settings_of(0.03), [top], {top.omega: 0.03})
    marks = Stability(np.array([verdict]), np.ones(1))
    resonance = JudgedResonance(top, marks, KeptBand(1.0, np.nan, np.nan, 0, reason))
    band = KeptBand(1.0, 0.9, 1.0, 100, points=LIFTING_POINTS) if error < np.inf else None
    told = ErrorInTime(max(error, 0.08), band)
    monkeypatch.setattr(judged_module, "error_in_time", lambda *_: None)
    monkeypatch.setattr(judged_module, "error_of_doubt", lambda *_: told)
    scene = SimpleNamespace(study=SimpleNamespace(stability=True), accuracy=0.05)
    found, estimated, march = judged_in_time(scene, None, curve, resonance)
    assert found.settings.error == error and estimated[0] == error
    assert march == (band if error > 0.03 else None)
