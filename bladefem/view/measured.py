"""Measured amplitudes over frequency, with the curves of a fitted contact."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .style import COLOURS, canvas, log_axis


def draw_measured(
    levels: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
    title: str,
    file: str | Path,
) -> None:
    """Each level with a colour of its own.

    Args:
        levels: name to frequencies [Hz] and amplitudes [m]: measured, by the contact that the scene
            gives, by the fitted one; frequencies ascending.
    """
    with canvas(file) as ax:
        for i, (name, (frequency, measured, before, fitted)) in enumerate(levels.items()):
            colour = COLOURS[i % len(COLOURS)]
            ax.plot(frequency, 1e6 * measured, "o", color=colour, label=f"{name}, measured")
            ax.plot(frequency, 1e6 * fitted, color=colour)
            ax.plot(frequency, 1e6 * before, color=colour, linestyle=":", linewidth=1.0)
        ax.plot([], [], color="black", label="fitted contact")
        ax.plot([], [], color="black", linestyle=":", linewidth=1.0, label="contact of the scene")
        log_axis(ax, "y")
        ax.set_xlabel("frequency [Hz]")
        ax.set_ylabel("amplitude [µm]")
        ax.set_title(title)
        ax.legend(loc="best")
