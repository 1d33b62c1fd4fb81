"""Tables in three formats, sentences of a report, and the two pages."""

import base64
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from bladefem.data import Patch, PressureMap
from bladefem.errors import InputError
from bladefem.io.run_folder import keep_given
from bladefem.report.datasets import contact_arrays
from bladefem.report.headlines import headlines
from bladefem.report.next_steps import next_steps
from bladefem.report.page_tables import page_tables, without_roundoff
from bladefem.report.run_messages import beyond_stick
from bladefem.report.scatter_sentences import loads_on_both_sides
from bladefem.report.statements import (
    ResponseAnswer,
    assumed_stiffness,
    cut_peaks,
    reliability,
    response_answer,
    wrong_speed,
)
from bladefem.report.tables import readable_texts, to_latex, to_markdown, write_tables
from bladefem.report.write import inputs_hash, write_report
from bladefem.scene.tables import Contact, Excitation, Operation, Scene, Seat
from bladefem.scene.toml import load_scene, vary
from bladefem.util.message import Message, method, warning
from bladefem.view.contact import pressure_points, pressure_summary
from bladefem.view.optimum import at_band_end
from bladefem.view.response import MARCHED

sys.path.insert(0, str(Path(__file__).parents[1] / "view"))
import synthetic

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNkYAAAAAYAAjCB0C8AAAAASUVORK5CYII="
)


class Balanced(HTMLParser):
    """Counts elements and refuses wrongly nested ones."""

    def __init__(self):
        super().__init__()
        self.open, self.count = [], {}

    def handle_starttag(self, tag, attrs):
        self.count[tag] = self.count.get(tag, 0) + 1
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture
def report(tmp_path):
    picture = tmp_path / "figures" / "optimum.png"
    picture.parent.mkdir()
    picture.write_bytes(PIXEL)
    tables = {
        "response/summary": synthetic.summary(),
        "response/points": synthetic.points(),
        "modes/frequencies": synthetic.wheel_frequencies(40),
    }
    return write_report(
        tmp_path,
        Scene(title="A <wedge> & its damper"),
        tables,
        {"response/optimum": picture},
        ["3 elements were straightened"],
        {"mesh": 1.0, "modes": 3.0},
    )


def test_readable_units():
    text = readable_texts(
        pd.DataFrame(
            {
                "load": [0.0, np.inf],
                "peak_amplitude": [5e-4, 3.70371e-5],
                "family": ["a", "b"],
                "points": [3, np.nan],
            }
        )
    )
    assert list(text.columns) == ["normal load [N]", "resonance amplitude [µm]", "family", "points"]
    assert text.to_numpy().tolist() == [["0", "500", "a", "3"], ["∞", "37.037", "b", ""]]


def test_an_error_without_a_bound_is_unknown_and_no_infinite_number():
    table = pd.DataFrame(
        {"load": [1.0, np.inf], "error": [0.05, np.inf], "own_error": [np.inf, 0.1]}
    )
    text = readable_texts(table)
    assert text.to_numpy().tolist() == [["1", "5", "unknown"], ["∞", "unknown", "10"]]
    # the column stays one of numbers, to the right
    assert "| ---: | ---: | ---: |" in to_markdown(table)


def test_influences_are_shown_in_the_units_of_people():
    names = ("amplitude_now", "amplitude_low", "amplitude_low_solved", "load_now", "frequency_high")
    text = readable_texts(pd.DataFrame({name: [1.5e-4] for name in names}))
    assert list(text.columns) == [
        "amplitude now [µm]",
        "amplitude, low end [µm]",
        "amplitude, low end, solved [µm]",
        "load now [N]",
        "frequency, high end [Hz]",
    ]
    assert text.iloc[0, 0] == "150"


def test_markdown_and_latex_align_numbers_and_escape():
    table = pd.DataFrame({"family": ["a_1 | 50 %"], "frequency": [812.4]})
    assert to_markdown(table).splitlines()[1] == "| --- | ---: |"
    assert r"a_1 \| 50 %" in to_markdown(table)
    latex = to_latex(table, "Modes & more")
    assert (
        r"a\_1 | 50 \% & 812.4 \\" in latex
        and r"\caption{Modes \& more}" in latex
        and "{lr}" in latex
    )


