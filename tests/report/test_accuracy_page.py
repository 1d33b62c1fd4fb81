"""Numbers of docs/accuracy.md are those of the tables beside its pictures."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs" / "figures"
PAGE = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
sys.path.insert(0, str(ROOT / "benchmarks"))

from whole_answer_picture import answer_table, what_was_solved, write_advice  # noqa: E402

SCENES = re.findall(r"<!-- answer of (\w+) -->", PAGE)
# rows of the page to rows of the table
REFERENCE = {
    "balance, H 1": "H 1",
    "automatic: H 3, 64 samples, 10 modes": "automatic: H 3, 64 samples",
    "balance, H 3, 512 samples": "H 3",
    "balance, H 7, 512 samples": "H 7",
    "balance, H 15, 512 samples": "H 15",
    "balance, H 15, exact events": "H 15 exact",
    "shooting": "shooting",
}


def test_whole_answers_are_copied_from_their_tables():
    made = {file.stem.split("_", 1)[1] for file in FIGURES.glob("answer_*.txt")}
    assert set(SCENES) == made
    for scene in SCENES:
        rows = pd.read_csv(FIGURES / f"answer_{scene}.csv")
        loads = pd.read_csv(FIGURES / f"answer_{scene}_loads.csv")
        begin, end = f"<!-- answer of {scene} -->", f"<!-- end of {scene} -->"
        reported = PAGE.split(begin)[1].split(end)[0]
        assert answer_table(rows) in reported
        assert what_was_solved(rows, loads)[1:] in reported
        assert (FIGURES / f"answer_{scene}.txt").read_text(encoding="utf-8") in reported
        assert f"figures/answer_{scene}.png" in reported


def test_the_line_to_paste_is_that_of_the_cheapest_way_that_is_a_setting(tmp_path):
    """The paper's loop is cheapest, and none; an automatic choice brings its own accuracy."""
    ways = {
        "automatic": ("automatic choice", 9.0, 0.03, 0.02, ""),
        "automatic, 0.5 %": ("automatic choice", 20.0, 0.01, 0.005, ""),
        "H 3": ("harmonics", 5.0, 0.2, 0.02, "model = {harmonics = 3}"),
        "paper's loop": ("paper's loop", 1.0, 0.001, 0.02, ""),
    }
    columns = ("family", "time", "error", "accuracy", "settings")
    rows = pd.DataFrame.from_dict(ways, orient="index", columns=columns)
    rows = rows.rename_axis("name").reset_index()
    rows = rows.assign(scale=1.0, converged=True, reason="", error_amplitude=0.01)
    rows["chosen"] = rows["name"] == "automatic"
    loads = pd.DataFrame({"load": [4.0, 8.0], "judge": [0.01, float("nan")]})
    file = tmp_path / "advice.txt"
    write_advice(rows, loads, 0.02, file)
    pasted = [x for x in file.read_text().splitlines() if x.startswith("take this")]
    assert pasted == ['take this: accuracy = "0.5 %"', "take this: model = {harmonics = 3}"]


def test_the_table_of_ways_says_what_was_not_solved_and_what_was_left_out():
    """Cheapest first, the automatic choice in bold."""
    common = dict.fromkeys(("error_amplitude", "error_frequency", "error_phasor", "median"), 0.02)
    rows = pd.DataFrame(
        [
            {"name": "automatic", "time": 3.0, "chosen": True, "converged": True, "reason": ""},
            {"name": "H 7", "time": 9.0, "chosen": False, "converged": False, "reason": "left out"},
            {"name": "loop", "time": 1.0, "chosen": False, "converged": False, "reason": "4 N: x"},
        ]
    ).assign(**common)
    lines = answer_table(rows).splitlines()[2:]
    assert lines[0].startswith("| loop | not solved |")
    assert lines[1] == "| **automatic** | 2 % | 2 % | 2 % | 2 % | 3 s |"
    assert lines[2].startswith("| H 7 | left out |")


@pytest.mark.parametrize("row", REFERENCE)
def test_the_reference_blade_is_that_of_its_table(row):
    table = pd.read_csv(FIGURES / "accuracy_reference_methods.csv").set_index("name")
    found = table.loc[REFERENCE[row]]
    blade = PAGE.split("## What the chart of the reference blade says")[1].split("\n## ")[0]
    (line,) = [x for x in blade.splitlines() if x.startswith(f"| {row} |")]
    amplitude, phasor, seconds = (x.strip() for x in line.strip("|").split("|")[1:])
    assert float(amplitude) == pytest.approx(found["error"], rel=0.06)
    assert float(phasor) == pytest.approx(found["error_phasor"], rel=0.06)
    reported = float(seconds.removesuffix(" ms")) / 1e3
    assert reported == pytest.approx(found["time [s]"], rel=0.06)
