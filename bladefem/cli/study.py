"""The command that varies fields: a response for each value, side by side in one picture.

One field: curves over its values. Two fields: a map. Scattered fields: a band over the loads.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..scene.units import newtons
from ..util.communicator import Communicator
from . import tables
from .commands import given_scene, prepared, run_folder, scene_path, tell

if TYPE_CHECKING:
    from ..report.study import Variant
    from ..study.pipeline.run_records import SolvedRun

# runs of one study
MOST_RUNS = 1000

# The study itself shows what its values do; what else each run depends on costs more than its
# responses. What the user says comes after it.
WITHOUT_INFLUENCES = "study.influences=false"


@dataclass(frozen=True)
class Plan:
    """What is run, and how it is written."""

    # dotted names of the fields
    names: tuple[str, ...]
    # values of all fields, one tuple a run
    runs: list[tuple[str, ...]]
    # (variants, folder) -> (table, files)
    write: Callable[[Sequence[Any], Path], tuple[Any, list[Path]]]
    # of that table, for the terminal
    show: Callable[[Any], str]


def add_study(sub: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    sub.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="field and its values, such as damper.angle='30, 40, 50 deg'; twice for a map of two",
    )
    sub.add_argument(
        "--scatter",
        action="append",
        default=[],
        metavar="KEY=LOW,HIGH",
        help="field and the ends between which it scatters, such as contact.mu='0.2, 0.4'; may be "
        "repeated",
    )
    sub.add_argument("--samples", type=int, default=16, metavar="N", help="runs of a scatter (16)")


def study(options: argparse.Namespace, comm: Communicator | None) -> None:
    """The response for each run of the plan, each in its own folder inside the run folder."""
    from ..io.stage_cache import on_root

    base = run_folder(options)
    plan = _make_plan(options)
    on_root(comm, lambda: _refuse_bladeless(options))
    parts = [_run_options(options, base, plan.names, values) for values in plan.runs]
    # all, before long work
    scenes = on_root(comm, lambda: [given_scene(one, responds=True) for one in parts])
    if options.scatter and any(scene.study.loads is None for scene in scenes):
        raise InputError("study.loads: expected the same loads for all samples of --scatter")
    prepared(options, comm)
    done: list[Any] = []
    table: Any = None
    files: list[Path] = []
    for number, (values, one, scene) in enumerate(zip(plan.runs, parts, scenes, strict=True), 1):
        said = ", ".join(f"{n} = {v}" for n, v in zip(plan.names, values, strict=True))
        place = f"{said} ({number} of {len(parts)})"
        begun = time.perf_counter()
        tell(options, comm, partial(str, f"\n{place}"))
        # files and pipes get their lines while a value is at work
        sys.stdout.flush()
        if done:
            on_root(comm, partial(_borrow_stages, Path(parts[0].output), Path(one.output)))
        run = _solve_variant(one, comm)
        tell(options, comm, partial(tables.response_tables, run.response), run)
        # not before the first line: it is slow to load
        from ..report.study import Variant, warnings_of_variant

        warnings = warnings_of_variant(run.response, run.messages)
        own = run.contact.own if scene.study.own_load else None
        done.append(Variant("; ".join(values), scene, run.response, warnings, own))
        # so that an interruption leaves some
        table, files = on_root(comm, lambda: plan.write(done, base))
        if not sys.stdout.isatty():
            seconds = time.perf_counter() - begun
            tell(options, comm, partial(_finished_line, place, seconds, done[-1]))
        sys.stdout.flush()
    written = ", ".join(map(str, files))
    tell(options, comm, lambda: f"\n{plan.show(table)}\nwritten: {written}")


def _refuse_bladeless(options: argparse.Namespace) -> None:
    """A kind without forced responses, before fields are set that it does not have.

    Raises:
        InputError: the kind, and what it can be used for.
    """
    from ..scene.toml import read_tables
    from ..scene.validate import refuse_bladeless

    refuse_bladeless(str(read_tables(scene_path(options.scene), options.overrides)["kind"]))


def _finished_line(place: str, seconds: float, variant: Variant) -> str:
    """One line a value for logs: the value, the time and the result."""
    from ..report.best_load import error_words
    from ..report.study import study_tables

    best = study_tables([variant])[0].iloc[0]
    return (
        f"finished: {place} in {seconds:.3g} s: {1e6 * best['peak_amplitude']:.4g} um, "
        f"{error_words(best)}, at {best['peak_frequency']:.5g} Hz under {newtons(best['load'], 4)}"
    )


def _solve_variant(options: argparse.Namespace, comm: Communicator | None) -> SolvedRun:
    """The responses of one run of the plan, in its own folder; collective."""
    scene, folder, bars = prepared(options, comm)
    from ..study.pipeline import pipeline

    return pipeline.run(scene, folder, until="response", comm=comm, progress=bars)


def _make_plan(options: argparse.Namespace) -> Plan:
    """What the options ask for.

    Raises:
        InputError: neither or both of --vary and --scatter, or too many of them.
    """
    if bool(options.vary) == bool(options.scatter):
        raise InputError(
            "study: expected --vary KEY=VALUES (once or twice), or --scatter KEY=LOW,HIGH"
        )
    if options.scatter:
        return _scatter_plan(options)
    if len(options.vary) > 2:
        raise InputError("--vary: given three times or more, expected one or two fields")
    fields = [_parse_variation(text) for text in options.vary]
    names = tuple(name for name, _ in fields)
    if len(set(names)) < len(names):
        raise InputError(f"--vary {names[0]}: given twice, expected two fields")
    values = [one for _, one in fields]
    runs = list(product(*values))
    if len(runs) > MOST_RUNS:
        raise InputError(f"--vary: {len(runs)} runs, expected at most {MOST_RUNS}")
    if len(fields) == 1:
        return Plan(names, runs, _write_one(names[0], len(runs)), partial(_value_table, names[0]))
    return Plan(names, runs, _write_map(names, values), partial(_map_table, names, values))


def _scatter_plan(options: argparse.Namespace) -> Plan:
    from ..study.scatter_plan import halton_values, read_ranges

    ranges = read_ranges(options.scatter)
    names = tuple(one.name for one in ranges)
    if len(set(names)) < len(names):
        raise InputError("--scatter: a field is given twice, expected each once")

    def write(variants: Sequence[Any], folder: Path) -> tuple[Any, list[Path]]:
        from ..report.study_map import write_scatter

        return write_scatter(names, variants, folder, options.samples)

    return Plan(names, halton_values(ranges, options.samples), write, tables.report_table)


def _write_one(name: str, planned: int) -> Callable[[Sequence[Any], Path], tuple[Any, list[Path]]]:
    def write(variants: Sequence[Any], folder: Path) -> tuple[Any, list[Path]]:
        from ..report.study import write_study

        return write_study(name, variants, folder, planned)

    return write


def _write_map(
    names: tuple[str, ...], values: list[list[str]]
) -> Callable[[Sequence[Any], Path], tuple[Any, list[Path]]]:
    def write(variants: Sequence[Any], folder: Path) -> tuple[Any, list[Path]]:
        from ..report.study_map import write_map

        return write_map((names[0], names[1]), (values[0], values[1]), variants, folder)

    return write


def _value_table(name: str, table: Any) -> str:
    """The values side by side, and the best one where the errors separate it."""
    from ..report.best_value import best_value_lines
    from ..report.study import best_values

    return f"{tables.side_by_side(name, table)}\n{best_value_lines(best_values(name, table))}"


def _map_table(names: tuple[str, ...], values: list[list[str]], table: Any) -> str:
    """The columns that fit on a terminal, and the best values where the errors separate them."""
    from ..report.best_value import best_value_lines
    from ..report.study_map import best_pair

    shown = [*names, "load", "peak_frequency", "peak_amplitude", "reduction", "error"]
    shown += [name for name in ("own_load", "own_amplitude") if name in table]
    best = best_pair((names[0], names[1]), (values[0], values[1]), table)
    return f"{tables.report_table(table[shown])}\n{best_value_lines(best)}"


def _parse_variation(text: str) -> tuple[str, list[str]]:
    """Name and texts of the values, each value once; the last unit holds for those without one, as
    in "30, 40, 50 deg".

    Raises:
        InputError: no such field, or no values.
    """
    from ..scene.fields import convert_value, field_at, split_values

    name, equals, values = (part.strip() for part in text.partition("="))
    if equals:
        field_at(name)
    if name == "title":
        raise InputError("--vary title: changes no result, expected a field that does")
    if not equals or not split_values(values):
        raise InputError(
            f"--vary {text}: expected key=values, such as damper.angle='30, 40, 50 deg'"
        )
    texts: dict[Any, str] = {}
    for one in split_values(values):
        # "0.3" and "0.30", "1 mm" and "0.001 m" are one run
        texts.setdefault(convert_value(one, field_at(name)), one)
    return name, list(texts.values())


def _run_options(
    options: argparse.Namespace,
    base: Path,
    names: Sequence[str],
    values: Sequence[str],
) -> argparse.Namespace:
    """The options of one run."""
    one = argparse.Namespace(**vars(options))
    changes = [f"{name}={value}" for name, value in zip(names, values, strict=True)]
    one.overrides = [WITHOUT_INFLUENCES, *options.overrides, *changes]
    one.output = str(base / ",".join(changes).replace(" ", "").replace("/", "_"))
    return one


def _borrow_stages(source: Path, target: Path) -> None:
    """Finished stages of the first run are there for the others: each knows by its hash whether it
    belongs to a scene, and a changed friction coefficient needs no new mesh.
    """
    from ..io.run_folder import borrow_stages

    borrow_stages(source, target)
