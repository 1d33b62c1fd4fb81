"""The command that draws mistuned wheels: amplification of the highest blade for each load."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..scene.tables import Scene
from ..util.communicator import Communicator
from . import tables
from .commands import prepared, tell


def scatter(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Statistics of many wheels, on top of the run's tuned responses."""
    scene, folder, bars = prepared(options, comm, responds=True)
    # before the tuned responses, which take minutes
    from ..study.mistuning.validate import refuse_scatter

    refuse_scatter(scene)
    from ..io.stage_cache import on_root
    from ..report.scatter_sentences import scatter_sentences, use_sentences
    from ..study.mistuning.stage import scatter_of_run, scatter_utilisation
    from ..study.pipeline import pipeline
    from ..study.pipeline.best_load import studied_load

    run = pipeline.run(scene, folder, comm=comm, progress=bars)
    found = scatter_of_run(run, comm, bars)
    used, remarks = scatter_utilisation(run, found)
    held = scene.model.static == "uncoupled"
    # what makes the tuned responses wrong makes the wheels' wrong, which are counted over them
    best = run.response.best_found
    searched = None if best is None else studied_load(best)
    own = [*scatter_sentences(found, held, searched), *use_sentences(used), *remarks]
    sentences = [*run.messages, *own]
    table, files = on_root(
        comm, lambda: _write_results(found, used, sentences, folder, scene, searched)
    )
    tell(
        options,
        comm,
        lambda: "\n".join(
            [
                tables.frame_table(table),
                "",
                *(f"{text}\n" for text in tables.message_lists(sentences, "report_scatter.html")),
                f"written: {', '.join(map(str, files))}",
            ]
        ),
    )


def _write_results(
    found: Any,
    used: Any,
    sentences: list[str],
    folder: Path,
    scene: Scene,
    searched: float | None,
) -> tuple[Any, list[Path]]:
    """The table as text, and the files of the folder.

    Args:
        searched: best load of the tuned wheel by the run's search [N]; None without one.
    """
    from ..report.scatter_pictures import scatter_drawings
    from ..report.scatter_sentences import scatter_headlines, use_headlines
    from ..report.scatter_tables import (
        optimum_is_known,
        optimum_table,
        scatter_table,
        shown_wheels,
        use_table,
        wheel_table,
    )
    from ..report.tables import readable_texts, write_tables
    from ..report.write import Page, write_report

    parts = {
        "wheel/scatter": scatter_table(found),
    }
    if optimum_is_known(found):
        parts["wheel/scatter_optima"] = optimum_table(found, searched)
    if used:
        parts["wheel/scatter_utilisation"] = use_table(used)
    files = []
    for name, table in parts.items():
        stem = name.split("/")[1]
        write_tables(table, folder / stem, stem)
        files.append(folder / f"{stem}.csv")
    seed = scene.mistuning.seed
    write_tables(wheel_table(found, seed), folder / "scatter_wheels", "scatter_wheels")
    files.append(folder / "scatter_wheels.csv")
    if len(shown := shown_wheels(found, seed)):
        parts["wheel/scatter_wheels"] = shown
    figures = {}
    for name, draw in scatter_drawings(found, searched).items():
        figures[name] = folder / f"{name.split('/')[1]}.png"
        draw(figures[name])
    numbers = [*scatter_headlines(found, searched), *use_headlines(used)]
    page = Page(numbers=numbers, stem="report_scatter")
    pages = write_report(folder, scene, parts, figures, sentences, page=page)
    return readable_texts(parts["wheel/scatter"]), [*files, *figures.values(), *pages]
