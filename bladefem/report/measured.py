"""Tables, picture, sentences and page of a contact that was fitted to measured responses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.units import newtons, show
from ..study.contact_identification import ContactFit
from ..study.fit_intervals import UNKNOWN_LOG_HALF_WIDTH
from ..study.fit_truncation import LeftOut
from ..study.measured_responses import LARGEST_AMPLITUDE, FittedScene
from ..util.message import warning
from ..view.measured import draw_measured
from .headlines import Headline
from .tables import write_tables
from .write import Page, write_report

# parameter to what it is called
NAMES = {
    "mu": "friction coefficient",
    "kt": "tangential contact stiffness",
    "kn": "normal contact stiffness",
    "stiffness": "contact stiffness",
    "load": "normal load",
}
# smallest shift of a logarithm that is reported
COUNTED_SHIFT = 5e-4


def parameter_table(found: FittedScene) -> pd.DataFrame:
    """One row a parameter: the factor on the scene's value, with its interval."""
    fit = found.fit
    return pd.DataFrame(
        {
            "parameter": [NAMES[name] for name in fit.names],
            "over_scene": fit.factors,
            "factor_low": fit.knowledge.intervals[:, 0],
            "factor_high": fit.knowledge.intervals[:, 1],
            **_shares_of_half_widths(fit),
            "determined": ["yes" if known else "no" for known in fit.knowledge.known],
        }
    )


def _shares_of_half_widths(fit: ContactFit) -> dict[str, np.ndarray]:
    """Columns of the half widths of the logarithms: by the readings, and by what richer models
    change.
    """
    model = np.sum([np.zeros(len(fit.names)), *(abs(o.shift) for o in fit.held)], axis=0)
    return {"log_half_by_readings": fit.half_by_readings, "log_half_by_model": model}


def readings_table(found: FittedScene) -> pd.DataFrame:
    """One row a reading."""
    readings = found.readings
    return pd.DataFrame(
        {
            "load": readings.load,
            "excitation_force": readings.force,
            "frequency": readings.frequency,
            "measured_amplitude": readings.amplitude,
            "scene_amplitude": found.before,
            "fitted_amplitude": found.fitted,
            "off": found.fitted / readings.amplitude - 1,
        }
    )


def fit_sentences(found: FittedScene) -> list[str]:
    """The contact, what it leaves, and what the readings cannot tell."""
    fit = found.fit
    off = found.fitted / found.readings.amplitude - 1
    kept = np.isfinite(off)
    sentences = [
        f"{len(off)} readings, by the fitted contact off by {_percent(off)} (root of the mean "
        f"square; by the scene's {_percent(found.before / found.readings.amplitude - 1)}); "
        f"{100 * found.error:.3g} % were assumed as their error; "
        f"{found.settings.harmonics} harmonics",
        fit.sentence(),
    ]
    if found.scene_values:
        rows = (f"{name} = {_value(name, value)}" for name, value in found.scene_values.items())
        sentences.append(f"for the scene, under [contact]: {', '.join(rows)}")
    sentences += _useless_values(found)
    sentences += left_out_sentences(fit)
    if fit.misfit > 2:
        sentences.append(
            warning(
                f"the readings are missed by {fit.misfit:.2g} times their error: something else "
                "than the contact differs from the model"
            )
        )
    if not kept.all():
        sentences.append(warning(f"{int((~kept).sum())} of {len(off)} readings not solved"))
    return sentences


def _useless_values(found: FittedScene) -> list[str]:
    """Why a fitted field is not given for the scene, and readings that look wrong."""
    sentences = []
    for one in found.fields:
        if not found.fit.knowledge.known[one.parameter]:
            sentences.append(
                warning(f"no value of contact.{one.name} for the scene: the readings leave it open")
            )
        elif not one.allows:
            low, high = (show(end, one.unit) for end in one.allowed)
            sentences.append(
                warning(
                    f"contact.{one.name} would be {show(one.value, one.unit)}, and a scene takes "
                    f"{low} to {high}: the readings are not those of this scene"
                )
            )
    largest, size = float(found.readings.amplitude.max()), found.sector_size
    if largest > LARGEST_AMPLITUDE * size:
        sentences.append(
            warning(
                f"an amplitude of {show(largest, 'm')} is {100 * largest / size:.2g} % of the "
                f"sector's size, {show(size, 'm')}: too large for a linear elastic blade; is its "
                "unit right?"
            )
        )
    return sentences


