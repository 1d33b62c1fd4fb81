"""netCDF and CSV files say their units, their scene and what made them."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bladefem.errors import InputError
from bladefem.io.stage_cache import (
    library_versions,
    read_results,
    write_results,
    write_table,
    write_text,
)
from bladefem.scene.toml import dump_scene, load_scene


def curve() -> xr.Dataset:
    return xr.Dataset(
        {
            "amplitude": (("load", "frequency"), np.ones((2, 3)) * (1 + 2j), {"units": "m"}),
            "residual": (("load", "frequency"), np.zeros((2, 3)), {"units": "1"}),
        },
        {
            "load": ("load", [20.0, 50.0], {"units": "N"}),
            "frequency": ("frequency", [1.0, 2.0, 3.0], {"units": "Hz"}),
        },
    )


def test_groups_units_complex_numbers_and_origin_come_back(tmp_path):
    scene = dump_scene(load_scene("scenes/wedge.toml"))
    path = write_results(
        tmp_path / "results.nc", {"response": curve(), "modes": curve()[["residual"]]}, scene
    )
    back = read_results(path, "response")
    xr.testing.assert_identical(back, curve()[["residual", "amplitude"]])
    assert back.amplitude.attrs["units"] == "m" and back["load"].attrs["units"] == "N"
    root = read_results(path)
    assert root.attrs["scene"] == scene and "dolfinx" in root.attrs["versions"]
    assert list(read_results(path, "modes").data_vars) == ["residual"]
    assert [p.name for p in tmp_path.iterdir()] == ["results.nc"]


def test_missing_group_and_missing_file_are_input_errors(tmp_path):
    path = write_results(tmp_path / "results.nc", {"response": curve()})
    for file, group in ((path, "nothing"), (tmp_path / "none.nc", "/")):
        with pytest.raises(InputError, match="cannot be read"):
            read_results(file, group)


def test_table_head_has_units(tmp_path):
    write_table(tmp_path / "t.csv", {"load": [20.0], "reason": ["converged"]}, {"load": "N"})
    assert (tmp_path / "t.csv").read_text() == "load [N],reason\n20,converged\n"
    with pytest.raises(KeyError, match="laod"):
        write_table(tmp_path / "t.csv", {"load": [20.0]}, {"laod": "N"})


def test_folder_that_vanished_is_an_input_error(tmp_path):
    for write in (
        lambda p: write_text(p, "x"),
        lambda p: write_table(p, {"a": [1]}),
        lambda p: write_results(p, {"a": curve()}),
    ):
        with pytest.raises(InputError, match="cannot be written"):
            write(tmp_path / "gone" / "x.nc")


def test_versions_name_the_finite_elements():
    assert {"bladefem", "dolfinx", "petsc4py", "numpy"} <= set(library_versions())
    assert library_versions()["dolfinx"] != "absent"
