"""The chart of speed against accuracy as files: tables, one picture, and the remarks."""

from __future__ import annotations

from pathlib import Path

from ..io.stage_cache import write_table, write_text
from ..study.chart.chart import Chart
from ..view.chart import draw_chart, draw_errors

__all__ = ["write_chart"]


def write_chart(chart: Chart, folder: str | Path, accuracy: float, title: str = "") -> list[Path]:
    """Write chart.png, chart_errors.png, chart.txt and one CSV a table (methods, models, meshes);
    returns the files.
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
    return [*files, *pictures, write_text(folder / "chart.txt", "\n".join(chart.remarks) + "\n")]
