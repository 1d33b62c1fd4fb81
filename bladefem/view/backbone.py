"""The design map of nonlinear modes: damping and frequency against amplitude for each load, and the
forced response that follows from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..study.backbone import Backbone
from ..util.percent import percent
from .response import load_colours, load_name
from .style import MICRO, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# smallest damping shown over the largest
MIN_DAMPING_SHARE = 1e-3
# amplitudes below this share of the highest resonance are left out of the response
MIN_AMPLITUDE_SHARE = 0.03


def draw_design_map(
    found: Sequence[Backbone],
    points: Sequence[tuple[np.ndarray, np.ndarray]],
    title: str,
    file: str | Path | None = None,
) -> object:
    """Damping, frequency and forced response of each load; returns the figure.

    Args:
        points: of each load, frequencies (k,) [Hz] and amplitudes (k,) [m] of the full balance.
        title: headline.
    """
    colours = load_colours(np.array([one.load for one in found]))
    turning = next((one for one in found if one.fold.any()), None)
    with canvas(file, size=(11.0, 7.6), grid=(2, 2)) as axes:
        for one in found:
            colour = colours[one.load]
            kept = one.converged
            micro = MICRO * one.amplitude[kept]
            total = 100 * (one.friction + one.own)[kept]
            axes[0, 0].plot(micro, total, color=colour, label=load_name(one.load))
            axes[1, 0].plot(micro, one.frequency[kept], color=colour)
            folds = MICRO * one.amplitude[one.fold]
            share = 100 * (one.friction + one.own)[one.fold]
            axes[0, 0].plot(folds, share, "D", color=colour, markersize=5, fillstyle="none")
            label = "turns back in amplitude" if one is turning else None
            axes[1, 0].plot(
                folds,
                one.frequency[one.fold],
                "D",
                color=colour,
                markersize=5,
                fillstyle="none",
                label=label,
            )
        _draw_need(axes[0, 0], found, colours)
        _draw_response(axes[1, 1], found, points, colours)
        _draw_prediction(axes[0, 1], found, colours)
        log_axis(axes[0, 0], "y")
        for ax in axes[:, 0]:
            log_axis(ax, "x")
            ax.set_xlabel("vibration amplitude [µm]")
        axes[0, 0].set(ylabel="damping [% of critical]", title=title)
        axes[1, 0].set(ylabel="frequency of the nonlinear mode [Hz]")
        for ax in axes[:, 0]:
            ax.margins(x=0.01)
        axes[0, 0].legend(title="normal load per seat", fontsize=8, loc="best")
        if turning is not None:
            axes[1, 0].legend(fontsize=8, loc="best")
        return axes[0, 0].figure


def _draw_need(ax: Axes, found: Sequence[Backbone], colours: dict[float, Any]) -> None:
    """The damping that the scene's force needs at each amplitude, and the resonances of the
    balance on it.
    """
    one = found[0]
    kept = one.converged
    total = 100 * (one.friction + one.own)
    ax.plot(
        MICRO * one.amplitude[kept],
        (total / one.drive)[kept],
        color="#777777",
        linestyle="--",
        linewidth=1.2,
        label="needed by the force",
    )
    for other in found:
        height, _ = other.balance
        need = needed_at(other, height)
        ax.plot(MICRO * height, 100 * need, "o", color=colours[other.load], zorder=4)
    highest = max(float((o.friction + o.own)[o.converged].max()) for o in found)
    lowest = min(float((o.friction + o.own)[o.converged].min()) for o in found)
    ax.set_ylim(100 * max(0.7 * lowest, MIN_DAMPING_SHARE * highest), 150 * highest)


def needed_at(one: Backbone, amplitude: float) -> float:
    """Damping that the scene's force needs to keep an amplitude up [1]: it falls as its inverse
    from that of the nearest motion.
    """
    i = int(np.argmin(abs(np.log(one.amplitude / amplitude))))
    need = (one.friction[i] + one.own[i]) / one.drive[i]
    return float(need * one.amplitude[i] / amplitude)


def _draw_response(
    ax: Axes,
    found: Sequence[Backbone],
    points: Sequence[tuple[np.ndarray, np.ndarray]],
    colours: dict[float, Any],
) -> None:
    highest = max(one.balance[0] for one in found)
    ends = [end for one in found for end in (one.balance[1] * 0.98, one.balance[1] * 1.02)]
    for one, (frequency, amplitude) in zip(found, points, strict=True):
        colour = colours[one.load]
        at, height = one.response()
        ax.plot(at, MICRO * height, color=colour, linewidth=1.3)
        ax.plot(frequency, MICRO * amplitude, ".", color=colour, markersize=4)
    ax.set_xlim(min(ends), max(ends))
    log_axis(ax, "y")
    ax.set_ylim(MICRO * MIN_AMPLITUDE_SHARE * highest, 1.4 * MICRO * highest)
    ax.set(
        xlabel="excitation frequency [Hz]",
        ylabel="vibration amplitude [µm]",
        title="lines: by the mode, dots: balance",
    )


def _draw_prediction(ax: Axes, found: Sequence[Backbone], colours: dict[float, Any]) -> None:
    """Resonance amplitude against the load: by the mode, and of the balance."""
    load = np.array([one.load for one in found])
    order = np.argsort(load)
    predicted = MICRO * np.array([one.predicted[0] for one in found])
    balance = MICRO * np.array([one.balance[0] for one in found])
    # the line of one load alone is a point, which only its mark shows
    ax.plot(load[order], predicted[order], "-x", color="#777777", label="by the mode")
    others = [(one.load, MICRO * a) for one in found for a, _ in one.resonances[1:]]
    if others:
        ax.plot(*zip(*others, strict=True), "+", color="#777777", label="detached, by the mode")
    for one, height in zip(found, balance, strict=True):
        ax.plot(one.load, height, "o", color=colours[one.load])
    ax.plot([], [], "o", color="#777777", label="forced response")
    if len(found) > 1:
        log_axis(ax, "x")
        log_axis(ax, "y")
    ax.set(xlabel="normal load of a seat [N]", ylabel="resonance amplitude [µm]")
    far = max(abs(one.error) for one in found)
    words = f"off by {percent(far)} at most" if np.isfinite(far) else "not all reached"
    ax.set_title(f"resonance: {words}")
    ax.legend()
