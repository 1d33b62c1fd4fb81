"""Frequencies against speed and nodal diameter: Campbell, interference (SAFE) and nodal-diameter
diagrams.

Frequency tables have one row a mode: nodal_diameter, mode, frequency [Hz], optionally family, and
speed [rad/s] for a Campbell diagram. Crossings come ready made, as tables of
bladefem.study.modes.crossings.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.patheffects import withStroke

from ..scene.units import RPM
from ..study.modes.crossings import CLOSE_MARGIN
from ..util.nodal_diameter import excited_diameter
from .style import COLOURS, FAILED_COLOUR, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# relative distance of two waves that are drawn as two lines
APART = 2e-3
# of the highest frequency drawn: below it there is no room for a number under a mark
LOWEST_LABEL = 0.06
# not as many as colours, so that a pair comes again late
MARKERS = "osD^vPX*<>h"


def draw_campbell(
    table: pd.DataFrame,
    orders: Sequence[int],
    file: str | Path | None = None,
    *,
    crossings: pd.DataFrame | None = None,
    operating: float | None = None,
    title: str = "",
) -> object:
    """Frequencies over speed with engine-order lines; crossings are ringed; returns the figure.

    Args:
        table: columns speed [rad/s], mode, frequency [Hz], optionally nodal_diameter and family;
            with forward and backward [Hz] the waves under Coriolis forces are drawn, the latter
            dashed where it is another line.
        orders: engine orders to draw.
        file: PNG to write.
        crossings: rows of ``campbell_crossings``: speed, frequency, engine_order.
        operating: speed to mark [rad/s].
        title: headline.
    """
    with canvas(file, size=(7.6, 5.0)) as ax:
        fastest = RPM * table["speed"].max()
        _draw_modes(ax, table)
        top = 1.12 * table["frequency"].max()
        names = diameter_names(table) if "nodal_diameter" in table else []
        name_lines(ax, fastest, top, names + draw_order_lines(ax, orders, fastest, top))
        if crossings is not None and len(crossings):
            ax.plot(
                RPM * crossings["speed"],
                crossings["frequency"],
                "o",
                mfc="none",
                mec=FAILED_COLOUR,
                mew=1.5,
                ms=9,
                zorder=5,
                label="crossing",
            )
        if operating is not None:
            ax.axvline(
                RPM * operating,
                color="#555555",
                ls="-.",
                lw=1.1,
                label=f"{RPM * operating:.5g} rpm",
            )
        ax.set(
            xlabel="rotational speed [rpm]",
            ylabel="frequency [Hz]",
            xlim=(0, fastest),
            ylim=(0, top),
            title=title or "Campbell diagram",
        )
        ax.legend(loc="center left", bbox_to_anchor=(1.14, 0.5))
        return ax.figure


def _draw_modes(ax: Axes, table: pd.DataFrame) -> None:
    """A line a mode and nodal diameter, named at the first diameter of each mode."""
    keys = [key for key in ("mode", "nodal_diameter") if key in table]
    split = False
    for key, line in table.groupby(keys):
        mode, *diameter = key
        line = line.sort_values("speed")
        colour = COLOURS[(int(mode) - 1) % len(COLOURS)]
        first = (
            not diameter or diameter[0] == table.loc[table["mode"] == mode, "nodal_diameter"].min()
        )
        wide = 1.7 if not diameter else 1.2
        speed = RPM * line["speed"]
        drawn = line["forward" if "forward" in line else "frequency"]
        ax.plot(speed, drawn, color=colour, lw=wide, label=line_name(line, mode) if first else None)
        if "backward" not in line:
            continue
        if (abs(line["backward"] / drawn.clip(lower=np.finfo(float).tiny) - 1) > APART).any():
            ax.plot(speed, line["backward"], color=colour, lw=wide, ls="--")
            split = True
    if split:
        ax.plot([], [], color="#555555", lw=1.2, ls="--", label="backward waves")


def diameter_names(table: pd.DataFrame) -> list[tuple[float, str, str]]:
    """(height, text, colour) of the nodal diameters at the right end of each mode's lines: both
    ends of a fan, one name for a bundle.
    """
    apart = 0.03 * table["frequency"].max()
    names = []
    last = table[table["speed"] == table["speed"].max()].sort_values("nodal_diameter")
    for mode, ends in last.groupby("mode"):
        low = ends.iloc[0]
        high = ends.iloc[-1]
        colour = COLOURS[(int(mode) - 1) % len(COLOURS)]
        if abs(high["frequency"] - low["frequency"]) > apart:
            names += [
                (row["frequency"], f"n = {row['nodal_diameter']:.0f}", colour)
                for row in (low, high)
            ]
        else:
            span = f"{low['nodal_diameter']:.0f}" + (
                f" to {high['nodal_diameter']:.0f}" if len(ends) > 1 else ""
            )
            names.append((ends["frequency"].mean(), f"n = {span}", colour))
    return names


def name_lines(
    ax: Axes,
    x: float,
    top: float,
    names: list[tuple[float, str, str]],
) -> None:
    """Names next to the right ends of lines, moved apart where they would overlap; a thin line
    leads to a moved one.
    """
    names = sorted(names)
    places = spread_labels(np.array([height for height, _, _ in names]), 0.03 * top)
    for place, (height, text, colour) in zip(places, names, strict=True):
        moved = abs(place - height) > 0.004 * top
        ax.annotate(
            text,
            (x, height),
            (1.025, place),
            textcoords=ax.get_yaxis_transform(),
            fontsize=7,
            va="center",
            color=colour,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.5} if moved else None,
        )


def spread_labels(heights: np.ndarray, apart: float) -> np.ndarray:
    """Ascending heights moved as little as leaves them ``apart``: groups that collide are centred
    on their mean.
    """
    groups: list[list[float]] = []
    for height in heights:
        groups.append([height])
        while (
            len(groups) > 1
            and _middle(groups[-1]) - _middle(groups[-2])
            < apart * (len(groups[-1]) + len(groups[-2])) / 2
        ):
            groups[-2:] = [groups[-2] + groups[-1]]
    return np.array(
        [
            _middle(group) + apart * (i - (len(group) - 1) / 2)
            for group in groups
            for i in range(len(group))
        ]
    )


def _middle(group: list[float]) -> float:
    return sum(group) / len(group)


def line_name(rows: pd.DataFrame, mode: Any) -> str:
    """ "mode 1, first flap"."""
    family = f", {rows['family'].iloc[0]}" if "family" in rows else ""
    return f"mode {mode}{family}"


def draw_order_lines(
    ax: Axes,
    orders: Sequence[int],
    fastest: float,
    top: float,
) -> list[tuple[float, str, str]]:
    """Engine-order rays, named where they leave the picture above.

    Returns:
        (height, text, colour) of those that leave it on the right.
    """
    names = []
    for order in orders:
        ax.plot([0, fastest], [0, order * fastest / 60], color="#999999", lw=0.8, zorder=1)
        x = min(fastest, 60 * top / order) if order else fastest
        if x < fastest:
            ax.annotate(
                f"EO {order}",
                (x, top),
                (0, 2),
                textcoords="offset points",
                fontsize=7,
                color="#555555",
                ha="center",
                va="bottom",
                annotation_clip=False,
            )
        else:
            names.append((order * fastest / 60, f"EO {order}", "#555555"))
    return names


def draw_nodal_diameters(
    table: pd.DataFrame,
    file: str | Path | None = None,
) -> object:
    """Frequency over nodal diameter, a line a mode number, coloured by family when it is known;
    returns the figure.

    Args:
        table: columns nodal_diameter, mode, frequency [Hz], optionally family.
        file: PNG to write.
    """
    with canvas(file, size=(7.6, 4.8)) as ax:
        for _, line in table.groupby("mode"):
            line = line.sort_values("nodal_diameter")
            # modes may veer between them: no line
            apart = np.flatnonzero(np.diff(line["nodal_diameter"]) > 1) + 1
            ax.plot(
                np.insert(line["nodal_diameter"].to_numpy(float), apart, np.nan),
                np.insert(line["frequency"].to_numpy(float), apart, np.nan),
                "-",
                color="#bbbbbb",
                lw=1,
                zorder=1,
            )
        draw_families(ax, table)
        ax.set(
            xlabel="nodal diameter [1]",
            ylabel="frequency [Hz]",
            title="natural frequencies of the wheel",
        )
        ax.set_ylim(bottom=0)
        ax.xaxis.get_major_locator().set_params(integer=True)
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax.figure


def draw_families(ax: Axes, table: pd.DataFrame) -> None:
    """A marker a mode, by family (or by mode number); coupled modes are hollow."""
    names = table["family"] if "family" in table else table["mode"].map("mode {}".format)
    plain = names.str.removesuffix(", coupled")
    for i, name in enumerate(plain.drop_duplicates()):
        for hollow in (False, True):
            part = table[(plain == name) & ((names != plain) == hollow)]
            if len(part):
                style = MARKERS[(i + i // len(COLOURS)) % len(MARKERS)]
                colour = COLOURS[i % len(COLOURS)]
                ax.plot(
                    part["nodal_diameter"],
                    part["frequency"],
                    style,
                    ms=4.5,
                    mec=colour,
                    ls="none",
                    mfc="white" if hollow else colour,
                    label=f"{name}, coupled" if hollow else name,
                )


def draw_interference(
    table: pd.DataFrame,
    sectors: int,
    speed: float,
    file: str | Path | None = None,
    *,
    orders: Sequence[int] = (),
) -> object:
    """SAFE diagram: modes over nodal diameter with the folded line of excitation frequencies;
    returns the figure.

    Args:
        table: columns nodal_diameter, mode, frequency [Hz], optionally family.
        sectors: number of blades N.
        speed: [rad/s].
        file: PNG to write.
        orders: engine orders to mark on the line.
    """
    with canvas(file, size=(7.6, 4.8)) as ax:
        draw_families(ax, table)
        top = 1.1 * table["frequency"].max()
        last = min(int(np.ceil(2 * np.pi * top / max(speed, 1e-9))), 6 * sectors, 2000)
        every = np.arange(last + 1)
        ax.plot(
            excited_diameter(every, sectors),
            every * speed / (2 * np.pi),
            "-",
            color="#999999",
            lw=1,
            zorder=1,
            label=f"excitation at {RPM * speed:.5g} rpm",
        )
        draw_excitations(ax, table, sectors, speed, orders)
        ax.set(
            xlabel="nodal diameter [1]",
            ylabel="frequency [Hz]",
            ylim=(0, top),
            title="interference (SAFE) diagram",
        )
        ax.xaxis.get_major_locator().set_params(integer=True)
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax.figure


def draw_excitations(
    ax: Axes,
    table: pd.DataFrame,
    sectors: int,
    speed: float,
    orders: Sequence[int],
) -> None:
    """Chosen engine orders on the folded line, with rings round modes that are too near."""
    rings = []
    for i, order in enumerate(orders):
        n = excited_diameter(order, sectors)
        f = order * speed / (2 * np.pi)
        ax.plot(n, f, "P", color="black", ms=7, zorder=4, label=None if i else "engine order")
        # below its mark, as beside it the next order's mark may lie; not across the axis
        low = f < LOWEST_LABEL * table["frequency"].max()
        ax.annotate(
            f"{order}",
            (n, f),
            (0, 6 if low else -7),
            textcoords="offset points",
            fontsize=7,
            ha="center",
            va="bottom" if low else "top",
            zorder=6,
            # an outline, not a box: that washes out the modes below it
            path_effects=[withStroke(linewidth=1.5, foreground="white")],
        )
        near = table[
            (table["nodal_diameter"] == n)
            & ((table["frequency"] / max(f, 1e-9) - 1).abs() < CLOSE_MARGIN)
        ]
        rings += near[["nodal_diameter", "frequency"]].to_numpy().tolist()
    if rings:
        ax.plot(
            *np.array(rings).T,
            "o",
            mfc="none",
            mec=FAILED_COLOUR,
            mew=1.6,
            ms=13,
            zorder=5,
            label=f"closer than {100 * CLOSE_MARGIN:.3g} %",
        )