def left_out_sentences(fit: ContactFit) -> list[str]:
    """What the intervals hold of the model's own error, and what they do not."""
    sentences = []
    counted = [one for one in fit.held if (abs(one.shift) >= COUNTED_SHIFT).any()]
    if counted:
        rows = (f"{one.what} {_shifts(fit.names, one)}" for one in counted)
        sentences.append(
            "the intervals hold what more of the model would change: " + "; ".join(rows)
        )
    lost = [f"{one.what} {one.unsolved}" for one in fit.held if one.unsolved]
    if lost:
        sentences.append(
            warning(
                "readings that richer models did not solve, in which the intervals do not hold "
                f"what these change: {', '.join(lost)}"
            )
        )
    for one in fit.left_out:
        if not one.widens and (abs(one.shift) > fit.half_by_readings).any():
            sentences.append(
                warning(
                    f"the estimated error of {one.what} would move {_shifts(fit.names, one)}, "
                    "which the intervals do not hold: a smaller mesh.size, or an E of the blade "
                    "that brings its frequency without damper to the measured one"
                )
            )
    return sentences


def _shifts(names: tuple[str, ...], one: LeftOut) -> str:
    """By how much each parameter moves."""
    return ", ".join(
        f"{name} by {_shift(shift)}" for name, shift in zip(names, one.shift, strict=True)
    )


def _shift(shift: float) -> str:
    if abs(shift) >= UNKNOWN_LOG_HALF_WIDTH:
        return "more than a factor of two"
    return f"{100 * np.expm1(shift):+.2g} %"


def _percent(off: np.ndarray) -> str:
    return f"{100 * float(np.sqrt(np.nanmean(off**2))):.3g} %"


def _value(name: str, value: float) -> str:
    """As a scene writes it."""
    if name.endswith("mu"):
        return f"{value:.4g}"
    return f'"{show(value, "N/m^3" if name.endswith("area") else "N/m")}"'


def write_fit(found: FittedScene, folder: Path) -> list[Path]:
    """Tables, picture and page in a folder; returns the files."""
    tables = {
        "contact/fit": parameter_table(found),
        "contact/fit_readings": readings_table(found),
    }
    for name, table in tables.items():
        stem = name.split("/")[1]
        write_tables(table, folder / stem, stem)
    readings = found.readings
    levels = {}
    for load, force in sorted(set(zip(readings.load, readings.force, strict=True))):
        rows = np.flatnonzero((readings.load == load) & (readings.force == force))
        rows = rows[np.argsort(readings.frequency[rows])]
        levels[f"{newtons(load, 4)}, force {newtons(force, 4)}"] = (
            readings.frequency[rows],
            readings.amplitude[rows],
            found.before[rows],
            found.fitted[rows],
        )
    picture = folder / "fit.png"
    draw_measured(levels, found.run.scene.title, picture)
    numbers = [
        Headline(
            NAMES[name],
            f"{factor:.4g} times the scene's",
            f"95 % interval {low:.3g} to {high:.3g}" if known else "the readings leave it open",
            "",
        )
        for name, factor, (low, high), known in zip(
            found.fit.names,
            found.fit.factors,
            found.fit.knowledge.intervals,
            found.fit.knowledge.known,
            strict=True,
        )
    ]
    pages = write_report(
        folder,
        found.run.scene,
        tables,
        {"contact/fit": picture},
        [*found.run.messages, *fit_sentences(found)],
        found.run.timings,
        page=Page(numbers=numbers, stem="report_fit"),
    )
    return [folder / "fit.csv", folder / "fit_readings.csv", picture, *pages]
