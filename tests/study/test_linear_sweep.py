"""Sweeps of the linear mistuned wheel: as many points as its resonances are wide, which find the
peaks of a dense sweep.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from bladefem.hbm.model import Damping
from bladefem.study.mistuning.pattern_response import LINEAR_POINTS, free_factor, linear_grid
from bladefem.wheel.linear_motion import free_wheel
from bladefem.wheel.lumped import LumpedBlades, lumped_matrices, lumped_pattern, lumped_wheel

BLADES = LumpedBlades(count=12)
M, K, _ = lumped_matrices(BLADES)
OWN = float(np.sqrt(linalg.eigh(K, M)[0][0]))
LOW, HIGH = 0.97 * OWN, 1.04 * OWN


def wheel_with(damping):
    return replace(lumped_wheel(BLADES, 3, 1.0, 1e5, 3.0), damping=damping)


@pytest.mark.parametrize(
    "damping", [Damping(ratio=1e-3), Damping(structural=1e-3), Damping(ratio=5e-3)]
)
def test_amplification_without_dampers_is_that_of_a_dense_sweep(damping):
    wheel = wheel_with(damping)
    pattern = lumped_pattern(BLADES, 0.01 * np.random.default_rng(3).normal(size=BLADES.count))
    heights = [
        max(abs(free_wheel(wheel, w, 1, p)[:, 1, 0]).max() for w in np.linspace(LOW, HIGH, 2000))
        for p in (pattern, replace(pattern, stiffness=None))
    ]
    found = free_factor(wheel, pattern, np.array([LOW, HIGH]), 1)
    assert found == pytest.approx(heights[0] / heights[1], rel=0.01)


def test_points_follow_the_damping():
    fewest, most = LINEAR_POINTS
    counts = [
        len(linear_grid(wheel_with(Damping(ratio=ratio)), LOW, HIGH))
        for ratio in (0.0, 1e-3, 2e-3, 0.1)
    ]
    assert counts[0] == most and counts[-1] == fewest
    # four in the half-power width of 0.2 %
    assert counts[1] == pytest.approx(4 * (HIGH / LOW - 1) / 2e-3, abs=1)
    assert counts[2] == pytest.approx(counts[1] / 2, abs=1)
