"""A bolted joint fitted to the lowest of eight measured levels, the others predicted: friction
alone by four levels, friction and contacts that close by five. Tables, and a picture,
docs/figures/bolted_beam.png. python benchmarks/bolted_beam.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bladefem.study.joint_identification import (
    JointFit,
    fit_joint,
    joint_curve,
    least_frequency_miss,
)
from bladefem.view.style import COLOURS, canvas

HERE = Path(__file__).resolve().parents[1]
# name to levels of the fit, and whether contacts close beyond a clearance
FITS = {"friction": (4, False), "friction, stop": (5, True)}


def read_levels() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitude [m], frequency [Hz] and damping [1] of the beam's first bending mode."""
    lines = (HERE / "benchmarks/bolted_beam.csv").read_text().splitlines()
    data = np.genfromtxt([line for line in lines if line[:1] != "#"], delimiter=",", names=True)
    return 1e-6 * data["displacement_um"], data["frequency_Hz"], data["damping_percent"] / 100


def draw_levels(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    damping: np.ndarray,
    fits: dict[str, JointFit],
    file: Path,
) -> None:
    """Measured levels, each fit up to its highest level and the prediction beyond."""
    fine = np.linspace(0.9 * amplitude.min(), 1.05 * amplitude.max(), 200)
    with canvas(file, size=(8.6, 3.8), grid=(1, 2)) as axes:
        for ax, measured, which, factor, label in (
            (axes[0], damping, 1, 100, "damping [% of critical]"),
            (axes[1], frequency, 0, 1, "frequency [Hz]"),
        ):
            for colour, (name, fit) in zip((COLOURS[0], COLOURS[2]), fits.items(), strict=True):
                curve = factor * joint_curve(fit.values, fine)[which]
                inside = fine <= amplitude[fit.fitted].max()
                words = f"{name}: fitted to {fit.fitted.sum()}"
                ax.plot(1e6 * fine[inside], curve[inside], color=colour, label=words)
                ax.plot(1e6 * fine[~inside], curve[~inside], color=colour, ls="--")
            ax.plot(1e6 * amplitude, factor * measured, "o", color=COLOURS[1], label="measured")
            ax.set(xlabel="displacement amplitude [µm]", ylabel=label)
        axes[0].set_title("dashed: predicted")
        axes[0].legend()


def main() -> None:
    """Fits, tables, picture."""
    amplitude, frequency, damping = read_levels()
    fits = {}
    for title, (levels, stop) in FITS.items():
        used = np.arange(len(amplitude)) < levels
        fits[title] = fit = fit_joint(amplitude, frequency, damping, used, stop)
        print(f"\n{title}: fitted to {levels} levels, misfit {fit.misfit:.2f}")
        for name, value, (low, high) in zip(fit.names, fit.values, fit.intervals, strict=True):
            print(f"{name:16s} {value:10.4g}   95 %: {low:.4g} to {high:.4g}")
        print(fit.sentence())
        by_frequency, by_damping = joint_curve(fit.values, amplitude)
        print("\n  um   damping [%]  by fit   off [%]   frequency [Hz]  by fit   off [%]")
        rows = zip(amplitude, damping, by_damping, frequency, by_frequency, used, strict=True)
        for a, z, fitted_z, f, fitted_f, known in rows:
            print(
                f"{1e6 * a:5.0f} {100 * z:10.3f} {100 * fitted_z:10.3f} "
                f"{100 * (fitted_z / z - 1):8.1f} {f:14.2f} {fitted_f:10.2f} "
                f"{100 * (fitted_f / f - 1):8.2f}{'' if known else '   predicted'}"
            )
    for within in (0.05, 0.15):
        least = least_frequency_miss(amplitude, frequency, damping, within)
        print(
            f"any friction with a damping within {100 * within:.0f} % at all eight levels misses "
            f"the frequency of one of them by {100 * least:.2f} % at least"
        )
    draw_levels(amplitude, frequency, damping, fits, HERE / "docs/figures/bolted_beam.png")


if __name__ == "__main__":
    main()
