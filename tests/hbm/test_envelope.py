"""Leaps along the slow envelope of a march: limits of series, and marches that end where long ones
do.
"""

from __future__ import annotations

import numpy as np
import pytest
from models import folding_pair, rebounding

from bladefem.hbm.envelope import (
    MOST_TO_COME,
    first_amplitudes,
    leap_from_end,
    moved_envelope,
    scatter,
    way_to_limit,
)
from bladefem.hbm.ring_march import Drive, driven_anew, march_ring, state_of_solution
from bladefem.hbm.sector_modes import sector_modes
from bladefem.hbm.solve import solve

RATIO = 0.8 * np.exp(0.1j)
LIMIT = 3.0 - 1.0j


def series(ratio: complex, count: int = 4) -> np.ndarray:
    return LIMIT + (0.5 + 0.2j) * ratio ** np.arange(count)


def test_a_geometric_series_tells_its_limit():
    known = series(RATIO)
    assert known[-1] + way_to_limit(known) == pytest.approx(LIMIT, abs=1e-12)
    assert way_to_limit(known[:2]) == 0 and leap_from_end(known[:2], 0.0) == 0


def test_a_leap_goes_most_of_the_way_from_the_end_of_the_last_part():
    """The envelope by its closed form, its means over parts, and its value at their end."""
    rate = 0.3
    ends = LIMIT + np.exp(-rate * np.arange(5))
    means = LIMIT + np.exp(-rate * np.arange(4)) * (1 - np.exp(-rate)) / rate
    left = (LIMIT - ends[4]) / leap_from_end(means, 0.0)
    assert left == pytest.approx(1 / 0.9, rel=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 1.1, 0.99])
def test_where_changes_do_not_fall_a_leap_is_as_long_as_some_of_them(ratio):
    known = series(ratio * (1 + 1e-12))
    last = abs(known[-1] - known[-2])
    assert abs(way_to_limit(known)) == pytest.approx(MOST_TO_COME * last, rel=1e-6, abs=1e-12)


def test_changes_that_turn_round_or_drown_in_scatter_make_no_leap():
    assert leap_from_end(series(-0.5), 0.0) == 0
    known = series(0.8)
    assert leap_from_end(known, 0.0) != 0
    assert leap_from_end(known, abs(known[-1] - known[-2])) == 0


def test_scatter_is_that_of_what_a_straight_line_leaves():
    place = np.arange(12)
    assert scatter(2.0 + 0.1j * place) == pytest.approx(0, abs=1e-12)
    assert scatter(2.0 + 0.1j * place + 0.01 * (-1.0) ** place) > 1e-3


def test_the_first_amplitude_of_a_wave_is_read_at_all_its_blades():
    r, S, amplitude = 4, 64, 0.3 - 0.2j
    angle = 2 * np.pi * (np.arange(S) / S + np.arange(r)[:, None] / r)
    motion = (amplitude * np.exp(1j * angle)).real + 0.1 * np.cos(2 * angle)
    assert first_amplitudes(np.stack([motion, motion])) == pytest.approx([amplitude] * 2)


def test_the_envelope_moves_by_what_the_probe_shall_see():
    model = folding_pair()
    system = sector_modes(model)
    omega = float(np.sqrt(system.stiffness.min()))
    M = len(system.stiffness)
    modal = np.random.default_rng(0).standard_normal(2 * M)
    leap = 1e-3 - 5e-4j
    moved = moved_envelope(system, system.probe[:1], modal, omega, leap) - modal
    phasor = moved[:M] - 1j * moved[M:] / omega
    assert (system.probe[:1] @ phasor)[0] == pytest.approx(leap)
    assert np.count_nonzero(moved) == 2


def test_a_march_with_leaps_ends_where_a_long_one_does():
    """A lightly damped mass that meets a soft stop, from the motion at another frequency."""
    model = rebounding(0.02, 2.0, 0.006)
    start = driven_anew(model, state_of_solution(model, solve(model, 1.02, 7, 256)), Drive(1.008))
    plain = march_ring(model, start, 1200, 64)
    leaping = march_ring(model, start, 180, 64, leaps=True)
    heights = abs(first_amplitudes(plain.motion))
    off = abs(abs(first_amplitudes(leaping.motion[-12:]).mean()) / heights[-12:].mean() - 1)
    assert leaping.periods == 180 and len(leaping.motion) < 180
    assert off < 2e-4
    # so far without leaps
    assert abs(heights[168:180].mean() / heights[-12:].mean() - 1) > 100 * off
