"""Peaks and optima against brute force."""

import numpy as np
import pytest

from bladefem.hbm.api import solve
from bladefem.hbm.optimum import optimum
from bladefem.hbm.peak import find_peak, track_peak
from bladefem.hbm.reference import reference_model
from bladefem.hbm.sweep import size
from bladefem.hbm.vary import vary

HZ = 2 * np.pi


@pytest.mark.parametrize("load", [0.3, 1.4])
def test_peak_of_a_fine_sweep(load):
    model = reference_model(1e6, 0.06, load, harmonics=3)
    peak = find_peak(model, HZ * (1240 if load < 1 else 1320), 3, 0)
    fine = np.linspace(peak.omega - HZ * 1.5, peak.omega + HZ * 1.5, 61)
    heights = [size(solve(model, omega, 3, 0)) for omega in fine]
    assert peak.points <= 12
    assert peak.height == pytest.approx(max(heights), rel=2e-4)
    assert abs(peak.omega - fine[np.argmax(heights)]) < HZ * 0.5


def test_a_tracked_peak_is_the_peak_at_each_load():
    model = reference_model(1e6, 0.06, 1.0, harmonics=3)
    path = list(track_peak(model, "load", np.geomspace(3.0, 0.5, 8), HZ * 1370, 3, 0))
    for peak in path[::3]:
        fine = np.linspace(peak.omega * 0.998, peak.omega * 1.002, 41)
        highest = max(size(solve(vary(model, "load", peak.value), omega, 3, 0)) for omega in fine)
        assert peak.height == pytest.approx(highest, rel=1e-3)
    # the derivative of the peak's height is that at a fixed frequency, since the slope with frequency is zero
    near = [find_peak(vary(model, "load", path[5].value * f), path[5].omega, 3, 0, tolerance=1e-7).height
            for f in (0.999, 1.001)]
    assert path[5].slope == pytest.approx((near[1] - near[0]) / np.log(1.001 / 0.999), rel=0.02)


def test_optimum_load_against_a_scan():
    model = reference_model(1e6, 0.06, 1.0, harmonics=3)
    band = (HZ * 1150, HZ * 1450)
    best = optimum(model, band, (0.3, 6.0), 3, 128)
    frequencies = np.arange(1200.0, 1400.0, 4.0)
    scan = {}
    for factor in np.geomspace(1.0, 1.9, 7):
        scan[factor] = max(size(solve(vary(model, "load", factor), HZ * f, 3, 128)) for f in frequencies)
    assert best.points < 60
    assert best.peak.height <= min(scan.values()) * 1.002
    assert best.peak.height == pytest.approx(min(scan.values()), rel=0.02)
    assert 1.0 < best.value < 1.9


@pytest.mark.parametrize(("kt", "mass", "band", "height"), [
    (1e6, 0.03, (1150, 2000), 1.0903e-6), (1e6, 0.12, (1150, 1650), 3.8691e-6), (2e7, 0.01, (900, 1400), 9.9683e-6),
    (2e7, 0.06, (900, 1400), 2.1029e-6), (1e6, 0.06, (190, 260), 5.6735e-4)])
def test_optima_of_light_and_heavy_dampers(kt, mass, band, height):
    """Heights: lowest of nine loads near the optimum, 600 frequencies each; two peaks exchange their order in some."""
    model = reference_model(kt, mass, 1.0, harmonics=3)
    best = optimum(model, (HZ * band[0], HZ * band[1]), (0.1, 20.0), 3, 128)
    assert best.points < 100
    assert best.peak.height == pytest.approx(height, rel=0.015)     # two peaks less than 2 % apart count as one
