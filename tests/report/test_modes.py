"""What ``bladefem modes`` leaves behind, and a comparison of two runs."""

from __future__ import annotations

import base64
import time
from itertools import product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
import xarray as xr

from bladefem import load_scene
from bladefem.cli.main import main
from bladefem.cli.tables import survey_tables
from bladefem.data import ModeSet
from bladefem.errors import InputError
from bladefem.fem.compat import MPI
from bladefem.io.stage_cache import read_results
from bladefem.report.modes import mac_table, report_survey
from bladefem.study.modes.survey import Wanted, refuse_other_kind

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


def quadratic_triangle(x, y):
    """Shape functions of six nodes at one place, and their derivatives by both coordinates."""
    one = np.array([1 - x - y, x, y])
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    ends = [(0, 1), (1, 2), (2, 0)]
    shape = [*(one * (2 * one - 1)), *(4 * one[i] * one[j] for i, j in ends)]
    gradient = [
        *((4 * one - 1)[:, None] * slope),
        *(4 * (one[i] * slope[j] + one[j] * slope[i]) for i, j in ends),
    ]
    return np.array(shape), np.array(gradient)


def test_shapes_have_a_unit_modal_mass_on_the_elements_beside_them(tmp_path):
    """Integrated here on the triangles of mesh.vtu, whose points are the nodes of modes.nc."""
    assert main([*PLANE, "-o", str(tmp_path), "--pictures", "0", "-q"]) == 0
    grid = pv.read(tmp_path / "mesh.vtu")
    data = xr.open_dataset(tmp_path / "modes.nc", engine="h5netcdf", group="modes")
    np.testing.assert_array_equal(grid.points, data["position"])
    # one body, no wheel
    assert data["nodal_diameter"].values.tolist() == [-1]
    assert not data["shape_im"].values.any()
    blade = grid.cells_dict[pv.CellType.QUADRATIC_TRIANGLE][grid.cell_data["body"] == 0]
    shapes = data["shape_re"].values[0].astype(float)
    assert not shapes[:, np.setdiff1d(np.arange(grid.n_points), blade)].any()
    mass = np.zeros(len(shapes))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for (a, wa), (b, wb) in product(zip((nodes + 1) / 2, weights / 2, strict=True), repeat=2):
        shape, gradient = quadratic_triangle(a, b * (1 - a))
        area = np.linalg.det(np.einsum("eni,nj->eij", grid.points[blade][..., :2], gradient))
        u = np.einsum("n,meni->mei", shape, shapes[:, blade])
        mass += wa * wb * (1 - a) * (abs(area) * (u**2).sum(axis=2)).sum(axis=1)
    scene = load_scene("scenes/plane.toml")
    np.testing.assert_allclose(mass * scene.material.blade.rho * scene.plane.depth, 1.0, rtol=1e-6)


def test_a_speed_survey_begins_with_the_first_engine_order(folder):
    """plane.toml gives no engine order, and turns at 0 rpm."""
    crossings = pd.read_csv(folder / "crossings.csv")
    assert set(crossings["engine_order"]) <= set(range(1, 10))
    margins = pd.read_csv(folder / "margins.csv")
    assert margins["engine_order"].tolist() == list(range(1, 10))
    assert set(margins["verdict"]) == {"not excited at rest"} and margins["margin"].isna().all()
    page = (folder / "report_modes.md").read_text()
    assert "engine orders 1 to 9, up to 3 above excitation.engine_order = 6, the default" in page


def test_a_linear_response_has_captions_of_its_own(folder):
    page = (folder / "report_modes.md").read_text()
    assert "Figure 1. Linear response without damper" in page
    assert "full stick" not in page and "normal load per seat" not in page
    assert "scaled to a largest displacement of 1 mm" in page


def test_captions_of_a_single_blade_speak_of_no_wheel(folder):
    """Pictures and tables of a plane blade: it has no sector, and no wave turns on it."""
    lines = (folder / "report_modes.md").read_text().splitlines()
    captions = [line for line in lines if line.startswith(("Figure ", "Table "))]
    assert len(captions) > 10
    for caption in captions:
        for word in ("nodal diameter", "wheel", "sector", "wave"):
            assert word not in caption.lower(), caption


def test_the_terminal_tells_resonances_without_a_maximum():
    table = pd.DataFrame(
        {
            **{name: [1.0, 2.0] for name in ("frequency", "amplitude", "phase", "largest")},
            "mode": [1, 2],
            "natural": [1.0, 2.0],
            "peaked": [True, False],
        }
    )
    found = SimpleNamespace(
        run=SimpleNamespace(
            modes=[ModeSet(np.array([1.0]), np.zeros((1, 1, 3)), None, np.zeros(1))]
        ),
        campbell=None,
        convergence=None,
        answer=SimpleNamespace(resonances=table),
        mac=None,
    )
    lines = survey_tables(found).splitlines()
    assert lines[-4].endswith("a maximum")
    assert lines[-2].endswith("yes") and lines[-1].endswith("no")


def test_a_wheel_is_not_compared_with_a_single_blade(folder):
    own, sets = (SimpleNamespace(pairs={}), [SimpleNamespace(nodal_diameter=3)])
    with pytest.raises(InputError) as said:
        refuse_other_kind(folder, own, sets)
    assert "its modes are those of a wheel, expected the run of a single blade" in str(said.value)
    own.pairs["cyclic"], sets[0].nodal_diameter = None, None
    with pytest.raises(InputError, match="those of a single blade, expected the run of a wheel"):
        refuse_other_kind(folder, own, sets)
    sets[0].nodal_diameter = 0
    refuse_other_kind(folder, own, sets)


def test_arrays_keep_the_scene_they_are_of(folder):
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
