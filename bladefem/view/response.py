"""Forced responses with friction: curves for several loads, the optimum, hysteresis loops, speed
against accuracy.

Response tables have one row a point, in SI units: load [N], frequency [Hz], amplitude [m],
converged, method, residual, iterations. Summary tables have one row a load: load, peak_frequency,
peak_amplitude, dissipated_energy [J], friction_damping [1], reduction (free over damped amplitude).
Load 0 means no damper, load inf full stick.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

from .labels import names_apart
from .style import COLOURS, FAILED_COLOUR, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MICRO = 1e6


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
            unstable = points[points["stability"] == "unstable"]
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
        ax.set(
            xlabel="excitation frequency [Hz]",
            ylabel="vibration amplitude [µm]",
            title=title or "forced response",
        )
        ax.margins(x=0.01)
        if logarithmic:
            log_axis(ax, "y")
        ax.legend(
            title="normal load per seat",
            alignment="left",
            loc="center left",
            bbox_to_anchor=(1.0, 0.5),
        )
        return ax.figure


def load_colours(loads: np.ndarray) -> dict[float, Any]:
    """Ordered colours for finite loads; the two linear limits in black and grey."""
    finite = [load for load in loads if 0 < load < np.inf]
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.92, max(len(finite), 1)))
    return {**dict(zip(finite, shades, strict=False)), 0.0: "#000000", np.inf: "#777777"}


def load_name(load: float) -> str:
    """ "250 N", or the name of the limit."""
    return {0.0: "0 (no damper)", np.inf: "∞ (full stick)"}.get(load, f"{load:.4g} N")


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
        lasting = amplitude.copy()
        if "stability" in curve:
            lasting[(curve["stability"] == "unstable").to_numpy()] = np.nan
        top = np.nanargmax(lasting if np.isfinite(lasting).any() else amplitude)
        ax.plot(
            curve["frequency"].iloc[top],
            amplitude[top],
            "o",
            color=colour,
            ms=4.5,
            mec="white",
            mew=0.6,
            zorder=4,
        )


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
    steps: int = 8,
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
                np.arange(steps * (len(run) - 1) + 1) / steps, np.arange(len(run)), x[run]
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


def draw_optimum(
    summary: pd.DataFrame,
    file: str | Path | None = None,
    *,
    points: pd.DataFrame | None = None,
    own: float | None = None,
    searched: pd.DataFrame | None = None,
    ax: Axes | None = None,
    title: str = "",
) -> object:
    """Resonance amplitude and frequency over load, the optimum marked; a curve a mass if there is
    such a column.

    Args:
        summary: summary table (see the head of this file); an optional column "mass" [kg] makes
            several curves, an optional column "unconverged" (number of points) marks doubtful
            peaks.
        file: PNG to write.
        points: response table; peaks at the end of the frequency band, which are none, are then
            drawn hollow.
        own: load that the damper's mass gives at the operating speed [N].
        searched: table of best loads by exact search, a row a mass; the star is then there,
            in the band of loads whose amplitudes keep within the accuracy of it.
        ax: two axes to draw into, amplitude and frequency.
        title: headline.
    """
    with canvas(file, ax, (7.2, 5.8), (2, 1), sharex=True, height_ratios=[1.6, 1]) as axes:
        groups = summary.groupby("mass") if "mass" in summary else [(None, summary)]
        for (mass, table), colour in zip(groups, COLOURS * 9, strict=False):
            label = None if mass is None else f"damper of {1e3 * mass:.4g} g"
            draw_optimum_curve(axes, table, colour, label, _exact_optimum(searched, mass))
        draw_limits(axes, summary)
        draw_cut(axes, summary, points)
        if own is not None:
            for axis in axes:
                axis.axvline(
                    own,
                    color="#555555",
                    lw=1.2,
                    ls=(0, (1, 1)),
                    label=f"the damper's own load, {own:.4g} N" if axis is axes[0] else None,
                )
        axes[0].set(ylabel="resonance amplitude [µm]", title=title or "optimum load")
        axes[1].set(ylabel="resonance frequency [Hz]", xlabel="normal load per seat [N]")
        log_axis(axes[0], "y")
        log_axis(axes[1], "x")
        axes[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return axes[0].figure


def draw_optimum_curve(
    axes: Any,
    table: pd.DataFrame,
    colour: str,
    label: str | None,
    exact: pd.Series | None = None,
) -> None:
    """One damper: two curves, its best load as a star with its numbers, the exact one where that
    was searched.
    """
    finite = table[(table["load"] > 0) & np.isfinite(table["load"])].sort_values("load")
    amplitude = MICRO * finite["peak_amplitude"]
    axes[0].plot(finite["load"], amplitude, "o-", color=colour, label=label)
    if "lowest" in finite and finite["lowest"].notna().any():
        _draw_history_range(axes[0], finite, colour)
    axes[1].plot(finite["load"], finite["peak_frequency"], "o-", color=colour)
    doubtful = (
        finite["unconverged"] > 0
        if "unconverged" in finite
        else pd.Series(False, index=finite.index)
    )
    if doubtful.any():
        axes[0].plot(
            finite["load"][doubtful],
            amplitude[doubtful],
            "x",
            color=FAILED_COLOUR,
            ms=9,
            mew=2,
            label="curve with unconverged points",
        )
    draw_unknown(axes[0], finite)
    best = finite.loc[finite["peak_amplitude"].idxmin()] if exact is None else exact
    if exact is not None:
        _draw_tolerated_loads(axes, exact, colour)
    text = f"optimum {best['load']:.4g} N: {MICRO * best['peak_amplitude']:.4g} µm"
    free = table.loc[table["load"] == 0, "peak_amplitude"]
    if len(free):
        text += f"\n{100 * (1 - best['peak_amplitude'] / free.iloc[0]):.1f} % below the free blade"
    elif exact is None and "reduction" in best:
        text += f"\n{best['reduction']:.3g} times smaller than the free blade's"
    for axis, y in zip(axes, (MICRO * best["peak_amplitude"], best["peak_frequency"]), strict=True):
        axis.plot(best["load"], y, "*", color=colour, ms=14, mec="black", mew=0.7, zorder=5)
        axis.axvline(best["load"], color=colour, lw=0.8, ls=":", alpha=0.8)
    axes[0].plot([], [], "*", color=colour, ms=11, mec="black", mew=0.7, label=text)
    axes[1].annotate(
        f"{best['peak_frequency']:.5g} Hz",
        (best["load"], best["peak_frequency"]),
        (8, -4),
        textcoords="offset points",
        fontsize=8.5,
        va="top",
    )


def _exact_optimum(searched: pd.DataFrame | None, mass: float | None) -> pd.Series | None:
    """The best load of a damper mass as a row with the names of the summary; None where no search
    succeeded.
    """
    if searched is None or searched.empty:
        return None
    found = searched[searched["amplitude"].notna()]
    if mass is not None and "mass" in found:
        found = found[np.isclose(found["mass"], mass)]
    if found.empty:
        return None
    return found.iloc[0].rename({"amplitude": "peak_amplitude", "frequency": "peak_frequency"})


def _draw_tolerated_loads(axes: Any, exact: pd.Series, colour: str) -> None:
    """The band of loads whose amplitudes keep within the accuracy of the optimum."""
    low, high = exact.get("tolerated_from", np.nan), exact.get("tolerated_to", np.nan)
    if not (np.isfinite(low) and np.isfinite(high)):
        return
    label = f"{low:.3g} to {high:.3g} N: within accuracy of the optimum"
    for axis, words in zip(axes, (label, None), strict=True):
        axis.axvspan(low, high, color=colour, alpha=0.12, lw=0, label=words, zorder=0)


def _draw_history_range(ax: Axes, finite: pd.DataFrame, colour: str) -> None:
    """Between which amplitudes the loading history decides; hollow where that was sampled."""
    sure = finite["interval"] != "sampled"
    ax.fill_between(
        finite["load"],
        MICRO * finite["lowest"],
        MICRO * finite["highest"],
        color=colour,
        alpha=0.22,
        lw=0,
        label="range by loading history" + ("" if sure.all() else " (hollow: sampled)"),
    )
    for name in ("lowest", "highest"):
        ax.plot(
            finite["load"][~sure],
            MICRO * finite[name][~sure],
            "o",
            mfc="none",
            mec=colour,
            ms=4,
        )


def draw_unknown(ax: Axes, finite: pd.DataFrame) -> None:
    """Hollow marks on peaks whose error is not known, because richer models were not solved."""
    unknown = finite[np.isinf(finite["error"])] if "error" in finite else finite.iloc[:0]
    _draw_hollow(ax, unknown, "peak_amplitude", MICRO, 7, 5, "error unknown")


def draw_cut(
    axes: Any,
    summary: pd.DataFrame,
    points: pd.DataFrame | None,
) -> None:
    """Hollow marks on peaks that are only the end of the frequency band."""
    if points is None or points.empty:
        return
    ends = summary["load"].map(
        points.groupby("load")["frequency"].agg(lambda f: (f.min(), f.max()))
    )
    cut = summary[
        [
            isinstance(end, tuple) and f in end
            for f, end in zip(summary["peak_frequency"], ends, strict=True)
        ]
    ]
    ended = "no peak: end of the frequency band"
    _draw_hollow(axes[0], cut, "peak_amplitude", MICRO, 8, 6, ended)
    _draw_hollow(axes[1], cut, "peak_frequency", 1.0, 8, 6)


def _draw_hollow(
    ax: Axes,
    peaks: pd.DataFrame,
    column: str,
    factor: float,
    size: int,
    zorder: int,
    label: str | None = None,
) -> None:
    """Hollow red marks on some peaks, none without any."""
    if len(peaks):
        ax.plot(
            peaks["load"],
            factor * peaks[column],
            "o",
            mfc="white",
            mec=FAILED_COLOUR,
            ms=size,
            mew=1.5,
            zorder=zorder,
            label=label,
        )


def draw_limits(axes: Any, summary: pd.DataFrame) -> None:
    """The free and the fully stuck blade as level lines, when the table has them."""
    for load, style in ((0.0, "--"), (np.inf, "-.")):
        row = summary[summary["load"] == load]
        if len(row):
            axes[0].axhline(
                MICRO * row["peak_amplitude"].iloc[0],
                color="#555555",
                ls=style,
                lw=1,
                label=load_name(load),
            )
            axes[1].axhline(row["peak_frequency"].iloc[0], color="#555555", ls=style, lw=1)


def loop_energy(displacement: np.ndarray, force: np.ndarray) -> float:
    """Energy dissipated in one closed loop [J], the area enclosed by (displacement [m], force
    [N]).
    """
    return float(
        abs(0.5 * np.sum(displacement * np.roll(force, -1) - np.roll(displacement, -1) * force))
    )


def draw_loops(
    loops: Mapping[str, tuple[np.ndarray, np.ndarray]],
    file: str | Path | None = None,
    *,
    ax: Axes | None = None,
    title: str = "",
) -> object:
    """Friction force over relative displacement, one closed loop a name, with its energy; returns
    the figure.

    Args:
        loops: name -> (displacement (k,) [m], force (k,) [N]) over one period.
        file: PNG to write.
        ax: axes to draw into; the legend is then inside them.
        title: headline.
    """
    right_of_axes = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)}
    place = right_of_axes if ax is None else {"loc": "lower right", "fontsize": 7.5}
    with canvas(file, ax, (6.4, 4.4)) as ax:
        shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.92, max(len(loops), 1)))
        colours = COLOURS if len(loops) <= 6 else shades
        for (name, (x, force)), colour in zip(loops.items(), colours, strict=False):
            closed = np.append(np.arange(len(x)), 0)
            energy = 1e3 * loop_energy(x, force)
            # a stuck node's loop is a line
            energy *= energy > 1e-9 * np.ptp(x) * np.ptp(force)
            ax.plot(
                MICRO * np.asarray(x)[closed],
                np.asarray(force)[closed],
                color=colour,
                label=f"{name}: {energy:.3g} mJ a cycle",
            )
        ax.set(
            xlabel="relative displacement [µm]",
            ylabel="friction force [N]",
            title=title or "hysteresis loops",
        )
        ax.legend(**place)
        return ax.figure


def draw_seat_loops(
    cases: Mapping[str, Mapping[str, tuple[np.ndarray, np.ndarray]]],
    file: str | Path | None = None,
) -> object:
    """``draw_loops`` of all seats, a panel a load, each on its own scale; returns the figure.

    Args:
        cases: name of the load -> name of the seat -> (displacement (k,) [m], force (k,) [N]).
    """
    across = min(len(cases), 4)
    down = -(-len(cases) // across)
    with canvas(
        file, None, (3.3 * across + 0.6, 2.9 * down + 0.3), (down, across), squeeze=False
    ) as axes:
        for number, (ax, (name, seats)) in enumerate(zip(axes.flat, cases.items(), strict=False)):
            draw_loops(seats, ax=ax, title=name)
            # the lowest panel of a column and the first of a row name the axes
            if number + across < len(cases):
                ax.set_xlabel("")
            if number % across:
                ax.set_ylabel("")
            low, high = ax.get_ylim()
            # room for the legend
            ax.set_ylim(low - 0.2 * (high - low), high)
        for ax in axes.flat[len(cases) :]:
            ax.set_axis_off()
        return axes[0, 0].figure


def pareto_front(time: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Indices of the points that no other beats in both time and error, by increasing time."""
    order = np.lexsort((error, time))
    best = np.minimum.accumulate(np.append(np.inf, error[order]))[:-1]
    return order[error[order] < best]


