"""A coarse subset of benchmarks/hbm_grid.py, and the numbers known of the reference blade."""

import numpy as np
import pytest
from hbm_grid import grid

from bladefem.hbm.linear_resonances import free_resonances, stuck_resonances
from bladefem.hbm.next_frequency import local_maxima
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve, stuck_response
from bladefem.hbm.sweep import sweep

HZ = 2 * np.pi


def test_every_fifth_point_of_the_grid():
    found = list(grid(every=5))
    assert all(s.converged and s.residual < 1e-10 for s in found)
    assert np.median([s.iterations for s in found]) <= 6 and max(s.iterations for s in found) <= 60
    assert max(s.work.imbalance for s in found) < 1e-9


@pytest.mark.parametrize(
    ("kt", "phase", "expected"), [(1e6, 0.0, 1386.0), (2e7, 0.0, 1086.0), (2e7, np.pi, 2046.0)]
)
def test_stuck_resonance_is_the_peak_of_the_stuck_response(kt, phase, expected):
    """Design values of the blade with 60 g: added stiffness, added mass, and no damper motion at
    all.
    """
    model = reference_model(kt, 0.06, 30.0, phase=phase, harmonics=1)
    resonances = stuck_resonances(model)
    omega = resonances[np.argmin(abs(resonances - HZ * expected))]
    assert omega / HZ == pytest.approx(expected, rel=1e-2)  # some slip lowers the last one
    heights = [abs(stuck_response(model, omega * f)[1, 0]) for f in (0.999, 1.0, 1.001)]
    assert heights[1] == max(heights)


def test_in_antiphase_the_mass_of_the_damper_does_not_matter():
    models = [reference_model(2e7, mass, 30.0, phase=np.pi, harmonics=3) for mass in (0.01, 0.3)]
    heights = [size(solve(model, HZ * 2040, 3, 128)) for model in models]
    assert heights[0] == pytest.approx(heights[1], rel=1e-6)


def test_resonance_rises_from_free_to_stuck_with_a_minimum_of_the_peak_between():
    frequencies, heights = [], []
    for load in (0.02, 0.4, 1.4, 5.0, 40.0):
        model = reference_model(1e6, 0.06, load, harmonics=3)
        points = sorted(sweep(model, (HZ * 1150, HZ * 1450), 3, 128), key=lambda s: s.omega)
        assert all(p.converged for p in points) and len(points) < 60
        top = max(points, key=size)
        frequencies.append(top.frequency)
        heights.append(size(top))
    assert np.all(np.diff(frequencies) > 0)
    assert frequencies[0] == pytest.approx(free_resonances(model)[1] / HZ, rel=1e-4)
    assert np.argmin(heights) == 2 and heights[2] == pytest.approx(2.73e-6, rel=0.01)


def test_sweep_meets_the_peak_of_a_fine_sweep():
    model = reference_model(1e6, 0.06, 1.4, points=3, harmonics=3)
    points = sorted(sweep(model, (HZ * 1150, HZ * 1450), 3, 128), key=lambda s: s.omega)
    top = max(size(p) for p in local_maxima(points))
    fine = max(size(solve(model, HZ * f, 3, 128)) for f in np.linspace(1300, 1350, 201))
    assert top == pytest.approx(fine, rel=1e-3)


@pytest.mark.parametrize("load", [0.6, 1.4, 5.0])
def test_a_sweep_for_peaks_alone_keeps_its_tolerance_with_few_points(load):
    """Brute force: 161 frequencies round the peak. Even steps over the band take 68 to 95 points to
    come as near.
    """
    model = reference_model(1e6, 0.06, load, points=3, harmonics=3)
    points = sorted(
        sweep(model, (HZ * 1150, HZ * 1450), 3, 0, peak=1e-4, curve=0.5), key=lambda s: s.omega
    )
    top = max(local_maxima(points), key=size)
    fine = max(size(p) for p in response(model, top.omega + HZ * np.linspace(-4, 4, 161), 3, 0))
    assert len(points) <= 22 and size(top) == pytest.approx(fine, rel=1e-4)
