"""Forced responses with friction: amplitude over frequency under several loads.

Response tables have one row a point, in SI units: load [N], frequency [Hz], amplitude [m],
converged, method, residual, iterations. Load 0 means no damper, load inf full stick. A lower
motion at the frequency of a point is in a column of its own (`bladefem.view.lower_motion`).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

from ..scene.units import newtons
from .labels import names_apart
from .lower_motion import explain_lower, mark_lower, with_lower_motion
from .style import FAILED_COLOUR, MICRO, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# of a drawn curve between two solved points
SMOOTH_STEPS = 8
# brightness of letters over that of their curve
LETTER_SHADE = 0.75
# methods of a row that gives the resonance in place of the balances of its curve
MARCHED = "march in time"
FOLLOWED = "followed to the stiff layer"
# what the legend says of them
GIVEN_INSTEAD = {
    MARCHED: "resonance marched in time",
    FOLLOWED: "resonance of the stiff layer",
}


def draw_responses(
    points: pd.DataFrame,
    file: str | Path | None = None,
    *,
    ax: Axes | None = None,
    title: str = "",
    logarithmic: bool = True,
) -> object:
    """Amplitude over frequency, a curve a load; points without convergence are crosses in a gap;
    returns the figure.

    Args:
        points: response table (see the head of this file).
        file: PNG to write.
        ax: axes to draw into.
        title: headline.
        logarithmic: amplitude axis.
    """
    with canvas(file, ax, (7.6, 4.8)) as ax:
        loads = np.sort(points["load"].unique())
        colours = load_colours(loads)
        for load in loads:
            draw_curve(
                ax,
                points[points["load"] == load].sort_values("frequency", kind="stable"),
                load,
                colours[load],
            )
        failed = points[~points["converged"].astype(bool)]
        if len(failed):
            draw_failed(ax, failed)
        if "stability" in points and (points["stability"] == "unstable").any():
            _draw_unstable(ax, points[points["stability"] == "unstable"])
        for load, rows in with_lower_motion(points).groupby("load"):
            mark_lower(ax, rows["frequency"], rows, colours[load])
        explain_diamonds(ax, points)
        explain_lower(ax, points)
        ax.set(
            xlabel="excitation frequency [Hz]",
            ylabel="vibration amplitude [µm]",
            title=title or "forced response",
        )
        ax.margins(x=0.01)
        if logarithmic:
            log_axis(ax, "y")
        _name_loads(ax, points, colours)
        ax.legend(
            title="normal load per seat",
            alignment="left",
            loc="center left",
            bbox_to_anchor=(1.0, 0.5),
        )
        return ax.figure


def _name_loads(ax: Axes, points: pd.DataFrame, colours: dict[float, Any]) -> None:
    """Each load at the highest of its motions that are not unstable: of a dozen colours, neighbours
    are alike.
    """
    shown = points[points["converged"].astype(bool)]
    if "stability" in shown:
        shown = shown[shown["stability"] != "unstable"]
    finite = shown[(shown["load"] > 0) & np.isfinite(shown["load"])]
    if finite.empty:
        return
    highest = finite.loc[finite.groupby("load")["amplitude"].idxmax()]
    # the lowest, which matters most, has the first choice of a place
    for row in highest.sort_values("amplitude").itertuples():
        ax.annotate(
            newtons(row.load, 4),
            (row.frequency, MICRO * row.amplitude),
            textcoords="offset points",
            xytext=(6, 7),
            fontsize=7.5,
            # the lightest colours are hard to read as letters
            color=LETTER_SHADE * np.asarray(matplotlib.colors.to_rgb(colours[row.load])),
        )
    names_apart(ax, keep=True)


def _draw_unstable(ax: Axes, unstable: pd.DataFrame) -> None:
    """Squares at unstable motions, with their number in the legend."""
    ax.plot(
        unstable["frequency"],
        MICRO * unstable["amplitude"],
        "s",
        mfc="white",
        mec=FAILED_COLOUR,
        ms=4.5,
        mew=1.2,
        zorder=5,
        label=f"unstable ({len(unstable)})",
    )


def load_colours(loads: np.ndarray) -> dict[float, Any]:
    """Ordered colours for finite loads; the two linear limits in black and grey."""
    finite = [load for load in loads if 0 < load < np.inf]
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.92, max(len(finite), 1)))
    return {**dict(zip(finite, shades, strict=False)), 0.0: "#000000", np.inf: "#777777"}


def load_name(load: float) -> str:
    """ "250 N", or the name of the limit."""
    return {0.0: "0 (no damper)", np.inf: "∞ (full stick)"}.get(load, newtons(load, 4))


def draw_curve(
    ax: Axes,
    curve: pd.DataFrame,
    load: float,
    colour: Any,
) -> None:
    """One load: dots are points that were solved, the line between them keeps their slopes; broken
    where one failed.
    """
    good = curve["converged"].to_numpy(bool)
    frequency = curve["frequency"].to_numpy(float)
    amplitude = np.where(good, MICRO * curve["amplitude"], np.nan)
    style = {0.0: "--", np.inf: ":"}.get(load, "-")
    label = load_name(load)
    # stable pieces first: the legend shows their line
    for piece, unstable in sorted(pieces_of(curve), key=lambda part: part[1]):
        line = "--" if unstable else style
        ax.plot(*smooth_curve(frequency[piece], amplitude[piece]), line, color=colour, label=label)
        label = "_nolegend_"
    if 0 < load < np.inf:
        ax.plot(frequency, amplitude, ".", color=colour, ms=2.5)
    if good.any():
        top, apart = resonance_of(curve)
        # above the squares of unstable motions
        ax.plot(
            frequency[top],
            amplitude[top],
            "D" if apart else "o",
            color=colour,
            ms=6 if apart else 4.5,
            mec="white",
            mew=0.6,
            zorder=6 if apart else 4,
        )


def explain_diamonds(ax: Axes, points: pd.DataFrame) -> None:
    """A line of the legend for resonances that are given in place of those of the balances."""
    if "method" not in points:
        return
    methods = set(points["method"])
    words = " or ".join(text for method, text in GIVEN_INSTEAD.items() if method in methods)
    if words:
        ax.plot([], [], "D", color="#777777", ms=6, mec="white", mew=0.6, label=words)


def resonance_of(curve: pd.DataFrame) -> tuple[int, bool]:
    """Row of the resonance that is given for a curve, and whether it is none of its balances: the
    one that a march or a stiff layer gives, else the highest that is not unstable.
    """
    if "method" in curve:
        given = np.flatnonzero(curve["method"].isin([MARCHED, FOLLOWED]))
        if len(given):
            return int(given[0]), True
    good = curve["converged"].to_numpy(bool)
    amplitude = np.where(good, curve["amplitude"], np.nan)
    lasting = amplitude.copy()
    if "stability" in curve:
        lasting[(curve["stability"] == "unstable").to_numpy()] = np.nan
    return int(np.nanargmax(lasting if np.isfinite(lasting).any() else amplitude)), False


def pieces_of(curve: pd.DataFrame) -> list[tuple[np.ndarray, bool]]:
    """Rows that make one line each, and whether the motions there are unstable.

    Pieces between the folds of a response with several motions are lines of their own, so that a
    jump is a gap; a stable and an unstable part meet in a common point.
    """
    branch = curve["branch"].to_numpy() if "branch" in curve else np.zeros(len(curve))
    branch = np.nan_to_num(branch.astype(float))
    unstable = np.zeros(len(curve), dtype=bool)
    if "stability" in curve:
        unstable = (curve["stability"] == "unstable").to_numpy()
    parts = []
    for number in np.unique(branch):
        rows = np.flatnonzero(branch == number)
        # an unsolved point between the pieces belongs to none of them
        if number == 0 and branch.any():
            continue
        cuts = np.flatnonzero(np.diff(unstable[rows])) + 1
        for run in np.split(np.arange(len(rows)), cuts):
            first = max(run[0] - 1, 0) if unstable[rows[run[0]]] else run[0]
            last = min(run[-1] + 1, len(rows) - 1) if unstable[rows[run[0]]] else run[-1]
            parts.append((rows[first : last + 1], bool(unstable[rows[run[0]]])))
    return parts


def smooth_curve(
    x: np.ndarray,
    y: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """A curve through positive points without overshoot (monotone cubics of log y), NaN where a
    point is missing.
    """
    runs = np.split(np.arange(len(x)), np.flatnonzero(~np.isfinite(y)))
    xs = []
    ys = []
    for run in runs:
        run = run[np.isfinite(y[run]) & (y[run] > 0)]
        run = run[np.unique(x[run], return_index=True)[1]]
        if len(run) > 1:
            fine = np.interp(
                np.arange(SMOOTH_STEPS * (len(run) - 1) + 1) / SMOOTH_STEPS,
                np.arange(len(run)),
                x[run],
            )
            xs.append(fine)
            ys.append(np.exp(PchipInterpolator(x[run], np.log(y[run]))(fine)))
    gap = [np.nan]
    return tuple(
        np.concatenate([gap, *(part for piece in pieces for part in (piece, gap))])
        for pieces in (xs, ys)
    )


def draw_failed(ax: Axes, failed: pd.DataFrame) -> None:
    """Points without a solution: crosses at their last amplitude, or on the lower edge when there
    is none.
    """
    amplitude = MICRO * failed["amplitude"].to_numpy(float)
    known = np.isfinite(amplitude) & (amplitude > 0)
    label = f"not converged ({len(failed)})"
    ax.plot(
        failed["frequency"][known],
        amplitude[known],
        "x",
        color=FAILED_COLOUR,
        ms=7,
        mew=1.8,
        zorder=5,
        label=label,
    )
    if not known.all():
        ax.plot(
            failed["frequency"][~known],
            np.full(int((~known).sum()), 0.01),
            "x",
            color=FAILED_COLOUR,
            ms=7,
            mew=1.8,
            transform=ax.get_xaxis_transform(),
            clip_on=False,
            label=None if known.any() else label,
        )
