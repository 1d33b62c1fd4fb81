"""What can go wrong, in two kinds: the input is wrong (exit code 2), or no solution was found (exit
code 1).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class InputError(ValueError):
    """The input is wrong. The message is one sentence: field, value, what was expected."""


class UnwritableError(InputError):
    """A file cannot be written, as on a full disk. What was finished before is good."""


class StageMissingError(InputError, AttributeError):
    """A result was asked for that the run did not come to."""


class NotSolvedError(RuntimeError):
    """The input was right and no acceptable solution was found. The message says which loop stopped
    and why.
    """


class IndefiniteError(NotSolvedError):
    """A stiffness that should be positive definite is not."""


def missing_file(path: str | Path) -> str:
    """The tail of an error message for a path that is no file."""
    return "a folder, expected a file" if Path(path).is_dir() else "there is no such file"


def suggestion(word: str, known: Iterable[str]) -> str:
    """The tail of an error message: "; did you mean 'twist'?", or the known words when none is
    close.

    >>> suggestion("twsit", ["twist", "span"]), suggestion("clamp", [])
    ("; did you mean 'twist'?", '; there are none')
    """
    known = sorted(known)
    if not known:
        return "; there are none"
    close = close_word(word, known)
    return f"; did you mean '{close}'?" if close else f"; known are {', '.join(known)}"


def close_word(word: str, known: Iterable[str]) -> str:
    """The known word that is nearest to one, however its letters are cased; "" when none is close.

    >>> close_word("ROOT", ["root", "tip"]), close_word("Root", ["root", "ROOT_2"])
    ('root', 'root')
    """
    words = list(known)
    same = [other for other in words if other.lower() == word.lower()]
    return next(iter([*same, *difflib.get_close_matches(word, words, n=1, cutoff=0.6)]), "")
