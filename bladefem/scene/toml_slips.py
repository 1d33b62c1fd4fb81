"""What was most likely meant by a line that is no TOML: a value without quotes, a decimal comma,
quotation marks of a word processor.
"""

from __future__ import annotations

import re
from pathlib import Path

from .units import THOUSANDS, meant_by_comma, shortened

_PLACE = re.compile(r"at line (\d+), column \d+")
_BARE = re.compile(r"\s*[\w.]+\s*=\s*(?P<value>[+-]?[\d.]+(?P<comma>,\d+)?[^#\[\]\"']*?)\s*(#.*)?")
_NUMBER = re.compile(r"[+-]?\d+(\.\d+)?")
_WITH_UNIT = re.compile(_NUMBER.pattern + r"\s*[^\d\s.,].*")
_BARE_LIST = re.compile(r"=\s*\[[^\"']*\d\s*[A-Za-z%]+[^\"']*$")
_CURLED = "\u201c\u201d\u201e\u201f\u2018\u2019\u00ab\u00bb"


def slip_of_pen(path: Path, error: ValueError) -> str:
    """The end of a message: the line of the error and how it is meant to be written; nothing where
    that is not known.

    Args:
        path: scene file, which could be read.
        error: of the parser, which names the line.
    """
    place = _PLACE.search(str(error))
    if place is None:
        return ""
    lines = path.read_text(encoding="utf-8-sig").split("\n")
    number = int(place[1])
    if number > len(lines):
        return ""
    line = lines[number - 1]
    if any(letter in line for letter in _CURLED):
        return f'; {shortened(line.strip())}: expected straight quotation marks, "..."'
    if _BARE_LIST.search(line):
        return f"; {shortened(line.strip())}: each value with a unit is written in quotes"
    bare = _BARE.fullmatch(line.rstrip("\r"))
    if bare is None:
        return ""
    value = bare["value"]
    here = shortened(line.strip())
    if bare["comma"]:
        point = value.replace(",", ".")
        meant = meant_by_comma(value, "" if _NUMBER.fullmatch(point) else '"')
        if THOUSANDS in meant:
            return f"; {here}: {meant.removeprefix('; ')}"
        if _NUMBER.fullmatch(point):
            return f"; {here}: decimals have a point, {point}"
        value = point
    # TOML wants a digit before the point
    value = re.sub(r"^([+-]?)\.", r"\g<1>0.", value)
    if _NUMBER.fullmatch(value):
        return f"; {here}: expected {value}"
    if not _WITH_UNIT.fullmatch(value):
        return ""
    return f'; {here}: a value with a unit is written in quotes, "{value}"'
