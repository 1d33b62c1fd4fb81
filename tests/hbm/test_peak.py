"""Peaks and optima against brute force."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from models import block, folding_pair, single_mass

from bladefem.data import Elements
from bladefem.errors import NotSolvedError
from bladefem.hbm import peak as peak_module
from bladefem.hbm.frequency_walk import walk_in_frequency
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.optimum import higher_from_neighbours, lowest_peak, optimum
from bladefem.hbm.parameters import vary
from bladefem.hbm.peak import find_peak, track_peak, with_slope
from bladefem.hbm.peak_levels import PeakSearch, Variation, look_over_band
from bladefem.hbm.peak_ripples import above_ripples
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.hbm.sweep import sweep
from bladefem.reduction.matrices import port_model_from_matrices

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


def test_the_vertex_is_nearer_to_the_maximum_than_the_highest_point():
    """Of two such searches the frequencies are compared: what they leave is no change of it."""
    model = reference_model(1e6, 0.06, 1.4, harmonics=3)
    truth = find_peak(model, HZ * 1320, 3, 0, tolerance=1e-10).omega
    for start in (1290, 1320):
        peak = find_peak(model, HZ * start, 3, 0, tolerance=1e-2)
        assert abs(peak.omega - truth) > 0.5 * HZ
        assert abs(peak.vertex - truth) < 0.3 * abs(peak.omega - truth)


def test_a_gain_that_is_too_small_for_a_walk_is_given_up(monkeypatch):
    """Where the next point is not solved: a peak that only judges another one needs no more."""
    model = reference_model(1e6, 0.06, 1.4, harmonics=3)
    solved = []

    def fails_later(*args, **options):
        point = solve(*args, **options)
        solved.append(point)
        return point if len(solved) < 5 else replace(point, converged=False)

    monkeypatch.setattr(peak_module, "solve", fails_later)
    monkeypatch.setattr(peak_module, "walk_in_frequency", lambda *args: [])
    found = find_peak(model, HZ * 1320, 3, 0, tolerance=1e-9, enough=1.0)
    assert found.height == max(size(point) for point in solved[:4]) and len(solved) == 5
    solved.clear()
    with pytest.raises(NotSolvedError, match="peak search stopped"):
        find_peak(model, HZ * 1320, 3, 0, tolerance=1e-9)


@pytest.mark.parametrize("fallbacks", [False, True])
def test_a_search_that_only_judges_walks_no_farther_than_it_must(fallbacks, monkeypatch):
    """The maximum may lie before a point that is not solved at once."""
    model = reference_model(1e6, 0.06, 1.4, harmonics=3)
    solved, walks = [], []

    def fails_once(*args, **options):
        solved.append(solve(*args, **options))
        return replace(solved[-1], converged=False) if len(solved) == 3 else solved[-1]

    def walk(*args):
        walks.append(args[-1])
        return walk_in_frequency(*args)

    monkeypatch.setattr(peak_module, "solve", fails_once)
    monkeypatch.setattr(peak_module, "walk_in_frequency", walk)
    options = replace(DEFAULT_OPTIONS, fallbacks=fallbacks)
    found = find_peak(model, HZ * 1320, 3, 0, options=options)
    assert walks == [1.0 if fallbacks else peak_module.JUDGED_WALK_SHARE]
    monkeypatch.undo()
    assert found.height == pytest.approx(find_peak(model, HZ * 1320, 3, 0).height, rel=2e-4)


def test_a_tracked_peak_is_the_peak_at_each_load():
    model = reference_model(1e6, 0.06, 1.0, harmonics=3)
    path = list(track_peak(model, "load", np.geomspace(3.0, 0.5, 8), HZ * 1370, 3, 0))
    for peak in path[::3]:
        fine = np.linspace(peak.omega * 0.998, peak.omega * 1.002, 41)
        highest = max(size(solve(vary(model, "load", peak.value), omega, 3, 0)) for omega in fine)
        assert peak.height == pytest.approx(highest, rel=1e-3)
    # the derivative of the peak's height is that at a fixed frequency, since the slope with
    # frequency is zero
    near = [
        find_peak(
            vary(model, "load", path[5].value * f), path[5].omega, 3, 0, tolerance=1e-7
        ).height
        for f in (0.999, 1.001)
    ]
    assert path[5].slope == pytest.approx((near[1] - near[0]) / np.log(1.001 / 0.999), rel=0.02)


def test_optimum_load_against_a_scan():
    model = reference_model(1e6, 0.06, 1.0, harmonics=3)
    band = (HZ * 1150, HZ * 1450)
    best = optimum(model, band, (0.3, 6.0), 3, 128)
    frequencies = np.arange(1200.0, 1400.0, 4.0)
    scan = {}
    for factor in np.geomspace(1.0, 1.9, 7):
        scan[factor] = max(
            size(solve(vary(model, "load", factor), HZ * f, 3, 128)) for f in frequencies
        )
    assert best.points < 60
    assert best.peak.height <= min(scan.values()) * 1.002
    assert best.peak.height == pytest.approx(min(scan.values()), rel=0.02)
    assert 1.0 < best.value < 1.9


def test_the_range_of_nearly_as_good_values_is_enclosed():
    """Without a wanted rise the search knows nothing above the optimum."""
    model = reference_model(1e6, 0.06, 1.0, harmonics=3)
    along = Variation(
        lambda factor: vary(model, "load", factor),
        lambda changed, peak, factor: with_slope(changed, peak, "load", factor),
    )
    best = lowest_peak(along, (HZ * 1150, HZ * 1450), (0.3, 6.0), 3, 128, start=1.3, rise=0.3)
    for side in (
        [peak.height for peak in best.tried if peak.value < best.value],
        [peak.height for peak in best.tried if peak.value > best.value],
    ):
        assert max(side) >= 1.3 * best.peak.height


@pytest.mark.parametrize(
    ("kt", "mass", "band", "height"),
    [
        (1e6, 0.03, (1150, 2000), 1.0903e-6),
        (1e6, 0.12, (1150, 1650), 3.8691e-6),
        (2e7, 0.01, (900, 1400), 9.9683e-6),
        (2e7, 0.06, (900, 1400), 2.1029e-6),
        (1e6, 0.06, (190, 260), 5.6735e-4),
    ],
)
def test_optima_of_light_and_heavy_dampers(kt, mass, band, height):
    """Heights: lowest of nine loads near the optimum, 600 frequencies each; two peaks exchange
    their order in some.
    """
    model = reference_model(kt, mass, 1.0, harmonics=3)
    best = optimum(model, (HZ * band[0], HZ * band[1]), (0.1, 20.0), 3, 128)
    assert best.points < 130  # where two peaks exchange their order both are climbed at each load
    assert best.peak.height == pytest.approx(
        height, rel=0.015
    )  # two peaks less than 2 % apart count as one


def test_a_band_without_a_peak_is_named_in_hertz_and_the_load_in_newtons():
    along = Variation(
        lambda load: vary(reference_model(2e7, 0.06, 1.0, harmonics=3), "load", load),
        lambda changed, peak, load: with_slope(changed, peak, "load", load),
    )
    band = (HZ * 1500, HZ * 1600)
    with pytest.raises(NotSolvedError, match=r"1500 to 1600 Hz with load \S+ N"):
        lowest_peak(along, band, (0.5, 2.0), 3, 128)


def test_a_level_that_missed_a_peak_gets_it_from_its_neighbour():
    """Two peaks: that of the blade that slips is 25 times as high as that of the stuck one."""
    along = Variation(
        lambda factor: vary(reference_model(2e7, 0.06, 1.0, harmonics=3), "load", factor),
        lambda changed, peak, factor: with_slope(changed, peak, "load", factor),
    )
    search = PeakSearch(along, (HZ * 900, HZ * 1400), 3, 128, (0.1, 20.0), 1e-3, DEFAULT_OPTIONS)

    def peak_at(value, frequency):
        model = along.model_at(value)
        return along.with_slope(model, search.peak(model, HZ * frequency), value)

    low, high, known = peak_at(0.5, 1114), peak_at(0.499, 1236), peak_at(0.5, 1236)
    assert known.height > 10 * low.height
    levels = {0.5: [low], 0.499: [high]}
    higher, points = higher_from_neighbours(search, levels)
    assert higher and points > 0
    top = max(levels[0.5], key=lambda peak: peak.height)
    assert top.value == 0.5 and top.height == pytest.approx(known.height, rel=2e-3)
    # neighbours that agree ask for nothing
    assert higher_from_neighbours(search, levels) == (False, 0)


def highest(model, band, count=101):
    last, heights = None, []
    for omega in np.linspace(*band, count):
        last = solve(model, omega, 3, 64, start=last)
        assert last.converged
        heights.append(size(last))
    return max(heights)


def test_the_optimum_sees_the_higher_of_two_maxima_of_one_hump():
    """Two dofs, forces of two harmonics: 3.8433 um at the best load, by 1600 frequencies at ten
    loads. Its height was once taken from the lower maximum, 1.4 % below what the band holds.
    """
    body = port_model_from_matrices(
        np.eye(2),
        np.array([[1.5e6, -0.5e6], [-0.5e6, 1.5e6]]),
        {"contact": [0], "load": [0, 1], "probe": [0, 1]},
        C=4e-6 * np.array([[1.5e6, -0.5e6], [-0.5e6, 1.5e6]]),
    )
    force = {1: np.array([1.0, 0.5j]), 3: np.array([0.0, 0.2])}
    model, band = (
        ReducedModel((body,), Elements([1e6], [0.0], [0.4], [10.0], 1), force),
        (800.0, 1600.0),
    )
    best = optimum(model, band, (0.01, 10.0), 7, 256)
    there = max(
        size(p)
        for p in response(vary(model, "load", best.value), np.linspace(1050, 1130, 81), 7, 256)
    )
    assert best.peak.height == pytest.approx(3.8433e-6, rel=1e-3)
    assert best.peak.height == pytest.approx(there, rel=1e-3)


def light_block(damper=False):
    """Two contacts in 3-D that slip, and lift off when a gap is added."""
    return replace(block(nodes=2, dofs=8, seed=5, force=0.3, damper=damper), damping=Damping(0.03))


@pytest.mark.parametrize(
    ("name", "values", "damper"),
    [
        ("load", (1.0, 0.8, 0.6), False),
        ("force", (1.0, 1.3, 1.7), False),
        ("mu", (1.0, 0.8, 0.6), False),
        ("kt", (1.0, 1.3, 1.7), False),
        ("kn", (1.0, 0.8, 0.6), False),
        ("gap", (0.0, 0.1, 0.2), False),
        ("mass", (1.0, 1.3, 1.7), True),
        ("damping", (1.0, 0.8, 0.6), False),
    ],
)
def test_a_peak_is_followed_in_every_parameter(name, values, damper):
    """Each peak against a fine sweep round it, its derivative against peaks at neighbouring
    values.
    """
    model, omega = light_block(damper), 1.45 if damper else 1.03
    for peak in list(track_peak(model, name, values, omega, 3, 512))[2:]:
        around = np.linspace(0.99, 1.01, 41) * peak.omega
        heights = [
            size(solve(vary(model, name, peak.value), w, 3, 512, start=peak.solution))
            for w in around
        ]
        assert max(heights) * 0.9999 < peak.height < max(heights) * 1.001
        step = 1e-3
        ends = [
            peak.value + by if name == "gap" else peak.value * np.exp(by) for by in (-step, step)
        ]
        low, high = (
            find_peak(vary(model, name, v), peak.omega, 3, 512, near=peak, tolerance=1e-9)
            for v in ends
        )
        # a peak known to 1e-4 of its height lies a hundredth of its width beside the top, where the
        # slope differs a bit
        assert peak.slope == pytest.approx(
            (high.height - low.height) / (2 * step), rel=0.02, abs=5e-3 * peak.height
        )


def test_the_best_gap_takes_as_much_load_away_as_the_best_load():
    """Normal and tangential motion uncoupled: a gap is nothing but a smaller load, n0 - kn gap."""
    ports = {"contact": [0, 1], "load": [1], "probe": [1]}
    body = port_model_from_matrices(np.eye(2), np.diag([5.0, 1.0]), ports)
    model = ReducedModel(
        (body,), Elements([1.0], [2.0], [0.5], [3.0], 1), {1: [1.0]}, Damping(0.01)
    )
    load = optimum(model, (0.8, 1.6), (0.05, 1.5), 5, 0, name="load", tolerance=1e-6)
    gap = optimum(model, (0.8, 1.6), (-0.5, 1.4), 5, 0, name="gap", tolerance=1e-6)
    assert gap.peak.height == pytest.approx(load.peak.height, rel=1e-5)
    assert 3.0 - 2.0 * gap.value == pytest.approx(3.0 * load.value, rel=3e-3)


@pytest.mark.parametrize(
    ("name", "bounds", "near"),
    [
        ("gap", (-0.5, 0.6), (0.326, 0.386)),
        ("mu", (0.2, 3.0), (0.30, 0.33)),
        ("kn", (0.2, 2.0), (0.84, 0.92)),
    ],
)
def test_optima_of_contacts_that_lift_off(name, bounds, near):
    """The minimum is one: not lower on either side, and the height is that of the whole band's
    highest peak.
    """
    model, band = light_block(), (0.5, 1.3)
    best = optimum(model, band, bounds, 3, 64, name=name)
    assert best.peak.height == pytest.approx(highest(vary(model, name, best.value), band), rel=3e-3)
    assert min(highest(vary(model, name, value), band) for value in near) > best.peak.height * 0.999
    assert near[0] < best.value < near[1]


@pytest.mark.parametrize("points", [1, 4])
def test_ripples_of_sampled_friction_are_no_peaks(points):
    """Between the first slip and full slip the response is flat, and slopes lead to the nearest of
    many small maxima: 0.33 % too low without a look further off, with 64 samples up to 3.3 %
    (tests/stability/test_mesh_failures.py).
    """
    worst = 0.0
    for load in (2.0, 3.0):
        model = reference_model(1e6, 0.06, load, points=points, harmonics=3)
        exact = find_peak(model, HZ * 1330, 1, 0, tolerance=1e-6)
        for share in (0.98, 0.99, 0.995, 1.005, 1.01):
            found = find_peak(model, exact.omega * share, 1, 256, tolerance=1e-3)
            worst = max(worst, abs(found.height / exact.height - 1))
    # measured 0.06 %
    assert worst < 1.5e-3


def test_the_way_over_ripples_ends_at_another_peak():
    """A contact that lifts off makes a sharp true maximum at 380 rad/s, 0.105 mm; the slopes beyond
    its trough lead to another one, 0.63 mm at 331 rad/s.
    """
    model = folding_pair()
    found = find_peak(model, 379.3, 7, 256, tolerance=1e-4)
    assert found.omega == pytest.approx(379.93, rel=2e-4)
    assert found.height == pytest.approx(1.0473e-4, rel=1e-3)


@pytest.mark.parametrize("omega", [0.1, 4.0])
def test_a_low_flank_is_no_rippled_top(omega):
    """Far from the resonance at 1 the mode alone would fall by 1 % only at a distance of fourteen
    times the frequency, on one side below zero, or of 6 % of it, where its flank is.
    """
    model = single_mass(force=0.9)
    flank = solve(model, omega, 3, 64)
    assert flank.converged
    found = above_ripples(model, flank, 1e-4, DEFAULT_OPTIONS)
    assert found.solution is flank
    assert found.points == 0


def look(omega, height, slope):
    """A reading of a response without its solution."""
    return peak_module._Look(SimpleNamespace(omega=omega), height, slope, np.zeros(0))


def test_a_point_below_a_jump_is_no_corner():
    """Readings on the shipped mistuned wheel under 50 N: 54 um where dampers stick, 198 um on the
    falling side of a peak of 263 um between them. The tangent at the lower one ends just above the
    higher one.
    """
    heights, slopes = np.array([53.979, 198.161]), np.array([0.0411, -0.0749])
    low, high = (
        look(HZ * at, size, slope * size / HZ)
        for at, size, slope in zip((370.9535, 381.9926), heights, slopes, strict=True)
    )
    target, gain = peak_module._vertex_between(low, high, corner=True)
    # the search goes on, on the rising side of the higher one
    assert gain > 0.01 and HZ * 372 < target < HZ * 381.9


def test_the_foot_of_a_jump_does_not_close_a_peak_in():
    """A bouncing mass (seed 43 of benchmarks/choice_random.py): the next point is that of another
    motion, a ninth as high. The cubic through both ended the search, at a slope by which the peak
    was 13 % higher.
    """
    high, foot = look(320.21, 107.7, 1.43), look(320.63, 25.9, -3.30)
    assert peak_module._jumps_between(high, foot)
    target, gain = peak_module._vertex_between(high, foot, corner=False)
    assert target == pytest.approx(320.42) and gain == pytest.approx(1.43 * 0.42 / 107.7)
    # one mode, however far the other point is down
    omegas = np.array([320.0, 330.0])
    squares = 1 + (omegas - 321.0) ** 2
    heights, slopes = squares**-0.5, -(omegas - 321.0) * squares**-1.5
    resonance = [look(*reading) for reading in zip(omegas, heights, slopes, strict=True)]
    assert not peak_module._jumps_between(*resonance)


def test_a_look_over_the_band_measures_at_the_probe_that_is_asked_for():
    """Two masses: the highest peak of the second is 0.5 rad/s above that of the first."""
    ports = {"contact": np.array([0]), "load": np.array([0, 1]), "probe": np.array([0, 1])}
    K = np.array([[1.05, -0.05], [-0.05, 2.3]])
    body = port_model_from_matrices(np.eye(2), K, ports)
    contact = Elements(np.array([0.5]), np.zeros(1), np.ones(1), np.array([0.5]), tangents=1)
    model = ReducedModel((body,), contact, {1: np.array([1.0, 1.0])}, Damping(ratio=0.01))
    for probe in (0, 1):
        along = Variation(
            lambda factor: vary(model, "load", factor),
            partial(lambda probe, *peak: with_slope(*peak[:2], "load", peak[2], probe), probe),
        )
        options = replace(DEFAULT_OPTIONS, probe=probe)
        search = PeakSearch(along, (0.8, 2.0), 3, 128, (0.1, 10.0), 1e-3, options)
        met, _ = look_over_band(search, 1.0)
        assert met is not None
        points = response(model, np.linspace(0.8, 2.0, 120), 3, 128)
        assert met.height >= max(size(point, probe) for point in points)


@pytest.mark.parametrize("model", [single_mass(force=0.0), replace(single_mass(), excitation={})])
def test_a_probe_that_does_not_move_has_no_curve_to_refine(model):
    """400 points were solved, with a note that peaks may be higher; without any excitation
    nothing was.
    """
    notes = []
    points = list(sweep(model, (0.5, 2.0), notes=notes))
    assert 0 < len(points) < 20 and not notes
    assert all(size(point) == 0 for point in points)


@pytest.mark.parametrize("sharper", [1.0, 100.0])
def test_a_judging_peak_is_one_point_where_bend_and_slope_promise_no_gain(sharper):
    """With four times the samples, from the peak with fewer; but not by the bend of a ripple."""
    model = reference_model(1e6, 0.06, 1.4, harmonics=3)
    peak = find_peak(model, HZ * 1320, 3, 128, tolerance=1e-5)
    judging = replace(DEFAULT_OPTIONS, fallbacks=False)
    start = {"near": peak.solution, "tolerance": 4e-3, "options": judging}
    judged = replace(peak, bend=sharper * peak.bend)
    found = find_peak(model, peak.omega, 3, 512, judged=judged, **start)
    truth = find_peak(model, peak.omega, 3, 512, tolerance=1e-6)
    assert (found.points == 1) == (sharper == 1.0)
    assert found.height == pytest.approx(truth.height, rel=1e-3)
    if sharper == 1.0:
        assert abs(found.vertex - truth.omega) < 0.3 * HZ
    # without a bend it is enclosed, and where the heights differ
    assert find_peak(model, peak.omega, 3, 512, **start).points > 1
    other = replace(judged, height=1.1 * peak.height)
    assert find_peak(model, peak.omega, 3, 512, judged=other, **start).points > 1
