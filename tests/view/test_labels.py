"""Names in a crowd of points: none covers another or a point, and those without room are
dropped.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from bladefem.view.accuracy import draw_accuracy
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


def test_ticks_of_a_map_are_round_numbers_among_its_cells():
    ticks, places = _round_ticks(np.geomspace(0.1, 100, 16))
    np.testing.assert_allclose(ticks, [0.1, 1, 10, 100])
    np.testing.assert_allclose(places, [0, 5, 10, 15], atol=1e-12)
    ticks, places = _round_ticks(np.linspace(1200, 1420, 8))
    np.testing.assert_allclose(ticks, [1200, 1300, 1400])
    np.testing.assert_allclose(places, (ticks - 1200) / 220 * 7)
