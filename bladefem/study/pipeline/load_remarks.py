"""Remarks on single loads: those of one kind are one sentence with what each load adds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class LoadRemark(NamedTuple):
    """What is said of one load."""

    # of all loads of its kind
    kind: str
    # of this one
    detail: str


def sentences_of_kinds(remarks: Iterable[LoadRemark | None]) -> list[str]:
    """One sentence a kind, in the order in which they first occur.

    >>> remarks = [LoadRemark("it lifts off", f"under {load} N") for load in (1, 2)]
    >>> sentences_of_kinds([*remarks, None])
    ['it lifts off: under 1 N; under 2 N']
    """
    kinds: dict[str, list[str]] = {}
    for remark in filter(None, remarks):
        kinds.setdefault(remark.kind, []).append(remark.detail)
    return [f"{kind}: {'; '.join(details)}" for kind, details in kinds.items()]
