"""The chart of speed against accuracy as files: two tables, one picture, and the remarks."""

from __future__ import annotations

from pathlib import Path

from ..store import write_table, write_text
from ..study.chart import Chart
from ..view.chart import draw_chart

__all__ = ["write_chart"]


def write_chart(chart: Chart, folder: str | Path, accuracy: float, title: str = "") -> list[Path]:
    """Write chart_methods.csv, chart_models.csv, chart.png and chart.txt; returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"chart{end}" for end in ("_methods.csv", "_models.csv", ".png", ".txt")]
    for file, table in zip(files, (chart.methods, chart.models), strict=False):
        write_table(file, table, {"time": "s"})
    draw_chart(chart.methods, chart.models, files[2], tolerance=accuracy, title=title)
    write_text(files[3], "\n".join(chart.remarks) + "\n")
    return files
