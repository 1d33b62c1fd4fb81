"""A study of one field as files: a row a value, a row a load of each value, and one picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from ..scene.fields import field_at, value_at
from ..scene.tables import Scene
from ..scene.units import parse, show
from ..study.pipeline.loads import summary
from ..view.study import draw_study
from .tables import write_tables

__all__ = ["Variant", "study_tables", "write_study"]


@dataclass(frozen=True)
class Variant:
    """One value of the varied field."""

    # as written, "30 deg"
    text: str
    scene: Scene
    # study.pipeline.Response
    response: Any


def write_study(
    name: str, variants: Sequence[Variant], folder: Path
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
    return table, [*files, folder / "study.png"]


def study_tables(name: str, variants: Sequence[Variant]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The best load of each value, and all of them; SI columns, the value also as written."""
    best = []
    every = []
    for variant in variants:
        rows = pd.DataFrame(summary(variant.response.curves, variant.response.limits))
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
    """Where each value stands on the axis, in the unit that people read; texts where they are no
    numbers.
    """
    numbers = [_number(name, variant.scene) for variant in variants]
    if None in numbers:
        return [variant.text for variant in variants], name
    unit = field_at(name).meta.get("unit") or "1"
    shown = show(max(numbers, key=abs), unit).partition(" ")[2]
    factor = parse(f"1 {shown}", unit) if shown else 1.0
    return [number / factor for number in numbers], f"{name} [{shown}]" if shown else name
