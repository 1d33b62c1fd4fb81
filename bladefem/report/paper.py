"""The page "The paper, claim by claim":  python -m bladefem.report.paper [folder]  writes paper.md and paper.html.

Pictures and the method map live in the folder ``paper`` beside the page. About two minutes; the method map itself is
made by benchmarks/paper_maps.py and only read here.
"""

from __future__ import annotations

import html
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from .claims import CHAPTERS, Claim

__all__ = ["as_html", "as_markdown", "main"]

INTRODUCTION = ("Each claim of the paper beside the number found here. Errors are against the exact integration of the "
                "coupled system unless said otherwise. Loads are friction limits of one seat.")


def as_markdown(chapters: Mapping[str, Sequence[Claim]]) -> str:
    """The page as Markdown: a table a chapter, then its pictures."""
    lines = ["# The paper, claim by claim", "", INTRODUCTION, ""]
    for title, claims in chapters.items():
        lines += [f"## {title}", "", "| where | the paper | here | verdict |", "| --- | --- | --- | --- |"]
        lines += [f"| {c.where} | {c.claim} | {c.ours} | **{c.verdict}** |" for c in claims]
        lines += ["", *(f"![{c.where}](paper/{c.picture})" for c in claims if c.picture), ""]
    return "\n".join(lines)


def as_html(chapters: Mapping[str, Sequence[Claim]]) -> str:
    """The same as HTML."""
    style = "body{font-family:sans-serif;max-width:60em;margin:2em auto}td,th{padding:.3em .6em;text-align:left;" \
            "border-bottom:1px solid #ddd;vertical-align:top}img{max-width:100%}"
    parts = [f"<!doctype html><meta charset='utf-8'><title>The paper, claim by claim</title><style>{style}</style>",
             f"<h1>The paper, claim by claim</h1><p>{html.escape(INTRODUCTION)}</p>"]
    for title, claims in chapters.items():
        rows = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in
                                        (c.where, c.claim, c.ours, c.verdict)) + "</tr>" for c in claims)
        parts.append(f"<h2>{html.escape(title)}</h2><table><tr><th>where<th>the paper<th>here<th>verdict</tr>{rows}"
                     "</table>")
        parts += [f"<p><img src='paper/{c.picture}' alt='{html.escape(c.where)}'></p>" for c in claims if c.picture]
    return "\n".join(parts)


def main(folder: Path) -> None:
    """Write paper.md and paper.html into the folder, pictures into its sub-folder ``paper``."""
    pictures = folder / "paper"
    pictures.mkdir(parents=True, exist_ok=True)
    chapters = {title: list(chapter(pictures)) for title, chapter in CHAPTERS.items()}
    (folder / "paper.md").write_text(as_markdown(chapters), encoding="utf-8")
    (folder / "paper.html").write_text(as_html(chapters), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs"))
