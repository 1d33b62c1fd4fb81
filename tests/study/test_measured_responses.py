"""A scene's contact from readings in a file: made by a run with another contact, by other settings;
bad files.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from mistuned import MISTUNED, ROUGH_MISTUNED

from bladefem.cli.main import main
from bladefem.errors import InputError
from bladefem.report.measured import fit_headlines, fit_sentences, parameter_table
from bladefem.scene.toml import load_scene, vary
from bladefem.study.contact_identification import ContactFit
from bladefem.study.fit_intervals import Knowledge, Product
from bladefem.study.fit_truncation import LeftOut
from bladefem.study.measured_models import BODY_MESH, Readings
from bladefem.study.measured_responses import FittedScene, read_readings
from bladefem.study.pipeline import pipeline
from bladefem.view.measured import draw_measured

COARSE = (
    *ROUGH_MISTUNED,
    "study.loads=80 N, 160 N",
    "model.harmonics=5",
    "model.samples=256",
)
TRUE = {"mu": 0.36, "stiffness": 1.4}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Readings between the half heights of both resonances, with the contact of TRUE."""
    scene = load_scene(MISTUNED, COARSE)
    stiff = scene.contact.kt_area * TRUE["stiffness"]
    contact = [f"contact.mu={TRUE['mu']}", f"contact.kt_area={stiff} N/m^3"]
    stages = tmp_path_factory.mktemp("stages")
    curves = []
    # one load a run: among several the best one is sought, which takes longer than all of them
    for load in scene.study.loads:
        true = load_scene(MISTUNED, [*COARSE, *contact, f"study.loads={load} N"])
        curves += pipeline.run(true, stages).response.curves
    rows = ["load [N], frequency [Hz], amplitude [um]"]
    for curve in curves:
        high = curve.converged & (curve.amplitude > 0.4 * curve.peak_amplitude)
        chosen = np.flatnonzero(high)
        chosen = chosen[np.linspace(0, len(chosen) - 1, 3).round().astype(int)]
        for i in np.unique(chosen):
            rows.append(f"{curve.load}, {curve.frequency[i]}, {1e6 * curve.amplitude[i]}")
    file = tmp_path_factory.mktemp("measured") / "readings.csv"
    file.write_text("# made by a run\n" + "\n".join(rows) + "\n")
    return scene, file


def test_command_finds_the_contact_of_the_readings(measured, tmp_path, capsys):
    scene, file = measured
    arguments = ["fit", str(MISTUNED), "-o", str(tmp_path), "--measured", str(file)]
    arguments += ["--parameters", "mu, stiffness", "--error", "2 %"]
    for override in COARSE:
        arguments += ["--set", override]
    assert main(arguments) == 0
    table = pd.read_csv(tmp_path / "fit.csv")
    factors = table["over_scene"].to_numpy()
    assert factors == pytest.approx([TRUE["mu"] / scene.contact.mu, TRUE["stiffness"]], rel=0.03)
    assert (table["factor_low"] < factors).all() and (factors < table["factor_high"]).all()
    # 16 mm are far too large for frequencies to be those of a measured blade
    assert list(table["determined"]) == ["but for the mesh", "but for the mesh"]
    assert (abs(table["mesh_shift"]) > table["log_half_by_readings"]).all()
    given = [scene.contact.mu, 1e-9 * scene.contact.kt_area]
    assert list(table["fitted_field"]) == ["contact.mu", "contact.kt_area"]
    assert table["fitted_value"].to_numpy() == pytest.approx(factors * given)
    assert table["fitted_low"].to_numpy() == pytest.approx(table["factor_low"] * given)
    assert table["fitted_unit"].iloc[1] == "N/mm^3"
    # the intervals hold both what readings and what the model leave open
    both = table["log_half_by_readings"] + table["log_half_by_model"]
    assert (table["log_half_by_model"] > 0).all()
    half = np.log(table["factor_high"].to_numpy() / factors)
    assert half == pytest.approx(both.to_numpy(), rel=1e-4)
    readings = pd.read_csv(tmp_path / "fit_readings.csv")
    assert abs(readings["off_reading"]).max() < 0.05
    said = capsys.readouterr().out
    assert "for the scene, under [contact]: mu = 0.3" in said
    assert " harmonics, not the 5 of model.harmonics: a fit takes 7 at least" in said
    assert "the data determine all parameters of the contact; for this mesh" in said
    assert "contact.mu = 0.3" in said and "mesh apart: +" in said
    assert "estimated error of the mesh of blade and damper would move mu by" in said
    page = (tmp_path / "report_fit.md").read_text()
    assert "off the reading [%]" in page and "off the balance" not in page
    assert (tmp_path / "fit.png").is_file() and (tmp_path / "report_fit.html").is_file()