def draw_accuracy(
    table: pd.DataFrame,
    file: str | Path | None = None,
    *,
    ax: Axes | None = None,
    tolerance: float | None = None,
    title: str = "",
) -> object:
    """Error over time of each setting, the Pareto front, and a star on the automatic choice;
    returns the figure.

    Args:
        table: one row a setting: name, time [s], error [1]; optional bool columns "chosen" and
            "converged", optional text column "family" for the colour.
        file: PNG to write.
        ax: axes to draw into; names are to be moved apart (names_apart) when its limits are set.
        tolerance: wanted relative accuracy, drawn as a line.
        title: headline.
    """
    alone = ax is None
    with canvas(file, ax, (7.2, 4.6)) as ax:
        good = (
            table["converged"].astype(bool)
            if "converged" in table
            else pd.Series(True, index=table.index)
        )
        families = table["family"] if "family" in table else pd.Series("setting", index=table.index)
        marked = (
            table["chosen"].astype(bool)
            if "chosen" in table
            else pd.Series(False, index=table.index)
        )
        for name, colour in zip(families.unique(), COLOURS * 9, strict=False):
            part = table[(families == name) & good & ~marked]
            if part.empty:
                continue
            ax.plot(part["time"], part["error"], "o", color=colour, ms=5, alpha=0.8, label=name)
        _draw_failed_settings(ax, table[~good])
        draw_front(ax, table[good])
        if tolerance is not None:
            ax.axhline(
                tolerance,
                color="#555555",
                ls="--",
                lw=1,
                label=f"wanted accuracy {100 * tolerance:.3g} %",
            )
        ax.set(xlabel="time [s]", ylabel="error [%]", title=title or "speed against accuracy")
        log_axis(ax, "x")
        log_axis(ax, "y", 100.0)
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        if alone:
            names_apart(ax)
        return ax.figure


