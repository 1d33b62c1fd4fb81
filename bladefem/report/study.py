"""A study of one field as files: a row a value, a row a load of each value, and one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..io.stage_cache import write_table
from ..scene.fields import field_at, value_at
from ..scene.tables import Scene
from ..scene.units import newtons, parse, show
from ..study.pipeline.curve import Curve
from ..study.pipeline.design_table import design_table
from ..study.pipeline.run_records import Response
from ..util.message import Message, by_level, warning
from ..util.percent import percent
from ..view.study import BALANCE, LINEAR, MARCH, STIFF_LAYER, UNSTABLE, draw_study
from .best_load import error_words, lowest_of_response
from .best_value import are_determined, value_headlines
from .headlines import Headline
from .tables import units_of, write_tables
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
    # of its run (``warnings_of_variant``)
    warnings: Sequence[str] = ()
    # load of a seat by the damper's own mass [N], where the scene studies it
    own: float | None = None


def write_study(
    name: str,
    variants: Sequence[Variant],
    folder: Path,
    planned: int = 0,
) -> tuple[pd.DataFrame, list[Path]]:
    """Write study and study_loads (CSV, Markdown, LaTeX) and study.png; returns the table of values
    and the files.

    Args:
        name: dotted name of the varied field.
        variants: those that are solved so far.
        planned: values asked for, where there may be more.
    """
    table, loads = study_tables(variants)
    files = write_value_tables(
        table, [name], variants, folder / "study", f"best load for each {name}"
    )
    files += write_value_tables(
        loads, [name], variants, folder / "study_loads", f"all loads for each {name}"
    )
    axis, label = _axis(name, variants)
    draw_study(
        table.assign(axis=axis), loads, folder / "study.png", label=label, title=f"study of {name}"
    )
    pages = _report(name, variants, (table, loads), folder, planned)
    return table, [*files, folder / "study.png", *pages]


def best_values(name: str, table: pd.DataFrame) -> list[Headline]:
    """The best value of the field, where the errors separate it from the others."""
    return value_headlines(table, {name: "value"}, {name: list(map(str, table["value"]))})


def _report(
    name: str,
    variants: Sequence[Variant],
    tables: tuple[pd.DataFrame, pd.DataFrame],
    folder: Path,
    planned: int,
) -> tuple[Path, Path]:
    """``report_study.html`` and ``.md``: the best value first, all of them in one table."""
    table, loads = tables
    best = table.loc[table["peak_amplitude"].idxmin()]
    values = best_values(name, table)
    sure = are_determined(values)
    words = load_words(best["load"], loads)
    numbers = [
        *unfinished_headlines(len(variants), planned),
        values[0]._replace(remark=words) if sure else values[0],
        Headline(
            "resonance amplitude there" if sure else "smallest resonance amplitude",
            f"{1e6 * best['peak_amplitude']:.4g} µm",
            error_words(best),
            f"{'' if sure else f'{words}, '}{best['reduction']:.4g} times below the blade without "
            "damper",
        ),
        Headline(
            "resonance frequency there",
            f"{best['peak_frequency']:.5g} Hz",
            "spacing of points, in the report of the value",
            f"{best['free_frequency']:.5g} Hz without damper",
        ),
        *own_headlines(table),
    ]
    shown = {
        "response/best_load_of_each_value": with_texts(table, [name], variants),
        "response/all_loads": with_texts(loads, [name], variants),
    }
    return write_report(
        folder,
        variants[0].scene,
        {entry: one.drop(columns=UNPRINTED) for entry, one in shown.items()},
        {"response/side_by_side": folder / "study.png"},
        warnings_of_all([name], variants),
        page=Page(numbers=numbers, stem="report_study", subject=f"study of {name}"),
    )


def unfinished_headlines(finished: int, planned: int) -> list[Headline]:
    """That runs of the study are missing, since the page is written after each of them and an
    interrupted study leaves it; none where all are there.
    """
    if finished >= planned:
        return []
    return [
        Headline(
            "runs finished",
            f"{finished} of {planned}",
            "what follows is of these alone; the same command goes on",
            "",
        )
    ]


def warnings_of_variant(response: Response, messages: Sequence[str]) -> list[str]:
    """What of the run of one value may make its answer wrong: why its best load is not determined,
    and its warnings.
    """
    against = lowest_of_response(response).against
    undetermined = [f"best load: not determined: {'; '.join(against)}"] if against else []
    return [*undetermined, *by_level(messages)["warning"]]


def warnings_of_all(names: Sequence[str], variants: Sequence[Variant]) -> list[str]:
    """The warnings of all runs, each with the values that it belongs to, the same sentence once;
    first those of every run, where listing more than two would bury the sentence.
    """
    belongs: dict[tuple[str, str], dict[str, str]] = {}
    for variant in variants:
        for one in by_level(map(_as_warning, variant.warnings))["warning"]:
            of = belongs.setdefault((str(one), one.advice), {})
            label = _label(names, variant)
            of[label] = ". ".join(filter(None, [of.get(label, ""), one.detail]))
    every = len(variants) if len(variants) > 2 else 0
    common = [
        _warning_of_runs(f"all {every} runs", said, of)
        for said, of in belongs.items()
        if len(of) == every
    ]
    others = [
        _warning_of_runs("; ".join(of), said, of)
        for said, of in belongs.items()
        if len(of) != every
    ]
    return [*common, *others]


def _as_warning(text: str) -> Message:
    return text if isinstance(text, Message) else warning(text)


def _warning_of_runs(runs: str, said: tuple[str, str], details: Mapping[str, str]) -> Message:
    """A warning of several runs, with the details of each.

    Args:
        said: sentence and advice.
        details: by run.
    """
    text, advice = said
    each = [f"{run}: {detail}" for run, detail in details.items() if detail]
    return warning(f"{runs}: {text}", advice, ". ".join(each))


def _label(names: Sequence[str], variant: Variant) -> str:
    """ "damper.angle = 30 deg, contact.mu = 0.2"."""
    values = texts_of(variant, len(names))
    return ", ".join(f"{name} = {value}" for name, value in zip(names, values, strict=True))


def texts_of(variant: Variant, fields: int) -> list[str]:
    """The values of a variant as written, one a field."""
    return variant.text.split("; ") if fields > 1 else [variant.text]


def with_texts(
    table: pd.DataFrame, names: Sequence[str], variants: Sequence[Variant]
) -> pd.DataFrame:
    """A table with a column of texts for each field in place of "value", for people."""
    texts = {variant.text: texts_of(variant, len(names)) for variant in variants}
    columns = {name: [texts[one][k] for one in table["value"]] for k, name in enumerate(names)}
    return _with_fields(table, columns)


def with_numbers(
    table: pd.DataFrame, names: Sequence[str], variants: Sequence[Variant]
) -> tuple[pd.DataFrame, dict[str, str]]:
    """A table with a column of SI numbers for each field in place of "value", texts where the field
    is no number, and the units of these columns.
    """
    columns: dict[str, list[Any]] = {}
    units = {}
    for k, name in enumerate(names):
        read = {variant.text: _number(name, variant.scene) for variant in variants}
        if None in read.values():
            texts = {variant.text: texts_of(variant, len(names))[k] for variant in variants}
            columns[name] = [texts[one] for one in table["value"]]
            continue
        columns[name] = [read[one] for one in table["value"]]
        unit = field_at(name).meta.get("unit") or "1"
        if unit != "1":
            units[name] = unit
    return _with_fields(table, columns), units


def _with_fields(table: pd.DataFrame, columns: dict[str, list[Any]]) -> pd.DataFrame:
    """The fields first, then the columns that are not theirs."""
    rest = table.drop(columns=["value", *(name for name in columns if name in table)])
    return pd.concat([pd.DataFrame(columns, index=table.index), rest], axis=1)


def write_value_tables(
    table: pd.DataFrame,
    names: Sequence[str],
    variants: Sequence[Variant],
    stem: Path,
    caption: str,
) -> list[Path]:
    """Write ``stem``.csv with the fields in SI, .md and .tex with them as written."""
    numbers, units = with_numbers(table, names, variants)
    csv = write_table(stem.with_name(f"{stem.name}.csv"), numbers, {**units_of(numbers), **units})
    return [csv, *write_tables(with_texts(table, names, variants), stem, caption, ("md", "tex"))]


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


def study_tables(variants: Sequence[Variant]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The best load of each value, and all of them; SI columns, the value as written."""
    best = []
    every = []
    for variant in variants:
        rows = pd.DataFrame(design_table(variant.response.curves, variant.response.limits))
        rows.insert(0, "value", variant.text)
        curves = variant.response.curves
        linear = [LINEAR] * (len(rows) - 1 - len(curves))
        rows["given_by"] = [LINEAR, *map(given_by, curves), *linear]
        damped = rows.iloc[1 : 1 + len(curves)]
        best.append(
            {
                "value": variant.text,
                "free_frequency": rows["peak_frequency"].iloc[0],
                "free_amplitude": rows["peak_amplitude"].iloc[0],
                **damped.loc[damped["peak_amplitude"].idxmin()].drop("value"),
                **_under_own_load(variant, damped),
            }
        )
        every.append(rows)
    return pd.DataFrame(best).infer_objects(), pd.concat(every, ignore_index=True)


