"""Plans of studies: grids of two fields, scattered values, and what is refused."""

from __future__ import annotations

import argparse
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from limit_stubs import linear_limits

from bladefem.cli.main import main
from bladefem.cli.study import WITHOUT_INFLUENCES, _make_plan, _run_options
from bladefem.errors import InputError
from bladefem.io.run_folder import borrow_stages
from bladefem.report.study import Variant
from bladefem.report.study_map import band_of, write_map, write_scatter
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary
from bladefem.scene.units import parse
from bladefem.study.scatter_plan import Range, halton_values, read_ranges


def options(vary=(), scatter=(), samples=4):
    return argparse.Namespace(
        vary=list(vary), scatter=list(scatter), samples=samples, overrides=[], output=None
    )


def test_two_fields_make_a_grid():
    plan = _make_plan(options(["damper.angle=50, 60 deg", "contact.mu=0.2, 0.3, 0.4"]))
    assert plan.names == ("damper.angle", "contact.mu")
    assert len(plan.runs) == 6
    assert plan.runs[1] == ("50 deg", "0.3")


def test_samples_fill_the_ranges_evenly():
    ranges = read_ranges(["contact.mu=0.2, 0.4", "operation.damping=0.05, 0.2 %"])
    rows = halton_values(ranges, 64)
    for column, one in enumerate(ranges):
        values = np.array([parse(row[column], one.unit) for row in rows])
        assert values.min() >= one.low
        assert values.max() <= one.high
        thirds = np.histogram(values, 4, (one.low, one.high))[0]
        assert thirds.min() >= 14
    assert halton_values(ranges, 8) == rows[:8]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (options(), "expected --vary KEY=VALUES"),
        (options(["contact.mu=0.2"], ["contact.mu=0.1, 0.2"]), "expected --vary KEY=VALUES"),
        (options(["contact.mu=0.2"] * 3), "three times or more"),
        (options(["contact.mu=0.2", "contact.mu=0.3"]), "given twice"),
        (options(scatter=["contact.mu=0.2"]), "expected key=low, high"),
        (options(scatter=["contact.mu=0.4, 0.2"]), "lower end first"),
        (options(scatter=["contact.mo=0.1, 0.2"]), "unknown key 'contact.mo'"),
        (options(scatter=["disc.sectors=30, 36"]), "not a single real number"),
        (options(scatter=["contact.mu=0.1, 0.2"], samples=1), "--samples 1: expected 2 to"),
        (options(scatter=["contact.mu=0.1, 0.2"] * 2), "given twice"),
        (
            options(
                [
                    "contact.mu=" + ",".join(map(str, np.linspace(0.1, 1, 40))),
                    "damper.angle=" + ",".join(f"{a:.4f}" for a in np.linspace(0.3, 1, 40)),
                ]
            ),
            "1600 runs, expected at most 1000",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_bad_plans_are_refused(given, said):
    with pytest.raises(InputError, match=said):
        _make_plan(given)


def test_folders_are_named_by_their_values(tmp_path):
    one = _run_options(options(), tmp_path, ["damper.angle", "contact.mu"], ["50 deg", "0.3"])
    assert one.output.endswith("damper.angle=50deg,contact.mu=0.3")
    assert one.overrides == [WITHOUT_INFLUENCES, "damper.angle=50 deg", "contact.mu=0.3"]


def response(*amplitudes):
    """As study.pipeline.Response, of given resonance amplitudes under 20, 40, ... N."""
    curves = [
        SimpleNamespace(
            load=20.0 * (i + 1),
            mass=None,
            peak_frequency=810.0,
            peak_amplitude=amplitude,
            friction_work=1e-3,
            slipping_at_peak=1,
            drift_at_peak=0.0,
            settings=SimpleNamespace(error=0.01, harmonics=3),
            halved=0.0,
            body_mesh=0.0,
            layer_law=0.0,
            error=0.01,
            frequency=np.arange(5.0),
            converged=np.ones(5, bool),
            interval=None,
            lower=None,
            is_march=False,
            keeps_unstable=False,
            reaches_layer=False,
        )
        for i, amplitude in enumerate(amplitudes)
    ]
    return SimpleNamespace(limits=linear_limits(), curves=curves)


def variants(names, rows, amplitudes):
    found = []
    for values, one in zip(rows, amplitudes, strict=True):
        scene = Scene(study=Scene().study)
        for name, value in zip(names, values, strict=True):
            scene = vary(scene, name, value)
        found.append(Variant("; ".join(values), scene, response(*one)))
    return found


def test_map_finds_the_best_of_both(tmp_path):
    names = ("damper.angle", "contact.mu")
    values = (["40 deg", "50 deg"], ["0.2", "0.3"])
    rows = [(a, m) for a in values[0] for m in values[1]]
    amplitudes = [(4e-5, 5e-5), (3e-5, 6e-5), (6e-5, 2e-5), (5e-5, 5e-5)]
    table, files = write_map(names, values, variants(names, rows, amplitudes), tmp_path)
    assert list(table["peak_amplitude"]) == [4e-5, 3e-5, 2e-5, 5e-5]
    assert list(table["contact.mu"]) == ["0.2", "0.3", "0.2", "0.3"]
    assert all(file.is_file() for file in files)
    written = pd.read_csv(tmp_path / "study.csv")
    np.testing.assert_allclose(written["damper.angle [rad]"], np.radians([40, 40, 50, 50]))
    np.testing.assert_allclose(written["contact.mu"], [0.2, 0.3, 0.2, 0.3])
    assert len(pd.read_csv(tmp_path / "study_loads.csv")["contact.mu"]) == 16
    page = (tmp_path / "report_study.html").read_text()
    assert "best damper.angle" in page
    assert "50 deg" in page
    assert "20 µm" in page


def test_a_map_is_written_while_runs_are_missing(tmp_path):
    names = ("damper.angle", "contact.mu")
    values = (["40 deg", "50 deg"], ["0.2", "0.3"])
    rows = [("40 deg", "0.2")]
    write_map(names, values, variants(names, rows, [(4e-5, 5e-5)]), tmp_path)
    assert (tmp_path / "study.png").stat().st_size > 5000


def test_band_holds_the_samples(tmp_path):
    rows = halton_values([Range("contact.mu", 0.2, 0.4, "1")], 11)
    amplitudes = [(1e-5 * (i + 1), 2e-5 * (i + 1)) for i in range(11)]
    band, files = write_scatter(
        ["contact.mu"], variants(["contact.mu"], rows, amplitudes), tmp_path
    )
    assert list(band["load"]) == [20.0, 40.0]
    assert list(band["amplitude_50"]) == pytest.approx([6e-5, 12e-5])
    assert list(band["amplitude_90"]) == pytest.approx([10e-5, 20e-5])
    assert list(band["smallest_amplitude"]) == pytest.approx([1e-5, 2e-5])
    assert all(file.is_file() for file in files)
    page = (tmp_path / "report_study.html").read_text()
    assert "most robust load" in page
    assert "of 2 loads under which all 11 samples were studied" in page
    assert "were studied, the smallest load studied: a smaller one may do better" in page


@pytest.mark.parametrize("samples", [2, 9, 10])
def test_shares_of_samples_take_ten_of_them(samples, tmp_path):
    rows = halton_values([Range("contact.mu", 0.2, 0.4, "1")], samples)
    amplitudes = [(1e-5 * (i + 1), 3e-5) for i in range(samples)]
    found = variants(["contact.mu"], rows, amplitudes)
    band, _ = write_scatter(["contact.mu"], found, tmp_path)
    shares = {name for name in band if name.startswith("amplitude_")}
    page = (tmp_path / "report_study.md").read_text(encoding="utf-8")
    assert bool(shares) == ("80 % between" in page) == (samples >= 10)
    assert ("all samples stay below" in page) == (samples < 10)
    head = (tmp_path / "study_band.md").read_text(encoding="utf-8").splitlines()[0]
    assert head.endswith("largest resonance amplitude [µm] |")
    assert ("median" in head) == (samples >= 10)


def test_best_loads_of_single_samples_are_no_part_of_the_band(tmp_path):
    """Each run studies the best load that it found: lower than what all samples reach."""
    rows = [("0.2",), ("0.3",), ("0.4",)]
    found = variants(["contact.mu"], rows, [(4e-5, 6e-5), (5e-5, 5e-5), (8e-5, 3e-5)])
    for number, variant in enumerate(found):
        own = SimpleNamespace(**vars(variant.response.curves[0]))
        own.load, own.peak_amplitude = 30.0 + number, 1e-5
        variant.response.curves.append(own)
    band, _ = write_scatter(["contact.mu"], found, tmp_path)
    assert list(band["load"]) == [20.0, 40.0]
    assert list(band["smallest_amplitude"]) == pytest.approx([4e-5, 3e-5])
    assert "31" in (tmp_path / "study_loads.csv").read_text(), "they stay in the table of loads"


def test_band_leaves_the_limits_out():
    loads = pd.DataFrame({"load": [0.0, 5.0, np.inf], "peak_amplitude": [1.0, 2.0, 3.0]})
    assert list(band_of(loads)["load"]) == [5.0]


def test_stages_are_shared_and_stay_apart(tmp_path):
    (tmp_path / "a" / "stages").mkdir(parents=True)
    (tmp_path / "a" / "stages" / "mesh.npz").write_bytes(b"one")
    borrow_stages(tmp_path / "a", tmp_path / "b")
    linked = tmp_path / "b" / "stages" / "mesh.npz"
    assert linked.read_bytes() == b"one"
    other = tmp_path / "b" / "stages" / "new.npz"
    other.write_bytes(b"two")
    other.replace(linked)
    assert (tmp_path / "a" / "stages" / "mesh.npz").read_bytes() == b"one"


def test_scatter_needs_common_loads(tmp_path, capsys):
    command = ["study", "tests/scene/wedge.toml", "-o", str(tmp_path / "s")]
    scatter = ["--scatter", "contact.mu=0.2,0.4", "--set", "study.loads=auto"]
    assert main([*command, *scatter]) == 2
    assert "expected the same loads for all samples" in capsys.readouterr().err
