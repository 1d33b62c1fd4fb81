"""The chart of speed against accuracy as files: tables, one picture, and the remarks."""

from __future__ import annotations

from pathlib import Path

from ..store import write_table, write_text
from ..study.chart import Chart
from ..view.chart import draw_chart

__all__ = ["write_chart"]


def write_chart(chart: Chart, folder: str | Path, accuracy: float, title: str = "") -> list[Path]:
    """Write chart.png, chart.txt and one CSV a table (methods, models, meshes); returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    tables = {name: table for name in ("methods", "models", "meshes")
              if (table := getattr(chart, name)) is not None and len(table)}
    files = [write_table(folder / f"chart_{name}.csv", table, {"time": "s"}) for name, table in tables.items()]
    picture = folder / "chart.png"
    draw_chart(tables, picture, tolerance=accuracy, title=title)
    return [*files, picture, write_text(folder / "chart.txt", "\n".join(chart.remarks) + "\n")]
