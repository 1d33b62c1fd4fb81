"""The list of resonances from a curve's columns against that from the paths themselves."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import FOLDING, folding_pair

from bladefem.hbm.branches import find_branches
from bladefem.hbm.solution import size
from bladefem.hbm.sweep import response
from bladefem.study.pipeline.resonance_list import local_resonances, reach_sentence

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
    return SimpleNamespace(**arrays, load=80.0, balance_amplitude=peak, sought=None)


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
    assert reach_sentence(curve_of(found.points)) == (
        "load 80 N: the resonance is reached by a slow sweep down; a sweep up keeps to "
        f"{1e6 * listed[1].amplitude:.4g} um and less"
    )


def test_a_plain_sweep_has_one_motion_that_both_sweeps_reach():
    model = folding_pair()
    weak = replace(model, excitation={1: 0.01 * FOLDING["force"]})
    points = list(response(weak, np.linspace(*BAND, 60), 3, 128))
    listed = local_resonances(curve_of(points))
    assert [(r.motions, r.reached) for r in listed] == [(1, "up and down")] * len(listed)
    assert listed[0].amplitude == max(map(size, points))
    assert reach_sentence(curve_of(points)) == ""
