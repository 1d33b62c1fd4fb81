"""All that a run leaves in its folder: tables, one netCDF file, ParaView files, pictures and the
report.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from ..hbm.parallel import share_work
from ..io.run_folder import take_folder
from ..io.stage_cache import on_root
from ..scene.tables import Scene
from ..study.mistuning.stage import with_whole_wheel
from ..study.mistuning.validate import check_mistuning, is_mistuned
from ..study.pipeline import pipeline
from ..study.pipeline.run_records import SolvedRun, folder_of
from ..util.communicator import Communicator
from ..util.progress import Progress, without_progress
from .fatigue import worst_utilisation
from .flow import flow_headlines
from .headlines import Headline
from .nodes import cycles_of
from .run_files import MODE_SHAPES, file_writers
from .run_messages import run_messages
from .run_pictures import live_figures, run_drawings
from .run_tables import run_tables
from .wheel import pattern_headlines
from .write import Page, write_report

# the figures to hover over and rotate, which go into the page
LIVE = "live figures"
# what takes a second or more
SLOWEST_TO_WRITE = (LIVE, "modes/first_modes", "mesh/mesh", "modes/mode_on_the_wheel", MODE_SHAPES)


def report_run(
    scene: Scene,
    folder: str | Path,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> SolvedRun:
    """Everything: mesh, modes, contact, responses, and the folder with pictures and report.

    Raises:
        InputError: the scene cannot be run as it is; NotSolvedError: a stage found no solution.
    """
    check_mistuning(scene)
    result = pipeline.run(scene, folder, comm=comm, progress=progress)
    if is_mistuned(scene):
        result = with_whole_wheel(result, comm, progress)
    return write_run(result, comm, progress)


def write_run(
    result: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> SolvedRun:
    """Write the folder of a finished run; returns the run with the time that it took.

    Pictures and files are dealt over the ranks; rank 0 writes the report, which holds the pictures.
    """
    start = time.perf_counter()
    folder = folder_of(result)
    moved = on_root(comm, lambda: take_folder(folder, result.scene))
    cycles = cycles_of(result)
    tables = run_tables(result, cycles)
    drawings = run_drawings(result, tables, cycles)
    figures = {name: folder / f"{name.split('/')[1]}.png" for name in drawings}
    jobs: dict[str, Callable[[], object]] = {
        LIVE: partial(live_figures, result, tables, cycles),
        **{name: partial(draw, figures[name]) for name, draw in drawings.items()},
        **file_writers(result, tables, cycles),
    }
    # the longest first: what follows goes to the rank that is free
    order = sorted(jobs, key=lambda name: name not in SLOWEST_TO_WRITE)
    found = share_work(
        lambda name: _finished(name, jobs[name]),
        order,
        comm,
        lambda items: progress(items, "pictures and files"),
        on_demand=True,
    )
    messages = [*filter(None, [moved]), *run_messages(result, cycles)]
    live = found[order.index(LIVE)]
    on_root(comm, lambda: _write_page(result, tables, figures, live, messages))
    return replace(
        result, timings={**result.timings, "pictures and report": time.perf_counter() - start}
    )


def _finished(name: str, job: Callable[[], object]) -> Any:
    """What a job returns, which but for the live figures is of no use to other ranks."""
    done = job()
    return done if name == LIVE else None


def _write_page(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    figures: dict[str, Path],
    live: dict[str, dict[str, Any]],
    messages: list[str],
) -> None:
    """The report, once its pictures are there."""
    write_report(
        folder_of(result),
        result.scene,
        tables,
        figures,
        messages,
        result.timings,
        page=Page(
            live,
            more=[*flow_headlines(result), *_wheel_headlines(result)],
        ),
    )


def _wheel_headlines(result: SolvedRun) -> list[Headline]:
    """First numbers of the whole wheel, where blades differ."""
    if result.wheel is None:
        return []
    return pattern_headlines(result.wheel, worst_utilisation(result))
