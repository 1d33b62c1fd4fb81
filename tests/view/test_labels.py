"""Names in a crowd of points: none covers another or a point, and those without room are
dropped.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.patheffects import withStroke

from bladefem.view.accuracy import draw_accuracy
from bladefem.view.response import draw_responses
from verification.paper.view_outcomes import _round_ticks


@pytest.mark.parametrize("crowded", [False, True])
def test_names_cover_nothing(crowded):
    k = np.arange(12)
    place = k // 6 + 0.002 * k if crowded else k / 4
    table = pd.DataFrame(
        {
            "name": [f"variant {i}" for i in k],
            "time": 10.0**place,
            "error": 10.0**-place,
            "chosen": k == 5,
            "converged": k != 11,
        }
    )
    ax = draw_accuracy(table).axes[0]
    boxes = [text.get_window_extent() for text in ax.texts]
    assert 1 <= len(boxes) < 12 if crowded else len(boxes) == 12
    assert "variant 5" in [text.get_text() for text in ax.texts]  # the chosen one comes first
    for i, box in enumerate(boxes):
        assert not box.count_overlaps(boxes[:i] + boxes[i + 1 :])
    points = np.concatenate(
        [
            line.get_transform().transform(line.get_xydata())
            for line in ax.lines
            if line.get_marker() in ("o", "*", "x")
        ]
    )
    assert not any(box.contains(*p) for box in boxes for p in points)


def test_every_curve_of_a_crowd_has_its_load():
    """Ten resonances at nearly one place: names without room next to theirs stand farther away,
    with a line to it, and none is struck through by a curve.
    """
    offset = np.linspace(-2, 2, 41)
    loads = np.arange(50.0, 60.0)
    curves = [
        pd.DataFrame(
            {
                "load": load,
                "frequency": 400 + 0.02 * load + offset,
                "amplitude": 1e-4 * (1 + 0.002 * load) / (1 + offset**2),
                "converged": True,
            }
        )
        for load in loads
    ]
    points = pd.concat(curves, ignore_index=True)
    ax = draw_responses(points).axes[0]
    names = [text for text in ax.texts if text.get_text()]
    assert sorted(text.get_text() for text in names) == [f"{load:.0f} N" for load in loads]
    legend = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {text.get_text() for text in names} <= legend
    boxes = [text.get_window_extent() for text in names]
    assert not any(box.count_overlaps(boxes[:i]) for i, box in enumerate(boxes))
    assert all(isinstance(text.get_path_effects()[0], withStroke) for text in names)
    joined = [text for text in ax.texts if text.arrow_patch is not None]
    assert joined and all(text.get_text() == "" for text in joined)
    assert {text.xyann for text in joined} <= {text.xyann for text in names}


def test_ticks_of_a_map_are_round_numbers_among_its_cells():
    ticks, places = _round_ticks(np.geomspace(0.1, 100, 16))
    np.testing.assert_allclose(ticks, [0.1, 1, 10, 100])
    np.testing.assert_allclose(places, [0, 5, 10, 15], atol=1e-12)
    ticks, places = _round_ticks(np.linspace(1200, 1420, 8))
    np.testing.assert_allclose(ticks, [1200, 1300, 1400])
    np.testing.assert_allclose(places, (ticks - 1200) / 220 * 7)