def test_written_csv_is_si_with_units(tmp_path):
    files = write_tables(synthetic.summary(), tmp_path / "tables" / "summary")
    assert [f.suffix for f in files] == [".csv", ".md", ".tex"]
    back = pd.read_csv(files[0])
    assert "peak_amplitude [m]" in back
    assert np.allclose(back["peak_amplitude [m]"], synthetic.summary()["peak_amplitude"], rtol=1e-8)


def test_answer_names_the_optimum():
    found = response_answer(synthetic.summary(), synthetic.points())
    values = [value for _, value, _ in found.numbers]
    assert values[:3] == ["200 N", "37.04 µm", "892 Hz"]
    assert "92.6 % below" in found.numbers[1][2]
    assert found.cautions == []


@pytest.mark.parametrize("error", [np.nan, 0.01, 0.5])
def test_no_load_is_best_that_is_worse_than_no_damper(error):
    """90 um with the best load, 80 without damper and 70 in full stick: whatever the error is."""
    table = pd.DataFrame(
        {
            "load": [0.0, 10.0, 20.0, 40.0, np.inf],
            "peak_frequency": [1000.0, 1010.0, 1020.0, 1030.0, 1040.0],
            "peak_amplitude": [8e-5, 9.5e-5, 9e-5, 9.2e-5, 7e-5],
            "error": error,
        }
    )
    optimum, lowest = response_answer(table).numbers
    assert optimum[1] == "not determined"
    assert optimum[2] == "it lies 29 % above the better of the free and the stuck blade"
    assert lowest[1] == "90 µm"


def test_answer_says_which_mass_would_press_best():
    """Without an exact search the best of the loads studied is named as that, no parabola."""
    summary = pd.DataFrame(
        {
            "load": [100.0, 200.0, 400.0],
            "peak_amplitude": [4e-5, 1e-5, 4e-5],
            "peak_frequency": [880.0, 890.0, 900.0],
        }
    )
    own = pd.DataFrame({"mass": [0.012], "speed": [800.0], "load": [np.sqrt(2) * 200.0]})
    found = response_answer(summary, None, own).numbers
    assert found[0][2] == "best of 3 loads studied"
    assert found[-2][1:] == (
        "282.8 N",
        "12 g at 7639.4 rpm; resonance amplitude about 20 µm, between the loads studied",
    )
    assert found[-1][1] == "8.49 g"


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (150.0, 190.0, "between 150 and 190 N"),
        (150.0, np.nan, "within the accuracy down to 150 N; how far up was not found"),
        (np.nan, 190.0, "within the accuracy up to 190 N; how far down was not found"),
        (np.nan, np.nan, "how flat the optimum is was not found"),
    ],
)
def test_a_searched_optimum_says_how_flat_it_is(low, high, said):
    """Never by the number of loads studied, which are not what the search looked at."""
    summary, points = synthetic.summary().assign(error=0.01), synthetic.points()
    row = {"load": 170.0, "amplitude": 3e-6, "frequency": 870.0, "error": 0.01, "tolerance": 1e-3}
    row |= {"tolerated_from": low, "tolerated_to": high, "reason": ""}
    searched = pd.DataFrame([row])
    found = response_answer(summary, points, None, None, searched)
    numbers = headlines(found, summary, points, searched)
    assert numbers[0].value == "170 N"
    assert numbers[0].uncertainty == said
    # of the frequency of that load, not of the lowest one studied
    (frequency,) = [one for one in numbers if "frequency" in one.what]
    assert frequency.uncertainty == "no estimate: no response under this load"


