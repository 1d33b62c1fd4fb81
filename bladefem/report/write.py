"""The report of a command: one self-contained HTML page and the same in Markdown, answer first."""

from __future__ import annotations

import base64
import hashlib
import json
import mimetypes
import os
import re
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from importlib import resources
from itertools import count
from pathlib import Path
from typing import Any

import pandas as pd

from bladefem.errors import InputError
from bladefem.io.run_folder import given_fields
from bladefem.io.stage_cache import library_versions, open_folder, write_text
from bladefem.scene.fields import value_at
from bladefem.scene.kinds import kind_named
from bladefem.scene.tables import Scene
from bladefem.scene.toml import Row, dump_scene, resolved_rows
from bladefem.util.message import Message, by_level

from .captions import caption_of
from .headlines import Headline, headlines
from .library import chart_library
from .next_steps import next_steps
from .page_tables import page_tables
from .statements import assumed_stiffness, reliability, response_answer, wrong_speed
from .tables import numeric_columns, readable_texts, to_markdown

SECTIONS = {
    "answer": "Answer",
    "response": "Forced response",
    "wheel": "Mistuned wheel",
    "contact": "Contact",
    "modes": "Modes",
    "mesh": "Mesh",
    "accuracy": "Accuracy and method",
    "inputs": "Inputs",
    "timings": "Where the time went",
    "versions": "Origin",
}
# rows of a table on the page; the CSV files hold all
MAX_PAGE_ROWS = 40
# width over height from which a picture takes the whole width of the page, to be read
BROAD_PICTURE = 1.7
# figures that answer most, the best first; the page begins with the first one there is
LEAD_FIGURES = (
    "response/forced_response",
    "response/side_by_side",
    "response/study_map",
    "response/study_band",
    "response/accuracy",
    "response/loops",
    "contact/pressure_on_both_seats",
    "contact/pressure",
    "modes/mode_shapes",
    "modes/modes",
)


@dataclass(frozen=True)
class Page:
    """What a command adds to its report besides tables and pictures."""

    # caption-less figures of plotly.js or shapes, by the name of the picture that they replace
    live: Mapping[str, dict[str, Any]] | None = None
    # first numbers where these do not follow from "response/summary"
    numbers: Sequence[Headline] | None = None
    # what to do next, in addition
    steps: Sequence[str] = ()
    # the file's name without ending
    stem: str = "report"
    # what the page is about; the scene's kind when left out
    subject: str = ""
    # numbers after the first ones
    more: Sequence[Headline] = ()
    # fields and whole tables among the inputs that the results depend on; all when left out, none
    # where the results are of no scene
    inputs: Collection[str] | None = None


def write_report(
    folder: str | Path,
    scene: Scene,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, str | Path],
    messages: Iterable[str] = (),
    timings: Mapping[str, float] | None = None,
    given: Iterable[str] | None = None,
    page: Page | None = None,
) -> tuple[Path, Path]:
    """Write ``report.html`` (images embedded, printable) and ``report.md`` (images linked).

    Args:
        folder: run folder.
        scene: as resolved.
        tables: "section/name" -> table in SI columns; sections are the keys of ``SECTIONS``. Two
            are also read for the answer and the statements on convergence: "response/summary" (one
            row a load) and "response/points" (one row a point; not printed itself).
        figures: "section/name" -> PNG or GIF file.
        messages: sentences of the run; those with a level (``util.message``) are kept apart.
        timings: stage -> seconds.
        given: dotted names of the scene's fields that the user gave; as the folder knows them when
            left out.
        page: interactive figures, numbers and name of the page.

    Returns:
        the two files.

    Raises:
        InputError: an unknown section, a missing figure, or a folder that cannot be written.
    """
    import jinja2

    page = page or Page()
    check_names(tables, figures)
    folder = open_folder(folder)
    given = given_fields(folder) if given is None else given
    found = page_contents(scene, tables, figures, list(messages), dict(timings or {}), given, page)
    loader = jinja2.PackageLoader("bladefem.report", "")
    html = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    html.filters["embed"] = data_uri
    plain = jinja2.Environment(
        loader=loader, autoescape=False, trim_blocks=True, lstrip_blocks=True
    )
    plain.filters["link"] = lambda file: os.path.relpath(file, folder)
    plain.filters["markdown"] = to_markdown
    return (
        write_text(folder / f"{page.stem}.html", html.get_template("page.html").render(found)),
        write_text(folder / f"{page.stem}.md", plain.get_template("page.md").render(found)),
    )