def _under_own_load(variant: Variant, damped: pd.DataFrame) -> dict[str, float]:
    """What the damper does under the load that its own mass makes; nothing where that was not
    studied.
    """
    if variant.own is None or "mass" in damped:
        return {}
    there = damped.loc[(damped["load"] - variant.own).abs().idxmin()]
    return {
        "own_load": there["load"],
        "own_frequency": there["peak_frequency"],
        "own_amplitude": there["peak_amplitude"],
        "own_error": there["error"],
    }


def own_headlines(table: pd.DataFrame) -> list[Headline]:
    """From where to where the amplitudes of the damper as it is go, over the values."""
    if "own_amplitude" not in table or not table["own_amplitude"].notna().any():
        return []
    low, high = (
        table.loc[place]
        for place in (table["own_amplitude"].idxmin(), table["own_amplitude"].idxmax())
    )
    return [
        Headline(
            f"resonance amplitude under the damper's own load, {word}",
            f"{1e6 * row['own_amplitude']:.4g} µm",
            "unknown" if not np.isfinite(row["own_error"]) else f"± {percent(row['own_error'])}",
            f"{row['value']}: {newtons(row['own_load'], 4)} on each seat",
        )
        for word, row in (("smallest", low), ("largest", high))
    ]


def given_by(curve: Curve) -> str:
    """What gives the resonance of a curve: a balance, or what stands in place of one."""
    if curve.is_march:
        return MARCH
    if curve.keeps_unstable:
        return UNSTABLE
    return STIFF_LAYER if curve.reaches_layer else BALANCE


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