def test_the_error_of_a_searched_optimum_has_that_of_the_mesh():
    """The search has one mesh: what finer ones change is given by the nearest load studied, not by
    the blade without damper, however far that load is.
    """
    rows = {"load": [0.0, 500.0, 3000.0, np.inf], "peak_amplitude": [1e-3, 1e-5, 9e-5, 9e-4]}
    rows |= {"peak_frequency": [400.0, 450.0, 460.0, 465.0], "error": [0.0, 0.1, 0.3, 0.0]}
    rows |= {"halved": [0.0, np.nan, 0.2, 0.0], "body_mesh": [0.0, 0.08, 0.05, 0.0]}
    rows |= {"layer_law": [0.0, 0.01, np.nan, 0.0]}
    rows |= {"alternating_stress": [1e8, 2e7, 2e7, 1e8]}
    rows |= {"stress_error": [np.nan, 0.2, np.nan, np.nan]}
    summary = pd.DataFrame(rows)
    row = {"load": 170.0, "amplitude": 9e-6, "frequency": 448.0, "error": 0.01, "tolerance": 1e-3}
    row |= {"tolerated_from": 150.0, "tolerated_to": 190.0, "reason": ""}
    searched = pd.DataFrame([row])
    numbers = headlines(
        response_answer(summary, None, None, None, searched), summary, None, searched
    )
    (amplitude,) = [one for one in numbers if one.what == "resonance amplitude there"]
    assert amplitude.uncertainty == "± 10 % (model and mesh)"
    (stress,) = [one for one in numbers if "stress" in one.what]
    assert stress.value == "18 MPa"
    assert stress.uncertainty == "± 30 % (20 % by the mesh there)"
    found = headlines(response_answer(summary, None), summary, None)
    assert "± 30 % (20 % by the mesh there)" in [one.uncertainty for one in found]
    unknown = summary.drop(columns="stress_error")
    found = headlines(response_answer(unknown, None), unknown, None)
    (stress,) = [one for one in found if "stress" in one.what]
    assert stress.uncertainty == "± 10 % (model and mesh), error by the mesh there apart"


def test_a_speed_that_does_not_drive_the_resonance_is_named():
    """Engine order 9 needs 60 f / 9 rpm."""
    summary = pd.DataFrame(
        {"load": [0.0, 90.0], "peak_frequency": [420.0, 450.0], "peak_amplitude": [1e-3, 1e-4]}
    )
    fast, right = (
        Scene(excitation=Excitation(engine_order=9), operation=Operation(speed=rpm * np.pi / 30))
        for rpm in (8000.0, 2900.0)
    )
    assert (
        wrong_speed(right, summary)
        == []
        == wrong_speed(Scene(operation=Operation(speed=0.0)), summary)
    )
    assert "excites at 1200 Hz" in wrong_speed(fast, summary)[0]
    assert "2800 to 3000 rpm" in wrong_speed(fast, summary)[0]
    # nothing turns with the wheel
    still = Scene(excitation=Excitation(engine_order=0), operation=Operation(speed=800.0))
    assert wrong_speed(still, summary) == []


def test_answer_warns_at_the_edge_of_loads_band_and_convergence():
    few = synthetic.summary().query("20 <= load <= 400").iloc[-1:]
    more = synthetic.summary().query("400 <= load <= 800")
    assert any("Only one load" in text for text in response_answer(few).cautions)
    assert any("smallest" in text for text in response_answer(more).cautions)
    assert any("did not converge" in text for text in response_answer(few).cautions)
    points = synthetic.points().query("load == 200 and frequency <= 892")
    assert any(
        "end of the frequency band" in text
        for text in response_answer(synthetic.summary(), points).cautions
    )
    assert response_answer(None).numbers == []


def test_band_ends_are_those_of_each_damper():
    """The peak of the light damper is the last point of its curve, not of the heavy one's."""
    curve = pd.DataFrame({"load": 80.0, "frequency": [390.0, 400.0, 430.0]})
    points = pd.concat([curve[:2].assign(mass=0.01), curve.assign(mass=0.02)])
    peaks = pd.DataFrame({"load": 80.0, "mass": [0.01, 0.02], "peak_frequency": 400.0})
    assert cut_peaks(peaks, points) == [80.0]
    assert list(at_band_end(peaks, points)) == [True, False]
    assert cut_peaks(peaks[1:], points) == []


