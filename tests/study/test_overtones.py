"""An internal resonance between the seventh and the fifteenth harmonic, as the estimate of one
harmonic sees it.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos

import numpy as np
import pytest

from bladefem.data import Elements, PortModel
from bladefem.hbm.linear.bodies import Damping
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.study.adaptive.family import family_member, family_of
from bladefem.study.adaptive.peak_errors import judge_settings, peak_errors, peak_from
from bladefem.study.adaptive.settings import first_for

OMEGA = np.array([1.0, 12.0])
AT_CONTACT = np.array([1.0, 6.0])
SPRING = 0.5
LIMIT = 2.0
DAMPING = 1e-3


@pytest.fixture(scope="module")
def family():
    """A mode that is driven and read, and one at its overtones that the contact alone moves."""
    shapes = np.array([AT_CONTACT, [1.0, 0.0], [1.0, 0.0]])
    ports = {"contact": slice(0, 1), "load": slice(1, 2), "probe": slice(2, 3)}
    side = PortModel(OMEGA, shapes, np.zeros((3, 3)), ports)
    one = np.ones(1)
    slider = Elements(SPRING * one, 0 * one, LIMIT * one, one, tangents=1)
    return family_of(ReducedModel((side,), slider, {1: one}, Damping(ratio=DAMPING)), [1])


def marched(omega, periods=60, steps=1000):
    """Amplitude of the first mode, by plain steps of both modes and of the slider."""
    step = 2 * np.pi / omega / steps
    q1 = q2 = v1 = v2 = force = before = 0.0
    (o1, o2), (c1, c2) = OMEGA.tolist(), AT_CONTACT.tolist()
    read = []
    for i in range(periods * steps):
        moved = c1 * q1 + c2 * q2
        force = min(max(force + SPRING * (moved - before), -LIMIT), LIMIT)
        before = moved
        v1 += step * (cos(omega * i * step) - c1 * force - o1**2 * q1 - 2 * DAMPING * o1 * v1)
        v2 += step * (-c2 * force - o2**2 * q2 - 2 * DAMPING * o2 * v2)
        q1 += step * v1
        q2 += step * v2
        read.append(q1)
    return 2 * np.linalg.norm(np.fft.rfft(read[-steps:])[1:32]) / steps


def test_error_of_one_harmonic_knows_a_mode_that_its_eleventh_meets(family):
    """Seven harmonics change the height by 0.5 %, fifteen by 2.7 %: they split the resonance in two
    with a valley between, and the search for the judging peak finds the higher one.
    """
    settings = replace(first_for(family.modes), points=None)
    model = family_member(family, settings).model
    band = np.linspace(1.0, 1.24, 25)
    sweep = [solve(model, omega, 1, 64) for omega in band]
    peak = peak_from(family, settings, max(sweep, key=size), settings, 0.05)
    rich = replace(settings, harmonics=31, samples=512)
    top = max((solve(model, omega, 31, 512) for omega in band), key=size)
    true = peak_from(family, rich, top, rich, 1e-3)
    assert true.height == pytest.approx(marched(true.omega), rel=2e-3)
    error = peak_errors(family, settings, peak, 0.05).height["harmonics"]
    assert error == pytest.approx(abs(peak.height / true.height - 1), rel=0.1)
    assert error > 0.025


def test_large_balances_keep_fewer_overtones(family, monkeypatch):
    """Fifteen harmonics of all points of a seat would take longer than the curve."""
    from bladefem.study.adaptive import peak_errors as judging

    settings = replace(first_for(family.modes), points=None)
    point = solve(family_member(family, settings).model, 1.1, 1, 64)
    assert judge_settings(family, settings, "harmonics", point).harmonics == 15
    monkeypatch.setattr(judging, "OVERTONES_JUDGE", 30)
    assert judge_settings(family, settings, "harmonics", point).harmonics == 7