def check_names(tables: Mapping[str, Any], figures: Mapping[str, str | Path]) -> None:
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


def page_contents(
    scene: Scene,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, str | Path],
    messages: list[str],
    timings: dict[str, float],
    given: Iterable[str] | None,
    page: Page,
) -> dict[str, Any]:
    """Everything that the two templates print."""
    statements, shown = _shown_tables(tables)
    said = {
        level: [_typeset_message(one) for one in those]
        for level, those in by_level(messages).items()
    }
    total = sum(timings.values())
    live = {name: spec for name, spec in (page.live or {}).items() if name in figures}
    keys = {name: f"live-{number}" for number, name in enumerate(live, 1)}
    lead = next(
        (name for known in LEAD_FIGURES for name in figures if name.startswith(known)), None
    )
    numbers = count(1)
    caption = partial(caption_of, of_wheel=_has_wheel(scene))
    parts = {
        "lead": None if lead is None else _figure(lead, figures[lead], numbers, keys, caption),
        "title": scene.title,
        "subject": page.subject or scene.kind,
        "date": datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        "inputs_hash": inputs_hash(scene) if page.inputs is None or page.inputs else "",
        "inputs": _relevant(resolved_rows(scene, given), page.inputs),
        "mark": "changed" if given is None else "given",
        "statements": statements,
        "warnings": said["warning"],
        "information": said["information"],
        "methods": said["method"],
        "remarks": said["timing"],
        "versions": library_versions(),
        "timings": [(name, t, t / total if total else 0.0) for name, t in timings.items()],
        "total": total,
        "live_data": {keys[name]: _script_data(spec) for name, spec in live.items()},
        "library": chart_library() if live else None,
        "style": _resource("page.css"),
        "script": _resource("page.js"),
        **_answer(scene, tables, page),
    }
    rest = {name: file for name, file in figures.items() if name != lead}
    parts["sections"] = _sections(parts, shown, rest, numbers, keys, caption)
    return parts


def _has_wheel(scene: Scene) -> bool:
    """The scene's blade is a sector of a wheel."""
    sectors = kind_named(scene.kind).sectors
    return sectors is not None and value_at(scene, sectors) > 0


def _typeset(sentence: str) -> str:
    """A sentence as terminals of any encoding print it, with the signs of the page's tables.

    >>> _typeset("it keeps between 140 and 142 um, and walks 3.5 um/s")
    'it keeps between 140 and 142 µm, and walks 3.5 µm/s'
    """
    return re.sub(r"(?<=\d )um\b", "µm", sentence)


def _typeset_message(message: Message) -> Message:
    text, advice, detail = map(_typeset, message.parts)
    return Message(text, message.level, advice, detail)


def _shown_tables(
    tables: Mapping[str, pd.DataFrame],
) -> tuple[list[str], dict[str, pd.DataFrame]]:
    """Statements on convergence, and the tables that are printed."""
    statements, doubtful = reliability(tables.get("response/points"))
    shown = {name: table for name, table in tables.items() if name != "response/points"}
    if len(doubtful):
        shown["accuracy/loads_with_doubtful_points"] = doubtful
    return statements, shown


