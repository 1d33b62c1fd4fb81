"""What a run leaves in its folder beside pictures and report: tables, one netCDF file, files for
ParaView.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd

from ..io.stage_cache import write_results, write_table
from ..scene.toml import dump_scene
from ..study.modes.survey import excited_set
from ..study.pipeline.contact_cycle import ContactCycle
from ..study.pipeline.run_records import SolvedRun, folder_of
from ..view import mesh, modes
from .datasets import datasets, table_dataset
from .fatigue import save_fatigue_vtu
from .linear import harmonic_table
from .nodes import loop_table, node_table, save_cycles_vtu
from .pressure import write_points
from .response_arrays import (
    curve_arrays,
    loop_arrays,
    node_arrays,
    resonance_arrays,
    stability_arrays,
)
from .tables import units_of, write_tables

# file of mode shapes for ParaView
MODE_SHAPES = "modes.vtu"


def file_writers(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    cycles: list[ContactCycle],
) -> dict[str, Callable[[], object]]:
    """Name of a set of files -> what writes it: tables, data sets and files for ParaView."""
    folder = folder_of(result)
    coefficient = result.scene.contact.wear_coefficient
    patches = list(result.contact.problem.patches)
    nodes = node_table(patches, cycles, coefficient)

    def write_all_tables() -> None:
        for name, table in tables.items():
            write_tables(table, folder / name.split("/")[1], name.split("/")[1])
        write_table(folder / "nodes.csv", nodes, units_of(nodes))
        loops = loop_table(cycles)
        write_table(folder / "hysteresis.csv", loops, units_of(loops))

    def write_contact() -> None:
        write_points(folder, result.contact.maps)
        save_cycles_vtu(patches, cycles, folder / "friction_work.vtu", coefficient)
        save_fatigue_vtu(result, folder / "fatigue.vtu")

    return {
        MODE_SHAPES: lambda: modes.save_modes_vtu(
            result.mesh, excited_set(result), folder / MODE_SHAPES
        ),
        "results.nc": lambda: write_results(
            folder / "results.nc",
            _data_sets(result, tables, cycles, nodes),
            dump_scene(result.scene),
        ),
        "mesh.vtu": lambda: mesh.save_vtu(result.mesh, folder / "mesh.vtu"),
        "tables": write_all_tables,
        "contact": write_contact,
    }


def _data_sets(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    cycles: list[ContactCycle],
    nodes: pd.DataFrame,
) -> dict[str, Any]:
    """The groups of the netCDF file."""
    patches = list(result.contact.problem.patches)
    return {
        **datasets(result, tables),
        "nodes": table_dataset(nodes, "row"),
        "approximation": table_dataset(harmonic_table(patches, cycles), "row"),
        "hysteresis": table_dataset(loop_table(cycles), "row"),
        "response": curve_arrays(tables["response/points"]),
        "stability": stability_arrays(tables["response/points"]),
        "resonance": resonance_arrays(result.response.curves, result.response.limits),
        "cycle": node_arrays(nodes),
        "loops": loop_arrays(cycles),
    }
