"""Names that a user gives to the groups of a file which has others: "clamp = face_3 + face_4"."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeVar

from bladefem.errors import InputError, suggestion

__all__ = ["read_names", "renamed"]

Part = TypeVar("Part")


def read_names(texts: Iterable[str]) -> dict[str, list[str]]:
    """New name to the old ones that it stands for.

    Raises:
        InputError: not "new = old" or "new = old + old".
    """
    wanted = {}
    for text in texts:
        new, equals, olds = (part.strip() for part in text.partition("="))
        parts = [old.strip() for old in olds.split("+")]
        if not (new and equals and all(parts)):
            raise InputError(
                f'imported.names = {text!r}: expected "new = old", such as "clamp = face_3 + '
                'face_4"'
            )
        wanted[new] = parts
    return wanted


def renamed(
    groups: Mapping[str, list[Part]], wanted: Mapping[str, list[str]]
) -> dict[str, list[Part]]:
    """Groups under their new names, several joined to one; the others keep theirs.

    Raises:
        InputError: an old name that is not there.
    """
    known = {name.lower(): name for name in groups}
    for olds in wanted.values():
        for old in olds:
            if old.lower() not in known:
                raise InputError(
                    f"imported.names: the file has no group '{old}'{suggestion(old, groups)}"
                )
    taken = {known[old.lower()] for olds in wanted.values() for old in olds}
    joined = {
        new: [part for old in olds for part in groups[known[old.lower()]]]
        for new, olds in wanted.items()
    }
    return {name: list(parts) for name, parts in groups.items() if name not in taken} | joined
