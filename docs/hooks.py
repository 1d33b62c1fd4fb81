"""Formulas of the pages as MathML, which browsers set without a script: $...$ and $$...$$."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

# code, which keeps its dollar signs
CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
DISPLAY = re.compile(r"\$\$(.+?)\$\$", re.DOTALL)
INLINE = re.compile(r"(?<![\\$\w])\$([^$\n]+?)\$(?![\w$])")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page before it becomes HTML."""
    parts = CODE.split(markdown)
    return "".join(part if number % 2 else with_formulas(part) for number, part in enumerate(parts))


def with_formulas(text: str) -> str:
    """Formulas of a text without code as MathML."""
    text = DISPLAY.sub(
        lambda found: f"\n<p>{convert(found[1].strip(), display='block')}</p>\n", text
    )
    # Markdown takes a line that begins with another element for a paragraph of its own
    return INLINE.sub(lambda found: f"<span>{convert(found[1])}</span>", text)
