"""Optimum: amplitude and frequency of the resonance against the normal load, between the linear
limits of no damper and full stick.

The summary table has one row a load, in SI units: load, peak_frequency, peak_amplitude,
dissipated_energy [J], friction_damping [1], reduction (free over damped amplitude). Load 0 means no
damper, load inf full stick.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..scene.units import newton_range, newtons
from ..util.arrays import BooleanArray
from .lower_motion import explain_lower, mark_lower, with_lower_motion
from .response import load_name
from .style import COLOURS, FAILED_COLOUR, MICRO, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# downwards, of the amplitude
LONGEST_BAR = 0.9


def draw_optimum(
    summary: pd.DataFrame,
    file: str | Path | None = None,
    *,
    points: pd.DataFrame | None = None,
    own: float | None = None,
    searched: pd.DataFrame | None = None,
    named: bool = True,
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
        named: the data can carry an optimum; else none is marked.
    """
    with canvas(file, size=(7.2, 5.8), grid=(2, 1), sharex=True, height_ratios=[1.6, 1]) as axes:
        groups = summary.groupby("mass") if "mass" in summary else [(None, summary)]
        for (mass, table), colour in zip(groups, COLOURS * 9, strict=False):
            label = None if mass is None else f"damper of {1e3 * mass:.4g} g"
            exact = exact_optimum(searched, mass)
            _draw_curve(axes, table, colour, label)
            if named:
                _draw_star(axes, table, colour, exact)
        if not named:
            axes[0].plot([], [], " ", label="no optimum is named: see the answer")
        draw_limits(axes, summary)
        draw_cut(axes, summary, points)
        explain_lower(axes[0], summary)
        if own is not None:
            for axis in axes:
                axis.axvline(
                    own,
                    color="#555555",
                    lw=1.2,
                    ls=(0, (1, 1)),
                    label=f"the damper's own load, {newtons(own, 4)}" if axis is axes[0] else None,
                )
        axes[0].set(ylabel="resonance amplitude [µm]", title="optimum load")
        axes[1].set(ylabel="resonance frequency [Hz]", xlabel="normal load per seat [N]")
        log_axis(axes[0], "y")
        log_axis(axes[1], "x")
        axes[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return axes[0].figure


def _draw_curve(
    axes: Any,
    table: pd.DataFrame,
    colour: str,
    label: str | None,
) -> None:
    """One damper: two curves, the amplitude with its estimated error."""
    finite = _finite_loads(table)
    amplitude = MICRO * finite["peak_amplitude"]
    if "error" in finite:
        _draw_errors(axes[0], finite, colour)
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
    lower = with_lower_motion(finite)
    if len(lower):
        mark_lower(axes[0], lower["load"], lower, colour)
    draw_unknown(axes[0], finite)


def _finite_loads(table: pd.DataFrame) -> pd.DataFrame:
    return table[(table["load"] > 0) & np.isfinite(table["load"])].sort_values("load")


def _draw_errors(ax: Axes, finite: pd.DataFrame, colour: str) -> None:
    """Bars of the estimated errors that are known."""
    amplitude = MICRO * finite["peak_amplitude"].to_numpy(float)
    error = finite["error"].to_numpy(float)
    error = np.where(np.isfinite(error), error, 0.0)
    # a logarithmic axis has no zero
    below = np.minimum(error, LONGEST_BAR)
    bars = np.stack([below, error]) * amplitude
    ax.errorbar(finite["load"], amplitude, bars, fmt="none", ecolor=colour, elinewidth=1)


def _draw_star(axes: Any, table: pd.DataFrame, colour: str, exact: pd.Series | None = None) -> None:
    """The best load of one damper with its numbers, the exact one where that was searched."""
    finite = _finite_loads(table)
    best = finite.loc[finite["peak_amplitude"].idxmin()] if exact is None else exact
    if exact is not None:
        _draw_tolerated_loads(axes, exact, colour)
    text = f"optimum {newtons(best['load'], 4)}: {MICRO * best['peak_amplitude']:.4g} µm"
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
        # lines of other loads would strike it through
        bbox={"fc": "white", "ec": "none", "pad": 1.0, "alpha": 0.9},
        zorder=6,
    )


def exact_optimum(searched: pd.DataFrame | None, mass: float | None) -> pd.Series | None:
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
    label = f"{newton_range(low, high, 3)}: within accuracy of the optimum"
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
    """Hollow marks on peaks whose error is not known."""
    unknown = finite[np.isinf(finite["error"])] if "error" in finite else finite.iloc[:0]
    _draw_hollow(ax, unknown, "peak_amplitude", MICRO, 7, 5, "error unknown")


def at_band_end(summary: pd.DataFrame, points: pd.DataFrame) -> BooleanArray:
    """(rows,) whether the highest point is the first or last of its curve.

    Args:
        summary: rows of the design table.
        points: response table.
    """
    by = ["load", "mass"] if "mass" in points and "mass" in summary else ["load"]
    ends = points.groupby(by, dropna=False)["frequency"].agg(["min", "max"]).reset_index()
    joined = summary[[*by, "peak_frequency"]].merge(ends, on=by, how="left")
    peak = joined["peak_frequency"]
    return np.asarray((peak == joined["min"]) | (peak == joined["max"]))


def draw_cut(
    axes: Any,
    summary: pd.DataFrame,
    points: pd.DataFrame | None,
) -> None:
    """Hollow marks on peaks that are only the end of the frequency band."""
    if points is None or points.empty:
        return
    cut = summary[at_band_end(summary, points)]
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
        for _, row in summary[summary["load"] == load].iterrows():
            axes[0].axhline(
                MICRO * row["peak_amplitude"],
                color="#555555",
                ls=style,
                lw=1,
                label=limit_name(row),
            )
            axes[1].axhline(row["peak_frequency"], color="#555555", ls=style, lw=1)


def limit_name(row: pd.Series) -> str:
    """ "∞ (full stick)", with the damper's mass where several are studied."""
    mass = row.get("mass", np.nan)
    return load_name(row["load"]) + ("" if np.isnan(mass) else f", {1e3 * mass:.4g} g")
