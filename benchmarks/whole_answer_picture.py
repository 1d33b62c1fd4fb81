"""The picture and the advice of benchmarks/whole_answer.py, from its tables alone."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from bladefem.view.accuracy import draw_accuracy
from bladefem.view.labels import names_apart
from bladefem.view.style import canvas

PANELS = {"error": "worst load", "median": "median of the loads"}


def draw_answer(rows: pd.DataFrame, accuracy: float, title: str, file: Path) -> None:
    """Total CPU time against the strictest error, of the worst load and of the median one."""
    with canvas(file, None, (12.5, 4.6), (1, 2), squeeze=False) as axes:
        for ax, (column, of) in zip(axes[0], PANELS.items(), strict=True):
            shown = rows[~rows["reason"].fillna("").str.startswith("left out")]
            draw_accuracy(shown.assign(error=shown[column]), ax=ax, tolerance=accuracy, title=of)
            ax.set(
                xlabel="CPU time from the mesh to the answer under all loads [s]",
                ylabel="largest error of amplitude, frequency, phasor [%]",
            )
        axes[0, 0].get_legend().remove()
        axes[0, 0].figure.suptitle(title)
        names_apart(*axes[0])


def write_advice(rows: pd.DataFrame, loads: pd.DataFrame, accuracy: float, file: Path) -> None:
    """What to paste into the scene: the cheapest way that has the accuracy under every load, or is
    as good as the automatic choice where none has.
    """
    good = rows[rows["converged"].astype(bool)]
    star = good[good["chosen"].astype(bool)].iloc[0]
    enough = good[good["error"] <= max(accuracy, 1.1 * star["error"])]
    best = enough.loc[enough["time"].idxmin()]
    wanted = f"{100 * accuracy:g} %"
    met = "has" if best["error"] <= accuracy else "none has them under every load; as good is"
    lines = [
        f"wanted: {wanted}; {met}: {best['name']}, {100 * best['error']:.2g} % under the worst "
        f"load, {100 * best['median']:.2g} % in the middle, {best['time']:.3g} s",
        f"take this: {_line_of(best, accuracy)}",
    ]
    march = loads["judge"].dropna()
    if len(march):
        lines.append(
            f"judge in time: {len(march)} of {loads['load'].nunique()} resonances of seven "
            f"harmonics keep their amplitude to {100 * march.max():.2g} % at worst, "
            f"{100 * march.median():.2g} % in the middle"
        )
    lines += [
        f"{row['name']}: {row['reason']}"
        for _, row in rows.iterrows()
        if row["reason"] == row["reason"] and row["reason"]
    ]
    file.write_text("\n".join(lines) + "\n")


def answer_table(rows: pd.DataFrame) -> str:
    """The ways of a scene as a table of Markdown, cheapest first."""
    lines = [
        "| way | amplitude | frequency | worst phasor | median of the loads | CPU time |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for _, row in rows.sort_values("time").iterrows():
        if row["converged"]:
            numbers = [row[f"error_{of}"] for of in ("amplitude", "frequency", "phasor")]
            told = [f"{100 * x:.2g} %" for x in (*numbers, row["median"])]
        else:
            lost = str(row["reason"]).startswith("left out")
            told = ["left out" if lost else "not solved", "", "", ""]
        name = f"**{row['name']}**" if row["chosen"] else row["name"]
        lines.append(f"| {' | '.join([name, *told])} | {row['time']:.3g} s |")
    return "\n".join(lines)


def write_table(name: str, rows: pd.DataFrame, page: Path) -> None:
    """Put the table of a scene into its place on the page."""
    text = page.read_text(encoding="utf-8")
    begin, end = f"<!-- ways of {name} -->\n", f"\n<!-- end of {name} -->"
    if begin in text:
        before, rest = text.split(begin)
        page.write_text(before + begin + answer_table(rows) + end + rest.split(end)[1])


def _line_of(best: pd.Series, accuracy: float) -> str:
    """A line of TOML with the keys spelled out."""
    given = best["settings"] if isinstance(best["settings"], str) else ""
    if given:
        return given
    scale = "" if best["scale"] == 1 else f"mesh.scale = {best['scale']:g}; "
    return f'{scale}accuracy = "{100 * accuracy:g} %"'
