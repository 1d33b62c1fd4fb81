"""Measured amplitudes over frequency, with those of a fitted contact at the same frequencies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .style import COLOURS, canvas, log_axis

# what is drawn of each level, in the order of its arrays, and its markers
SERIES: dict[str, dict[str, Any]] = {
    "measured": {"marker": "o"},
    "fitted contact": {"marker": "s", "markersize": 8.0, "fillstyle": "none"},
    "contact of the scene": {"marker": "x", "markersize": 5.0},
}


def draw_measured(
    levels: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
    title: str,
    file: str | Path,
) -> Axes:
    """Each level with a colour of its own, as points: a resonance rises and falls between two
    readings, and a line from one to the next would cut it off.

    Args:
        levels: name to frequencies [Hz] and amplitudes [m]: measured, by the fitted contact, by the
            one that the scene gives.
    """
    with canvas(file) as ax:
        for i, (name, (frequency, *amplitudes)) in enumerate(levels.items()):
            colour = COLOURS[i % len(COLOURS)]
            for values, marks in zip(amplitudes, SERIES.values(), strict=True):
                ax.plot(frequency, 1e6 * values, linestyle="", color=colour, **marks)
            ax.plot([], [], color=colour, linewidth=4.0, label=name)
        for words, marks in SERIES.items():
            ax.plot([], [], linestyle="", color="black", label=words, **marks)
        log_axis(ax, "y")
        ax.set_xlabel("frequency [Hz]")
        ax.set_ylabel("amplitude [µm]")
        ax.set_title(title)
        ax.legend(loc="best")
    return ax
