"""The pages of `modes`, `contact`, `study` and `chart`: each begins with its own answer."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from bladefem.data import ModeSet
from bladefem.report import chart as report_chart
from bladefem.report.captions import caption_of
from bladefem.report.chart import write_chart
from bladefem.report.modes import _numbers
from bladefem.report.run_tables import _stresses
from bladefem.report.write import LEAD_FIGURES
from bladefem.scene.tables import Scene
from bladefem.study.chart.chart import Chart
from bladefem.study.modes.stress import Strength

sys.path.insert(0, str(Path(__file__).parents[1] / "view"))


def test_chart_page_names_the_automatic_choice(tmp_path, monkeypatch):
    # tests/study/test_chart.py is about the pictures
    for draw in ("draw_chart", "draw_errors"):
        monkeypatch.setattr(
            report_chart, draw, lambda tables, file, **_: plt.imsave(file, np.zeros((2, 2)))
        )
    table = pd.DataFrame(
        {
            "name": ["H 3", "H 7", "H 31"],
            "family": "balance",
            "time": [0.1, 0.3, 2.0],
            "error": [0.03, 0.004, 1e-5],
            "error_frequency": [1e-3, 1e-4, 1e-6],
            "error_phasor": [0.03, 0.004, 1e-5],
            "left_out": False,
            "reason": "",
            "reference_error": 1e-6,
            "chosen": [False, True, False],
            "converged": True,
        }
    )
    made = Chart(table, table.assign(family="rigid"), ["the reference is H 63"], None)
    files = write_chart(made, tmp_path, 0.02, "a chart", Scene(accuracy=0.02))
    page = next(file for file in files if file.name == "report_chart.html").read_text()
    assert "0.4 % error" in page
    assert "wanted 2 %" in page
    assert "the reference is H 63" in page[page.index('<section id="accuracy"') :]


@pytest.mark.parametrize("studied", [True, False])
def test_frequencies_say_whether_the_mesh_was_studied(studied):
    modes = ModeSet(np.array([100.0, 250.0]), np.zeros((2, 1, 3)), 3, np.array([1e-9, 1e-8]))
    # the second frequency is of another mesh
    summary = pd.DataFrame({"mode": [1, 2], "frequency": [100.0, 245.1], "error": [0.004, 0.01]})
    result = SimpleNamespace(convergence=SimpleNamespace(summary=summary) if studied else None)
    first, second = _numbers(modes, ["flap", "edge"], result, 0.0)
    assert first.what == "mode 1, flap"
    assert second.value == "250 Hz"
    assert first.uncertainty == ("± 0.4 % (mesh)" if studied else "mesh error not studied")
    if studied:
        assert second.uncertainty == "± 3 % (mesh)"


def test_stresses_of_a_run_are_those_of_its_table():
    """A run has the mode studied alone, for 1 mm at the probe, at Gauss points; the modes' page
    has several states, for a largest displacement.
    """
    found = Strength(2, 1e9, np.zeros(3), 2e8, np.zeros(3), np.zeros(1), 0.0)
    table = _stresses(found)
    assert table["state"].tolist() == ["rotation", "mode 2, 1 mm at the probe"]
    for of_wheel in (True, False):
        caption = caption_of("modes/stresses", of_wheel)
        assert "1 mm at the probe" in caption and "largest displacement" not in caption
        assert "largest displacement of 1 mm" in caption_of("modes/stresses_of_modes", of_wheel)


def test_captions_are_sentences():
    names = [
        *LEAD_FIGURES,
        "modes/mode_3_wheel",
        "response/forced_response_12g",
        "mesh/anything_else",
    ]
    for name in names:
        assert re.match(r"[A-Z].*\.$", caption_of(name)), name
    assert caption_of("response/forced_response_12g").endswith("Damper of 12 g.")
