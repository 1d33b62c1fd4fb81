"""The resultants of each face: the same numbers in the table, in the netCDF file, and by their definition."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bladefem.contact.summary import resultant
from bladefem.data import PressureMap
from bladefem.report.datasets import resultants
from bladefem.store import read_results, write_results
from bladefem.view.contact import pressure_summary

sys.path.insert(0, str(Path(__file__).parents[1] / "study"))
from test_cycle import strip

UNITS = {"force": "N", "moment": "N m", "centre": "m", "normal_force": "N", "area": "m^2", "peak_pressure": "Pa",
         "contact_share": "1"}


def test_netcdf_table_and_definition_agree(tmp_path):
    rng = np.random.default_rng(2)
    loads, patches = (40.0, 90.0, 250.0), (strip("this", 0.0), strip("next", 1.0))
    maps = {load: [PressureMap(p, load * rng.random(8) * (rng.random(8) > 0.3), np.zeros(8), 0.0) for p in patches]
            for load in loads}
    table = pd.concat([pressure_summary(seats).assign(load=load) for load, seats in maps.items()], ignore_index=True)
    file = write_results(tmp_path / "results.nc", {"resultants": resultants(table)}, "title = 'x'\n")
    found = read_results(file, "resultants")
    for name, unit in UNITS.items():
        assert found[name].attrs["units"] == unit, name
    for load, seats in maps.items():
        for seat in seats:
            one, wanted = found.sel(load=load, seat=seat.patch.name), resultant(seat)
            row = table[(table["load"] == load) & (table["patch"] == seat.patch.name)].iloc[0]
            for name in ("force", "moment", "centre"):
                np.testing.assert_allclose(one[name], getattr(wanted, name), rtol=1e-12)
                np.testing.assert_array_equal(one[name], [row[f"{name}_{axis}"] for axis in "xyz"])
            assert float(one["normal_force"]) == row["force"] == pytest.approx(wanted.normal)
            assert float(one["peak_pressure"]) == row["peak_pressure"] == pytest.approx(wanted.peak)
            assert float(one["contact_share"] * one["area"]) == pytest.approx(wanted.area)
