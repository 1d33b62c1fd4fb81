"""Steps of the explicit march of benchmarks/loads_in_time.py on a layer that stiffens."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from loads_in_time import (
    Layer,
    Ring,
    contact_forces,
    has_enough_steps,
    start_at_rest,
    steps_needed,
)

DECAY = 0.1


def test_steps_are_judged_by_the_stiffness_that_the_layer_reaches(capsys):
    """One mode of 1 rad/s on the first of two nodes: sqrt(1 + growth (kn + kt))."""
    one, none, pair = np.ones(1), np.zeros(1), np.ones(2)
    rows = np.array([[1.0], [1.0], [0.0], [0.0]])
    whole = np.ones((1, 1))
    ring = Ring(one, none, one, none, rows, whole, whole, 0 * rows, 2, 0.0)
    layer = Layer(2 * pair, 3 * pair, 0 * pair, 0.1 * pair, DECAY * pair, np.zeros((2, 1)))
    state = start_at_rest(ring, layer)
    at_rest = np.sqrt(1 + 5) / 0.2 / 2
    assert steps_needed(ring, layer, 0.2, state.growth) == pytest.approx(at_rest)
    assert has_enough_steps(ring, layer, state, 9.0, 0.2, 10)
    counts = state.slips, state.opens, state.work, state.growth
    # pressed by so many lengths of the layer, then let go
    for lengths in (3.0, -3.0):
        w = np.array([[DECAY * lengths, 0.0, 0.0, 0.0]])
        forces = (*layer.table, layer.t0), np.zeros((1, 4))
        contact_forces.py_func(w, state.before, state.friction, *forces, *counts)
    pressed = np.sqrt(1 + 5 * np.exp(3)) / 0.2 / 2
    assert steps_needed(ring, layer, 0.2, state.growth) == pytest.approx(pressed)
    assert not has_enough_steps(ring, layer, state, 9.0, 0.2, 10)
    assert f"9 N: 10 steps a period, expected more than {pressed:.0f}" in capsys.readouterr().out