def fitted_scene(factors, intervals, amplitude=1e-4, names=("mu", "stiffness"), mesh=0.0, **more):
    """A fit as its report takes it, of the shipped wheel without a run."""
    scene = load_scene(MISTUNED, COARSE)
    intervals = np.array(intervals, dtype=float)
    half = np.log(intervals[:, 1] / np.array(factors))
    shift = LeftOut(BODY_MESH, np.full(len(names), np.log1p(mesh)), 0, widens=False)
    fit = ContactFit(
        names,
        np.array(factors),
        Knowledge(half, intervals, []),
        1.0,
        [np.array([amplitude])],
        [np.array([amplitude])],
        half,
        (shift,),
    )
    one = np.array([amplitude])
    readings = Readings(np.array([80.0]), np.array([1.5]), np.array([200.0]), one)
    run = SimpleNamespace(
        scene=vary(scene, **more) if more else scene,
        mesh=SimpleNamespace(points=np.array([[0.0, 0, 0], [0.3, 0.4, 0]])),
        messages=[],
        timings={},
    )
    settings = SimpleNamespace(harmonics=7, samples=128)
    return FittedScene(run, readings, fit, 0.05, one, one, settings)


def test_no_value_for_the_scene_that_is_open_or_out_of_range():
    """The answer to amplitudes in a wrong unit was a friction coefficient of 2.565."""
    good = fitted_scene([0.8, 1.2], [[0.7, 0.9], [1.1, 1.3]])
    assert good.scene_values == pytest.approx({"mu": 0.24, "kt_area": 4.8e10})
    assert "for the scene, under [contact]: mu = 0.24" in " ".join(fit_sentences(good))
    odd = fitted_scene([8.55, 1.2], [[8, 9], [0.0, np.inf]])
    assert odd.scene_values == {}
    said = fit_sentences(odd)
    assert not any("for the scene, under [contact]" in one for one in said)
    (high,) = (one for one in said if "contact.mu would be 2.565" in one)
    assert high.level == "warning" and "a scene takes 0 to 2" in high
    (wide,) = (one for one in said if "no value of contact.kt_area" in one)
    assert wide.level == "warning"


def test_a_product_of_open_parameters_is_told():
    """Under one load friction and load are known together: 80 N of load times mu = 0.3."""
    wide = [[0.0, np.inf]] * 2
    plain = fitted_scene([0.5, 1.2], wide, names=("mu", "load"))
    half = float(np.log(1.1))
    knowledge = replace(plain.fit.knowledge, products=(Product(("mu", "load"), half),))
    found = replace(plain, fit=replace(plain.fit, knowledge=knowledge))
    (said,) = (one for one in fit_sentences(found) if "mu times load is known" in one)
    # 0.15 times 96 N
    assert "14.4 N, 95 % interval 13.1 to 15.8 N" in said
    (both,) = (one for one in fit_headlines(found) if "times" in one.what)
    assert both.what == "friction coefficient times normal load" and both.value == "14.4 N"