def test_a_march_is_no_point_of_a_balance():
    """It is neither solved nor reached by a fallback."""
    points = synthetic.points().query("load == 200 and converged and method == 'newton'")
    march = points.iloc[[0]].assign(method=MARCHED, residual=np.nan)
    text, doubtful = reliability(pd.concat([points, march], ignore_index=True))
    assert f"{len(points)} of {len(points)} points converged" in text[0]
    assert len(text) == 1 and doubtful.empty


def test_failed_points_and_fallbacks_are_counted():
    points = synthetic.points()
    text, doubtful = reliability(points)
    failed, fallback = (
        (~points["converged"]).sum(),
        ((points["method"] == "homotopy") & points["converged"]).sum(),
    )
    assert f"{len(points) - failed} of {len(points)} points converged" in text[0]
    assert "3 points did NOT converge" in text[1]
    assert f"homotopy ({fallback})" in text[2]
    assert doubtful["not converged"].sum() == 3 and doubtful["by fallback"].sum() == fallback


def test_page_is_whole_and_self_contained(report):
    page = report[0].read_text()
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "A &lt;wedge&gt; &amp; its damper" in page
    order = [
        page.index(f'<section id="{key}"')
        for key in ("answer", "response", "modes", "accuracy", "inputs", "timings", "versions")
    ]
    assert order == sorted(order)
    assert '<section id="contact"' not in page  # nothing to say about it
    assert "did NOT converge" in page
    assert "3 elements were straightened" in page
    assert "23 more rows are in the CSV file" in page  # 63 modes, 40 shown


def test_markdown_page_links_the_figures(report):
    text = report[1].read_text()
    assert not re.search(r"\d um\b", text[: text.index("## Inputs")])
    assert "](<figures/optimum.png>)" in text
    assert "Figure 1. Amplitude and frequency of the resonance over the normal load" in text
    assert "| normal load [N] |" in text and "**200 N**" in text
    assert "\n\n\n\n" not in text


def test_bad_entries_are_refused(tmp_path):
    with pytest.raises(InputError, match="section"):
        write_report(tmp_path, Scene(), {"misc/table": synthetic.summary()}, {})
    with pytest.raises(InputError, match="there is no file"):
        write_report(tmp_path, Scene(), {}, {"mesh/mesh": tmp_path / "none.png"})


def test_report_of_nothing_but_a_scene(tmp_path):
    page, _ = write_report(tmp_path, Scene(kind="hertz"), {}, {})
    assert "hertz.radius" in page.read_text()


def test_levels_stay_apart(tmp_path):
    """Only warnings are boxed; method goes to the end, what was found to the timings."""
    said = ["plain", warning("sharp edge"), method("balance"), Message("mesh: found", "timing")]
    page, _ = write_report(tmp_path, Scene(), {}, {}, said, {"mesh": 1.0})
    text = page.read_text()
    box = text[
        text.index('<div class="warnings">') : text.index("</div>", text.index('"warnings"'))
    ]
    assert "sharp edge" in box
    assert not any(word in box for word in ("plain", "balance", "found"))
    assert text.index("plain") < text.index('<section id="accuracy"') < text.index("balance")
    assert text.index('<section id="timings"') < text.index("mesh: found")


def test_both_pages_say_what_to_do_and_why(tmp_path):
    said = [
        warning("it is unstable", "use a march", "9 N: 120 um"),
        Message("sought", detail="8 loads"),
    ]
    files = write_report(tmp_path, Scene(), {}, {}, said)
    page, plain = (file.read_text(encoding="utf-8") for file in files)
    box = page[page.index('<div class="warnings">') : page.index("<h3>Information")]
    assert "<div><b>What to do:</b> use a march</div>" in box
    assert '<div class="detail">9 N: 120 µm</div>' in box
    assert '<div class="detail">8 loads</div>' in page
    assert "- it is unstable\n  - What to do: use a march\n  - 9 N: 120 µm\n" in plain
    assert "- sought\n  - 8 loads\n" in plain


