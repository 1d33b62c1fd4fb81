"""Warnings on loads: those that have one reason are one warning, with what each load adds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from ...util.message import Message, warning

# loads that a sentence names; more are counted, and named in its details
MAX_NAMED = 5


class Reason(NamedTuple):
    """What a warning says of all its loads."""

    # what it means for the user, one sentence with {loads} in it
    text: str
    # what the user can do about it
    advice: str
    # why it is so, for the details
    cause: str = ""


class LoadRemark(NamedTuple):
    """That a reason holds for one load."""

    reason: Reason
    load: str
    # figures of this load, for the details
    detail: str = ""
    # the one figure of it that the sentence itself should have
    figure: str = ""


def load_warnings(remarks: Iterable[LoadRemark | None]) -> list[Message]:
    """One warning a reason, in the order in which they first occur.

    >>> lifted = Reason("contacts lift off under {loads}", "nothing")
    >>> (said,) = load_warnings([LoadRemark(lifted, f"{n} N", f"{n} um") for n in (1, 2)])
    >>> said, said.detail
    ('contacts lift off under 1 N and 2 N', '1 N: 1 um; 2 N: 2 um')
    """
    found: dict[tuple[str, str], list[LoadRemark]] = {}
    for remark in filter(None, remarks):
        found.setdefault((remark.reason.text, remark.reason.advice), []).append(remark)
    return [_warning(*said, those) for said, those in found.items()]


def _warning(text: str, advice: str, remarks: Sequence[LoadRemark]) -> Message:
    named = len(remarks) <= MAX_NAMED
    texts = [r.load + (f" ({r.figure})" if r.figure else "") for r in remarks]
    loads = enumeration(texts) if named else f"{len(remarks)} loads"
    # loads with the same cause have it once
    of_cause: dict[str, list[LoadRemark]] = {}
    for remark in remarks:
        of_cause.setdefault(remark.reason.cause, []).append(remark)
    details = []
    for cause, those in of_cause.items():
        lines = "; ".join(_line(r) for r in those if r.detail or not named or len(of_cause) > 1)
        details += [part for part in (cause, lines) if part]
    return warning(text.format(loads=loads), advice, ". ".join(details))


def _line(remark: LoadRemark) -> str:
    """What the details say of one load."""
    known = remark.detail or remark.figure
    return f"{remark.load}: {known}" if known else remark.load


def enumeration(texts: Sequence[str]) -> str:
    """Texts in one line.

    >>> enumeration(["9 N", "18 N", "36 N"]), enumeration(["9 N"])
    ('9 N, 18 N and 36 N', '9 N')
    """
    return " and ".join(filter(None, [", ".join(texts[:-1]), *texts[-1:]]))
