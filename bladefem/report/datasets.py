"""The labelled arrays of a run, with units, for one netCDF file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..data import PressureMap
from ..study.pipeline.run_records import ModalRun, SolvedRun
from .tables import units_of

if TYPE_CHECKING:
    import xarray as xr

VARIABLE_MEANINGS = {
    "force": "contact force on the damper",
    "moment": "its moment about the engine's origin",
    "centre": "force-weighted middle of the contact",
    "forces": "sum of the normal forces",
    "areas": "whole face",
}


def datasets(result: SolvedRun, tables: dict[str, pd.DataFrame]) -> dict[str, xr.Dataset]:
    """Groups "modes", "contact", "resultants", "points", "summary" of a finished run."""
    return {
        "modes": mode_shapes(result),
        "contact": contact_arrays(result.contact.maps),
        "resultants": resultants(tables["contact/pressure"]),
        "points": table_dataset(tables["response/points"], "point"),
        "summary": table_dataset(tables["response/summary"], "case"),
    }


def mode_shapes(result: ModalRun) -> xr.Dataset:
    """Frequencies, shapes and node positions of all nodal diameters."""
    import xarray as xr

    sets = result.modes
    diameters = [-1 if s.nodal_diameter is None else s.nodal_diameter for s in sets]
    count = min(len(s.frequencies) for s in sets)
    shapes = np.empty((len(sets), count, *sets[0].shapes.shape[1:]), np.complex64)
    for own, one in zip(shapes, sets, strict=True):
        own[:] = one.shapes[:count]
    return xr.Dataset(
        {
            "frequency": (
                ("nodal_diameter", "mode"),
                [s.frequencies[:count] for s in sets],
                {"units": "Hz"},
            ),
            "residual": (
                ("nodal_diameter", "mode"),
                [s.residuals[:count] for s in sets],
                {"units": "1"},
            ),
            "shape": (
                ("nodal_diameter", "mode", "node", "direction"),
                shapes,
                {"units": "kg^-1/2", "long_name": "mass-normalised over one sector, or the body"},
            ),
            "position": (("node", "direction"), result.mesh.points, {"units": "m"}),
        },
        {
            "nodal_diameter": (
                "nodal_diameter",
                diameters,
                {"long_name": "nodal diameter, -1 without cyclic symmetry"},
            ),
            "mode": np.arange(1, count + 1),
            "direction": ["x", "y", "z"],
        },
    )


def contact_arrays(maps: Mapping[float, Sequence[PressureMap]]) -> xr.Dataset:
    """Force, gap and pressure of each contact node under each load [N], with its place and
    patch.
    """
    import xarray as xr

    patches = next(iter(maps.values()))
    force = np.array([np.concatenate([m.force for m in seats]) for seats in maps.values()])
    gap = np.array([np.concatenate([m.gap for m in seats]) for seats in maps.values()])
    area = np.concatenate([m.patch.area for m in patches])
    return xr.Dataset(
        {
            "force": (("load", "contact"), force, {"units": "N"}),
            "gap": (("load", "contact"), gap, {"units": "m"}),
            "pressure": (("load", "contact"), force / area, {"units": "Pa"}),
            "area": ("contact", area, {"units": "m^2"}),
            "position": (
                ("contact", "direction"),
                np.concatenate([m.patch.points for m in patches]),
                {"units": "m"},
            ),
            "patch": (
                "contact",
                np.repeat([m.patch.seat for m in patches], [len(m.force) for m in patches]),
            ),
        },
        {"load": ("load", list(maps), {"units": "N"}), "direction": ["x", "y", "z"]},
    )


def resultants(table: pd.DataFrame) -> xr.Dataset:
    """Force, moment, centre, area and peak pressure of each face under each load: the table's rows
    by (load, seat).

    Args:
        table: ``view.contact.pressure_summary`` with the load in front, one row a load and seat.
    """
    import xarray as xr

    loads = table["load"].unique()
    seats = table["patch"].unique()
    units = units_of(table)
    data: dict[str, Any] = {}
    vectors = {name: [f"{name}_{axis}" for axis in "xyz"] for name in ("force", "moment", "centre")}
    for name, columns in vectors.items():
        values = table[columns].to_numpy().reshape(len(loads), len(seats), 3)
        data[name] = (
            ("load", "seat", "direction"),
            values,
            {"units": units[columns[0]], "long_name": VARIABLE_MEANINGS[name]},
        )
    for name in table.columns.drop(
        ["load", "patch", *(column for some in vectors.values() for column in some)]
    ):
        data["normal_force" if name == "force" else name] = (
            ("load", "seat"),
            table[name].to_numpy().reshape(len(loads), len(seats)),
            {
                "units": units.get(name, "1"),
                "long_name": VARIABLE_MEANINGS.get(f"{name}s", name.replace("_", " ")),
            },
        )
    return xr.Dataset(
        data,
        {
            "load": ("load", loads, {"units": "N"}),
            "seat": list(seats),
            "direction": ["x", "y", "z"],
        },
    )


def table_dataset(table: pd.DataFrame, rows: str) -> xr.Dataset:
    """The columns of a table as variables with units along one dimension; "drift x [m/s]" becomes
    drift_x in m/s.
    """
    import xarray as xr

    units = units_of(table)
    data = {}
    for name, column in table.items():
        plain, _, unit = str(name).rstrip("]").partition(" [")
        values = column.to_numpy(dtype=str) if column.dtype == object else column.to_numpy()
        data["_".join(plain.replace(",", "").split())] = (
            rows,
            values,
            {"units": unit or units.get(name, "1")},
        )
    return xr.Dataset(data)
