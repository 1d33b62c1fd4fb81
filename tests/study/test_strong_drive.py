"""Motions that a blade keeps only after a strong drive, against all motions of the balance."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import folding_pair, rebounding

from bladefem.hbm.branches import find_branches
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.sweep import response
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline.error_in_time import Marches
from bladefem.study.pipeline.kept_band import band_by_steps
from bladefem.study.pipeline.strong_drive import (
    STRONG_DRIVE,
    band_after_strong_drive,
    band_of_strong_drives,
)

BAND = (249.0, 431.0)


@pytest.fixture(scope="module")
def folding():
    """Two masses and a gap."""
    return folding_pair()


def test_the_high_motion_beside_a_low_one_is_found(folding):
    """A march from the low motion stays there, one from a strong drive does not."""
    model = folding
    omega = 340.0
    low = solve(model, omega, 15, 512)
    assert low.converged
    stays = band_by_steps(model, low)
    assert stays.highest == pytest.approx(size(low), rel=1e-2)
    found = band_after_strong_drive(model, low, 1.02 * size(low))
    assert found is not None and found.drive == STRONG_DRIVE
    # the highest of all motions near that frequency
    sweep = [p for p in response(model, np.linspace(*BAND, 40), 7, 256) if p.converged]
    points = find_branches(model, BAND, sweep, 7, 256, peak=1e-4).points
    near = sorted(points, key=lambda p: abs(p.omega - omega))[:6]
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
    assert band_after_strong_drive(model, point, 1.02 * size(point)) is None


def test_both_amplitudes_are_told(folding):
    """That after a strong drive is given, with that without it in the sentence."""
    low = solve(folding, 340.0, 15, 512)
    # as if it lifted off
    low = replace(low, states={**low.states, "lift": 1})
    curve = SimpleNamespace(points=[low], settings=Settings(10, 15, 512, "rigid"))
    point, kept = band_of_strong_drives(Marches(family_of(folding)), curve, size(low))
    assert point is low and kept.highest > 2 * size(low)
    assert "after 16 times its excitation" in kept.sentence
    assert f"without such a start it keeps {1e6 * size(low):.4g} um" in kept.sentence


def test_closed_contacts_are_not_driven_hard():
    """Where nothing lifts off there is one motion."""
    curve = SimpleNamespace(
        points=[SimpleNamespace(probe=np.array([[0.0], [1.0]]), states={"lift": 0}, converged=True)]
    )
    assert band_of_strong_drives(None, curve, 1.0) is None
