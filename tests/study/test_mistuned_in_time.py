"""A mistuned wheel of 12 blades on a coarse mesh against plain marching in time from rest, by the
code of benchmarks/wheel_in_time.py, which marches the shipped wheel; and many harmonics that
converge.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mistuned import ORDER, ROUGH_MISTUNED, SECTORS, reduced_wheel

from bladefem.hbm.solver.newton import Options
from bladefem.study.mistuning.whole_wheel import whole_wheel
from bladefem.wheel.model import frequency_pattern
from bladefem.wheel.resonance import find_wheel_peak
from bladefem.wheel.solve import solve_wheel
from bladefem.wheel.statistics import wheel_respond

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from wheel_in_time import march

OPTIONS = Options(tolerance=1e-6)


@pytest.fixture(scope="module")
def wheel():
    scene, run, patches, sector, case, settings = reduced_wheel(ROUGH_MISTUNED)
    # two modes: what the others do without inertia is in the residual flexibility
    settings = replace(settings, modes=2)
    made = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    # the scatter of the scene, drawn so that the highest blade stands out by 7 %
    deviation = 0.005 * np.random.default_rng(5).normal(size=(SECTORS, 3))
    return made, frequency_pattern(sector.families, deviation)


def test_highest_blade_is_that_of_marching_in_time(wheel):
    """At the resonance, all contacts slipping: which blade, and its amplitude."""
    made, pattern = wheel
    own = made.sectors[ORDER].omega[0]
    grid = own * np.linspace(0.998, 1.07, 17)
    peak = find_wheel_peak(wheel_respond(made, pattern, 3, 128, OPTIONS), grid, 0.01)
    assert peak.closed_in
    point = None
    for H in (1, 3, 5, 7, 9):
        # no other way than from the poorer balance
        point = solve_wheel(
            made,
            peak.omega,
            H,
            max(128, 32 * (H + 1)),
            pattern=pattern,
            start=point,
            options=replace(OPTIONS, fallbacks=False),
        )
        assert point.converged, (H, point.reason)
    assert (point.shares[..., 1] > 0.05).all()
    marched = march(made, pattern, peak.omega, steps=128, steady=5e-4)
    assert marched.change < 5e-4 and marched.slipping == 1.0
    assert marched.size.argmax() == point.size().argmax() == peak.blade
    assert marched.size.max() == pytest.approx(point.size().max(), rel=5e-3)
    # every blade
    np.testing.assert_allclose(marched.size, point.size(), atol=0.02 * marched.size.max())
