"""Pressure maps of a seated damper in the folder of a run: tables, labelled arrays, ParaView file
and picture.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from ..data import PressureMap
from ..errors import InputError
from ..io.stage_cache import on_root, read_results, write_results, write_table
from ..scene.tables import Scene
from ..scene.toml import dump
from ..study.pipeline import pipeline
from ..util.progress import Progress, unwatched
from ..view import contact
from .datasets import contact_arrays, resultants
from .tables import units_of, write_tables

__all__ = ["PICTURE", "draw_seats", "pressure_table", "run", "write_points"]

PICTURE = "pressure_on_both_seats"

# mean normal load of a seat [N] to the maps of its patches
Maps = Mapping[float, Sequence[PressureMap]]


def run(
    scene: Scene, folder: str | Path, comm: Any = None, progress: Progress = unwatched
) -> pipeline.Run:
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


def draw_seats(maps: Maps, load: float, file: Path) -> object:
    """The picture of both seats under one of the loads."""
    return contact.draw_pressure(
        maps[load], file, title=f"contact pressure under {load:g} N per seat"
    )


def _write(result: pipeline.Run) -> None:
    folder = Path(result.folder)
    maps = result.contact.maps
    table = pressure_table(maps)
    write_tables(table, folder / "pressure", "pressure")
    write_points(folder, maps)
    draw_seats(maps, sorted(maps)[len(maps) // 2], folder / f"{PICTURE}.png")
    if not _has_responses(folder / "results.nc"):
        write_results(
            folder / "results.nc",
            {"contact": contact_arrays(maps), "resultants": resultants(table)},
            dump(result.scene),
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
