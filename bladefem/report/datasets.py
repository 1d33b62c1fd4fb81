"""The labelled arrays of a run, with units, for one netCDF file."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .tables import units_of

__all__ = ["datasets", "mode_shapes", "table_dataset"]


def datasets(result: Any, tables: dict[str, pd.DataFrame]) -> dict[str, Any]:
    """Groups "modes", "contact", "points", "summary" of a finished run (study.pipeline.Run)."""
    return {"modes": mode_shapes(result), "contact": _contact(result),
            "points": table_dataset(tables["response/points"], "point"),
            "summary": table_dataset(tables["response/summary"], "case")}


def mode_shapes(result: Any) -> Any:
    """Frequencies, shapes and node positions of all nodal diameters."""
    import xarray as xr
    sets = result.modes
    diameters = [-1 if s.nodal_diameter is None else s.nodal_diameter for s in sets]
    count = min(len(s.frequencies) for s in sets)
    shapes = np.stack([s.shapes[:count].astype(complex) for s in sets]).astype(np.complex64)
    return xr.Dataset(
        {"frequency": (("nodal_diameter", "mode"), [s.frequencies[:count] for s in sets], {"units": "Hz"}),
         "residual": (("nodal_diameter", "mode"), [s.residuals[:count] for s in sets], {"units": "1"}),
         "shape": (("nodal_diameter", "mode", "node", "direction"), shapes, {"units": "kg^-1/2"}),
         "position": (("node", "direction"), result.mesh.points, {"units": "m"})},
        {"nodal_diameter": ("nodal_diameter", diameters, {"long_name": "nodal diameter, -1 without cyclic symmetry"}),
         "mode": np.arange(1, count + 1), "direction": ["x", "y", "z"]})


def _contact(result: Any) -> Any:
    import xarray as xr
    maps = result.contact.maps
    patches = next(iter(maps.values()))
    force = np.array([np.concatenate([m.force for m in seats]) for seats in maps.values()])
    gap = np.array([np.concatenate([m.gap for m in seats]) for seats in maps.values()])
    area = np.concatenate([m.patch.area for m in patches])
    return xr.Dataset(
        {"force": (("load", "contact"), force, {"units": "N"}), "gap": (("load", "contact"), gap, {"units": "m"}),
         "pressure": (("load", "contact"), force / area, {"units": "Pa"}), "area": ("contact", area, {"units": "m^2"}),
         "position": (("contact", "direction"), np.concatenate([m.patch.points for m in patches]), {"units": "m"}),
         "patch": ("contact", np.repeat([m.patch.name for m in patches], [len(m.force) for m in patches]))},
        {"load": ("load", list(maps), {"units": "N"}), "direction": ["x", "y", "z"]})


def table_dataset(table: pd.DataFrame, rows: str) -> Any:
    """The columns of a table as variables with units along one dimension."""
    import xarray as xr
    units = units_of(table)
    return xr.Dataset({name: (rows, column.to_numpy(dtype=str) if column.dtype == object else column.to_numpy(),
                              {"units": units.get(name, "1")}) for name, column in table.items()})