def test_every_headline_says_how_sure_it_is():
    summary = synthetic.summary().assign(error=0.012)
    found = headlines(response_answer(summary, synthetic.points()), summary, synthetic.points())
    assert all(one.uncertainty for one in found)
    sure = {one.what: one.uncertainty for one in found}
    assert sure["optimum normal load per seat"] == "between 100 and 400 N"
    assert sure["resonance amplitude there"].startswith("± 1.2 %")
    assert re.fullmatch(r"± [\d.]+ Hz \(flat top: .*\)", sure["resonance frequency there"])
    exact = summary.assign(error=1e-6)
    found = headlines(response_answer(exact, synthetic.points()), exact, synthetic.points())
    sure = {one.what: one.uncertainty for one in found}
    assert re.fullmatch(r"± [\d.]+ Hz \(spacing of points\)", sure["resonance frequency there"])


def test_a_flat_top_leaves_the_frequency_open():
    """Where the amplitude is within its own error of the highest, the highest may lie."""
    summary = synthetic.summary().assign(error=0.1)
    points = synthetic.points()
    best = summary[np.isfinite(summary["load"])].nsmallest(1, "peak_amplitude").iloc[0]
    points["converged"] = True
    frequency = best["peak_frequency"] + np.array([-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0])
    amplitude = best["peak_amplitude"] * np.array([0.2, 0.5, 0.95, 1.0, 0.85, 0.94, 0.3])
    flat = points[points["load"] == best["load"]].iloc[[0] * 7]
    flat = flat.assign(frequency=frequency, amplitude=amplitude)
    points = pd.concat([points[points["load"] != best["load"]], flat])
    found = headlines(response_answer(summary, points), summary, points)
    (sure,) = [one.uncertainty for one in found if one.what == "resonance frequency there"]
    assert sure == "± 2 Hz (flat top: the amplitude is within its error there)"
    (value,) = [one.value for one in found if one.what == "resonance frequency there"]
    assert value == f"{best['peak_frequency']:.0f} Hz", "no more digits than are known"


def test_one_load_alone_is_not_called_the_optimum():
    summary = synthetic.summary().assign(error=0.01)
    one = summary[(summary["load"] == 0) | np.isinf(summary["load"]) | (summary["load"] == 200)]
    found = headlines(response_answer(one), one, None)
    assert found[0][:3] == ("normal load per seat", "200 N", "only one load studied")
    assert not any("optimum" in line.what for line in found)
    # nor with several dampers
    two = pd.concat([one.assign(mass=mass) for mass in (0.01, 0.02)], ignore_index=True)
    answer = response_answer(two)
    assert not any("optimum" in what for what, _, _ in answer.numbers)
    assert any("Only one load" in text for text in answer.cautions)
    assert not any("smallest" in text for text in answer.cautions)


@pytest.mark.parametrize(
    ("error", "said"), [(np.nan, "not estimated"), (np.inf, "error unknown"), (0.0, "± 0.01 %")]
)
def test_unknown_errors_are_said_to_be_unknown(error, said):
    summary = synthetic.summary().assign(error=error)
    found = headlines(response_answer(summary), summary, None)
    assert said in found[1].uncertainty


def test_seats_are_called_right_and_left_in_tables_and_files():
    """As the fields of a scene call them."""
    maps = [pressure_map(name) for name in ("this", "next", "contact")]
    table = pressure_summary(maps)
    assert list(table["patch"]) == ["right", "left", "contact"]
    assert list(pressure_points(maps)["patch"].unique()) == ["right", "left", "contact"]
    assert list(readable_texts(table)["seat"]) == ["right", "left", "contact"]
    assert set(contact_arrays({1.0: maps})["patch"].to_numpy()) == {"right", "left", "contact"}


def pressure_map(name):
    """Two nodes of a face that press."""
    frame = np.broadcast_to(np.eye(3), (2, 3, 3))
    patch = Patch(name, np.eye(2, 3), np.ones(2), frame, np.empty((0, 2), int), np.empty(0, int))
    return PressureMap(patch, np.ones(2), np.zeros(2), 0.0)


def test_roundoff_is_no_number_on_a_page():
    table = pd.DataFrame(
        {"centre_x": [0.25], "centre_y": [7.6e-18], "centre_z": [np.nan], "residual": [3e-16]}
    )
    clean = without_roundoff(table)
    assert clean["centre_y"].iloc[0] == 0
    assert clean["residual"].iloc[0] == 3e-16
    assert np.isnan(clean["centre_z"].iloc[0])


