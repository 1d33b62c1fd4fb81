"""Linear forced response: amplitude and phase over frequency, resonances named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from .style import COLOURS, canvas, log_axis


def draw_forced(
    points: pd.DataFrame,
    resonances: pd.DataFrame,
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """Amplitude above, phase below; returns the figure.

    Args:
        points: columns frequency [Hz], amplitude [m], phase [rad].
        resonances: columns mode, frequency [Hz], amplitude [m], peaked (else the mark is hollow).
        file: PNG to write.
        title: headline.
    """
    with canvas(file, None, (7.6, 5.4), (2, 1), sharex=True, height_ratios=(2.2, 1)) as (
        above,
        below,
    ):
        above.plot(points["frequency"], 1e6 * points["amplitude"], color=COLOURS[0], lw=1.4)
        for seen, part in resonances.groupby("peaked"):
            above.plot(
                part["frequency"],
                1e6 * part["amplitude"],
                "o",
                color=COLOURS[1],
                ms=4,
                mfc=COLOURS[1] if seen else "white",
            )
        for row in resonances.itertuples():
            above.annotate(
                f"{row.mode}: {row.frequency:.5g} Hz",
                (row.frequency, 1e6 * row.amplitude),
                (0, 5),
                textcoords="offset points",
                ha="center",
                fontsize=7,
            )
        log_axis(above, "y")
        above.margins(y=0.12)
        above.set(ylabel="amplitude [µm]", title=title or "linear forced response")
        below.plot(points["frequency"], np.degrees(points["phase"]), color=COLOURS[0], lw=1.2)
        below.set(
            xlabel="excitation frequency [Hz]",
            ylabel="phase [deg]",
            ylim=(-190, 190),
            yticks=(-180, -90, 0, 90, 180),
        )
        above.margins(x=0.01)
        return above.figure
