"""Tables on the terminal."""

from __future__ import annotations

from math import pi
from types import SimpleNamespace

import numpy as np
import pandas as pd

from bladefem.cli.tables import mesh_quality, message_lists, run_summary, survey_tables
from bladefem.util.message import Message, warning


def test_a_mesh_is_told_in_nodes():
    """Points are those of a curve, or of a contact."""
    mesh = SimpleNamespace(points=np.zeros((7, 3)), bodies={}, parts={}, faces={}, report={})
    assert mesh_quality(mesh).splitlines()[-1].split() == ["nodes", "7"]


def survey(**parts):
    modes = SimpleNamespace(nodal_diameter=3, frequencies=np.array([100.0]), residuals=[1e-9])
    nothing = dict.fromkeys(("campbell", "convergence", "answer", "mac"))
    return SimpleNamespace(run=SimpleNamespace(modes=[modes]), **(nothing | parts))


def test_crossings_are_in_revolutions_a_minute():
    crossing = {"engine_order": [9], "mode": [1], "frequency": [382.5], "speed": [255 * pi / 3]}
    found = survey(campbell=SimpleNamespace(crossings=pd.DataFrame(crossing)))
    table = survey_tables(found).split("\n\n")[1]
    assert "speed [rpm]" in table and table.splitlines()[-1].split() == [
        "9",
        "1",
        "382.50",
        "2550.0",
    ]
    none = pd.DataFrame(crossing).iloc[:0]
    said = survey_tables(survey(campbell=SimpleNamespace(crossings=none)))
    assert said.endswith("no engine order crosses a mode in this range of speeds")


def test_a_mode_without_a_limit_says_why():
    summary = pd.DataFrame(
        {
            "mode": [1, 2],
            "frequency": [100.0, 200.0],
            "limit": [99.0, np.nan],
            "order": [4.0, np.nan],
            "error": [0.01, 0.02],
            "reason": ["", "it wavers"],
        }
    )
    found = survey(convergence=SimpleNamespace(summary=summary))
    rows = survey_tables(found).split("\n\n")[1].splitlines()
    assert rows[-2].split() == ["1", "100.00", "99.00", "4.00", "1.000"]
    assert rows[-1].split() == ["2", "200.00", "2.000", "it", "wavers"]
    own = summary.assign(given=[101.0, 202.0], given_error=[0.02, 0.03])
    head, _, first, _ = (
        survey_tables(survey(convergence=SimpleNamespace(summary=own)))
        .split("\n\n")[1]
        .splitlines()
    )
    assert "as given [Hz]" in head and first.split()[:3] == ["1", "101.00", "2.000"]


SAID = [
    warning("the amplitude is that of a march", "use it as given", "9 N: 120 um"),
    Message("searched", detail="8 loads"),
]


def test_a_page_has_the_details_that_the_terminal_leaves_out(tmp_path):
    run = SimpleNamespace(timings={}, messages=SAID, folder=tmp_path)
    told = run_summary(run)
    assert "  - the amplitude is that of a march\n    what to do: use it as given" in told
    # no page was written
    assert "    details: 9 N: 120 um" in told and "    details: 8 loads" in told
    (tmp_path / "report.html").touch()
    told = run_summary(run)
    assert "120 um" not in told and "8 loads" not in told
    assert "figures and reasons of each: report.html" in told
    assert told.index("what to do") < told.index("figures and reasons") < told.index("report: ")


def test_a_page_is_not_referred_to_where_nothing_was_left_out():
    assert message_lists(["plain"], "report.html") == ["information:\n  - plain"]