def test_wide_tables_are_split_and_name_what_is_left_out():
    columns = ["load", "patch", "nodes", "force", "force_x", "force_y", "force_z", "mean_pressure"]
    table = pd.DataFrame({name: [1.0] for name in columns})
    parts = dict(page_tables("contact/pressure", table))
    assert list(parts["contact/pressure"]) == ["load", "patch", "force", "mean_pressure"]
    assert list(parts["contact/resultants"]) == ["load", "patch", "force_x", "force_y", "force_z"]
    assert parts["contact/pressure"].attrs["left_out"] == ["nodes"]


def test_given_fields_are_shown_and_others_folded(tmp_path):
    """The span is given, though it is the default; the folder remembers that."""
    keep_given(tmp_path, ["aerofoil.span"])
    page, _ = write_report(tmp_path, Scene(), {}, {})
    text = page.read_text()
    assert text.index("<td>aerofoil.span</td>") < text.index("<details>")
    assert text.index("<td>aerofoil.twist</td>") > text.index("<details>")


def test_hash_of_inputs_changes_with_any_input():
    base = Scene()
    assert inputs_hash(base) == inputs_hash(Scene())
    assert inputs_hash(base) != inputs_hash(vary(base, "contact.mu", 0.31))
    assert re.fullmatch("[0-9a-f]{16}", inputs_hash(base))


def test_next_steps_name_the_mass_to_try():
    summary = synthetic.summary()
    own = pd.DataFrame({"mass": [0.012], "speed": [800.0], "load": [100.0]})
    steps = next_steps(Scene(), [], summary, own)
    assert steps[0].startswith("Change the damper's mass from 12 g to 24 g, and confirm with")
    # the mass of the headline: of the load that was searched, not of the nearest one studied
    searched = pd.DataFrame({"load": [150.0], "amplitude": [1e-6], "frequency": [800.0]})
    exact = next_steps(Scene(), [], summary, own, None, searched)
    assert "damper.mass = '18 g'" in exact[0]
    plane = next_steps(Scene(kind="plane blades"), [], summary, own)
    assert "plane.damper_mass = '24 g'" in plane[0]
    # and what the mesh changes is that of the same load
    meshes = summary.assign(body_mesh=np.linspace(0.01, 0.05, len(summary)))
    finite = meshes[(meshes["load"] > 0) & np.isfinite(meshes["load"])]
    lightest = finite.loc[finite["load"].idxmin()]
    there = pd.DataFrame({"load": [lightest["load"]], "amplitude": [1e-6], "frequency": [800.0]})
    reported = next_steps(Scene(), [], meshes, own, None, there)[-1]
    assert f"changes the amplitude by {100 * lightest['body_mesh']:.2g} %" in reported
    # a stress that the mesh leaves uncertain is not one to sign
    for error, said in ((0.26, True), (0.1, False), (np.nan, False)):
        asked = next_steps(Scene(), [], summary.assign(stress_error=error), own)
        assert any("26 % of error in the alternating stress" in step for step in asked) == said
    kept = next_steps(Scene(), [], summary, own.assign(load=200.0))
    assert "keep its mass" in kept[0]
    assert next_steps(Scene(), ["widen"], summary, own)[0] == "widen"


