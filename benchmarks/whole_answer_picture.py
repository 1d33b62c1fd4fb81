"""The picture and the advice of benchmarks/whole_answer.py, from its tables alone."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes

from bladefem.scene.tables import Scene
from bladefem.view.accuracy import draw_accuracy
from bladefem.view.labels import names_apart
from bladefem.view.style import canvas

# column of the table, what it is
PANELS = {
    "error": "amplitude, frequency and phasors within three half widths",
    "error_amplitude": "resonance amplitude alone",
}


def draw_answer(rows: pd.DataFrame, loads: pd.DataFrame, scene: Scene, file: Path) -> None:
    """Total CPU time against the strictest error and against that of the amplitude, each of the
    worst load.
    """
    shown = rows[~rows["reason"].fillna("").str.startswith("left out")]
    with canvas(file, None, (12.5, 5.0), (1, 2), squeeze=False) as axes:
        for ax, (column, of) in zip(axes[0], PANELS.items(), strict=True):
            table = shown.assign(error=shown[column])
            draw_accuracy(table, ax=ax, tolerance=scene.accuracy, title=of)
            _name_the_others(ax, table)
            ax.set(
                xlabel="CPU time from the mesh to the answer under all loads [s]",
                ylabel="largest error under the worst load [%]",
            )
        axes[0, 0].get_legend().remove()
        said = f"{scene.title}:\n{what_was_solved(rows, loads)}"
        axes[0, 0].figure.suptitle(said, fontsize=10)
        names_apart(*axes[0])


def _name_the_others(ax: Axes, table: pd.DataFrame) -> None:
    """Names of the ways off the front, where there is room."""
    named = {text.get_text() for text in ax.texts}
    for _, row in table[table["converged"].astype(bool)].iterrows():
        if row["name"] not in named:
            place = row["time"], row["error"]
            ax.annotate(row["name"], place, (6, 8), textcoords="offset points", fontsize=7)


def what_was_solved(rows: pd.DataFrame, loads: pd.DataFrame) -> str:
    """Loads, mesh and truth of a table, in words."""
    star = rows[rows["chosen"].astype(bool)].iloc[0]
    solved = sorted(loads["load"].unique())
    coarse = "" if star["coarse"] == 1 else f", elements {star['coarse']:g} times the scene's"
    return (
        f"{len(solved)} loads of {solved[0]:g} to {solved[-1]:g} N, {star['dofs']} degrees of "
        f"freedom{coarse}; truth: elements {star['truth_scale']:g} times as large, "
        f"{star['truth_harmonics']} harmonics or more"
    )


def write_advice(rows: pd.DataFrame, loads: pd.DataFrame, accuracy: float, file: Path) -> None:
    """What to paste into the scene: the cheapest way that has the accuracy under every load, or is
    as good as the automatic choice where none has; for the strictest error, and for the amplitude.
    """
    # the loop is no setting of a scene
    good = rows[rows["converged"].astype(bool) & (rows["family"] != "paper's loop")]
    star = good[good["chosen"].astype(bool)].iloc[0]
    lines = []
    for column, of in {"error": "all three errors", "error_amplitude": "amplitude alone"}.items():
        enough = good[good[column] <= accuracy]
        if enough.empty:
            enough = good[good[column] <= 1.1 * star[column]]
        best = enough.loc[enough["time"].idxmin()]
        met = "the cheapest that has it is" if best[column] <= accuracy else "no way has it under"
        met += "" if best[column] <= accuracy else " every load; as good as the automatic choice is"
        lines += [
            f"{of}, {100 * accuracy:g} % wanted: {met} {best['name']}, with "
            f"{100 * best[column]:.2g} % in {best['time']:.3g} s",
            f"take this: {_line_of(best)}",
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


def _percent(share: float) -> str:
    """ "2.5 %", "130 %"."""
    two_digits = f"{100 * share:.2g}"
    return f"{float(two_digits):.0f} %" if share >= 0.995 else f"{two_digits} %"


def answer_table(rows: pd.DataFrame) -> str:
    """The ways of a scene as a table of Markdown, cheapest first."""
    lines = [
        "| way | amplitude | frequency | worst phasor | median of the loads | CPU time |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for _, row in rows.sort_values("time").iterrows():
        if row["converged"]:
            numbers = [row[f"error_{of}"] for of in ("amplitude", "frequency", "phasor")]
            reported = [_percent(x) for x in (*numbers, row["median"])]
        else:
            lost = str(row["reason"]).startswith("left out")
            reported = ["left out" if lost else "not solved", "", "", ""]
        name = f"**{row['name']}**" if row["chosen"] else row["name"]
        lines.append(f"| {' | '.join([name, *reported])} | {row['time']:.3g} s |")
    return "\n".join(lines)


def section(name: str, title: str, figures: Path) -> str:
    """What the page says of a scene: picture, table, and the lines to paste."""
    rows = pd.read_csv(figures / f"answer_{name}.csv")
    loads = pd.read_csv(figures / f"answer_{name}_loads.csv")
    advice = (figures / f"answer_{name}.txt").read_text(encoding="utf-8").rstrip()
    said = what_was_solved(rows, loads)
    return "\n\n".join(
        [
            f"### {title}",
            f"{said[0].upper()}{said[1:]}.",
            f"![Whole answer of {name}](figures/answer_{name}.png)",
            answer_table(rows),
            f"```text\n{advice}\n```",
        ]
    )


def write_section(name: str, title: str, figures: Path, page: Path) -> None:
    """Put the section of a scene into its place on the page, behind the others where it is new."""
    text = page.read_text(encoding="utf-8")
    begin, end = f"<!-- answer of {name} -->\n", f"\n<!-- end of {name} -->\n"
    if begin not in text:
        last = "<!-- end of whole answers -->"
        text = text.replace(last, f"{begin}{end}\n{last}")
    before, rest = text.split(begin)
    page.write_text(before + begin + section(name, title, figures) + end + rest.split(end)[1])


def _line_of(best: pd.Series) -> str:
    """A line of TOML with the keys spelled out."""
    given = best["settings"] if isinstance(best["settings"], str) else ""
    if given:
        return given
    scale = "" if best["scale"] == 1 else f"mesh.scale = {best['scale']:g}; "
    return f'{scale}accuracy = "{100 * best["accuracy"]:g} %"'
