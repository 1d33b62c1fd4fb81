"""Motions that a blade keeps only after a strong drive, against all motions of the balance."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import folding_pair, rebounding

from bladefem.hbm.branches import find_branches
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline.stability_remarks import undriven_sentence
from bladefem.study.stability import strong_drive as module
from bladefem.study.stability.error_in_time import Marches
from bladefem.study.stability.march_by_steps import band_by_steps
from bladefem.study.stability.strong_drive import (
    STRONG_DRIVE,
    StrongDrives,
    after_strong_drive,
    strong_drives,
)

BAND = (249.0, 431.0)


@pytest.fixture(scope="module")
def folding():
    """Two masses and a gap."""
    return folding_pair()


@pytest.fixture(scope="module")
def motions(folding):
    """All motions of its balance."""
    sweep = [p for p in response(folding, np.linspace(*BAND, 40), 7, 256) if p.converged]
    return find_branches(folding, BAND, sweep, 7, 256, peak=1e-4).points


def test_the_high_motion_beside_a_low_one_is_found(folding, motions):
    """A march from the low motion stays there, one from a strong drive does not."""
    model = folding
    omega = 340.0
    low = solve(model, omega, 15, 512)
    assert low.converged
    stays = band_by_steps(model, low)
    assert stays.highest == pytest.approx(size(low), rel=1e-2)
    kept = after_strong_drive(model, low, 1.02 * size(low))
    assert kept is not None
    found = kept.band
    assert found.drive == STRONG_DRIVE
    # the highest of all motions near that frequency
    near = sorted(motions, key=lambda p: abs(p.omega - omega))[:6]
    highest = max(near, key=size)
    assert size(highest) > 2 * size(low)
    at_omega = solve(model, omega, 15, 512, start=highest)
    assert at_omega.converged
    assert found.highest == pytest.approx(size(at_omega), rel=2e-2)
    assert found.lowest > 0.98 * found.highest


def test_where_one_motion_is_all_there_is_none_is_told():
    """A contact so far open that it never closes."""
    model = rebounding(1.0, 1e3, 0.04)
    point = solve(model, 0.985, 1, 64)
    assert after_strong_drive(model, point, 1.02 * size(point)) is None


def lifting_curve(folding):
    """One low motion, as if it lifted off."""
    low = solve(folding, 340.0, 15, 512)
    low = replace(low, states={**low.states, "lift": 1})
    return SimpleNamespace(points=[low], settings=Settings(10, 15, 512, "rigid"))


def test_both_amplitudes_are_told(folding):
    """That after a strong drive is given, with that without it in the sentence."""
    curve = lifting_curve(folding)
    low = curve.points[0]
    found = strong_drives(Marches(family_of(folding)), curve, size(low))
    point, kept = found.point, found.kept
    assert point is low and kept.highest > 2 * size(low)
    assert "after 16 times its excitation" in kept.sentence
    assert f"without such a start {1e6 * size(low):.4g} um" in kept.sentence


def test_the_highest_of_these_motions_lies_where_no_strong_drive_was_made(folding, motions):
    """Uphill from the one frequency at which the blade is driven hard it keeps more."""
    last = solve(folding, 340.0, 15, 512)
    # below it a motion that is as low; as if it lifted off, alone
    below = replace(last, omega=335.0)
    last = replace(last, states={**last.states, "lift": 1})
    curve = SimpleNamespace(points=[below, last], settings=Settings(10, 15, 512, "rigid"))
    found = strong_drives(Marches(family_of(folding)), curve, size(last))
    point, kept = found.point, found.kept
    near = sorted(motions, key=lambda p: abs(p.omega - below.omega))[:6]
    truth = solve(folding, below.omega, 15, 512, start=max(near, key=size))
    assert truth.converged
    assert point is below and kept.without_drive == size(last)
    assert kept.highest == pytest.approx(size(truth), rel=0.02)


def test_closed_contacts_are_not_driven_hard():
    """Where nothing lifts off there is one motion."""
    curve = SimpleNamespace(
        points=[SimpleNamespace(probe=np.array([[0.0], [1.0]]), states={"lift": 0}, converged=True)]
    )
    assert strong_drives(None, curve, 1.0) == StrongDrives()


def test_marches_that_take_too_long_are_told(folding, monkeypatch):
    curve = lifting_curve(folding)
    low = curve.points[0]
    monkeypatch.setattr(module, "MOST_OPERATIONS", 0.0)
    assert strong_drives(Marches(family_of(folding)), curve, size(low)).too_long
    curves = [
        SimpleNamespace(load=4.0, strong_drive_skipped=True),
        SimpleNamespace(load=9.0, strong_drive_skipped=False),
    ]
    assert undriven_sentence(curves).startswith("under 4 N contacts lift off")
    assert undriven_sentence(curves[1:]) == ""


def test_what_dies_out_with_short_steps_is_not_given(folding, monkeypatch):
    curve = lifting_curve(folding)
    low = curve.points[0]
    monkeypatch.setattr(module, "_lasts_with_short_steps", lambda *_: False)
    assert strong_drives(Marches(family_of(folding)), curve, size(low)).point is None