@pytest.mark.parametrize(("own_load", "metal"), [(200.0 * 4.0, True), (200.0 * 46.0, False)])
def test_no_mass_is_advised_that_no_metal_gives_the_shape(own_load, metal):
    """A blade of 62 mm at 7500 rpm was told to make its steel wedge of 12.5 g one of 0.273 g, whose
    density is that of balsa: 7850 kg/m^3 * 0.273 / 12.5.
    """
    summary = synthetic.summary()
    own = pd.DataFrame({"mass": [0.012], "speed": [800.0], "load": [own_load]})
    (step, *_) = next_steps(Scene(), [], summary, own)
    assert step.startswith("Change the damper's mass") == metal
    if not metal:
        assert step.startswith("No metal damper of this shape") and "171 kg/m^3" in step
        # what the scene has already is not asked for
        assert "(damper.length, damper.base, damper.angle); study.own_load = true" in step
        studied = vary(Scene(), "study.own_load", True)
        assert "study.own_load" not in next_steps(studied, [], summary, own)[0]
        # at its temperature the damper has another density
        rows = "material.damper.table", ["20 degC: rho=7850", "600 degC: rho=7600"]
        warm = vary(Scene(), *rows, "material.damper.rho", 3000.0)
        assert "171 kg/m^3" in next_steps(warm, [], summary, own)[0]
        # an angle that the seats of a file give is no field to change
        fitted = load_scene("scenes/own_blade.toml")
        assert "flanks (damper.length" in next_steps(fitted, [], summary, own)[0]
        assert "damper.angle" not in next_steps(fitted, [], summary, own)[0]
    # a mass that is given has the density that it takes
    heavy = next_steps(vary(Scene(), "damper.mass", "12 g"), [], summary, own)
    assert heavy[0].startswith("Change the damper's mass")


def test_an_assumed_contact_stiffness_is_told():
    """Whichever of the stiffnesses is given, for both seats or for each, nothing is assumed."""
    pressed = pd.DataFrame({"mean_pressure": [3.3e5, 3.3e6]})
    (reported,) = assumed_stiffness(Scene(), pressed)
    # (1 + 0.01) MPa over 0.4 sqrt(2) 1.25 0.8 um
    assert (
        "Ra 0.8 um on each face (ground seats)" in reported and "1785 N/mm^3 at 1 MPa" in reported
    )
    assert "601 to 5851 N/mm^3 at the mean pressures" in reported and "Persson" in reported
    (reported,) = assumed_stiffness(Scene(contact=Contact(roughness=1.6e-6)))
    assert "Ra 1.6 um" in reported and "893 N/mm^3 at 1 MPa" in reported
    seats = Contact(left=Seat(kn=1e7), right=Seat(kt_area=1e12))
    for given in (Contact(kt_area=4e10), Contact(kn=1e7), Contact(stiffness="map"), seats):
        assert assumed_stiffness(Scene(contact=given)) == []
    assert assumed_stiffness(Scene(contact=Contact(left=Seat(kn=1e7))))


def test_an_own_load_that_was_studied_has_its_own_amplitude():
    """No interpolation between loads where the load itself is among them."""
    summary = synthetic.summary()
    own = pd.DataFrame({"mass": [0.012], "speed": [800.0], "load": [199.96]})
    remark = next(
        r for what, _, r in response_answer(summary, None, own).numbers if "own mass" in what
    )
    assert "resonance amplitude 37.04 µm there" in remark
    assert "between the loads studied" not in remark


def test_loads_on_both_sides_share_a_unit():
    found = SimpleNamespace(loads=np.array([900.0, 9000.0, 2e4]))
    assert loads_on_both_sides(found, 1e4) == "between 9 and 20 kN studied"
    assert loads_on_both_sides(found, 3e4) == "an end of the loads studied"


def test_what_is_not_determined_has_no_bracket():
    summary = synthetic.summary().assign(error=0.01)
    reported = ResponseAnswer([("optimum normal load per seat", "not determined", "why")], [])
    (found,) = headlines(reported, summary, None)
    assert found.uncertainty == "see what to do next"


@pytest.mark.parametrize(
    ("force", "frequency", "said"),
    [(0.0, 103.0, True), (0.0, 100.001, False), (1.0, 103.0, False)],
)
def test_resonances_above_full_stick_are_explained_by_open_contacts_alone(force, frequency, said):
    """By the rounding of a search, or with all points pressed, there is nothing to explain."""
    curve = SimpleNamespace(load=80.0, mass=None, peak_frequency=frequency)
    limit = SimpleNamespace(peak_frequency=100.0, mass=None)
    result = SimpleNamespace(
        response=SimpleNamespace(curves=[curve], limits=(limit, limit)),
        contact=SimpleNamespace(maps={80.0: (SimpleNamespace(force=np.array([2.0, force])),)}),
    )
    found = beyond_stick(result)
    assert bool(found) == said
    assert not said or "full stick under 80 N: contact points" in found[0]
