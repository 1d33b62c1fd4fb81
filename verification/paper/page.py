"""The page "The paper, claim by claim":  python -m verification.paper.page [folder]  writes
paper.md and paper.html.

Pictures, claims (claims.json) and the method map live in the folder ``paper`` beside the page.
Thirteen minutes of CPU; titles of chapters after the folder remake those alone. The method map itself
is made by benchmarks/paper_maps.py and only read here. Under mpirun rank 0 does the work alone.
"""

from __future__ import annotations

import html
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from bladefem.errors import InputError, suggestion

from .claim import Chapter, Claim
from .errata import ERRATA

INTRODUCTION = (
    "An effective numerical method for calculating nonlinear dynamics of structures with dry "
    "friction: application to predict the vibration response of blades with underplatform "
    "dampers (Nonlinear Dynamics, doi:10.1007/s11071-016-3239-6). Each figure and claim of that paper beside what is found here, in the paper's "
    "order. The paper gives no dimensions for its blades and no stiffness for its contacts: "
    "shapes and numbers of the blades are this project's, of the mass those of its Table 1. "
    "Errors are against the exact integration of the coupled system unless said otherwise."
)
REMAKE = "python -m verification.paper.page docs"
STYLE = (
    "body{font-family:sans-serif;max-width:64em;margin:2em auto;padding:0 "
    "1em}table{border-collapse:collapse}td,th{padding:.3em .6em;text-align:left;border-bottom:1px "
    "solid #ddd;vertical-align:top}img{max-width:100%}figure{margin:1em "
    "0}figcaption{color:#555}.fails{color:#a00}.holds{color:#060}"
)
Found = Mapping[str, Sequence[Claim]]


def as_markdown(chapters: Sequence[Chapter], found: Found) -> str:
    """The page as Markdown: verdicts at a glance, then a table a chapter and its pictures.

    Args:
        found: claims by the chapter's title.
    """
    lines = [
        "# The paper, claim by claim",
        "",
        INTRODUCTION,
        "",
        f"Made by `{REMAKE}`.",
        "",
        "## At a glance",
        "",
        tally(found),
        "",
        "| chapter | where | the paper says | verdict |",
        "| --- | --- | --- | --- |",
    ]
    lines += [
        f"| {c.title} | {x.where} | {x.claim} | **{x.verdict}** |"
        for c in chapters
        for x in found[c.title]
    ]
    for c in chapters:
        lines += [
            "",
            f"## {c.title}",
            "",
            c.text,
            "",
            "| where | the paper says | found here | verdict |",
            "| --- | --- | --- | --- |",
        ]
        lines += [f"| {x.where} | {x.claim} | {x.ours} | **{x.verdict}** |" for x in found[c.title]]
        for x in found[c.title]:
            lines += [
                line for picture in x.pictures for line in ("", f"![{x.where}](paper/{picture})")
            ]
            lines += ["", f"*{x.where}: {x.caption}*"] if x.pictures else []
    lines += [
        "",
        "## Formulas to correct",
        "",
        "| where | printed | right |",
        "| --- | --- | --- |",
    ]
    lines += [f"| {e.where} | {_cell(e.printed)} | {_cell(e.right)} |" for e in ERRATA]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def as_html(chapters: Sequence[Chapter], found: Found) -> str:
    """The same as HTML."""
    parts = [
        "<!doctype html><meta charset='utf-8'><title>The paper, claim by "
        f"claim</title><style>{STYLE}</style>",
        f"<h1>The paper, claim by claim</h1><p>{html.escape(INTRODUCTION)}</p>",
        f"<p>Made by <code>{REMAKE}</code>.</p>",
        f"<h2>At a glance</h2><p>{html.escape(tally(found))}</p>",
        _table(
            ("chapter", "where", "the paper says", "verdict"),
            [(c.title, x.where, x.claim, x.verdict) for c in chapters for x in found[c.title]],
        ),
    ]
    for c in chapters:
        parts += [
            f"<h2>{html.escape(c.title)}</h2><p>{html.escape(c.text)}</p>",
            _table(
                ("where", "the paper says", "found here", "verdict"),
                [(x.where, x.claim, x.ours, x.verdict) for x in found[c.title]],
            ),
        ]
        parts += [_figure(x) for x in found[c.title] if x.pictures]
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}" for cell in e) + "</tr>" for e in ERRATA
    )
    parts += [
        f"<h2>Formulas to correct</h2><table><tr><th>where<th>printed<th>right</tr>{rows}</table>"
    ]
    return "\n".join(parts) + "\n"


def tally(found: Found) -> str:
    """How many claims hold."""
    counts = Counter(claim.verdict for claims in found.values() for claim in claims)
    return (
        f"{sum(counts.values())} claims: {counts['holds']} hold, {counts['holds in part']} hold in "
        f"part, {counts['fails']} fail."
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    body = "".join(
        "<tr>"
        + "".join(f"<td>{html.escape(cell)}" for cell in row[:-1])
        + f"<td class='{row[-1]}'>{html.escape(row[-1])}</tr>"
        for row in rows
    )
    return "<table><tr>" + "".join(f"<th>{cell}" for cell in head) + f"</tr>{body}</table>"


def _figure(claim: Claim) -> str:
    images = "".join(
        f"<img src='paper/{file}' alt='{html.escape(claim.where)}'>" for file in claim.pictures
    )
    return (
        f"<figure>{images}<figcaption>{html.escape(claim.where)}: "
        f"{html.escape(claim.caption)}</figcaption></figure>"
    )


def main(folder: Path, titles: Sequence[str] = ()) -> None:
    """Write paper.md and paper.html into the folder, pictures into its sub-folder ``paper``.

    Args:
        titles: of the chapters to remake; all when empty.

    Raises:
        InputError: no such chapter, or one that was never made.
    """
    from .claims import CHAPTERS

    pictures = folder / "paper"
    pictures.mkdir(parents=True, exist_ok=True)
    known = [c.title for c in CHAPTERS]
    for title in titles:
        if title not in known:
            raise InputError(f"chapter '{title}' is unknown{suggestion(title, known)}")
    found = _kept(pictures / "claims.json") if titles else {}
    for c in CHAPTERS:
        if c.title in titles or not titles:
            found[c.title] = [claim for part in c.parts for claim in part(pictures)]
        elif c.title not in found:
            raise InputError(
                f"chapter '{c.title}' was never made, expected a run without titles first"
            )
    kept = {title: [asdict(claim) for claim in claims] for title, claims in found.items()}
    (pictures / "claims.json").write_text(
        json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    (folder / "paper.md").write_text(as_markdown(CHAPTERS, found), encoding="utf-8")
    (folder / "paper.html").write_text(as_html(CHAPTERS, found), encoding="utf-8")


def _kept(file: Path) -> dict[str, list[Claim]]:
    """Claims of an earlier run."""
    if not file.is_file():
        return {}
    kept = json.loads(file.read_text(encoding="utf-8"))
    return {
        title: [Claim(**{**c, "pictures": tuple(c["pictures"])}) for c in claims]
        for title, claims in kept.items()
    }


if __name__ == "__main__":
    from mpi4py import MPI

    if MPI.COMM_WORLD.rank == 0:
        try:
            main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs"), sys.argv[2:])
        except InputError as error:
            sys.exit(f"paper: {error}")
