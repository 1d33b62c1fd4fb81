"""The lines of CSV files that other programs write: a byte order mark is no part of the first name,
and what a spreadsheet makes of them in some countries is refused in one sentence.
"""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError


def csv_lines(path: str | Path, where: str) -> list[str]:
    """The lines of a file of cells with commas between them; "#" starts a comment.

    Args:
        where: of an error message, such as "--measured readings.csv".

    Raises:
        InputError: it is no text in UTF-8, or has semicolons between its cells.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{where}: cannot be read as a CSV file in UTF-8 ({error})") from None
    lines = [line.split("#")[0].strip() for line in text.splitlines()]
    if any(";" in line for line in lines):
        raise InputError(
            f"{where}: it has semicolons between its cells, expected commas, and points in decimals"
        )
    return lines
