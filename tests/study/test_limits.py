"""The linear limits of a response against the harmonic balance under a very small and a very large
load.
"""

from dataclasses import replace

import numpy as np

from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.study.pipeline.linear_limits import linear_limits


def test_limits_are_reached_under_extreme_loads():
    model = reference_model(load=3.0, points=3, harmonics=3)
    for limit, factor in zip(linear_limits(model, 2, (1000.0, 1600.0)), (1e-9, 1e9), strict=True):
        loaded = replace(model, elements=replace(model.elements, n0=model.elements.n0 * factor))
        point = solve(loaded, 2 * np.pi * limit.peak_frequency, 3, 64)
        assert point.converged
        assert (
            abs(abs(point.probe[1, 0]) / limit.peak_amplitude - 1) < 1e-5
        )  # friction of 3e-9 N is left
        assert np.isclose(abs(limit.first).max(), limit.peak_amplitude, rtol=1e-12)


def test_nodes_without_static_load_stay_open_in_full_stick():
    model = reference_model(load=3.0, points=3, harmonics=3)
    some = replace(
        model.elements,
        n0=np.where(np.arange(len(model.elements.n0)) % 3 == 0, -1.0, model.elements.n0),
    )
    less, whole = (
        linear_limits(replace(model, elements=e), 2, (1000.0, 1600.0))[1]
        for e in (some, model.elements)
    )
    assert less.peak_frequency < whole.peak_frequency - 1.0
