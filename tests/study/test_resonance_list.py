"""The list of resonances from a curve's columns against that from the paths themselves."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import FOLDING, folding_pair

from bladefem.hbm.branches import find_branches
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.report.resonance_table import resonance_table
from bladefem.study.pipeline.load_remarks import load_warnings
from bladefem.study.pipeline.motion_warnings import selective_sweeps
from bladefem.study.pipeline.resonance_list import local_resonances, motions_at, reach_of_resonance
from bladefem.study.stability.lower_motion import LowerMotion

BAND = (249.0, 431.0)


def curve_of(points) -> SimpleNamespace:
    """The columns that a curve keeps, in ascending frequency."""
    points = sorted(points, key=lambda p: p.omega)
    columns = {
        "frequency": [p.frequency for p in points],
        "amplitude": [size(p) for p in points],
        "first": [p.probe[1, 0] for p in points],
        "branch": [p.branch for p in points],
        "converged": [p.converged for p in points],
        "stability": [""] * len(points),
        "bifurcation": [""] * len(points),
    }
    peak = max(columns["amplitude"])
    arrays = {name: np.array(values) for name, values in columns.items()}
    return SimpleNamespace(
        **arrays, load=80.0, mass=None, balance_amplitude=peak, resonance_by_march=None, lower=None
    )


def test_columns_give_what_the_paths_gave():
    model = folding_pair()
    known = list(response(model, np.linspace(*BAND, 13), 7, 256))
    found = find_branches(model, BAND, known, 7, 256)
    listed = local_resonances(curve_of(found.points))
    assert len(listed) == len(found.resonances) >= 2
    for one, truth in zip(listed, found.resonances, strict=True):
        assert one.frequency == pytest.approx(truth.frequency, rel=1e-12)
        assert one.amplitude == pytest.approx(truth.height, rel=1e-12)
        assert one.motions == truth.multiplicity
        assert one.reached == truth.reached
    assert listed[0].reached == "down"
    keeps = f"{1e6 * listed[1].amplitude:.4g} um and less"
    assert reach_of_resonance(curve_of(found.points)) == ("down", keeps)
    (said,) = load_warnings(selective_sweeps([curve_of(found.points)]))
    assert said == "under 80 N only a slow sweep down reaches the resonance given"
    assert said.detail == f"80 N: the other sweep keeps to {keeps}"


def test_a_plain_sweep_has_one_motion_that_both_sweeps_reach():
    model = folding_pair()
    weak = replace(model, excitation={1: 0.01 * FOLDING["force"]})
    points = list(response(weak, np.linspace(*BAND, 60), 3, 128))
    listed = local_resonances(curve_of(points))
    assert [(r.motions, r.reached) for r in listed] == [(1, "up and down")] * len(listed)
    assert listed[0].amplitude == max(map(size, points))
    assert reach_of_resonance(curve_of(points)) == ("", "")
    assert not list(selective_sweeps([curve_of(points)]))


def sweep_with(*motions, branch=2) -> SimpleNamespace:
    """A smooth resonance as one piece, and further motions (frequency, first harmonic) as
    another.
    """
    frequency = np.linspace(*BAND, 41)
    first = 1.0 / (1 - (frequency / 300) ** 2 + 0.05j)
    columns = {
        "frequency": np.concatenate([frequency, [f for f, _ in motions]]),
        "first": np.concatenate([first, [value for _, value in motions]]),
        "branch": np.array([1] * len(frequency) + [branch] * len(motions)),
    }
    count = len(columns["branch"])
    columns["amplitude"] = abs(columns["first"])
    columns["converged"] = np.ones(count, bool)
    columns |= {"stability": np.full(count, ""), "bifurcation": np.full(count, "")}
    return SimpleNamespace(
        **columns,
        load=8.0,
        mass=None,
        resonance_by_march=None,
        march_at_peak=None,
        lower=None,
        peak_frequency=frequency[abs(first).argmax()],
        peak_amplitude=abs(first).max(),
        balance_amplitude=abs(first).max(),
        curve_amplitude=abs(first).max(),
    )


@pytest.mark.parametrize("motions", [[(310.0, 40j)], [(308.0, 40j), (310.0, 39j), (312.0, 38j)]])
def test_motions_apart_from_the_paths_are_listed(motions):
    """Also single ones, and those that are highest at an end."""
    top, (_, height) = local_resonances(sweep_with(*motions))[0], motions[0]
    assert (top.frequency, top.amplitude) == (motions[0][0], abs(height))
    assert top.reached == "isolated" and top.motions == 2


def test_a_motion_on_the_path_is_no_other_one():
    """The climb to a peak leaves its last point beside the path that was followed."""
    plain = sweep_with()
    near = sweep_with((plain.frequency[12], 0.99 * plain.first[12]), branch=0)
    assert len(local_resonances(near)) == len(local_resonances(plain)) == 1


def test_a_marched_resonance_has_a_row_in_the_table():
    curve = sweep_with()
    assert resonance_table([curve]) == {}
    for kept, reached in (
        (SimpleNamespace(drive=1.0), "march in time"),
        (SimpleNamespace(drive=16.0), "march in time after a strong drive"),
    ):
        curve = sweep_with()
        vars(curve).update(
            march_at_peak=kept, curve_amplitude=30.0, peak_amplitude=30.0, peak_frequency=310
        )
        (table,) = resonance_table([curve]).values()
        assert list(table["reached"]) == [reached, "up and down"]
        assert list(table["amplitude"]) == [30.0, pytest.approx(curve.balance_amplitude)]


@pytest.mark.parametrize(("doubt", "stability"), [("", "stable"), ("too long", "unknown")])
def test_a_lower_motion_counts_at_the_resonance_and_has_a_row(doubt, stability):
    """Under 36 N of the shipped wedge one motion was counted where the report told two."""
    curve = sweep_with()
    top = curve.peak_frequency
    curve.lower = LowerMotion(0.2345 * curve.peak_amplitude, doubt)
    (resonance,) = local_resonances(curve)
    assert (resonance.frequency, resonance.motions) == (top, 2)
    # elsewhere it was not sought
    assert motions_at(curve, 1.01 * top) == 1
    assert reach_of_resonance(curve) == ("", "")
    (table,) = resonance_table([curve]).values()
    assert list(table["reached"]) == ["up and down", "from rest"]
    assert list(table["motions"]) == [2, 2] and list(table["frequency"]) == [top, top]
    # with two digits, as the report tells it
    assert table["amplitude"][1] == float(f"{curve.lower.amplitude:.2g}") < curve.peak_amplitude
    assert table["stability"][1] == stability


def test_a_lower_motion_that_a_path_has_is_counted_once():
    """A path that folds below the resonance goes through it."""
    plain = sweep_with()
    top = plain.peak_frequency
    low = 0.2 * plain.peak_amplitude
    curve = sweep_with((top - 1, low), (top + 1, low))
    assert motions_at(curve, top) == 2
    curve.lower = LowerMotion(1.1 * low)
    assert motions_at(curve, top) == 2
