"""The chart of speed against accuracy as files: tables, one picture, and the remarks."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from ..io.stage_cache import write_table, write_text
from ..scene.tables import Scene
from ..study.chart.chart import Chart
from ..util.message import Message, method
from ..util.percent import percent
from ..view.chart import draw_chart, draw_errors
from .headlines import Headline
from .write import Page, write_report


def write_chart(
    chart: Chart,
    folder: str | Path,
    accuracy: float,
    title: str = "",
    scene: Scene | None = None,
) -> list[Path]:
    """Write chart.png, chart_errors.png, chart.txt, one CSV a table (methods, models, meshes) and,
    for a scene, ``report_chart.html`` and ``.md``; returns the files.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    tables = {
        name: table
        for name in ("methods", "models", "meshes")
        if (table := getattr(chart, name)) is not None and len(table)
    }
    files = [
        write_table(folder / f"chart_{name}.csv", table, {"time": "s"})
        for name, table in tables.items()
    ]
    pictures = [folder / "chart.png", folder / "chart_errors.png"]
    for picture, draw in zip(pictures, (draw_chart, draw_errors), strict=True):
        draw(tables, picture, tolerance=accuracy, title=title)
    files += [*pictures, write_text(folder / "chart.txt", "\n".join(chart.remarks) + "\n")]
    if scene is not None:
        files += _report(chart, scene, tables, pictures, folder)
    return files


def _report(
    chart: Chart,
    scene: Scene,
    tables: dict[str, pd.DataFrame],
    pictures: list[Path],
    folder: Path,
) -> tuple[Path, Path]:
    """The automatic choice first, then all methods and models."""
    chosen = [table[table["chosen"].astype(bool)] for table in tables.values() if "chosen" in table]
    rows = [row for table in chosen for _, row in table.iterrows()]
    numbers = [
        Headline(
            "automatic choice",
            f"{percent(row['error'])} error",
            f"wanted {percent(scene.accuracy)}",
            f"{row['name']}, {row['time']:.3g} s",
        )
        for row in rows[:1]
    ]
    names = ("response/accuracy_of_methods_and_models", "response/errors_of_each")
    return write_report(
        folder,
        scene,
        {f"accuracy/{name}": table for name, table in tables.items()},
        dict(zip(names, pictures, strict=True)),
        (text if isinstance(text, Message) else method(text) for text in chart.remarks),
        page=Page(
            numbers=numbers,
            stem="report_chart",
            subject=f"{scene.kind}, speed against accuracy",
        ),
    )
