"""What ``bladefem modes`` leaves behind, and a comparison of two runs."""

from __future__ import annotations

import base64
import time

import numpy as np
import pandas as pd
import pytest

from bladefem import load_scene
from bladefem.cli.main import main
from bladefem.data import ModeSet
from bladefem.fem.compat import MPI
from bladefem.io.stage_cache import read_results
from bladefem.report.modes import mac_table, report_survey
from bladefem.study.modes.survey import Wanted

ONE_PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
# until another rank must have drawn something
WAIT_SECONDS = 200.0
PLANE = ["modes", "scenes/plane.toml", "--set", "mesh.size=5 mm"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plane blade with everything but the refinement study, one mode drawn."""
    place = tmp_path_factory.mktemp("plane")
    assert (
        main(
            [
                *PLANE,
                "-o",
                str(place),
                "--campbell",
                "0, 3000, 6000 rpm",
                "--pictures",
                "1",
                "--forced",
                "excitation, pressure_side=100 Pa",
            ]
        )
        == 0
    )
    return place


def test_folder_holds_tables_pictures_and_shapes(folder):
    names = {file.name for file in folder.iterdir()}
    for table in (
        "frequencies",
        "excited_modes",
        "effective_masses",
        "campbell",
        "crossings",
        "interference",
        "margins",
        "forced_response",
        "resonances",
        "stresses",
    ):
        assert {f"{table}.{kind}" for kind in ("csv", "md", "tex")} <= names
    assert {
        "modes.png",
        "mode_1.png",
        "wave.gif",
        "campbell.png",
        "forced_response.png",
        "modes.vtu",
        "stress.vtu",
    } <= names
    shapes = read_results(folder / "modes.nc", "modes")
    table = pd.read_csv(folder / "frequencies.csv")
    np.testing.assert_allclose(
        shapes["frequency"].values.ravel(), table["frequency [Hz]"], rtol=1e-8
    )
    assert table["family"].iloc[0] == "first flap"


def test_arrays_keep_the_scene_they_are_of(folder):
    import xarray as xr

    kept = xr.open_dataset(folder / "modes.nc", engine="h5netcdf").attrs["scene"]
    assert kept.splitlines() == (folder / "scene.toml").read_text().splitlines()


def test_the_page_lists_inputs_of_the_modes_alone(folder):
    page = (folder / "report_modes.md").read_text()
    for name in ("material.blade.E", "operation.damping", "support.clamp", "mesh.size"):
        assert f"{name} " in page or f"`{name}`" in page
    assert not any(name in page for name in ("contact.mu", "study.loads", "model.harmonics"))


def test_a_run_equals_itself_and_another_mesh_is_recognised(folder, tmp_path, capsys):
    other = [
        *PLANE[:-1],
        "mesh.size=7 mm",
        "-o",
        str(tmp_path),
        "--pictures",
        "0",
        "--compare",
        str(folder),
    ]
    assert main(other) == 0
    table = pd.read_csv(tmp_path / "mac.csv")
    assert (table["mac"].iloc[:4] > 0.99).all() and (
        table["partner"].iloc[:4] == table["mode"].iloc[:4]
    ).all()
    assert "mode of the other run" in capsys.readouterr().out
    assert main([*PLANE, "-o", str(folder), "--pictures", "0", "--compare", str(folder)]) == 0
    assert (pd.read_csv(folder / "mac.csv")["mac"] > 1 - 1e-9).all()


def test_a_folder_without_modes_is_refused(tmp_path, capsys):
    assert main([*PLANE, "-o", str(tmp_path / "a"), "--compare", str(tmp_path / "none")]) == 2
    assert "expected the folder of an earlier run" in capsys.readouterr().err


def test_partners_are_the_best_matches():
    sets = [
        ModeSet(np.array(f), np.zeros((2, 1, 3)), None, np.zeros(2))
        for f in ([10.0, 20.0], [19.0, 11.0])
    ]
    table = mac_table(np.array([[0.1, 0.9], [0.8, 0.2]]), *sets)
    assert table["partner"].tolist() == [2, 1] and table["frequency_of_partner"].tolist() == [
        11.0,
        19.0,
    ]


@pytest.mark.mpi
@pytest.mark.two_ranks
def test_ranks_share_out_pictures_and_files(tmp_path, monkeypatch):
    """Every picture is drawn once, by whichever rank is free; the page holds all of them.

    The first one is finished when there is a second one, which takes another rank.
    """
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    drawn = []

    def drawings(result, tables, pictures):
        def draw(file):
            drawn.append(file.name)
            file.write_bytes(ONE_PIXEL)
            end = time.monotonic() + WAIT_SECONDS
            while not (folder / "mode_2.png").exists() and comm.size > 1:
                assert time.monotonic() < end, "no other rank draws"
                time.sleep(0.01)

        return {f"mode_{i + 1}.png": draw for i in range(8)}

    monkeypatch.setattr("bladefem.report.modes._drawings", drawings)
    scene = load_scene("scenes/plane.toml", ["mesh.size=7 mm"])
    report_survey(scene, folder, Wanted(), comm=comm)
    parts = comm.allgather(drawn)
    assert sorted(name for part in parts for name in part) == [
        f"mode_{i + 1}.png" for i in range(8)
    ]
    assert comm.size == 1 or sum(map(bool, parts)) > 1
    assert "mode_8" in (folder / "report_modes.md").read_text()
    assert {"modes.nc", "modes.vtu", "stress.vtu", "frequencies.csv"} <= {
        file.name for file in folder.iterdir()
    }
    comm.Barrier()