def test_headlines_are_values_and_what_they_leave_out():
    good = fitted_scene([0.8423, 1.2], [[0.72, 0.985], [1.1, 1.3]], mesh=0.31)
    mu, stiffness = fit_headlines(good)
    assert (mu.value, stiffness.value) == ("0.25", "48 N/mm^3")
    assert mu.uncertainty == "95 % interval 0.216 to 0.295; mesh apart: +31 %"
    assert mu.remark == "contact.mu, 0.84 times the scene's (0.72 to 0.985)"
    assert list(parameter_table(good)["determined"]) == ["but for the mesh"] * 2
    assert "its error moves mu and stiffness beyond the intervals" in " ".join(fit_sentences(good))
    # a mesh whose error moves nothing needs no words
    fine = fitted_scene([0.8423, 1.2], [[0.83, 0.855], [1.1, 1.3]])
    assert fit_headlines(fine)[0].value == "0.253"
    assert "mesh" not in fit_headlines(fine)[0].uncertainty
    assert list(parameter_table(fine)["determined"]) == ["yes", "yes"]
    # what is not known is no number
    left = fit_headlines(fitted_scene([8.55, 1.2], [[8, 9], [0.0, np.inf]]))[1]
    assert left.value == "not determined" and left.remark.endswith("interval 0 to ∞")


def test_normal_load_is_a_value_where_all_readings_have_one():
    found = fitted_scene([0.9, 1.2], [[0.8, 1.0], [1.1, 1.3]], names=("load", "kn"))
    (load, stiffness) = fit_headlines(found)
    assert (load.value, load.uncertainty) == ("72 N", "95 % interval 64 to 80 N")
    # by kn alone: the scene gives none
    assert stiffness.value == "1.2 times the scene's"
    assert "load" not in " ".join(found.scene_values)
    table = parameter_table(found)
    assert table["fitted_value"].iloc[0] == pytest.approx(72) and np.isnan(
        table["fitted_value"].iloc[1]
    )


def test_harmonics_of_the_fit_are_explained_where_the_scene_gives_fewer():
    few = fitted_scene([0.8, 1.2], [[0.7, 0.9], [1.1, 1.3]], model__harmonics=3)
    (said,) = (one for one in fit_sentences(few) if "model.harmonics" in one)
    assert "7 harmonics, not the 3 of model.harmonics: a fit takes 7 at least, since" in said
    enough = fitted_scene([0.8, 1.2], [[0.7, 0.9], [1.1, 1.3]], model__harmonics=9)
    assert not any("model.harmonics" in one for one in fit_sentences(enough))


def test_picture_joins_no_readings(tmp_path):
    frequency = np.array([200.0, 204.0, 210.0])
    high = np.array([1e-4, 2e-4, 1e-4])
    ax = draw_measured({"80 N": (frequency, high, 1.1 * high, 2 * high)}, "", tmp_path / "fit.png")
    drawn = [line for line in ax.lines if len(line.get_xdata())]
    assert len(drawn) == 3 and all(line.get_linestyle() == "None" for line in drawn)
    assert len({line.get_marker() for line in drawn}) == 3
    # the second array is the fitted contact's, in the marker that the legend gives it
    words = {line.get_label(): line.get_marker() for line in ax.lines}
    assert drawn[1].get_marker() == words["fitted contact"]


def test_amplitudes_of_the_size_of_the_blade_raise_a_warning():
    wide = fitted_scene([0.8, 1.2], [[0.7, 0.9], [1.1, 1.3]], amplitude=0.06)
    (said,) = (one for one in fit_sentences(wide) if "an amplitude of 60 mm is 12 %" in one)
    assert said.level == "warning"


def test_amplitudes_larger_than_the_sector_are_refused(measured, tmp_path, capsys):
    file = tmp_path / "metres.csv"
    file.write_text("frequency [Hz], amplitude [m]\n200, 105\n205, 253\n")
    arguments = ["fit", str(MISTUNED), "-o", str(tmp_path / "run"), "--measured", str(file)]
    for override in (*COARSE, "study.loads=80 N"):
        arguments += ["--set", override]
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert "an amplitude of 253 m is larger than the sector" in said and said.count("\n") == 1


