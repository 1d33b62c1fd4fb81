"""Names that a user gives to the groups of a file which has others: "clamp = face_3 + face_4"."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from bladefem.errors import InputError, suggestion

from .raw_mesh import RawMesh

Part = TypeVar("Part")


def read_names(texts: Iterable[str]) -> dict[str, list[str]]:
    """New name to the old ones that it replaces.

    Raises:
        InputError: not "new = old" or "new = old + old".
    """
    wanted: dict[str, list[str]] = {}
    for text in texts:
        new, equals, olds = (part.strip() for part in text.partition("="))
        parts = [old.strip() for old in olds.split("+")]
        if not (new and equals and all(parts)):
            raise InputError(
                f'imported.names = {text!r}: expected "new = old", such as "clamp = face_3 + '
                'face_4"'
            )
        if new in wanted:
            raise InputError(
                f"imported.names: '{new}' is given twice, expected '{new} = "
                f"{' + '.join(wanted[new] + parts)}' for one group of all"
            )
        wanted[new] = parts
    return wanted


def rename_groups(
    groups: Mapping[str, list[Part]], wanted: Mapping[str, list[str]]
) -> dict[str, list[Part]]:
    """Groups under their new names, several joined to one; the others keep theirs.

    Raises:
        InputError: an old name that is not there.
    """
    _check_names(wanted, groups)
    return _join_parts(groups, wanted)


def renamed_raw(raw: RawMesh, wanted: Mapping[str, list[str]]) -> RawMesh:
    """The same for element groups, node sets and surfaces alike.

    Raises:
        InputError: an old name that is none of them.
    """
    _check_names(wanted, [*raw.groups, *raw.node_sets, *raw.surfaces])
    sets = _join_parts({name: [nodes] for name, nodes in raw.node_sets.items()}, wanted)
    return replace(
        raw,
        groups=_join_parts(raw.groups, wanted),
        node_sets={name: np.unique(np.concatenate(parts)) for name, parts in sets.items()},
        surfaces=_join_parts(raw.surfaces, wanted),
    )


def _check_names(wanted: Mapping[str, list[str]], known: Iterable[str]) -> None:
    names = list(known)
    there = {name.lower() for name in names}
    for olds in wanted.values():
        for old in olds:
            if old.lower() not in there:
                raise InputError(
                    f"imported.names: the file has no group '{old}'{suggestion(old, names)}"
                )


def _join_parts(
    groups: Mapping[str, list[Part]], wanted: Mapping[str, list[str]]
) -> dict[str, list[Part]]:
    """Parts of the old names under the new ones, as far as this kind of group has them."""
    known: dict[str, list[Part]] = {}
    for name, parts in groups.items():
        known.setdefault(name.lower(), []).extend(parts)
    taken = {old.lower() for olds in wanted.values() for old in olds}
    joined = {
        new: [part for old in olds for part in known.get(old.lower(), [])]
        for new, olds in wanted.items()
    }
    kept = {name: list(parts) for name, parts in groups.items() if name.lower() not in taken}
    return kept | {new: parts for new, parts in joined.items() if parts}
