"""Pressure maps of a seated damper in the folder of a run: tables, labelled arrays, ParaView file
and picture.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from ..data import PressureMap
from ..errors import InputError
from ..io.stage_cache import on_root, read_results, write_results, write_table
from ..scene.tables import Scene
from ..scene.toml import dump_scene
from ..scene.units import newtons
from ..study.pipeline import pipeline
from ..study.pipeline.run_records import SeatedRun, folder_of
from ..util.communicator import Communicator
from ..util.progress import Progress, without_progress
from ..view import contact
from .datasets import contact_arrays, resultants
from .headlines import Headline
from .tables import units_of, write_tables
from .write import Page, write_report

PICTURE = "pressure_on_both_seats"
MESH_STEP = (
    "Halve mesh.contact_size and compare the mean pressure and the pressed share before numbers "
    "are frozen."
)

# mean normal load of a seat [N] to the maps of its patches
Maps = Mapping[float, Sequence[PressureMap]]


def report_pressure(
    scene: Scene,
    folder: str | Path,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> SeatedRun:
    """Seat the damper under each load and write the pressures into the folder.

    Raises:
        InputError: the scene cannot be run as it is; NotSolvedError: the damper finds no seat.
    """
    result = pipeline.run(scene, folder, until="contact", comm=comm, progress=progress)
    start = time.perf_counter()
    on_root(comm, lambda: _write(result))
    return replace(
        result, timings={**result.timings, "tables and picture": time.perf_counter() - start}
    )


def pressure_table(maps: Maps) -> pd.DataFrame:
    """One row a load and seat: resultants, peak and mean pressure, pressed share, proof (SI)."""
    return _by_load({load: contact.pressure_summary(seats) for load, seats in maps.items()})


def write_points(folder: Path, maps: Maps) -> None:
    """Pressure, force and gap of each contact node: ``pressure_points.csv`` and
    ``pressure.vtu``.
    """
    points = _by_load({load: contact.pressure_points(seats) for load, seats in maps.items()})
    write_table(folder / "pressure_points.csv", points, units_of(points))
    contact.save_pressure_vtu(maps, folder / "pressure.vtu")


def draw_seats(
    maps: Maps,
    load: float,
    file: Path,
) -> object:
    """The picture of both seats under one of the loads."""
    return contact.draw_pressure(
        maps[load], file, title=f"contact pressure under {newtons(load)} per seat"
    )


def _write(result: SeatedRun) -> None:
    folder = folder_of(result)
    maps = result.contact.maps
    table = pressure_table(maps)
    write_tables(table, folder / "pressure", "pressure")
    write_points(folder, maps)
    shown = sorted(maps)[len(maps) // 2]
    draw_seats(maps, shown, folder / f"{PICTURE}.png")
    _report(result, table, shown)
    if not _has_responses(folder / "results.nc"):
        write_results(
            folder / "results.nc",
            {"contact": contact_arrays(maps), "resultants": resultants(table)},
            dump_scene(result.scene),
        )


def _report(
    result: SeatedRun,
    table: pd.DataFrame,
    load: float,
) -> None:
    """``report_contact.html`` and ``.md``: pressures of one load first, then all of them."""
    folder = folder_of(result)
    rows = table[table["load"] == load]
    worst = rows.loc[rows["peak_pressure"].idxmax()]
    numbers = [
        Headline(
            "peak pressure",
            f"{1e-6 * worst['peak_pressure']:.4g} MPa",
            "mesh error not studied; see the warnings",
            f"on the {worst['patch']} seat under {newtons(load, 4)}",
        ),
        Headline(
            "mean pressure there",
            f"{1e-6 * worst['mean_pressure']:.4g} MPa",
            "by equilibrium over the pressed area",
            f"{100 * worst['contact_share']:.3g} % of the seat pressed",
        ),
    ]
    own = result.contact.own
    if own is not None:
        numbers.append(
            Headline(
                "load of a seat by the damper's own mass",
                newtons(own, 4),
                "by equilibrium, no model error",
                f"{1e3 * result.contact.problem.mass:.3g} g",
            )
        )
    write_report(
        folder,
        result.scene,
        {"contact/pressure": table},
        {f"contact/{PICTURE}": folder / f"{PICTURE}.png"},
        result.messages,
        result.timings,
        page=Page(
            numbers=numbers,
            steps=[MESH_STEP],
            stem="report_contact",
            subject=f"{result.scene.kind}, contact pressure",
        ),
    )


def _by_load(tables: Mapping[float, pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(
        [table.assign(load=load)[["load", *table]] for load, table in tables.items()],
        ignore_index=True,
    )


def _has_responses(file: Path) -> bool:
    """A whole run of the same scene has left these arrays and more."""
    try:
        return read_results(file, "points") is not None
    except InputError:
        return False
