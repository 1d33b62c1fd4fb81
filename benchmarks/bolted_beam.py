"""Friction of a bolted joint fitted to the lowest four of eight measured levels, the others
predicted: a table, and docs/figures/bolted_beam.png. python benchmarks/bolted_beam.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bladefem.study.joint_identification import PARAMETERS, JointFit, fit_joint, joint_curve
from bladefem.view.style import COLOURS, canvas

HERE = Path(__file__).resolve().parents[1]
LEVELS = 4


def read_levels() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitude [m], frequency [Hz] and damping [1] of the beam's first bending mode."""
    lines = (HERE / "benchmarks/bolted_beam.csv").read_text().splitlines()
    data = np.genfromtxt([line for line in lines if line[:1] != "#"], delimiter=",", names=True)
    return 1e-6 * data["displacement_um"], data["frequency_Hz"], data["damping_percent"] / 100


def draw_levels(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    damping: np.ndarray,
    fit: JointFit,
    file: Path,
) -> None:
    """Measured levels, the fit up to its highest level and the prediction beyond."""
    fine = np.linspace(0.9 * amplitude.min(), 1.05 * amplitude.max(), 200)
    curves = joint_curve(fit.values, fine)
    last = amplitude[fit.fitted].max()
    with canvas(file, size=(8.2, 3.6), grid=(1, 2)) as axes:
        for ax, measured, curve, factor, label in (
            (axes[0], damping, curves[1], 100, "damping [% of critical]"),
            (axes[1], frequency, curves[0], 1, "frequency [Hz]"),
        ):
            inside = fine <= last
            ax.plot(1e6 * fine[inside], factor * curve[inside], color=COLOURS[0], label="fit")
            ax.plot(
                1e6 * fine[~inside],
                factor * curve[~inside],
                color=COLOURS[0],
                ls="--",
                label="prediction",
            )
            for used, words, face in ((True, "fitted", COLOURS[1]), (False, "not used", "none")):
                here = fit.fitted == used
                ax.plot(
                    1e6 * amplitude[here],
                    factor * measured[here],
                    "o",
                    color=COLOURS[1],
                    markerfacecolor=face,
                    label=f"measured, {words}",
                )
            ax.set(xlabel="displacement amplitude [µm]", ylabel=label)
        axes[0].legend()


def main() -> None:
    """Fit, table, picture."""
    amplitude, frequency, damping = read_levels()
    fit = fit_joint(amplitude, frequency, damping, np.arange(len(amplitude)) < LEVELS)
    for name, value, (low, high) in zip(PARAMETERS, fit.values, fit.intervals, strict=True):
        print(f"{name:16s} {value:10.4g}   95 %: {low:.4g} to {high:.4g}")
    print(fit.sentence())
    by_frequency, by_damping = joint_curve(fit.values, amplitude)
    print("\n  um   damping [%]  by fit   off [%]   frequency [Hz]  by fit   off [%]")
    rows = zip(amplitude, damping, by_damping, frequency, by_frequency, fit.fitted, strict=True)
    for a, z, fitted_z, f, fitted_f, used in rows:
        print(
            f"{1e6 * a:5.0f} {100 * z:10.3f} {100 * fitted_z:10.3f} {100 * (fitted_z / z - 1):8.1f}"
            f" {f:14.2f} {fitted_f:10.2f} {100 * (fitted_f / f - 1):8.2f}"
            f"{'' if used else '   predicted'}"
        )
    draw_levels(amplitude, frequency, damping, fit, HERE / "docs/figures/bolted_beam.png")


if __name__ == "__main__":
    main()
