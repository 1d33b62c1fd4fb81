"""Engine orders against frequencies with closed forms."""

import numpy as np
import pandas as pd
import pytest

from bladefem.study.modes.crossings import (
    campbell_crossings,
    crossing_margins,
    fold_order,
    interference_table,
)


def southwell(speeds, still=300.0, factor=1.7):
    """f^2 = f0^2 + B (speed / 2 pi)^2."""
    return np.sqrt(still**2 + factor * (speeds / (2 * np.pi)) ** 2)


@pytest.mark.parametrize(
    "order, sectors, diameter",
    [(6, 36, 6), (30, 36, 6), (36, 36, 0), (18, 36, 18), (43, 36, 7), (0, 12, 0)],
)
def test_folding(order, sectors, diameter):
    assert fold_order(order, sectors) == diameter


def test_crossing_of_a_southwell_line_is_exact_with_three_speeds():
    """EO^2 s^2 = f0^2 + B s^2 gives s = f0 / sqrt(EO^2 - B), whatever the speeds between."""
    speeds = np.array([0.0, 400.0, 1500.0])
    table = pd.DataFrame({"speed": speeds, "mode": 1, "frequency": southwell(speeds)})
    found = campbell_crossings(table, [2, 3, 4, 6])
    expected = 2 * np.pi * 300.0 / np.sqrt(np.array([6, 4, 3, 2]) ** 2 - 1.7)
    assert np.allclose(found["speed"], expected, rtol=1e-12)
    assert np.allclose(found["frequency"], southwell(expected), rtol=1e-12)


def test_only_the_folded_diameter_crosses():
    speeds = np.linspace(0, 1500, 4)
    table = pd.concat(
        [
            pd.DataFrame(
                {"speed": speeds, "mode": 1, "nodal_diameter": n, "frequency": southwell(speeds)}
            )
            for n in range(7)
        ]
    )
    found = campbell_crossings(table, [3, 9, 4], sectors=12)
    assert sorted(zip(found["engine_order"], found["nodal_diameter"], strict=True)) == [
        (3, 3),
        (4, 4),
        (9, 3),
    ]


def test_a_crossing_on_a_given_speed_is_found_once():
    table = pd.DataFrame(
        {"speed": 2 * np.pi * np.array([50.0, 100.0, 150.0]), "mode": 1, "frequency": 400.0}
    )
    assert np.allclose(campbell_crossings(table, [4])["speed"], 200 * np.pi)


def test_interference_and_margins():
    table = pd.DataFrame(
        {
            "nodal_diameter": np.repeat(np.arange(7), 2),
            "mode": [1, 2] * 7,
            "frequency": np.tile([390.0, 1000.0], 7),
        }
    )
    speed = 2 * np.pi * 100.0
    rows = interference_table(table, 12, speed, [4, 8, 10])
    assert rows["wave"].tolist() == ["with"] * 2 + ["against"] * 4
    assert np.allclose(
        rows["margin"], [390 / 400 - 1, 1.5, 390 / 800 - 1, 0.25, 390 / 1000 - 1, 0.0]
    )
    assert crossing_margins(table, 12, speed, [4, 8, 10])["verdict"].tolist() == [
        "close",
        "ok",
        "close",
    ]
