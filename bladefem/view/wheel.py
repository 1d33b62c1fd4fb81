"""Pictures of a mistuned wheel: amplitude of each blade, and what scatter does against the load."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .style import COLOURS, canvas, log_axis


def draw_blades(
    amplitude: np.ndarray,
    deviation: np.ndarray,
    tuned: float,
    title: str,
    file: str | Path,
) -> None:
    """Amplitude of each blade over its pattern.

    Args:
        amplitude: (N,) highest amplitude of each blade [m].
        deviation: (N,) relative deviation of its first family [1].
        tuned: amplitude of all blades of the tuned wheel [m].
    """
    blades = np.arange(1, len(amplitude) + 1)
    with canvas(file, size=(7.6, 5.0), grid=(2, 1), sharex=True, height_ratios=(3, 1)) as axes:
        top, bottom = axes
        worst = int(np.argmax(amplitude))
        colours = [COLOURS[1] if i == worst else COLOURS[0] for i in range(len(amplitude))]
        top.bar(blades, 1e6 * amplitude, color=colours)
        top.axhline(1e6 * tuned, color=COLOURS[6], linewidth=1.2, label="tuned wheel")
        top.set_ylabel("largest amplitude [µm]")
        top.set_title(title)
        top.legend(loc="upper right")
        bottom.bar(blades, 100 * deviation, color=COLOURS[2])
        bottom.set_ylabel("deviation of\nfrequency [%]")
        bottom.set_xlabel("blade")


def draw_wheel_motion(
    amplitude: np.ndarray,
    phase: np.ndarray,
    title: str,
    file: str | Path,
) -> None:
    """The wheel seen along its axis: each blade as long as its amplitude, coloured by its phase.

    Args:
        amplitude: (N,) at one frequency [m].
        phase: (N,) of its first harmonic [rad].
    """
    count = len(amplitude)
    angle = 2 * np.pi * np.arange(count) / count
    with canvas(file, size=(6.0, 5.4), subplot_kw={"projection": "polar"}) as ax:
        inner = 0.5 * amplitude.max()
        ax.bar(
            angle,
            1e6 * amplitude,
            width=0.8 * 2 * np.pi / count,
            bottom=1e6 * inner,
            color=_phase_colours(phase),
        )
        ax.set_title(title)
        ax.set_theta_zero_location("N")
        ax.set_xticks(angle[:: max(count // 12, 1)])
        ax.set_xticklabels([f"{i + 1}" for i in range(count)][:: max(count // 12, 1)])
        marks = np.linspace(0, amplitude.max(), 3)
        ax.set_yticks(1e6 * (inner + marks))
        ax.set_yticklabels([])
        note = f"length: amplitude, {1e6 * amplitude.max():.4g} µm the longest; colour: phase"
        ax.set_xlabel(note, labelpad=8)


def draw_bands(
    load: np.ndarray,
    tuned: np.ndarray,
    quantiles: dict[str, np.ndarray],
    best: Sequence[tuple[str, float, float, float]],
    file: str | Path,
) -> None:
    """Resonance amplitude against the load: the tuned wheel, and quantiles of the drawn ones.

    Args:
        load: (L,) [N].
        tuned: (L,) [m].
        quantiles: name to (L, 3) value and interval of the highest blade [m].
        best: names of the optima, loads and ends of their intervals.
    """
    with canvas(file) as ax:
        ax.plot(load, 1e6 * tuned, color=COLOURS[6], marker="o", label="tuned wheel")
        for colour, (name, value) in zip(COLOURS, quantiles.items(), strict=False):
            middle, low, high = 1e6 * value.T
            ax.plot(load, middle, color=colour, marker="o", label=name)
            # open ends, of few wheels, have no place
            ends = [np.where(np.isfinite(end), end, middle) for end in (low, high)]
            ax.fill_between(load, *ends, alpha=0.18)
        first = min((at for _, at, _, _ in best), default=0.0)
        for place, (name, at, lowest, highest) in enumerate(best):
            ax.axvline(at, color="#888888", linewidth=1.0, linestyle=("--", ":")[place % 2])
            words = f"{name}: {at:.4g} N"
            if highest > lowest:
                ax.axvspan(lowest, highest, color="#888888", alpha=0.15, linewidth=0)
                words += f" ({lowest:.4g} to {highest:.4g})"
            # words on the outer side of neighbouring lines, which they would cross otherwise, where
            # there is room for them
            room = np.log(at / load.min()) > 0.5 * np.log(load.max() / load.min())
            outside = -1 if at == first and len(best) > 1 and room else 1
            ax.annotate(
                words,
                (at, 0.97 - 0.06 * place),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                xytext=(4 * outside, 0),
                ha="right" if outside < 0 else "left",
                fontsize=8.5,
                bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.0},
            )
        log_axis(ax, "x")
        log_axis(ax, "y")
        ax.set_xlabel("normal load of a seat [N]")
        ax.set_ylabel("highest blade [µm]")
        ax.set_title("Highest blade of mistuned wheels")
        ax.legend(loc="best")


def draw_histogram(
    factor: np.ndarray,
    marks: dict[str, float],
    title: str,
    file: str | Path,
) -> None:
    """How often an amplification occurs.

    Args:
        factor: (W,) highest blade over the tuned wheel [1].
        marks: name to value.
    """
    with canvas(file) as ax:
        ax.hist(factor, bins=max(8, int(np.sqrt(len(factor)))), color=COLOURS[5])
        for colour, (name, value) in zip(COLOURS, marks.items(), strict=False):
            ax.axvline(value, color=colour, label=f"{name}: {value:.3g}")
        ax.set_xlabel("highest blade over the tuned wheel")
        ax.set_ylabel("wheels")
        ax.set_title(title)
        ax.legend()


def _phase_colours(phase: np.ndarray) -> np.ndarray:
    from matplotlib import colormaps

    return colormaps["twilight"]((phase % (2 * np.pi)) / (2 * np.pi))


def draw_waves(
    diameters: np.ndarray,
    net: np.ndarray,
    blade: float,
    excited: int,
    friction: Sequence[float],
    file: str | Path,
) -> None:
    """Damping of the waves of a wheel in a flow.

    Args:
        diameters: (N,) ascending, negative ones run with the rotation.
        net: (N,) share of critical damping of blade and flow, without dampers.
        blade: the same of the blade alone.
        excited: nodal diameter of the engine order.
        friction: largest damping by the dampers of each wave that is fed, under each load.
    """
    with canvas(file, size=(7.6, 3.9)) as ax:
        colours = [COLOURS[1] if value < 0 else COLOURS[0] for value in net]
        ax.bar(diameters, 100 * net, color=colours, width=0.8)
        ax.axhline(0.0, color="black", linewidth=0.8)
        ax.axhline(
            100 * blade, color=COLOURS[6], linewidth=1.2, linestyle="--", label="without flow"
        )
        height = float(net[list(diameters).index(excited)])
        ax.plot([excited], [100 * height], "v", color="black", label="engine order")
        if (net < 0).any():
            label = "fed by the flow"
            if friction:
                ends = dict.fromkeys(f"{100 * end:.3g}" for end in (min(friction), max(friction)))
                label += f"; friction damps a wave by up to {' to '.join(ends)} %"
            ax.plot([], [], "s", color=COLOURS[1], label=label)
        ax.set_xlabel("nodal diameter; negative: with the rotation")
        ax.set_ylabel("damping without dampers [%]")
        ax.set_title("Damping of the waves in the flow")
        ax.legend(loc="best")
