"""Pictures to compare with those of the paper: loops, spectra, responses, resonance against
load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from bladefem.damper.zmass import Footprint
from bladefem.data import PressureMap

from ..scene.units import newtons
from .style import COLOURS, MICRO, canvas, log_axis

MILLI = 1e3
LOAD_LABEL = "normal load of a seat [N]"


def draw_fit(
    angle: np.ndarray,
    motion: np.ndarray,
    force: np.ndarray,
    linear: np.ndarray,
    file: str | Path | None = None,
) -> object:
    """A loop and its best linear force, against displacement and in time (the paper's Fig. 1);
    returns the figure.

    Args:
        angle: (s,) [rad].
        motion: (s,) [m]. force, linear: (s,) [N].
    """
    with canvas(file, None, (9.0, 3.8), (1, 2)) as (left, right):
        left.plot(MICRO * motion, force, label="friction")
        left.plot(MICRO * motion, linear, "--", label="best linear force")
        right.plot(angle / np.pi, force)
        right.plot(angle / np.pi, linear, "--")
        left.set(xlabel="relative displacement [µm]", ylabel="force [N]", title="hysteresis")
        right.set(xlabel="phase [half turns]", ylabel="force [N]", title="in time")
        left.legend()
        return left.figure


def draw_coupled_loops(
    loops: Mapping[str, Sequence[tuple[str, np.ndarray, np.ndarray]]],
    file: str | Path | None = None,
) -> object:
    """Loops under a load that varies, one panel a case, each with several laws (Fig. 4); returns
    the figure.

    Args:
        loops: panel title to (law, displacement (s,) [m], force (s,) [N]).
    """
    with canvas(file, None, (4.0 * len(loops), 3.8), (1, len(loops)), squeeze=False) as axes:
        for ax, (title, laws) in zip(axes[0], loops.items(), strict=True):
            for (law, motion, force), style in zip(laws, ("-", "--", ":"), strict=False):
                ax.plot(MICRO * motion, force, style, label=law)
            ax.set(xlabel="relative displacement [µm]", title=title)
        axes[0, 0].set_ylabel("friction force [N]")
        axes[0, 0].legend()
        return axes[0, 0].figure


def draw_footprint(
    seat: PressureMap,
    points: Footprint,
    file: str | Path | None = None,
) -> object:
    """Pressure under the mass over its mean, and the contact points with their shares (Fig. 8 and
    9); the figure.

    Args:
        seat: on the plane z = 0.
        points: sizes of the marks go with the shares.
    """
    xy = MILLI * seat.patch.points[:, :2]
    mean = seat.force.sum() / seat.patch.area.sum()
    with canvas(file, None, (9.4, 4.2), (1, 2), sharex=True, sharey=True) as (left, right):
        flat = Triangulation(xy[:, 0], xy[:, 1], seat.patch.faces[:, :3])
        image = left.tripcolor(
            flat, seat.pressure / mean, shading="gouraud", cmap="viridis", rasterized=True
        )
        left.figure.colorbar(image, ax=left, label="pressure over its mean")
        left.set(
            xlabel="x [mm]",
            ylabel="y [mm]",
            aspect="equal",
            title=f"{newtons(seat.force.sum(), 4)}, mean {mean / 1e3:.4g} kPa",
        )
        place = MILLI * points.points
        share = len(points.share) * points.share
        right.triplot(flat, color="#cccccc", lw=0.3)
        marks = right.scatter(
            *place.T,
            c=share,
            s=8 + 60 * min(1.0, 40 / len(share)) * share,
            cmap="viridis",
            zorder=3,
        )
        right.figure.colorbar(marks, ax=right, label="share of the load over its mean")
        right.set(xlabel="x [mm]", aspect="equal", title=f"{len(share)} contact points")
        return left.figure


def draw_mass_loops(
    cases: Mapping[str, tuple[np.ndarray, np.ndarray, int]], file: str | Path | None = None
) -> object:
    """Friction force over relative displacement, drift taken out (Fig. 10); returns the figure.

    Args:
        cases: title to (displacement (s,) [m], force (s,) [N], number of loops).
    """
    rows = (len(cases) + 1) // 2
    with canvas(file, None, (8.4, 3.4 * rows), (rows, 2), squeeze=False) as axes:
        for ax, (title, (motion, force, loops)) in zip(axes.ravel(), cases.items(), strict=False):
            ax.plot(MILLI * motion, force)
            ax.set(
                xlabel="relative displacement [mm]",
                ylabel="friction force [N]",
                title=f"{title}: {loops} loop{'s' if loops > 1 else ''}",
            )
        return axes[0, 0].figure


def draw_mass_spectra(
    cases: Mapping[str, tuple[np.ndarray, np.ndarray]], file: str | Path | None = None
) -> object:
    """Amplitude lines of the displacement (Fig. 11); returns the figure.

    Args:
        cases: title to (frequency (l,) [Hz], amplitude (l,) [m]).
    """
    rows = (len(cases) + 1) // 2
    with canvas(file, None, (8.4, 2.8 * rows), (rows, 2), squeeze=False) as axes:
        for ax, (title, (frequency, amplitude)) in zip(axes.ravel(), cases.items(), strict=False):
            shown = frequency <= 500
            ax.vlines(
                frequency[shown],
                1e-4,
                np.maximum(MILLI * amplitude[shown], 1e-4),
                lw=2.2,
                color=COLOURS[0],
            )
            ax.set(xlabel="frequency [Hz]", ylabel="amplitude [mm]", title=title, ylim=(1e-4, 3))
            ax.set_yscale("log")
        return axes[0, 0].figure


def draw_tip_responses(
    curves: Mapping[float, tuple[np.ndarray, np.ndarray]],
    file: str | Path | None = None,
    title: str = "",
    dots: Mapping[float, np.ndarray] | None = None,
    crosses: Mapping[float, np.ndarray] | None = None,
) -> object:
    """Tip amplitude over frequency for several loads (Fig. 15); returns the figure.

    Args:
        curves: load [N] to (frequency (p,) [Hz], amplitude (p,) [m]).
        dots: load [N] to the same (2, k) by another method.
        crosses: as dots, by a third method.
    """
    marks = (
        (dots or {}, {"marker": "o", "ms": 3.5, "mec": "#444444", "mew": 0.4}),
        (crosses or {}, {"marker": "x", "ms": 5.5, "mew": 1.3}),
    )
    with canvas(file, None, (7.6, 4.6)) as ax:
        shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.92, len(curves)))
        for shade, (value, (frequency, amplitude)) in zip(
            shades, sorted(curves.items()), strict=True
        ):
            ax.plot(frequency, MICRO * amplitude, color=shade, label=f"{value:.3g}")
            for points, how in marks:
                x, y = points.get(value, np.empty((2, 0)))
                inside = (x > frequency.min()) & (x < frequency.max())
                ax.plot(
                    x[inside], MICRO * y[inside], ls="none", color=shade, **{"mec": shade, **how}
                )
        for name, (points, how) in zip(("loop, damper exact", "paper's loop"), marks, strict=True):
            if points:
                ax.plot([], [], ls="none", color="#444444", label=name, **how)
        ax.set(xlabel="frequency [Hz]", ylabel="amplitude at the tip [µm]", title=title)
        log_axis(ax, "y")
        ax.legend(title=LOAD_LABEL, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax.figure


def draw_friction_loops(
    loops: Mapping[float, tuple[np.ndarray, np.ndarray]],
    file: str | Path | None = None,
) -> object:
    """Total friction force of a seat over its relative displacement at resonance (Fig. 16); returns
    the figure.

    Args:
        loops: load [N] to (displacement (s,) [m], force (s,) [N]).
    """
    with canvas(file, None, (7.2, 4.6)) as ax:
        shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.92, len(loops)))
        for shade, (value, (motion, force)) in zip(shades, sorted(loops.items()), strict=True):
            ax.plot(
                MICRO * np.r_[motion, motion[0]],
                np.r_[force, force[0]],
                color=shade,
                label=f"{value:.3g}",
            )
        ax.set(
            xlabel="relative displacement [µm]",
            ylabel="friction force of a seat [N]",
            title="loops at resonance",
        )
        ax.legend(title=LOAD_LABEL, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax.figure


def draw_peaks(
    curves: Mapping[float, np.ndarray],
    file: str | Path | None = None,
    title: str = "",
    best: Mapping[float, tuple[float, float]] | None = None,
    loop: np.ndarray | None = None,
) -> object:
    """Resonance frequency and amplitude over the load, a curve a damper mass (Fig. 17); returns the
    figure.

    Args:
        curves: damper mass [kg] to (loads, 3) of load [N], frequency [Hz], amplitude [m].
        best: damper mass [kg] to its optimum load [N] and the amplitude there [m].
        loop: (k, 3) as curves, by another method.
    """
    with canvas(file, None, (9.4, 4.0), (1, 2)) as (left, right):
        for mass, rows in sorted(curves.items()):
            (line,) = left.plot(rows[:, 0], rows[:, 1], "o-", ms=3, label=f"{1e3 * mass:.0f} g")
            right.plot(rows[:, 0], MICRO * rows[:, 2], "o-", ms=3)
            if best is not None:
                right.plot(
                    best[mass][0],
                    MICRO * best[mass][1],
                    "*",
                    ms=11,
                    color=line.get_color(),
                    mec="white",
                    mew=0.6,
                )
        if loop is not None:
            left.plot(loop[:, 0], loop[:, 1], "kx", ms=6, label="paper's loop")
            right.plot(loop[:, 0], MICRO * loop[:, 2], "kx", ms=6)
        for ax in (left, right):
            ax.set_xscale("log")
            ax.set_xlabel(LOAD_LABEL)
        left.set(ylabel="resonance frequency [Hz]", title=title)
        right.set(ylabel="resonance amplitude [µm]")
        log_axis(right, "y")
        left.legend(title="damper")
        return left.figure


def draw_histories(
    lines: Mapping[tuple[float, str], tuple[Sequence[float], float]],
    wanted: float,
    file: str | Path | None = None,
    title: str = "",
) -> object:
    """Steps of an iteration over its turns, one panel a way to run it (Fig. 14); returns the
    figure.

    Args:
        lines: (load [N], way) to the relative steps and the error of the end [%].
        wanted: step at which it stops.
    """
    ways = list(dict.fromkeys(way for _, way in lines))
    loads = list(dict.fromkeys(load for load, _ in lines))
    shades = dict(
        zip(loads, matplotlib.colormaps["viridis"](np.linspace(0, 0.92, len(loads))), strict=True)
    )
    with canvas(
        file, None, (4.8 * len(ways), 3.8), (1, len(ways)), squeeze=False, sharey=True
    ) as axes:
        for ax, way in zip(axes[0], ways, strict=True):
            for load in loads:
                steps, error = lines[load, way]
                ax.plot(
                    np.arange(1, len(steps) + 1),
                    steps,
                    "o-",
                    ms=3.5,
                    color=shades[load],
                    label=f"{newtons(load)}: {error:.3g} % off",
                )
            ax.axhline(wanted, color="#888888", ls="--", lw=1)
            ax.set(xlabel="turn", title=way)
            ax.set_yscale("log")
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
            ax.legend()
        axes[0, 0].set_ylabel("step over motion")
        axes[0, 0].figure.suptitle(title, fontsize=11)
        return axes[0, 0].figure
