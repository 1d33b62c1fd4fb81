"""Several files of one model: nodes and cells side by side, groups of one name joined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bladefem.errors import InputError

from .mesh import padded_numbers
from .raw_mesh import RawMesh, read_raw
from .topology import DIMENSION, FAMILY


def split_entry(entry: str) -> tuple[str, str]:
    """Body ("" when left out) and path of an entry "damper = damper.inp" of imported.more."""
    body, equals, path = entry.partition("=")
    if not equals:
        return "", entry.strip()
    if not body.strip() or not path.strip():
        raise InputError(f'imported.more = {entry!r}: expected "path" or "damper = path"')
    return body.strip(), path.strip()


def joined_files(first: RawMesh, more: Iterable[str], names: Iterable[str] = ()) -> RawMesh:
    """One model of a file and the entries of imported.more.

    Args:
        names: wanted ones, of which numbered faces become surfaces: "face_3" of the first file,
            "damper.face_3" of the one whose body, or stem where it has none, is damper. Each file
            is numbered alone, as `bladefem look` shows it.

    Raises:
        InputError: an entry or a file that cannot be read.
    """
    # scenes are read without SciPy, and split their entries here
    from .numbered_faces import with_numbered_faces

    names = list(names)
    model = with_numbered_faces(first, names)
    for entry in more:
        body, path = split_entry(entry)
        raw = read_raw(Path(path))
        raw = with_numbered_faces(raw, names, f"{body or Path(path).stem}.")
        model = _join_meshes(model, _as_body(raw, body) if body else raw)
    return model


def _as_body(raw: RawMesh, body: str) -> RawMesh:
    """All cells of the highest dimension as one group."""
    top = max((DIMENSION[FAMILY[word]] for word, _ in raw.blocks if word in FAMILY), default=0)
    every = [
        (b, np.arange(len(cells)))
        for b, (word, cells) in enumerate(raw.blocks)
        if word in FAMILY and DIMENSION[FAMILY[word]] == top
    ]
    return replace(raw, groups={**raw.groups, body: every})


def _join_meshes(one: RawMesh, other: RawMesh) -> RawMesh:
    """Nodes and cells of both; nothing is merged, bodies stay apart. Numbers of nodes are those of
    the first.
    """
    nodes = len(one.points)
    count = len(one.blocks)
    groups = {name: list(parts) for name, parts in one.groups.items()}
    for name, parts in other.groups.items():
        groups.setdefault(name, []).extend((b + count, rows) for b, rows in parts)
    sets = dict(one.node_sets)
    for name, members in other.node_sets.items():
        sets[name] = np.concatenate([sets.get(name, np.empty(0, dtype=int)), members + nodes])
    surfaces = {name: list(parts) for name, parts in one.surfaces.items()}
    for name, facets in other.surfaces.items():
        surfaces.setdefault(name, []).extend(part + nodes for part in facets)
    return RawMesh(
        np.vstack([one.points, other.points]),
        [*one.blocks, *((word, cells + nodes) for word, cells in other.blocks)],
        groups,
        sets,
        surfaces,
        (*one.notes, *other.notes),
        padded_numbers(one.numbers, nodes + len(other.points)),
    )