def _draw_failed_settings(ax: Axes, failed: pd.DataFrame) -> None:
    """Crosses at the top, with names, for settings without an error to show."""
    if failed.empty:
        return
    ax.plot(
        failed["time"],
        np.full(len(failed), 0.98),
        "x",
        color=FAILED_COLOUR,
        ms=7,
        mew=1.8,
        transform=ax.get_xaxis_transform(),
        label=f"not converged ({len(failed)})",
    )
    for _, row in failed[failed["time"].notna()].iterrows():
        ax.annotate(
            str(row["name"]),
            (row["time"], 0.98),
            (6, -13),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            fontsize=7.5,
            color=FAILED_COLOUR,
        )


def draw_front(ax: Axes, table: pd.DataFrame) -> None:
    """The Pareto front as stairs, with names where there is room, and the chosen setting."""
    front = table.iloc[pareto_front(table["time"].to_numpy(float), table["error"].to_numpy(float))]
    ax.step(
        front["time"],
        front["error"],
        where="post",
        color="#888888",
        lw=1,
        zorder=1,
        label="Pareto front",
    )
    for _, row in (
        front.sort_values("chosen", ascending=False) if "chosen" in front else front
    ).iterrows():
        ax.annotate(
            str(row["name"]),
            (row["time"], row["error"]),
            (6, 8),
            textcoords="offset points",
            fontsize=7.5,
        )
    if "chosen" in table and table["chosen"].any():
        chosen = table[table["chosen"].astype(bool)]
        ax.plot(
            chosen["time"],
            chosen["error"],
            "*",
            color=COLOURS[4],
            mec="black",
            ms=15,
            mew=0.8,
            zorder=5,
            label="automatic choice",
        )
