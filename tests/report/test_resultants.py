"""The resultants of each face: the same numbers in the table, in the netCDF file, and by their
definition.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bladefem.contact.resultants import resultant
from bladefem.data import PressureMap
from bladefem.io.stage_cache import read_results, write_results
from bladefem.report import pressure
from bladefem.report.datasets import resultants
from bladefem.report.pressure import pressure_table
from bladefem.scene.tables import Scene
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.run_records import SeatedRun, Seating

sys.path.insert(0, str(Path(__file__).parents[1] / "study"))
from test_contact_cycle import strip

UNITS = {
    "force": "N",
    "moment": "N m",
    "centre": "m",
    "normal_force": "N",
    "area": "m^2",
    "peak_pressure": "Pa",
    "contact_share": "1",
}


def pressed():
    """Some nodes of two seats pressed at random, under three loads."""
    rng, patches = np.random.default_rng(2), (strip("this", 0.0), strip("next", 1.0))
    return {
        load: [
            PressureMap(p, load * rng.random(8) * (rng.random(8) > 0.3), np.zeros(8), 0.0)
            for p in patches
        ]
        for load in (40.0, 90.0, 250.0)
    }


def test_netcdf_table_and_definition_agree(tmp_path):
    maps = pressed()
    table = pressure_table(maps)
    file = write_results(
        tmp_path / "results.nc", {"resultants": resultants(table)}, "title = 'x'\n"
    )
    found = read_results(file, "resultants")
    for name, unit in UNITS.items():
        assert found[name].attrs["units"] == unit, name
    for load, seats in maps.items():
        for seat in seats:
            one, wanted = found.sel(load=load, seat=seat.patch.seat), resultant(seat)
            row = table[(table["load"] == load) & (table["patch"] == seat.patch.seat)].iloc[0]
            for name in ("force", "moment", "centre"):
                np.testing.assert_allclose(one[name], getattr(wanted, name), rtol=1e-12)
                np.testing.assert_array_equal(one[name], [row[f"{name}_{axis}"] for axis in "xyz"])
            assert float(one["normal_force"]) == row["force"] == pytest.approx(wanted.normal)
            assert float(one["peak_pressure"]) == row["peak_pressure"] == pytest.approx(wanted.peak)
            assert float(one["contact_share"] * one["area"]) == pytest.approx(wanted.area)


def test_contact_alone_leaves_all_maps(tmp_path, monkeypatch):
    """Tables, arrays, ParaView file and picture of ``bladefem contact``; the arrays of a whole run
    are not lost.
    """
    import pyvista
    import xarray as xr

    maps = pressed()
    seated = SeatedRun(
        scene=Scene(),
        folder=tmp_path,
        mesh=None,
        modes=[],
        contact=Seating(None, maps),
    )
    monkeypatch.setattr(pipeline, "run", lambda *_, **__: seated)
    result = pressure.report_pressure(Scene(), tmp_path)
    assert "tables and picture" in result.timings
    forces = {load: np.concatenate([m.force for m in seats]) for load, seats in maps.items()}
    points, table = (
        pd.read_csv(tmp_path / "pressure_points.csv"),
        pd.read_csv(tmp_path / "pressure.csv"),
    )
    assert list(points)[:2] == ["load [N]", "patch"] and len(table) == 3 * 2
    for load, force in forces.items():
        np.testing.assert_allclose(
            points[points["load [N]"] == load]["force [N]"], force, rtol=1e-8
        )
        np.testing.assert_allclose(
            pyvista.read(tmp_path / "pressure.vtu")[f"normal force [N] at {load:g} N"], force
        )
        arrays = read_results(tmp_path / "results.nc", "contact")
        np.testing.assert_allclose(arrays["force"].sel(load=load), force)
    assert list(read_results(tmp_path / "results.nc", "resultants")["load"]) == list(maps)
    assert (tmp_path / "pressure_on_both_seats.png").stat().st_size > 10_000
    write_results(
        tmp_path / "results.nc",
        {"points": xr.Dataset({"amplitude": ("point", [1.0], {"units": "m"})})},
    )
    pressure.report_pressure(Scene(), tmp_path)
    assert float(read_results(tmp_path / "results.nc", "points")["amplitude"][0]) == 1.0
