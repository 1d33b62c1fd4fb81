"""The chart of speed against accuracy as files: tables, one picture, and the remarks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..io.stage_cache import write_table, write_text
from ..scene.tables import Scene
from ..study.chart.chart import Chart
from ..util.message import Message, method
from ..util.percent import percent
from ..view.chart import draw_chart, draw_errors
from .headlines import NOT_DETERMINED, Headline
from .write import Page, write_report

# tables with a row of the automatic choice, that of the whole model first: methods are compared on
# a simplified one where all of them shall take it
CHOICE_TITLES = {
    "models": "automatic choice, whole model",
    "methods": "its harmonics and samples alone, on the model of the methods",
}


def write_chart(
    chart: Chart,
    folder: str | Path,
    accuracy: float,
    title: str = "",
    scene: Scene | None = None,
) -> list[Path]:
    """Write chart.png, chart_errors.png, chart.txt, one CSV a table (methods, models, meshes), and
    ``report_chart.html`` and ``.md``; returns the files.

    Args:
        scene: what the chart is of; None for the built-in model, which has no fields.
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
    built_in = Scene(title=title, accuracy=accuracy)
    files += _report(chart, scene or built_in, tables, pictures, folder, scene is None)
    return files


def _report(
    chart: Chart,
    scene: Scene,
    tables: dict[str, pd.DataFrame],
    pictures: list[Path],
    folder: Path,
    built_in: bool,
) -> tuple[Path, Path]:
    """The automatic choice first, then all methods and models.

    Args:
        built_in: the scene stands for a model that has no fields.
    """
    numbers = [
        headline
        for name in CHOICE_TITLES
        if name in tables
        for headline in choice_headlines(name, tables[name], scene.accuracy)
    ]
    names = ("response/accuracy_of_methods_and_models", "response/errors_of_each")
    return write_report(
        folder,
        scene,
        # no estimates, as the columns of this name are in other tables
        {
            f"accuracy/{name}": table.rename(columns={"error": "error_to_reference"})
            for name, table in tables.items()
        },
        dict(zip(names, pictures, strict=True)),
        (text if isinstance(text, Message) else method(text) for text in chart.remarks),
        given=() if built_in else None,
        page=Page(
            numbers=numbers,
            stem="report_chart",
            subject=f"{'built-in model' if built_in else scene.kind}, speed against accuracy",
            inputs=() if built_in else None,
        ),
    )


def choice_headlines(name: str, table: pd.DataFrame, accuracy: float) -> list[Headline]:
    """Error and time of the automatic choice in one table.

    Args:
        name: key of ``CHOICE_TITLES``.
        table: of a chart.
        accuracy: wanted.
    """
    return [
        Headline(
            CHOICE_TITLES[name],
            f"{percent(row['error'])} error" if np.isfinite(row["error"]) else NOT_DETERMINED,
            f"against the reference of the {name}, wanted {percent(accuracy)}",
            ", ".join(filter(None, [f"{row['time']:.3g} s a frequency", row["reason"]])),
        )
        for _, row in table[table["chosen"].astype(bool)].iterrows()
    ]
