"""A study of one field as files: a row a value, a row a load of each value, and one picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..scene.fields import field_at, value_at
from ..scene.tables import Scene
from ..scene.units import newtons, parse, show
from ..study.pipeline.design_table import design_table
from ..study.pipeline.run_records import Response
from ..view.study import draw_study
from .best_load import error_words
from .headlines import Headline
from .tables import write_tables
from .write import Page, write_report

# columns that only the tables in files have
UNPRINTED = ["halved", "body_mesh", "layer_law", "harmonics"]


@dataclass(frozen=True)
class Variant:
    """One value of the varied field."""

    # as written, "30 deg"
    text: str
    scene: Scene
    response: Response


def write_study(
    name: str,
    variants: Sequence[Variant],
    folder: Path,
) -> tuple[pd.DataFrame, list[Path]]:
    """Write study and study_loads (CSV, Markdown, LaTeX) and study.png; returns the table of values
    and the files.

    Args:
        name: dotted name of the varied field.
    """
    table, loads = study_tables(name, variants)
    files = write_tables(table, folder / "study", f"best load for each {name}")
    files += write_tables(loads, folder / "study_loads", f"all loads for each {name}")
    axis, label = _axis(name, variants)
    draw_study(
        table.assign(axis=axis), loads, folder / "study.png", label=label, title=f"study of {name}"
    )
    pages = _report(name, variants, table, loads, folder)
    return table, [*files, folder / "study.png", *pages]


def _report(
    name: str,
    variants: Sequence[Variant],
    table: pd.DataFrame,
    loads: pd.DataFrame,
    folder: Path,
) -> tuple[Path, Path]:
    """``report_study.html`` and ``.md``: the best value first, all of them in one table."""
    best = table.loc[table["peak_amplitude"].idxmin()]
    numbers = [
        Headline(
            f"best {name}",
            str(best["value"]),
            place_of_value(str(best["value"]), list(map(str, table["value"]))),
            load_words(best["load"], loads),
        ),
        Headline(
            "resonance amplitude there",
            f"{1e6 * best['peak_amplitude']:.4g} µm",
            error_words(best),
            f"{best['reduction']:.4g} times below the blade without damper",
        ),
        Headline(
            "resonance frequency there",
            f"{best['peak_frequency']:.5g} Hz",
            "spacing of points, in the report of the value",
            f"{best['free_frequency']:.5g} Hz without damper",
        ),
    ]
    return write_report(
        folder,
        variants[0].scene,
        {
            "response/best_load_of_each_value": table.drop(columns=UNPRINTED),
            "response/all_loads": loads.drop(columns=UNPRINTED),
        },
        {"response/side_by_side": folder / "study.png"},
        page=Page(numbers=numbers, stem="report_study", subject=f"study of {name}"),
    )


def place_of_value(best: str, values: Sequence[str]) -> str:
    """How many values were studied, and whether the best is at an end of them.

    >>> place_of_value("50 deg", ["40 deg", "50 deg", "60 deg"])
    'best of 3 values'
    >>> place_of_value("60 deg", ["40 deg", "50 deg", "60 deg"])
    'best of 3 values, the last: better ones may lie beyond'
    """
    words = f"best of {len(values)} values"
    # words such as "coupled" have no order
    ordered = all(value.lstrip("+-.")[:1].isdigit() for value in values)
    if not ordered or len(values) < 2 or best not in (values[0], values[-1]):
        return words
    end = "first" if best == values[0] else "last"
    return f"{words}, the {end}: better ones may lie beyond"


def load_words(load: float, loads: pd.DataFrame) -> str:
    """The load of a best value, and whether it is at an end of those studied."""
    return f"with {newtons(load, 4)} on each seat{end_words(load, loads)}"


def end_words(load: float, loads: pd.DataFrame) -> str:
    """Words that a load is at an end of those studied, or ""."""
    damped = loads["load"][(loads["load"] > 0) & np.isfinite(loads["load"])]
    if load == damped.min():
        return ", the smallest load studied: a smaller one may do better"
    if load == damped.max():
        return ", the largest load studied: a larger one may do better"
    return ""


def study_tables(name: str, variants: Sequence[Variant]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The best load of each value, and all of them; SI columns, the value also as written."""
    best = []
    every = []
    for variant in variants:
        rows = pd.DataFrame(design_table(variant.response.curves, variant.response.limits))
        rows.insert(0, "value", variant.text)
        damped = rows.iloc[1:-1]
        own = _number(name, variant.scene)
        best.append(
            {
                "value": variant.text,
                **({} if own is None else {_head(name): own}),
                "free_frequency": rows["peak_frequency"].iloc[0],
                "free_amplitude": rows["peak_amplitude"].iloc[0],
                **damped.loc[damped["peak_amplitude"].idxmin()].drop("value"),
            }
        )
        every.append(rows)
    return pd.DataFrame(best).infer_objects(), pd.concat(every, ignore_index=True)


def _head(name: str) -> str:
    """ "damper.angle [rad]"."""
    unit = field_at(name).meta.get("unit") or "1"
    return name if unit == "1" else f"{name} [{unit}]"


def _number(name: str, scene: Scene) -> float | None:
    """SI value of the field; None where it is no single number."""
    value = value_at(scene, name)
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _axis(name: str, variants: Sequence[Variant]) -> tuple[list[Any], str]:
    """Position of each value on the axis, in the unit that people read; texts where they are no
    numbers.
    """
    read = [_number(name, variant.scene) for variant in variants]
    numbers = [number for number in read if number is not None]
    if len(numbers) < len(variants):
        return [variant.text for variant in variants], name
    unit = field_at(name).meta.get("unit") or "1"
    shown = show(max(numbers, key=abs), unit).partition(" ")[2]
    factor = parse(f"1 {shown}", unit) if shown else 1.0
    return [number / factor for number in numbers], f"{name} [{shown}]" if shown else name
