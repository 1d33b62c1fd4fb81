"""Where error indicators are blind (F19 to F21), and what the automatic choice does there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bladefem.data import Elements, PortModel
from bladefem.hbm.api import solve
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.reference import reference_model
from bladefem.study.choice import choose
from bladefem.study.family import family_of, member
from bladefem.study.indicators import grips, indicate
from bladefem.study.settings import Settings, first_for

HZ = 2 * np.pi
STIFFNESS = 0.3 * (100 * HZ) ** 2       # of the contact, beside a modal stiffness of (100 Hz)^2


def oscillator(limit: float, second: float = 1e4, phase: float = 0.0) -> ReducedModel:
    """Two modes, 100 Hz and `second` [Hz]; the second is moved by the contact alone."""
    ports = {name: slice(k, k + 1) for k, name in enumerate(("contact", "load", "probe"))}
    body = PortModel(HZ * np.array([100.0, second]), np.array([[1.0, 1.0], [1.0, 0.0], [1.0, 0.0]]), np.zeros((3, 3)),
                     ports)
    one = np.ones(1)
    return ReducedModel((body,), Elements(STIFFNESS * one, 0 * one, one, limit * one, 1),
                        {1: np.exp(1j * phase) * one}, Damping(ratio=1e-3))


def chosen(model: ReducedModel, omega: float, first: Settings, accuracy: float):
    family = family_of(model)
    point = solve(member(family, first).model, omega, first.harmonics, first.samples)
    return choose(family, first, point, accuracy)


def test_F19_points_are_compared_with_the_finest():
    """Single steps of 3 to 2 points see nothing where the edges of the patch slip; the finest patch does."""
    model, omega = reference_model(1e6, 0.06, 12.0, points=80, modes=5, harmonics=63), HZ * 1385.7 * 1.01
    first = replace(first_for(5), points=3)
    told = indicate(family_of(model), first, solve(member(family_of(model), first).model, omega, 1, 64))
    assert told.errors["points"] > 0.4
    _, point, found = chosen(model, omega, first, 0.02)
    assert found.total < 0.01
    assert abs(point.probe[1, 0] / solve(model, omega, 15, 1024).probe[1, 0] - 1) < 0.02


def test_F20_an_internal_resonance_that_2H1_harmonics_do_not_reach():
    """Five times 105 Hz is the second mode: 1 and 3 harmonics agree to 5e-4, and both are 6 % off."""
    model, omega = oscillator(0.3, 525.0), HZ * 105
    first = {H: solve(model, omega, H, 1024).probe[1, 0] for H in (1, 3, 31)}
    assert abs(first[1] / first[3] - 1) < 1e-3
    assert abs(first[1] / first[31] - 1) > 0.05
    settings, point, found = chosen(model, omega, first_for(2), 0.02)
    assert settings.harmonics >= 5
    assert found.total < 0.01
    assert abs(point.probe[1, 0] / first[31] - 1) < 0.01


def test_F21_slip_between_two_samples():
    """The force passes its limit by 1e-3 between two of 64 samples: they see stick, and miss the friction work."""
    omega = HZ * 100 * np.sqrt(1.3)
    stuck = solve(oscillator(1e9), omega, 1, 64)
    pull = STIFFNESS * np.hypot(*stuck.w[0, 0, 1:3])
    phase = np.pi / 64 - np.angle(stuck.w[0, 0, 1] - 1j * stuck.w[0, 0, 2])
    model = oscillator((1 - 1e-3) * pull, phase=phase)
    blind, true = solve(model, omega, 1, 64), solve(model, omega, 15, 4096)
    assert blind.states["stick"] == 1 and true.states["slip"] == 1
    missed = abs(blind.probe[1, 0] / true.probe[1, 0] - 1)
    assert missed > 5e-4
    assert not grips(model, blind)
    told = indicate(family_of(model), first_for(2), blind).total
    assert told == pytest.approx(missed, rel=0.3)
