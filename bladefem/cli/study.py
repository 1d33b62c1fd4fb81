"""The command that varies one field: a response for each value, side by side in one table and one
picture.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..errors import InputError
from . import tables
from .commands import default_folder, given_scene, prepared, tell, until

__all__ = ["study"]


def study(options: argparse.Namespace, comm: Any) -> None:
    """The response for several values of one field, each in its own folder inside the run
    folder.
    """
    from ..io.stage_cache import on_root

    base = Path(options.output or default_folder(options.scene))
    parts = [(value, _one(options, base, name, value)) for name, value in _varied(options.vary)]
    name = options.vary.partition("=")[0].strip()
    # all, before long work
    scenes = on_root(comm, lambda: [given_scene(one, responds=True) for _, one in parts])
    prepared(options, comm)
    count = len(parts)
    done = []
    for i, ((value, one), scene) in enumerate(zip(parts, scenes, strict=True), 1):
        tell(options, comm, lambda text=f"\n{name} = {value} ({i} of {count})": text)
        run = until("response", one, comm)
        tell(options, comm, lambda run=run: tables.responses(run.response), run)
        # not before the first line: it is slow to load
        from ..report.study import Variant, write_study

        done.append(Variant(value, scene, run.response))
        # so that an interruption leaves some
        table, files = on_root(comm, lambda: write_study(name, done, base))
    tell(
        options,
        comm,
        lambda: f"\n{tables.side_by_side(name, table)}\nwritten: {', '.join(map(str, files))}",
    )


def _varied(text: str) -> list[tuple[str, str]]:
    """Name and text of each value; the last unit holds for those without one, as in "30, 40, 50
    deg".

    Raises:
        InputError: no such field, or no values.
    """
    from ..scene.fields import field_at, split_values

    name, equals, values = (part.strip() for part in text.partition("="))
    if equals:
        field_at(name)
    if not equals or not split_values(values):
        raise InputError(
            f"--vary {text}: expected key=values, such as damper.angle='30, 40, 50 deg'"
        )
    return [(name, value) for value in dict.fromkeys(split_values(values))]


def _one(options: argparse.Namespace, base: Path, name: str, value: str) -> argparse.Namespace:
    """The options of one value."""
    one = argparse.Namespace(**vars(options))
    one.overrides = [*options.overrides, f"{name}={value}"]
    one.output = str(base / f"{name}={value}".replace(" ", "").replace("/", "_"))
    return one
