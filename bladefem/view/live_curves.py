"""Curves for a page with script: the same as the pictures, as data and layout of plotly.js."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.colors
import numpy as np
import pandas as pd

from ..scene.units import newtons
from ..util.percent import percent
from .lower_motion import COLUMN, LOWER, with_lower_motion
from .optimum import exact_optimum, limit_name
from .response import FOLLOWED, MARCHED, load_colours, load_name, pieces_of, smooth_curve
from .style import COLOURS, FAILED_COLOUR, MICRO

# significant digits of numbers on the page
SIGNIFICANT_DIGITS = 7
SYMBOLS = ("circle", "diamond", "triangle-up", "square")
DASHES = {0.0: "dash", np.inf: "dot"}


def live_responses(
    points: pd.DataFrame,
    title: str = "",
) -> dict[str, Any]:
    """Amplitude over frequency, a curve a load, every solved point with its numbers.

    Args:
        points: response table, SI columns (see ``response.py``).
        title: headline.
    """
    loads = np.sort(points["load"].unique())
    colours = load_colours(loads)
    data: list[dict[str, Any]] = []
    for load in loads:
        curve = points[points["load"] == load].sort_values("frequency", kind="stable")
        for number, (piece, unstable) in enumerate(pieces_of(curve)):
            colour = _hex(colours[load])
            lines = _curve_traces(curve.iloc[piece], float(load), colour)
            if curve["method"].iloc[piece].isin([MARCHED, FOLLOWED]).any():
                lines[1]["marker"] = {**lines[1]["marker"], "symbol": "diamond", "size": 9}
            # one name a load, for all its pieces
            lines[0]["showlegend"] = number == 0
            if unstable:
                lines[0]["line"] = {**lines[0].get("line", {}), "dash": "dash"}
            data += lines
    failed = points[~points["converged"].astype(bool) & (points["amplitude"] > 0)]
    if len(failed):
        data.append(
            _mark_points(
                failed, f"not converged ({len(failed)})", {"symbol": "x", "color": FAILED_COLOUR}
            )
        )
    if "stability" in points and (points["stability"] == "unstable").any():
        unstable = points[points["stability"] == "unstable"]
        style = {"symbol": "square-open", "color": FAILED_COLOUR, "size": 7}
        data.append(_mark_points(unstable, f"unstable ({len(unstable)})", style))
    data += _lower_motions(points, "frequency", {load: _hex(colours[load]) for load in loads})
    layout = {
        "title": _escape_title(title),
        "xaxis": {"title": {"text": "excitation frequency [Hz]"}},
        "yaxis": {
            "title": {"text": "vibration amplitude [µm]"},
            **_log_axis(MICRO * points["amplitude"]),
        },
        "legend": {"title": {"text": "normal load per seat"}},
        "hovermode": "closest",
    }
    return {"kind": "chart", "data": data, "layout": layout}


def _hex(colour: Any) -> str:
    return str(matplotlib.colors.to_hex(colour))


def _lower_motions(
    table: pd.DataFrame, at: str, colours: Mapping[float, str]
) -> list[dict[str, Any]]:
    """Open marks at the lower motions of a table, in one entry of the legend; none without any.

    Args:
        at: column that is their place along the figure.
        colours: of the loads [N].
    """
    rows = with_lower_motion(table)
    if rows.empty:
        return []
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": LOWER,
            "x": json_numbers(rows[at]),
            "y": json_numbers(MICRO * rows[COLUMN]),
            "marker": {
                "symbol": "triangle-down-open",
                "size": 9,
                "color": [colours[load] for load in rows["load"]],
            },
            "text": [load_name(float(load)) for load in rows["load"]],
            "hovertemplate": "load %{text}, %{y:.4g} µm<extra></extra>",
        }
    ]


def _curve_traces(
    curve: pd.DataFrame,
    load: float,
    colour: str,
) -> list[dict[str, Any]]:
    """A line that keeps the slopes, and the solved points to hover over."""
    good = curve["converged"].to_numpy(bool)
    frequency = curve["frequency"].to_numpy(float)
    amplitude = np.where(good, MICRO * curve["amplitude"].to_numpy(float), np.nan)
    x, y = smooth_curve(frequency, amplitude)
    name = load_name(load)
    line = {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "legendgroup": name,
        "x": json_numbers(x),
        "y": json_numbers(y),
        "line": {"color": colour, "dash": DASHES.get(load, "solid"), "width": 2},
        "hoverinfo": "skip",
    }
    marks = _mark_points(curve[good], name, {"color": colour, "size": 5})
    return [line, {**marks, "legendgroup": name, "showlegend": False}]


def _mark_points(
    points: pd.DataFrame,
    name: str,
    style: dict[str, Any],
) -> dict[str, Any]:
    """Points with their numbers; names come from the scene and are plain text."""
    hover = ["load", "method", "estimated_error", "slipping"]
    known = [column for column in hover if column in points]
    texts = [
        "<br>".join(_hover_line(column, row[column]) for column in known)
        for _, row in points.iterrows()
    ]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": json_numbers(points["frequency"]),
        "y": json_numbers(MICRO * points["amplitude"]),
        "marker": style,
        "text": texts,
        "hovertemplate": "%{x:.3f} Hz, %{y:.4g} µm<br>%{text}<extra></extra>",
    }


def _hover_line(column: str, value: Any) -> str:
    """One line of a hover text."""
    if column == "load":
        return f"load {load_name(float(value))}"
    if column == "estimated_error":
        return f"estimated error {percent(value)}" if np.isfinite(value) else "error unknown"
    if column == "slipping":
        return f"{value:g} elements slip or lift off"
    return str(value)


def live_optimum(
    summary: pd.DataFrame,
    own: float | None = None,
    searched: pd.DataFrame | None = None,
    named: bool = True,
) -> dict[str, Any]:
    """Resonance amplitude and frequency over load, a curve a damper mass; a star at the best load.

    Args:
        summary: one row a load, SI columns.
        own: load that the damper's mass gives at the operating speed [N].
        searched: table of best loads by exact search, a row a mass; the star is then there, in
            the band of loads whose amplitudes keep within the accuracy of it.
        named: the data can carry an optimum; else none is marked.
    """
    data: list[dict[str, Any]] = []
    shapes = _level_lines(summary)
    groups = list(summary.groupby("mass")) if "mass" in summary else [(None, summary)]
    for number, (mass, table) in enumerate(groups):
        finite = table[(table["load"] > 0) & np.isfinite(table["load"])].sort_values("load")
        name = "resonance" if mass is None else f"damper of {1e3 * mass:.4g} g"
        colour = COLOURS[number % len(COLOURS)]
        data += _optimum_curve(finite, name, colour)
        data += _lower_motions(finite, "load", dict.fromkeys(finite["load"], colour))
        if not named:
            continue
        exact = exact_optimum(searched, mass)
        best = finite.loc[finite["peak_amplitude"].idxmin()] if exact is None else exact
        data += _optimum_stars(best, name, colour)
        if exact is not None:
            shapes += _tolerated_band(exact, colour)
    if own is not None:
        shapes.append(_level_line("x", own, "dot", f"own load {newtons(own, 4)}", "end"))
    finite = summary[np.isfinite(summary["load"]) & (summary["load"] > 0)]
    loads = _log_axis(finite["load"])
    layout = {
        "title": _escape_title("optimum load"),
        "showlegend": len(groups) > 1,
        "grid": {"rows": 2, "columns": 1, "pattern": "independent"},
        "xaxis": {**loads, "domain": [0, 1], "anchor": "y"},
        "xaxis2": {
            **loads,
            "matches": "x",
            "anchor": "y2",
            "title": {"text": "normal load per seat [N]"},
        },
        "yaxis": {
            **_log_axis(MICRO * summary["peak_amplitude"]),
            "range": _log_range(MICRO * summary["peak_amplitude"]),
            "domain": [0.42, 1],
            "title": {"text": "resonance amplitude [µm]"},
        },
        "yaxis2": {"domain": [0, 0.34], "title": {"text": "frequency [Hz]"}},
        "shapes": shapes,
    }
    return {"kind": "chart", "data": data, "layout": layout}


def _optimum_curve(
    finite: pd.DataFrame,
    name: str,
    colour: str,
) -> list[dict[str, Any]]:
    """Amplitude with its estimated error above, frequency below; hollow where the error is not
    known.
    """
    amplitude = MICRO * finite["peak_amplitude"].to_numpy(float)
    error = finite["error"].to_numpy(float) if "error" in finite else np.full(len(finite), np.nan)
    common = {
        "type": "scatter",
        "mode": "lines+markers",
        "name": name,
        "legendgroup": name,
        "x": json_numbers(finite["load"]),
        "line": {"color": colour},
    }
    unknown = np.isinf(error)
    symbols = ["circle-open" if doubt else "circle" for doubt in unknown]
    colours = [FAILED_COLOUR if doubt else colour for doubt in unknown]
    hover = ["error unknown" if doubt else "" for doubt in unknown]
    bars = np.where(np.isfinite(error), error * amplitude, 0.0)
    upper = {
        **common,
        "y": json_numbers(amplitude),
        "marker": {"symbol": symbols, "size": 7, "color": colours},
        "error_y": {"type": "data", "array": json_numbers(bars), "thickness": 1},
        "text": hover,
        "hovertemplate": "%{x:.4~r} N, %{y:.4g} µm<br>%{text}<extra></extra>",
    }
    lower = {
        **common,
        "y": json_numbers(finite["peak_frequency"]),
        "xaxis": "x2",
        "yaxis": "y2",
        "showlegend": False,
        "hovertemplate": "%{x:.4~r} N, %{y:.6g} Hz<extra></extra>",
    }
    return [upper, lower]


def _optimum_stars(best: pd.Series, name: str, colour: str) -> list[dict[str, Any]]:
    """The best load in both panels.

    Args:
        best: load, peak_amplitude, peak_frequency; SI.
    """
    star = {
        "type": "scatter",
        "mode": "markers",
        "name": f"best load, {name}",
        "legendgroup": name,
        "showlegend": False,
        "x": json_numbers([best["load"]]),
        "marker": {"symbol": "star", "size": 15, "color": colour, "line": {"width": 1}},
    }
    words = "best load %{x:.4~r} N, "
    return [
        {
            **star,
            "y": json_numbers([MICRO * best["peak_amplitude"]]),
            "hovertemplate": words + "%{y:.4g} µm<extra></extra>",
        },
        {
            **star,
            "y": json_numbers([best["peak_frequency"]]),
            "xaxis": "x2",
            "yaxis": "y2",
            "hovertemplate": words + "%{y:.6g} Hz<extra></extra>",
        },
    ]


def _tolerated_band(exact: pd.Series, colour: str) -> list[dict[str, Any]]:
    """The loads whose amplitudes keep within the accuracy of the optimum, in both panels; none
    where an end is not known.
    """
    low, high = exact.get("tolerated_from", np.nan), exact.get("tolerated_to", np.nan)
    if not (np.isfinite(low) and np.isfinite(high)):
        return []
    band = {
        "type": "rect",
        "x0": float(low),
        "x1": float(high),
        "y0": 0,
        "y1": 1,
        "fillcolor": colour,
        "opacity": 0.12,
        "line": {"width": 0},
        "layer": "below",
    }
    return [
        {**band, "xref": "x", "yref": "y domain"},
        {**band, "xref": "x2", "yref": "y2 domain"},
    ]


def _level_lines(summary: pd.DataFrame) -> list[dict[str, Any]]:
    """The blade without damper and in full stick."""
    lines = []
    # the two often lie close together: their names are at both ends
    places = dict(zip(DASHES, ("start", "end"), strict=True))
    for load, dash in DASHES.items():
        for _, row in summary[summary["load"] == load].iterrows():
            value = MICRO * float(row["peak_amplitude"])
            lines.append(_level_line("y", value, dash, limit_name(row), places[load]))
    return lines


def _level_line(
    axis: str,
    value: float,
    dash: str,
    label: str,
    place: str = "start",
) -> dict[str, Any]:
    """A line across the upper panel."""
    other = "y" if axis == "x" else "x"
    return {
        "type": "line",
        f"{axis}0": value,
        f"{axis}1": value,
        f"{axis}ref": axis,
        f"{other}0": 0,
        f"{other}1": 1,
        f"{other}ref": f"{other} domain",
        "line": {"color": "#555555", "dash": dash, "width": 1},
        "label": {
            "text": label,
            "textposition": place,
            # inside of the panel: above a level line at its start, below at its end
            "xanchor": "left" if place == "start" else "right",
            "yanchor": "bottom" if place == "start" else "top",
            "textangle": 0,
            "font": {"size": 10},
        },
    }


def live_loops(
    cases: Mapping[str, Mapping[str, tuple[np.ndarray, np.ndarray]]],
) -> dict[str, Any]:
    """Hysteresis of each seat, all loads in one chart; a click on a name hides a load.

    Args:
        cases: name of the load -> name of the seat -> (displacement (k,) [m], force (k,) [N]), in
            the order of the loads.
    """
    data = []
    colours = load_colours(np.arange(1.0, len(cases) + 1.0))
    dashes = ("solid", "dash")
    names = next(iter(cases.values()), {})
    dash_note = ", ".join(f"{dash}: {seat}" for dash, seat in zip(dashes, names, strict=False))
    for number, (load, seats) in enumerate(cases.items(), 1):
        colour = matplotlib.colors.to_hex(colours[number])
        pairs = zip(dashes, seats.items(), strict=False)
        for first, (dash, (seat, (x, force))) in enumerate(pairs):
            closed = np.append(np.arange(len(x)), 0)
            data.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "name": load,
                    "legendgroup": load,
                    # one name for both seats
                    "showlegend": first == 0,
                    "x": json_numbers(MICRO * np.asarray(x)[closed]),
                    "y": json_numbers(np.asarray(force)[closed]),
                    "line": {"color": colour, "dash": dash, "width": 1.6},
                    "hovertemplate": f"%{{x:.4g}} µm, %{{y:.4g}} N<extra>{load}, {seat}</extra>",
                }
            )
    layout = {
        "title": _escape_title("hysteresis loops"),
        "xaxis": {"title": {"text": f"relative displacement [µm]<br>{dash_note}"}},
        "yaxis": {"title": {"text": "friction force [N]"}},
        "hovermode": "closest",
    }
    return {"kind": "chart", "data": data, "layout": layout}


def live_diameters(table: pd.DataFrame) -> dict[str, Any]:
    """Natural frequencies over nodal diameter, by family.

    Args:
        table: columns nodal_diameter, mode, frequency [Hz], optionally family.
    """
    names = table["family"] if "family" in table else table["mode"].map("mode {}".format)
    data = [
        {
            "type": "scatter",
            "mode": "markers",
            "name": str(name),
            "x": json_numbers(table.loc[names == name, "nodal_diameter"]),
            "y": json_numbers(table.loc[names == name, "frequency"]),
            "marker": {
                "color": COLOURS[i % len(COLOURS)],
                "symbol": SYMBOLS[i // len(COLOURS) % len(SYMBOLS)],
                "size": 8,
            },
            "hovertemplate": "nodal diameter %{x}, %{y:.6g} Hz<extra>%{fullData.name}</extra>",
        }
        for i, name in enumerate(dict.fromkeys(names))
    ]
    layout = {
        "title": _escape_title("natural frequencies of the wheel"),
        "xaxis": {"title": {"text": "nodal diameter"}, "dtick": 1},
        "yaxis": {"title": {"text": "frequency [Hz]"}, "rangemode": "tozero"},
        "hovermode": "closest",
    }
    return {"kind": "chart", "data": data, "layout": layout}


def _log_axis(values: Any) -> dict[str, Any]:
    """A logarithmic axis with plain numbers at 1, 2 and 5 of each decade, or at 1 alone where
    there are many.
    """
    array = np.asarray(values, dtype=float)
    array = array[np.isfinite(array) & (array > 0)]
    if not len(array):
        return {"type": "log"}
    low = int(np.floor(np.log10(array.min())))
    high = int(np.ceil(np.log10(array.max())))
    steps = (1, 2, 3, 4, 5, 6, 8) if high - low < 2 else (1, 2, 5) if high - low < 5 else (1,)
    ticks = [step * 10.0**decade for decade in range(low, high + 1) for step in steps]
    return {"type": "log", "tickvals": ticks, "ticktext": [f"{tick:g}" for tick in ticks]}


def _log_range(values: Any) -> list[float | None] | None:
    """Decades from the least to the largest value with room for marks and names."""
    array = np.asarray(values, dtype=float)
    array = array[np.isfinite(array) & (array > 0)]
    if not len(array):
        return None
    low, high = np.log10(array.min()), np.log10(array.max())
    room = 0.08 * (high - low) + 0.02
    return json_numbers([low - room, high + 1.5 * room])


def json_numbers(values: Any) -> list[float | None]:
    """Plain numbers with the digits that a page needs; None where there is none."""
    array = np.asarray(values, dtype=float)
    return [float(f"{v:.{SIGNIFICANT_DIGITS}g}") if np.isfinite(v) else None for v in array]


def _escape_title(words: str) -> dict[str, Any]:
    """A title; plotly.js takes markup, so that the user's own words are escaped."""
    plain = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return {"text": plain, "x": 0.0, "xref": "paper", "font": {"size": 14}}
