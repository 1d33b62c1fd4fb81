"""Pictures of contact and stability for the paper's page: the punch of Fig. 5 and 6, branches of
solutions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from bladefem.view.style import COLOURS, canvas, log_axis

# largest multiplier of a stable motion: sliders that never move have exactly 1
STABLE = 1.001


def draw_punch(
    radius: np.ndarray,
    pressure: np.ndarray,
    stiffness: np.ndarray,
    exact: tuple[np.ndarray, np.ndarray],
    springs: tuple[np.ndarray, np.ndarray],
    file: str | Path | None = None,
) -> object:
    """Pressure under a round punch, and the stiffness of the contact within a radius (Fig. 5, 6);
    returns the figure.

    Args:
        radius, pressure: (n,) of the nodes over the radius of the punch [1] and over the mean
            pressure [1].
        stiffness: (n,) force of the nodes over the approach [N/m].
        exact: radius (k,) [1] and pressure (k,) [1] of Johnson's formula.
        springs: edges (m + 1,) [1] and stiffness (m,) [N/m] of rings of springs.
    """
    with canvas(file, None, (9.4, 4.0), (1, 2)) as (left, right):
        order = np.argsort(radius)
        left.plot(*exact, color=COLOURS[1], label="Johnson: Eq. 24 in terms of the force")
        left.plot(
            radius[order],
            pressure[order],
            "o",
            ms=3,
            color=COLOURS[0],
            label="finite elements, all nodes",
        )
        left.set(
            xlabel="radius over that of the punch",
            ylabel="pressure over its mean",
            ylim=(0, 4),
            title="under a flat punch",
        )
        left.legend()
        right.plot(
            radius[order],
            np.cumsum(stiffness[order]) / 1e6,
            "o",
            ms=3,
            color=COLOURS[0],
            label="finite elements: force over approach",
        )
        right.plot(
            springs[0],
            np.r_[0, np.cumsum(springs[1])] / 1e6,
            "s-",
            ms=4,
            mfc="none",
            color=COLOURS[1],
            label=f"{len(springs[1])} rings of springs, Eq. 25",
        )
        right.set(
            xlabel="radius over that of the punch",
            ylabel="stiffness within the radius [N/µm]",
            title="discretised springs",
        )
        right.legend()
        return left.figure


def draw_branches(
    frequency: np.ndarray,
    amplitude: np.ndarray,
    multiplier: np.ndarray,
    marks: Sequence[tuple[float, float]],
    file: str | Path | None = None,
) -> object:
    """A path of periodic solutions, unstable parts dashed, and its largest multiplier; returns the
    figure.

    Args:
        frequency: (p,) along the path [Hz]. amplitude: (p,) [m]. multiplier: (p,) largest modulus
            [1].
        marks: (frequency [Hz], amplitude [m]) of single solutions.
    """
    unstable = multiplier > 1 + 1e-6
    with canvas(file, None, (9.4, 4.0), (1, 2), sharex=True) as (left, right):
        for ax, values in ((left, 1e6 * amplitude), (right, multiplier)):
            ax.plot(frequency, np.where(unstable, np.nan, values), color=COLOURS[0], label="stable")
            ax.plot(
                frequency,
                np.where(unstable, values, np.nan),
                "--",
                color=COLOURS[1],
                label="unstable",
            )
            ax.set_xlabel("frequency [Hz]")
        left.plot(
            [f for f, _ in marks], [1e6 * a for _, a in marks], "ko", ms=5, label="by shooting"
        )
        right.axhline(1.0, color="#888888", lw=0.8)
        left.set(ylabel="amplitude [µm]", title="normal load follows the motion")
        right.set(ylabel="largest Floquet multiplier", title="stability")
        log_axis(left, "y")
        left.legend()
        return left.figure


def draw_sweeps(
    frequency: np.ndarray,
    ways: Mapping[str, tuple[np.ndarray, np.ndarray]],
    file: str | Path | None = None,
) -> object:
    """Sweeps with rising and falling frequency, each point marked by its stability; returns the
    figure.

    Args:
        frequency: (p,) ascending [Hz].
        ways: name to amplitudes (p,) [m] and largest Floquet multipliers (p,) [1], NaN where
            unknown.
    """
    looks = (
        {"marker": "o", "mfc": "white"},
        {"marker": "s", "mec": "#222222"},
        {"marker": "x", "mec": "#888888"},
    )
    with canvas(file, None, (9.4, 4.0), (1, 2), sharex=True) as (left, right):
        for (name, (amplitude, multiplier)), colour, style in zip(
            ways.items(), COLOURS, ("-", "--"), strict=False
        ):
            left.plot(frequency, 1e6 * amplitude, style, color=colour, lw=1.2, label=name)
            right.plot(frequency, multiplier, style, color=colour, marker=".", lw=1.2)
            for kind, look in zip(_kinds(multiplier), looks, strict=True):
                left.plot(
                    frequency[kind], 1e6 * amplitude[kind], ls="none", color=colour, ms=4.5, **look
                )
        for word, look in zip(("stable", "unstable", "not judged"), looks, strict=True):
            left.plot([], [], ls="none", color="#888888", ms=4.5, label=word, **look)
        right.axhline(1.0, color="#888888", lw=0.8)
        left.set(
            xlabel="frequency [Hz]",
            ylabel="amplitude at the tip [µm]",
            title="plane blades, 3 N a seat",
        )
        right.set(xlabel="frequency [Hz]", ylabel="largest Floquet multiplier", title="stability")
        left.legend()
        return left.figure


def _kinds(multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which points are stable, unstable, unknown."""
    return multiplier <= STABLE, multiplier > STABLE, np.isnan(multiplier)