def _answer(
    scene: Scene,
    tables: Mapping[str, pd.DataFrame],
    page: Page,
) -> dict[str, Any]:
    """First numbers, and what to do next."""
    summary = tables.get("response/summary")
    points = tables.get("response/points")
    if page.numbers is not None or summary is None or "peak_amplitude" not in summary:
        return {"numbers": list(page.numbers or ()), "steps": list(page.steps)}
    own = tables.get("contact/own_load")
    searched = tables.get("response/best_load")
    masses = tables.get("contact/damper_mass")
    found = response_answer(summary, points, own, masses, searched)
    cautions = [
        *assumed_stiffness(scene, tables.get("contact/pressure")),
        *wrong_speed(scene, summary),
        *found.cautions,
    ]
    steps = next_steps(scene, cautions, summary, own, masses, searched)
    numbers = [*headlines(found, summary, points, searched), *page.more]
    return {"numbers": numbers, "steps": [_typeset(text) for text in (*steps, *page.steps)]}


def _sections(
    parts: Mapping[str, Any],
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, str | Path],
    numbers: Iterator[int],
    keys: Mapping[str, str],
    caption: Callable[[str], str],
) -> list[dict[str, Any]]:
    """Sections that have something to say, with numbered figures and tables.

    Args:
        caption: of "section/name".
    """
    table_numbers = count(1)
    extra = {
        "answer": any(
            parts[key] for key in ("numbers", "lead", "steps", "warnings", "information")
        ),
        "inputs": parts["inputs"],
        "accuracy": parts["statements"] or parts["methods"],
        "timings": parts["timings"],
        "versions": parts["versions"],
    }
    found = []
    for key, title in SECTIONS.items():
        section = {
            "key": key,
            "title": title,
            "figures": [
                _figure(name, file, numbers, keys, caption)
                for name, file in figures.items()
                if name.split("/")[0] == key
            ],
            "tables": [
                page_table(part, piece, next(table_numbers), caption)
                for name, table in tables.items()
                if name.split("/")[0] == key
                for part, piece in page_tables(name, table)
            ],
        }
        if section["figures"] or section["tables"] or extra.get(key):
            found.append(section)
    return found


def _figure(
    name: str,
    file: str | Path,
    numbers: Iterator[int],
    keys: Mapping[str, str],
    caption: Callable[[str], str],
) -> dict[str, Any]:
    return {
        "number": next(numbers),
        "caption": caption(name),
        "file": Path(file),
        "live": keys.get(name),
        "broad": name not in keys and _width_over_height(Path(file)) > BROAD_PICTURE,
    }


def _width_over_height(file: Path) -> float:
    """Width over height of a PNG file; 1 of others."""
    head = file.read_bytes()[:24]
    if not head.startswith(b"\x89PNG"):
        return 1.0
    width, height = struct.unpack(">II", head[16:24])
    return float(width / height)


def page_table(
    name: str,
    table: pd.DataFrame,
    number: int,
    caption: Callable[[str], str],
) -> dict[str, Any]:
    """A table as text, cut to the longest that a page should hold."""
    text = readable_texts(table.head(MAX_PAGE_ROWS))
    return {
        "number": number,
        "caption": caption(name),
        "frame": table.head(MAX_PAGE_ROWS),
        "head": list(text.columns),
        "right": numeric_columns(text),
        "rows": text.to_numpy().tolist(),
        "left_out": max(len(table) - MAX_PAGE_ROWS, 0),
        "columns_left_out": table.attrs.get("left_out", []),
    }


def _relevant(rows: list[Row], inputs: Collection[str] | None) -> list[Row]:
    """The rows that are named, themselves or by their table."""
    if inputs is None:
        return rows
    return [row for row in rows if any(f"{row.name}.".startswith(f"{name}.") for name in inputs)]


def inputs_hash(scene: Scene) -> str:
    """The first 16 hexadecimal digits of the SHA-256 sum of the resolved scene and of the file that
    it reads.
    """
    digest = hashlib.sha256(dump_scene(scene).encode())
    for file in kind_named(scene.kind).files(scene):
        if file.is_file():
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def data_uri(file: Path) -> str:
    """A file as a data URI."""
    kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(file.read_bytes()).decode()}"


def _script_data(spec: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element that holds it."""
    return json.dumps(spec, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _resource(name: str) -> str:
    return (resources.files("bladefem.report") / name).read_text(encoding="utf-8")
