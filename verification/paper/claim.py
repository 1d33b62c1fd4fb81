"""What a page of claims is made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Claim:
    """One row of the page."""

    # figure or equation of the paper
    where: str
    # what the paper says
    claim: str
    # what is found here
    ours: str
    # "holds", "holds in part", "fails"
    verdict: str
    # files next to the page
    pictures: tuple[str, ...] = ()
    # of the pictures
    caption: str = ""


@dataclass(frozen=True)
class Chapter:
    """Claims that belong together; they are computed, and pictures drawn into a folder, when asked
    for.
    """

    title: str
    text: str
    parts: tuple[Callable[[Path], Iterator[Claim]], ...]


def verdict(whole: bool, part: bool = False) -> str:
    """The word for a claim that numbers bear out as a whole, in part, or not."""
    return "holds" if whole else "holds in part" if part else "fails"