def test_scene_of_one_harmonic_is_fitted_with_more(measured, tmp_path):
    scene, file = measured
    few = tmp_path / "few.csv"
    few.write_text("\n".join(file.read_text().splitlines()[:7]) + "\n")
    arguments = ["fit", str(MISTUNED), "-o", str(tmp_path / "run"), "--measured", str(few)]
    for override in (*COARSE, "model.harmonics=1"):
        arguments += ["--set", override]
    assert main([*arguments, "--parameters", "stiffness", "--set", f"contact.mu={TRUE['mu']}"]) == 0
    factor = pd.read_csv(tmp_path / "run" / "fit.csv")["over_scene"].iloc[0]
    assert factor == pytest.approx(TRUE["stiffness"], rel=0.05)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frequency [Hz]\n200\n", "expected a column 'amplitude .um.'"),
        ("frequency [Hz], amplitude\n200, 105\n", "'amplitude' has no unit.*'amplitude .um.'"),
        ("frequency, amplitude [um]\n200, 105\n", "'frequency' has no unit.*'frequency .Hz.'"),
        ("frequency [Hz], amplitude [um], load []\n200, 1, 80\n", "'load ..' has no unit"),
        ("frequency [Hz], amplitude [kg]\n200, 1\n", "amplitude .kg.*unit"),
        ("frequency [Hz], height [um]\n200, 1\n", "column 'height .um.', expected load, force"),
        ("frequency [Hz], amplitude [um]\n200\n", "expected 2 .*numbers in each row"),
        ("frequency [Hz], amplitude [um]\n200, -1\n", "expected 2 positive numbers"),
        ("frequency [Hz], amplitude [um]\n", "expected a row of names and readings"),
        ("frequency [Hz];amplitude [um]\n200;1,5\n", "semicolons between its cells, expected comm"),
        ("frequency [Hz], amplitude [um]\n200, 1\n", "no column 'load .N.', expected it"),
    ],
)
def test_bad_files_are_refused(text, message, tmp_path):
    file = tmp_path / "readings.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        read_readings(file, load_scene(MISTUNED, COARSE))
    with pytest.raises(InputError, match="there is no such file"):
        read_readings(tmp_path / "nowhere.csv", load_scene(MISTUNED, COARSE))


def test_files_of_spreadsheets(tmp_path):
    """A byte order mark is no part of a name; letters of another encoding end in one sentence."""
    file = tmp_path / "readings.csv"
    text = "frequency [Hz], amplitude [µm], load [N]\n200, 105, 80\n"
    file.write_text(text, encoding="utf-8-sig")
    read = read_readings(file, load_scene(MISTUNED, COARSE))
    assert read.amplitude == pytest.approx([105e-6]) and list(read.load) == [80.0]
    file.write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="cannot be read as a CSV file in UTF-8"):
        read_readings(file, load_scene(MISTUNED, COARSE))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ("mu, speed", "--parameters mu, speed: 'speed' is no parameter, expected some of mu, kt"),
        ("kn, stiffness", "--parameters kn, stiffness: 'stiffness' is both kt and kn"),
        ("mu, mu", "--parameters mu, mu: one is given twice"),
        ("kt", "--parameters kt: one stiffness follows the other"),
    ],
)
def test_parameters_are_checked_before_the_readings(parameters, message, tmp_path, capsys):
    file = tmp_path / "readings.csv"
    file.write_text("frequency [Hz], amplitude [um]\n200, -1\n")
    scene = ["fit", str(MISTUNED), "-o", str(tmp_path / "run"), "--measured", str(file)]
    assert main([*scene, "--parameters", parameters]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not (tmp_path / "run").exists()
