"""The linear limits of a response against the harmonic balance under a very small and a very large
load.
"""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.hbm.model import in_series, softened_layer
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline.design_table import design_table
from bladefem.study.pipeline.linear_limits import judged_limits, linear_limits


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


@pytest.mark.parametrize("modes", [2, 3, 5])
def test_what_modes_leave_out_of_a_limit_is_estimated(modes):
    """Against all 40 modes: never below half of the true error, and no more than twice as much. Full
    stick with two modes is 1.3 % too low.
    """
    rich = reference_model(load=3.0, points=4, harmonics=3)
    band = (1000.0, 1600.0)
    settings = Settings(modes, 1, 64, "rigid", 2)
    found = judged_limits(family_of(rich), settings, None, 2, band, True)
    for limit, exact in zip(found, linear_limits(rich, 2, band), strict=True):
        wrong = abs(limit.peak_amplitude / exact.peak_amplitude - 1)
        assert 0.5 * wrong <= limit.error <= 2 * wrong
        # more than half of the points are not used, and no body less its error is known
        assert np.isnan([limit.halved, limit.body_mesh]).all()
        assert limit.estimated.shape == limit.frequency.shape
        assert (limit.estimated > 0).all()
    if modes == 2:
        assert found[1].error > 0.01


def test_limits_are_of_the_layer_itself():
    """Where the settings of a damped resonance have a softer layer in its place."""
    model = reference_model(load=3.0, points=4, harmonics=3)
    series = -0.5 / model.springs
    split = replace(model, sides=tuple(in_series(s, series) for s in model.sides), series=series)
    settings = Settings(5, 1, 64, "rigid", None)
    band = (1000.0, 1600.0)
    plain, softened = (
        judged_limits(family_of(split), one, None, 2, band, True)[1]
        for one in (settings, replace(settings, softened=True))
    )
    assert softened.peak_frequency == plain.peak_frequency
    softer = linear_limits(softened_layer(split), 2, band)[1]
    assert softer.peak_frequency < 0.99 * plain.peak_frequency


def test_the_error_of_the_bodies_mesh_counts_in_a_limit():
    """A body that is a thousandth softer moves 0.1 % farther at its resonance, at least."""
    rich = reference_model(load=3.0, points=4, harmonics=3)
    sides = tuple(replace(side, omega=side.omega * 0.999) for side in rich.sides)
    softer = family_of(replace(rich, sides=sides))
    settings = Settings(5, 1, 64, "rigid", None)
    limits = judged_limits(family_of(rich), settings, softer, 2, (1000.0, 1600.0), True)
    for limit in limits:
        assert 1e-3 < limit.body_mesh < 5e-3
        assert limit.halved < 1e-9
        assert limit.error == limit.balance + limit.halved + limit.body_mesh


def test_a_limit_that_nothing_was_compared_with_has_no_error():
    """An empty cell, and not one that says that it is exact."""
    model = reference_model(load=3.0, points=4, harmonics=3)
    table = design_table([], linear_limits(model, 2, (1000.0, 1600.0)))
    assert np.isnan(table["error"]).all()
