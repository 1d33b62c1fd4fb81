"""Studies of two fields and of scattered inputs: a map, and a band over the loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.units import newtons
from ..util.percent import percent
from .study import MARKS
from .style import COLOURS, MICRO, canvas, log_axis

# samples from which shares of them are reported
LEAST_FOR_SHARES = 10
# luminance below which white letters are read better
DARK_LUMINANCE = 0.5


def draw_map(
    table: pd.DataFrame,
    labels: tuple[Sequence[str], Sequence[str]],
    names: tuple[str, str],
    file: str | Path | None = None,
) -> object:
    """Resonance amplitude at the best load over two fields, each field of the map with its numbers,
    the estimated error and what gives the resonance where that is no stable balance; returns the
    figure.

    Args:
        table: one row a pair of values, the second field within the first, those that are not
            solved yet left out at the end: peak_amplitude [m], load [N], error, given_by.
        labels: values of rows and columns.
        names: of the fields along rows and columns.
        file: PNG to write.
    """
    rows, columns = len(labels[0]), len(labels[1])
    amplitude = np.full(rows * columns, np.nan)
    amplitude[: len(table)] = table["peak_amplitude"]
    texts = [_cell_text(row) for _, row in table.iterrows()]
    texts += ["not solved"] * (rows * columns - len(table))
    with canvas(file, size=(2.2 + 1.3 * columns, 1.7 + 0.95 * rows)) as ax:
        image = ax.imshow(
            MICRO * amplitude.reshape(rows, columns),
            origin="lower",
            aspect="auto",
            cmap="viridis_r",
        )
        ax.set_xticks(range(columns), labels[1])
        ax.set_yticks(range(rows), labels[0])
        ax.set(xlabel=names[1], ylabel=names[0], title="resonance amplitude at the best load")
        ax.grid(False)
        best = np.nanargmin(amplitude) if np.isfinite(amplitude).any() else -1
        for number, (value, text) in enumerate(zip(amplitude, texts, strict=True)):
            red, green, blue, _ = image.cmap(image.norm(MICRO * value))
            dark = 0.3 * red + 0.59 * green + 0.11 * blue < DARK_LUMINANCE
            ax.text(
                number % columns,
                number // columns,
                text,
                ha="center",
                va="center",
                fontsize=8,
                fontweight="bold" if number == best else "normal",
                color="white" if dark and np.isfinite(value) else "black",
            )
        ax.figure.colorbar(image, ax=ax, label="resonance amplitude [µm]")
        return ax.figure


def _cell_text(row: pd.Series) -> str:
    """Amplitude with its estimated error, load, and what gives the resonance."""
    error = row["error"]
    certainty = "error unknown" if np.isinf(error) else f"± {percent(error)}"
    lines = [f"{MICRO * row['peak_amplitude']:.4g} µm"]
    lines += [] if np.isnan(error) else [certainty]
    lines += [newtons(row["load"], 4)]
    return "\n".join([*lines, row["given_by"]] if row["given_by"] in MARKS else lines)


def draw_band(
    loads: pd.DataFrame,
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """Resonance amplitude over load with its scatter: all samples, and the middle 80 % and the
    median where they are enough for that; returns the figure.

    Args:
        loads: one row a load of each sample: value, load [N], peak_amplitude [m]; load 0 is the
            blade without damper.
        file: PNG to write.
        title: headline.
    """
    damped = loads[(loads["load"] > 0) & np.isfinite(loads["load"])]
    amplitude = MICRO * damped.pivot_table(
        index="load", columns="value", values="peak_amplitude", sort=True
    )
    quantiles = amplitude.quantile([0.1, 0.5, 0.9], axis=1).T
    with canvas(file) as ax:
        ax.fill_between(
            amplitude.index,
            amplitude.min(axis=1),
            amplitude.max(axis=1),
            color=COLOURS[0],
            alpha=0.15,
            label=f"all {amplitude.shape[1]} samples",
        )
        if amplitude.shape[1] >= LEAST_FOR_SHARES:
            ax.fill_between(
                amplitude.index,
                quantiles[0.1],
                quantiles[0.9],
                color=COLOURS[0],
                alpha=0.35,
                label="80 % of them",
            )
            ax.plot(amplitude.index, quantiles[0.5], "o-", color=COLOURS[0], label="median")
        free = MICRO * loads.loc[loads["load"] == 0, "peak_amplitude"]
        if len(free):
            ax.axhspan(free.min(), free.max(), color="#777777", alpha=0.3, label="no damper")
        ax.set(
            xlabel="normal load per seat [N]",
            ylabel="resonance amplitude [µm]",
            title=title or "scatter of inputs",
        )
        log_axis(ax, "x")
        log_axis(ax, "y")
        ax.legend()
        return ax.figure
