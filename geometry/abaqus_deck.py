"""Text of Abaqus and CalculiX decks as keyword blocks: comments, continued lines, *INCLUDE, byte
order marks and blanks are dealt with here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from bladefem.errors import InputError

# also where it goes on after a comma
INCLUDE_LINE = re.compile(r"^\s*\*\s*include\b[^*]*?\binput\s*=([^,\n]*)", re.I | re.M)
# files inside files; more is a circle
MAX_INCLUDE_DEPTH = 20


@dataclass
class Keyword:
    """One keyword with its parameters and data lines."""

    # upper case, without the star
    name: str
    # upper-case names -> values as written
    options: dict[str, str]
    file: Path
    # line number of the keyword
    line: int
    # (line number, comma-separated fields)
    data: list[tuple[int, list[str]]] = field(default_factory=list)


def deck_error(
    file: Path,
    line: int,
    what: str,
) -> InputError:
    """One sentence that says where."""
    return InputError(f"imported.file = '{file}', line {line}: {what}")


def keywords_of(file: Path, depth: int = 0) -> Iterator[Keyword]:
    """All keywords of a deck in their order, included files in their place.

    Raises:
        InputError: an included file that is not there or includes itself.
    """
    current: Keyword | None = None
    head = ""
    head_line = 0
    for number, raw in enumerate(_read_text(file).splitlines(), 1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if head or line.startswith("*"):
            head_line = head_line if head else number
            head += line
            # a keyword line that ends with a comma goes on
            if line.endswith(","):
                continue
            if current is not None:
                yield current
            current = _parse_keyword(head, file, head_line)
            head = ""
            if current.name == "INCLUDE":
                yield from _included_keywords(current, depth)
                current = None
        elif current is not None:
            current.data.append((number, [part.strip() for part in line.split(",")]))
    if current is not None:
        yield current


def included_files(file: Path, depth: int = 0) -> list[Path]:
    """The files that a deck includes, and those that these do, as far as they are there."""
    if depth >= MAX_INCLUDE_DEPTH:
        return []
    found = []
    for name in _included_names(file, file.stat().st_mtime_ns):
        inner = file.parent / name
        if name and inner.is_file():
            found += [inner, *included_files(inner, depth + 1)]
    return found


@lru_cache(maxsize=64)
def _included_names(file: Path, changed: int) -> tuple[str, ...]:
    """What the *INCLUDE lines of a deck name, read once for each time of its change."""
    return tuple(name.strip().strip("\"'") for name in INCLUDE_LINE.findall(_read_text(file)))


def _read_text(file: Path) -> str:
    """Text of a file in whatever encoding it was written."""
    raw = file.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16", errors="replace")
    return raw.decode("utf-8-sig", errors="replace")


def _parse_keyword(
    head: str,
    file: Path,
    line: int,
) -> Keyword:
    """Parse "*ELEMENT, TYPE=C3D10, ELSET="a b"" into a Keyword."""
    first, *parts = [part.strip() for part in head.lstrip("*").split(",")]
    options = {}
    for part in parts:
        name, _, value = part.partition("=")
        options["".join(name.split()).upper()] = value.strip().strip("\"'")
    return Keyword(" ".join(first.upper().split()), options, file, line)


def _included_keywords(keyword: Keyword, depth: int) -> Iterator[Keyword]:
    name = keyword.options.get("INPUT", "")
    found = keyword.file.parent / name
    if not name or not found.is_file():
        raise deck_error(
            keyword.file, keyword.line, f"*INCLUDE, INPUT={name}: there is no such file"
        )
    if depth >= MAX_INCLUDE_DEPTH:
        raise deck_error(keyword.file, keyword.line, "*INCLUDE goes in circles")
    yield from keywords_of(found, depth + 1)
