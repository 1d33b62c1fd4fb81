"""A folder opened again: labels, units, pictures; exact against the tables of the run."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import bladefem
from bladefem.data import ModeSet
from bladefem.errors import InputError, StageMissingError
from bladefem.io.stage_cache import write_results
from bladefem.report.response_arrays import (
    curve_arrays,
    loop_arrays,
    node_arrays,
    resonance_arrays,
    stability_arrays,
)
from bladefem.report.run_pictures import _motions
from bladefem.scene.tables import Scene
from bladefem.scene.toml import dump_scene
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.run_records import (
    ModalRun,
    Response,
    Run,
    SolvedRun,
    folder_of,
)
from bladefem.view.response import MARCHED
from geometry.mesh import Mesh

sys.path.insert(0, str(Path(__file__).parents[1] / "view"))
import synthetic

LOADS = (20.0, 80.0)


def points(mass: float | None = None) -> pd.DataFrame:
    """Response table; each load has frequencies of its own."""
    table = synthetic.points()
    table = table[table["load"].isin([0.0, 50.0, 200.0, np.inf])].copy()
    table["phase"] = 0.1
    if mass is not None:
        table["mass"] = np.where(np.isfinite(table["load"]) & (table["load"] > 0), mass, np.nan)
    return table


def cycles(mass: float | None = None) -> list:
    angle = 2 * np.pi * np.arange(32) / 32
    loop = {"this": SimpleNamespace(displacement=1e-6 * np.sin(angle), force=np.cos(angle))}
    return [SimpleNamespace(load=load, mass=mass, loops=loop) for load in LOADS]


def nodes() -> pd.DataFrame:
    parts = [
        pd.DataFrame(
            {
                "load": load,
                "patch": ["right", "right", "left"],
                "x": [0.1, 0.2, 0.3],
                "area": 1e-6,
                "stick": [1.0, 0.5, 0.0],
                "slip": [0.0, 0.5, 0.5],
                "separated": [0.0, 0.0, 0.5],
                "work": load * np.arange(3.0),
            }
        )
        for load in LOADS
    ]
    return pd.concat(parts, ignore_index=True)


def curves() -> list:
    """Balances of 1 and of 3 harmonics."""
    return [
        SimpleNamespace(
            load=load,
            mass=None,
            settings=SimpleNamespace(harmonics=H),
            peak_frequency=800.0 + load,
            peak=SimpleNamespace(
                probe=(1 + 1j) * np.arange(H + 1)[:, None], frequency=800.0 + load
            ),
        )
        for load, H in zip(LOADS, (1, 3), strict=True)
    ]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    scene = Scene(title="A <run>")
    (folder / "scene.toml").write_text(dump_scene(scene))
    groups = {
        "response": curve_arrays(points()),
        "resonance": resonance_arrays(curves()),
        "cycle": node_arrays(nodes()),
        "loops": loop_arrays(cycles()),
        "summary": xr.Dataset.from_dataframe(synthetic.summary()),
    }
    write_results(folder / "results.nc", groups, dump_scene(scene))
    return bladefem.open(folder)


def test_a_load_is_its_curve_again(run):
    part = run.response.sel(load=200).data.isel(load=0).dropna("frequency")
    table = points().query("load == 200").drop_duplicates("frequency").sort_values("frequency")
    table = table[table["amplitude"].notna()]
    assert np.array_equal(part["frequency"], table["frequency"])
    assert np.array_equal(part["amplitude"], table["amplitude"])
    assert set(part["converged"].to_numpy()) == {1.0}


def test_every_number_has_a_unit(run):
    for name in ("response", "resonance", "cycle", "loops"):
        arrays = getattr(run, name)
        for variable in (*arrays.data.data_vars.values(), arrays.data["load"]):
            assert "units" in variable.attrs, (name, variable.name)
    assert run.response["amplitude"].attrs["units"] == "m"
    assert run.loops["displacement"].attrs["units"] == "m"
    assert run.cycle["work"].attrs["units"] == "J/m^2"


def test_harmonics_beyond_a_balance_are_not_numbers(run):
    motion = run.resonance["motion"]
    assert np.array_equal(motion.sel(load=80), (1 + 1j) * np.arange(4))
    assert np.isnan(motion.sel(load=20)[2:]).all()
    assert np.array_equal(motion.sel(load=20)[:2], (1 + 1j) * np.arange(2))


def test_a_limit_has_the_motion_of_its_resonance():
    """Not that of a higher one which the band has as well."""
    limit = SimpleNamespace(
        load=0.0,
        frequency=np.array([300.0, 310.0, 900.0]),
        first=np.array([1e-6, 5e-6, 9e-6j]),
        peak_frequency=309.0,
        mass=None,
    )
    found = resonance_arrays(curves(), [limit])
    assert complex(found["motion"].sel(load=0.0, harmonic=1)) == 5e-6


def test_a_picture_of_a_motion_has_the_amplitude_that_is_given():
    """In proportion where a march keeps to another one than the balance."""
    curve = SimpleNamespace(peak_amplitude=1.5e-6, peak_frequency=380.0, over_balance=1.5)
    motion = SimpleNamespace(load=80.0, motion=np.full((1, 2, 3), 1e-6))
    result = SimpleNamespace(
        response=SimpleNamespace(curves=[curve]), damped={0: motion}, wheel=None
    )
    (shown,) = _motions(result).values()
    np.testing.assert_allclose(shown, 1.5e-6)


def test_nodes_keep_their_place_and_patch(run):
    assert list(run.cycle["patch"].to_numpy()) == ["right", "right", "left"]
    assert run.cycle["work"].sel(load=80, node=2) == 160.0


def test_masses_are_a_dimension_and_limits_belong_to_each():
    data = curve_arrays(pd.concat([points(0.01), points(0.02)], ignore_index=True))
    assert dict(data.sizes)["mass"] == 2
    free = data["amplitude"].sel(load=0.0)
    assert np.array_equal(free.sel(mass=0.01), free.sel(mass=0.02), equal_nan=True)
    assert data["mass"].attrs["units"] == "kg"


@pytest.mark.parametrize("name", ["response", "resonance", "cycle", "loops"])
def test_results_draw_themselves(run, name, tmp_path):
    arrays = getattr(run, name)
    arrays.plot(tmp_path / "all.png")
    arrays.isel(load=0).plot(tmp_path / "one.png")
    assert all((tmp_path / file).stat().st_size > 5000 for file in ("all.png", "one.png"))


def test_a_picture_of_a_response_knows_what_its_table_knows(tmp_path):
    """The resonance is the march, not the unstable balance above it."""
    table = points().query("load == 200 and converged").reset_index(drop=True)
    top = int(table["amplitude"].idxmax())
    table["stability"] = np.where(table.index == top, "unstable", "stable")
    march = table.iloc[[top]].assign(amplitude=0.9 * table["amplitude"][top], method=MARCHED)
    table = pd.concat([table, march.assign(stability="stable")], ignore_index=True)
    (tmp_path / "scene.toml").write_text(dump_scene(Scene()))
    groups = {"response": curve_arrays(table), "points": xr.Dataset.from_dataframe(table)}
    write_results(tmp_path / "results.nc", groups, dump_scene(Scene()))
    figure = bladefem.open(tmp_path).response.sel(load=200).plot()
    (axes,) = figure.axes
    # another diamond is the legend's, without a point
    drawn = [line for line in axes.lines if len(line.get_xdata())]
    assert [line.get_marker() for line in drawn].count("D") == 1
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "unstable (1)" in labels


def test_representations_are_short_and_safe(run):
    assert len(repr(run)) < 200
    assert len(repr(run.response)) < 300
    page = run._repr_html_()
    assert "A &lt;run&gt;" in page
    assert "resonance amplitude [µm]" in page
    assert "<b>response</b>" in run.response._repr_html_()


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        ({"load": 79}, "load = 79 is not there, expected one of"),
        ({"lod": 80}, "no dimension 'lod'"),
    ],
)
def test_unknown_labels_are_named(run, labels, said):
    with pytest.raises(InputError, match=said):
        run.response.sel(**labels)


def test_a_file_that_is_no_picture_is_refused(run, tmp_path):
    with pytest.raises(InputError, match=r"a\.doc', expected a file name that ends with \.png"):
        run.response.plot(tmp_path / "a.doc")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"mode": 3}, "mode = 3, expected a whole number from 1 to 2"),
        ({"mode": 0}, "mode = 0, expected a whole number from 1 to 2"),
        ({"nodal_diameter": 4}, "nodal_diameter = 4 is not there, expected one of 9"),
    ],
)
def test_a_mode_that_is_not_there_is_named(run, asked, said):
    coordinates = {"nodal_diameter": [9], "mode": [1, 2]}
    data = xr.Dataset({"frequency": (("nodal_diameter", "mode"), [[1.0, 2.0]])}, coordinates)
    with pytest.raises(InputError, match=said):
        run._draw_modes(data, **{"nodal_diameter": 9, **asked})


def test_a_mode_shape_is_a_table_for_other_programs(run, monkeypatch):
    """Two nodes: one on an ellipse three times as long as wide and turned by 0.7 rad in phase, one
    that moves half as far along y.
    """
    shape = np.zeros((1, 2, 2, 3), complex)
    shape[0, 1] = np.exp(0.7j) * np.array([[6.0, 2.0j, 0.0], [0.0, 3.0, 0.0]])
    over = ("nodal_diameter", "mode")
    data = xr.Dataset(
        {
            "frequency": (over, [[100.0, 250.0]]),
            "residual": (over, [[0.0, 0.0]]),
            "shape": ((*over, "node", "direction"), shape),
            "position": (("node", "direction"), [[0.2, 0.0, 0.0], [0.3, 0.1, 0.0]]),
        },
        {"nodal_diameter": [9], "mode": [1, 2]},
    )
    monkeypatch.setattr(type(run), "group", lambda self, name: data)
    # of its own, as results that were read once are kept
    run = type(run)(run.folder, run.scene)
    table = run.mode_shape(2, nodal_diameter=9)
    size = np.sqrt(40)
    np.testing.assert_allclose(table["ux real"], [6 / size, 0], atol=1e-12)
    np.testing.assert_allclose(table["uy imaginary"], [2 / size, 0], atol=1e-12)
    np.testing.assert_allclose(table["uy real"], [0, 3 / size], atol=1e-12)
    assert list(table["x [m]"]) == [0.2, 0.3]
    assert table.attrs == {"frequency": 250.0, "nodal_diameter": 9}
    for mode, said in ((3, "3"), (0, "0"), (1.5, "1.5"), ("1", "'1'"), (True, "True")):
        expected = rf"^mode_shape: mode = {said}, expected a whole number from 1 to 2$"
        with pytest.raises(InputError, match=expected):
            run.mode_shape(mode, nodal_diameter=9)
    for diameter in (8, 9.0, "9"):
        expected = f"^mode_shape: nodal_diameter = {diameter!r} is not there, expected one of 9$"
        with pytest.raises(InputError, match=expected):
            run.mode_shape(1, nodal_diameter=diameter)
    assert len(run.mode_shape(np.int64(2), nodal_diameter=np.int64(9))) == 2


def test_a_single_blade_has_no_nodal_diameters(run):
    coordinates = {"nodal_diameter": [-1], "mode": [1]}
    data = xr.Dataset({"frequency": (("nodal_diameter", "mode"), [[1.0]])}, coordinates)
    # what is stored under -1 is not called so
    for asked in (9, -1):
        said = f"nodal_diameter = {asked} .*expected it to be left out"
        with pytest.raises(InputError, match=said):
            run._draw_modes(data, nodal_diameter=asked)


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no scene\.toml in it"):
        bladefem.open(tmp_path)


def test_results_that_are_not_there_are_named(run):
    with pytest.raises(InputError, match="group 'modes' cannot be read"):
        _ = run.modes


def test_a_star_import_leaves_open_alone():
    assert "open" not in bladefem.__all__
    assert "open" in bladefem._WHERE


def test_a_run_in_memory_is_short_too():
    """The arrays of its stages stay out of it."""
    cells = np.arange(4000).reshape(-1, 4)
    mesh = Mesh(np.zeros((4000, 3)), "tetra", {"blade": cells})
    modes = ModeSet(np.array([100.0, 300.0]), np.zeros((2, 4000, 3)), 9, np.zeros(2))
    best = SimpleNamespace(load=80.0, peak_amplitude=2e-4)
    run = SolvedRun(
        scene=Scene(title="A <run>"),
        folder=None,
        mesh=mesh,
        modes=[modes],
        contact=None,
        strength=None,
        settings=None,
        reduced=None,
        mode_errors=None,
        response=Response(None, [best], ()),
        damped={},
    )
    stages = "mesh, modes, contact, reduced, response"
    assert repr(run) == f"<bladefem run of 'A <run>' in memory: {stages}>"
    assert len(repr(mesh)) < 200
    page = run._repr_html_()
    assert "nodal diameter 9" in page
    assert "200 µm under 80 N" in page
    assert "A &lt;run&gt;" in page


def test_a_result_of_a_later_stage_is_missed_in_one_sentence(tmp_path):
    """A shorter run says which stage finds the result, not "NoneType has no attribute"."""
    found = {"scene": Scene(title="Short"), "folder": tmp_path, "mesh": None}
    with pytest.raises(StageMissingError, match="'modes' is found by the stage 'modes'"):
        _ = Run(**found).modes
    modal = ModalRun(**found, modes=[])
    with pytest.raises(InputError, match="'response'.*expected a run that reached it.*mesh, modes"):
        _ = modal.response
    assert not hasattr(modal, "reduced")
    with pytest.raises(AttributeError, match="'ModalRun' object has no attribute 'solutions'"):
        _ = modal.solutions


def test_files_of_a_run_in_memory_are_refused():
    with pytest.raises(InputError, match="made in memory, expected a folder"):
        folder_of(Run(scene=Scene(title="Short"), folder=None, mesh=None))


def test_an_unknown_stage_is_refused_before_any_work():
    with pytest.raises(InputError, match="until = 'respons'.*did you mean 'response'"):
        pipeline.run(Scene(), None, until="respons")


def test_stability_is_a_flag_that_xarray_reads(tmp_path):
    """Every verdict with its kind, the linear limits, and curves without a point there."""
    table = points()
    table["method"] = np.where(np.isfinite(table["load"]) & (table["load"] > 0), "", "linear")
    reported = {
        1: ("unstable", "fold", 1.2),
        2: ("unstable", "period doubling", 1.3),
        3: ("unstable", "torus", 1.4),
        4: ("stable", "", 0.9),
        5: ("unknown", "", np.nan),
        6: ("unstable", "", 1.1),
    }
    rows = table.index[table["load"] == 200.0]
    for name in ("stability", "bifurcation"):
        table[name] = np.where(table["method"] == "linear", None, "")
    table["multiplier"] = np.nan
    for place, values in reported.items():
        table.loc[rows[place], ["stability", "bifurcation", "multiplier"]] = values
    write_results(
        tmp_path / "results.nc",
        {"response": curve_arrays(table), "stability": stability_arrays(table)},
    )
    data = xr.open_dataset(tmp_path / "results.nc", group="stability", engine="h5netcdf")
    flag = data["verdict"]
    meanings = flag.attrs["flag_meanings"].split()
    assert len(meanings) == len(flag.attrs["flag_values"])
    assert flag.attrs["flag_values"].dtype == flag.encoding["dtype"] == np.int8
    words = {
        1: "unstable_fold",
        2: "unstable_period_doubling",
        3: "unstable_torus",
        4: "stable",
        5: "not_judged",
        6: "unstable",
    }
    for place, word in words.items():
        at = {"load": 200.0, "frequency": table.loc[rows[place], "frequency"]}
        assert meanings[int(flag.sel(at))] == word
        assert float(data["multiplier"].sel(at)) == pytest.approx(reported[place][2], nan_ok=True)
    free = flag.sel(load=0.0)
    assert {meanings[int(number)] for number in free.dropna("frequency")} == {"unique"}
    # where a curve has no point there is no verdict
    assert np.array_equal(np.isnan(flag), np.isnan(curve_arrays(table)["converged"]))


def test_stability_that_was_not_asked_for_is_not_judged():
    flag = stability_arrays(points())["verdict"]
    assert set(flag.to_numpy()[np.isfinite(flag)]) == {0.0}
