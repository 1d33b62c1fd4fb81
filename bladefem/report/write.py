"""The report of a run: one self-contained HTML page and the same in Markdown, answer first."""

from __future__ import annotations

import base64
import mimetypes
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from bladefem.errors import InputError
from bladefem.io.stage_cache import open_folder, versions, write_text
from bladefem.scene.tables import Scene
from bladefem.scene.toml import resolved

from .statements import answer, trust, wrong_speed
from .tables import numeric, readable, to_markdown

__all__ = ["SECTIONS", "write_report"]

SECTIONS = {
    "answer": "Answer",
    "inputs": "Inputs",
    "mesh": "Mesh",
    "modes": "Modes",
    "contact": "Contact",
    "response": "Forced response",
    "wheel": "Mistuned wheel",
    "accuracy": "Accuracy and convergence",
    "timings": "Where the time went",
    "versions": "Versions",
}
# rows of a table on the page; the CSV files hold all
LONGEST = 40


def write_report(
    folder: str | Path,
    scene: Scene,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, str | Path],
    messages: Iterable[str] = (),
    timings: Mapping[str, float] | None = None,
    given: Iterable[str] | None = None,
) -> tuple[Path, Path]:
    """Write ``report.html`` (images embedded, printable) and ``report.md`` (images linked).

    Args:
        folder: run folder.
        scene: as resolved.
        tables: "section/caption" -> table in SI columns; sections are the keys of ``SECTIONS``. Two
            are also read for the answer and the statements on convergence: "response/summary" (one
            row a load) and "response/points" (one row a point; not printed itself).
        figures: "section/caption" -> PNG or GIF file.
        messages: warnings and fallbacks of the run, reported under accuracy.
        timings: stage -> seconds.
        given: dotted names of the scene's fields that the user gave, when known.

    Returns:
        the two files.

    Raises:
        InputError: an unknown section, a missing figure, or a folder that cannot be written.
    """
    import jinja2

    check(tables, figures)
    page = contents(scene, tables, figures, list(messages), dict(timings or {}), given)
    loader = jinja2.PackageLoader("bladefem.report", "")
    html = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    html.filters["embed"] = embed
    plain = jinja2.Environment(
        loader=loader, autoescape=False, trim_blocks=True, lstrip_blocks=True
    )
    folder = open_folder(folder)
    plain.filters["link"] = lambda file: os.path.relpath(file, folder)
    plain.filters["markdown"] = to_markdown
    return (
        write_text(folder / "report.html", html.get_template("page.html").render(page)),
        write_text(folder / "report.md", plain.get_template("page.md").render(page)),
    )


def check(tables: Mapping[str, Any], figures: Mapping[str, str | Path]) -> None:
    """Sections are known, figures are there."""
    for name in (*tables, *figures):
        if name.split("/")[0] not in SECTIONS:
            raise InputError(
                f"report entry '{name}': expected a section of {', '.join(SECTIONS)} before the "
                "slash"
            )
    for name, file in figures.items():
        if not Path(file).is_file():
            raise InputError(f"report figure '{name}': there is no file {file}")


def contents(
    scene: Scene,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, str | Path],
    messages: list[str],
    timings: dict[str, float],
    given: Iterable[str] | None,
) -> dict[str, Any]:
    """Everything that the two templates print."""
    points = tables.get("response/points")
    statements, doubtful = trust(points)
    shown = {name: table for name, table in tables.items() if name != "response/points"}
    if len(doubtful):
        shown["accuracy/loads with doubtful points"] = doubtful
    total = sum(timings.values())
    summary = tables.get("response/summary")
    found = answer(summary, points, tables.get("contact/own_load"))
    found = found._replace(cautions=[*wrong_speed(scene, summary), *found.cautions])
    return {
        "title": scene.title,
        "kind": scene.kind,
        "answer": found,
        "inputs": resolved(scene, given),
        "mark": "changed" if given is None else "given",
        "statements": statements,
        "messages": messages,
        "versions": versions(),
        "timings": [(name, t, t / total if total else 0.0) for name, t in timings.items()],
        "total": total,
        "sections": [section(key, title, shown, figures) for key, title in SECTIONS.items()],
    }


def section(
    key: str,
    title: str,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, str | Path],
) -> dict[str, Any]:
    """One section with its tables and figures, in the order given."""
    return {
        "key": key,
        "title": title,
        "figures": [
            (caption(name), Path(file))
            for name, file in figures.items()
            if name.split("/")[0] == key
        ],
        "tables": [
            printed(caption(name), table)
            for name, table in tables.items()
            if name.split("/")[0] == key
        ],
    }


def caption(name: str) -> str:
    """ "response/optimum_curve" -> "Optimum curve"."""
    text = name.partition("/")[2].replace("_", " ")
    return text[:1].upper() + text[1:]


def printed(title: str, table: pd.DataFrame) -> dict[str, Any]:
    """A table as text, cut to the longest that a page should hold."""
    text = readable(table.head(LONGEST))
    return {
        "title": title,
        "frame": table.head(LONGEST),
        "head": list(text.columns),
        "right": numeric(text),
        "rows": text.to_numpy().tolist(),
        "left_out": max(len(table) - LONGEST, 0),
    }


def embed(file: Path) -> str:
    """A file as a data URI."""
    kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(file.read_bytes()).decode()}"
