"""Tables, picture, sentences and page of a contact that was fitted to measured responses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..scene.units import newtons, parse, plain_number, readable_units, show
from ..study.contact_identification import ContactFit
from ..study.fit_intervals import UNKNOWN_LOG_HALF_WIDTH, Product
from ..study.fit_truncation import LeftOut
from ..study.measured_models import FEWEST_HARMONICS
from ..study.measured_responses import LARGEST_AMPLITUDE, FittedField, FittedScene
from ..util.message import warning
from ..view.measured import draw_measured
from .headlines import NOT_DETERMINED, Headline
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
# columns of the parameters that files have and a terminal has no room for
FILE_COLUMNS = ("log_half_by_readings", "log_half_by_model")
# significant digits of a fitted value
FEWEST_DIGITS, MOST_DIGITS = 2, 4
# smallest shift of a logarithm that is reported
COUNTED_SHIFT = 5e-4


def parameter_table(found: FittedScene) -> pd.DataFrame:
    """One row a parameter, or a field of the scene where it scales several: the value and the
    factor on the scene's, with intervals.
    """
    fit = found.fit
    rows: list[tuple[int, FittedField | None]] = []
    for number in range(len(fit.names)):
        values = [one for one in found.absolute_values if one.parameter == number]
        rows += [(number, one) for one in values] or [(number, None)]
    numbers = [number for number, _ in rows]
    table = pd.DataFrame(
        {
            "parameter": [NAMES[fit.names[number]] for number in numbers],
            **_absolute_columns([one for _, one in rows]),
            "over_scene": fit.factors[numbers],
            "factor_low": fit.knowledge.intervals[numbers, 0],
            "factor_high": fit.knowledge.intervals[numbers, 1],
            **{name: half[numbers] for name, half in _shares_of_half_widths(fit).items()},
            "mesh_shift": _told_shifts(fit)[numbers],
            "determined": [_determined(fit, number) for number in numbers],
        }
    )
    return (
        table if any(not one.widens for one in fit.left_out) else table.drop(columns="mesh_shift")
    )


def terminal_table(found: FittedScene) -> pd.DataFrame:
    """The columns of `parameter_table` that fit a terminal."""
    table = parameter_table(found)
    dropped = set(FILE_COLUMNS)
    if table["fitted_value"].notna().all():
        # the interval of the value says as much
        dropped |= {"factor_low", "factor_high"}
    return table[[name for name in table if name not in dropped]]


def _absolute_columns(values: Sequence[FittedField | None]) -> dict[str, list[Any]]:
    """Columns of the fitted values in units that people read; empty where the scene gives none."""
    shown = [(*_in_readable_unit(one)[0], _in_readable_unit(one)[1]) for one in values]
    names = ("fitted_value", "fitted_low", "fitted_high", "fitted_unit")
    columns = dict(zip(names, map(list, zip(*shown, strict=True)), strict=True))
    fields = [f"contact.{one.name}" if one is not None and one.name else "" for one in values]
    return {"fitted_field": fields, **columns}


def _in_readable_unit(one: FittedField | None) -> tuple[tuple[float, float, float], str]:
    """The value with the ends of its interval, and their unit; NaN where there is none."""
    if one is None:
        return (np.nan, np.nan, np.nan), ""
    unit = "N" if one.unit == "N" else readable_units(one.unit)[0]
    size = 1.0 if unit == "1" else parse(f"1 {unit}", one.unit)
    return (one.value / size, one.low / size, one.high / size), "" if unit == "1" else unit


def _told_shifts(fit: ContactFit) -> np.ndarray:
    """(p,) relative shifts by what no interval holds; infinite where it is not known."""
    unknown = abs(fit.apart) >= UNKNOWN_LOG_HALF_WIDTH
    return np.where(unknown, np.inf, np.expm1(np.where(unknown, 0.0, fit.apart)))


def _determined(fit: ContactFit, number: int) -> str:
    if not fit.knowledge.known[number]:
        return "no"
    return "but for the mesh" if fit.moved_apart[number] else "yes"


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
            "off_reading": found.fitted / readings.amplitude - 1,
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
        *_more_than_the_scene(found),
        _known_sentence(fit),
        *_absolute_sentences(found),
        *_product_sentences(found),
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


def _more_than_the_scene(found: FittedScene) -> list[str]:
    """Why a fit has more harmonics than the scene gives."""
    given, taken = found.run.scene.model.harmonics, found.settings.harmonics
    if given is None or given >= taken:
        return []
    said = (
        f"{taken} harmonics, not the {given} of model.harmonics: a fit takes {FEWEST_HARMONICS} at "
        "least, since what fewer leave out (three: up to 6 % of an amplitude where contacts lift "
        "off) would be taken for the contact's"
    )
    more = ", and more where these move a parameter further than half of what the readings tell"
    return [said + (more if taken > FEWEST_HARMONICS else "")]


def _known_sentence(fit: ContactFit) -> str:
    """What the readings determine, and whether another mesh would say something else."""
    moved = fit.moved_apart & fit.knowledge.known
    if not moved.any():
        return fit.sentence()
    names = " and ".join(name for name, far in zip(fit.names, moved, strict=True) if far)
    return f"{fit.sentence()}; for this mesh: its error moves {names} beyond the intervals"


def _absolute_sentences(found: FittedScene) -> list[str]:
    """The values of those parameters that the readings determine, with their intervals."""
    fit = found.fit
    return [
        f"{_field_name(one)} = {_value_words(fit, one)}, 95 % interval {_interval_words(one)}"
        f"{_apart_words(fit, one.parameter)}"
        for one in found.absolute_values
        if fit.knowledge.known[one.parameter]
    ]


def _product_sentences(found: FittedScene) -> list[str]:
    """What is known of two parameters that are not known apart."""
    return [
        f"{one.names[0]} times {one.names[1]} is known: {value}, 95 % interval {interval}; "
        f"{one.names[0]} follows from a {NAMES[one.names[1]]} that is known, and the other way "
        "round"
        for one in found.fit.knowledge.products
        for value, interval in [_product_words(found, one)]
    ]


def _product_words(found: FittedScene, one: Product) -> tuple[str, str]:
    """Value and interval of a product: of friction coefficient and normal load in newtons where
    there is one of each, else as factors on the scene's.
    """
    fit = found.fit
    numbers = [fit.names.index(name) for name in one.names]
    factor = float(np.prod(fit.factors[numbers]))
    values = [[a for a in found.absolute_values if a.parameter == n] for n in numbers]
    digits = int(np.clip(np.ceil(-np.log10(max(one.half, 1e-12))) + 1, FEWEST_DIGITS, MOST_DIGITS))
    ends = np.exp([-one.half, one.half])
    if set(one.names) == {"mu", "load"} and all(len(some) == 1 for some in values):
        force = values[0][0].value * values[1][0].value
        low, high = force * ends
        return f"{plain_number(force, digits)} N", f"{low:.3g} to {high:.3g} N"
    low, high = factor * ends
    return f"{plain_number(factor, digits)} times the scene's", f"{low:.3g} to {high:.3g}"


def _field_name(one: FittedField) -> str:
    return f"contact.{one.name}" if one.name else "normal load of a seat"


def _value_words(fit: ContactFit, one: FittedField) -> str:
    """ "0.25", "34 N/mm^3": by as many digits as are known."""
    (value, _, _), unit = _in_readable_unit(one)
    return f"{plain_number(value, _known_digits(fit, one.parameter))} {unit}".rstrip()


def _interval_words(one: FittedField) -> str:
    (_, low, high), unit = _in_readable_unit(one)
    return f"{plain_number(low, 3)} to {plain_number(high, 3)} {unit}".rstrip()


def _apart_words(fit: ContactFit, number: int) -> str:
    """ "; mesh apart: +31 %", where that counts."""
    shift = float(fit.apart[number])
    return f"; mesh apart: {_shift(shift)}" if abs(shift) >= COUNTED_SHIFT else ""


def _known_digits(fit: ContactFit, number: int) -> int:
    """Significant digits of a value by its interval, or by the mesh where that moves it further."""
    known = max(float(fit.knowledge.half[number]), abs(float(fit.apart[number])), 1e-12)
    return int(np.clip(np.ceil(-np.log10(known)) + 1, FEWEST_DIGITS, MOST_DIGITS))


def fit_headlines(found: FittedScene) -> list[Headline]:
    """One number a parameter: its value where the scene gives one, else the factor on its own."""
    fit = found.fit
    numbers = []
    for number, name in enumerate(fit.names):
        factor = f"{plain_number(float(fit.factors[number]), _known_digits(fit, number))} times"
        low, high = fit.knowledge.intervals[number]
        between = f"{low:.3g} to {high:.3g}"
        values = [one for one in found.absolute_values if one.parameter == number]
        if not fit.knowledge.known[number]:
            best = f"best fit: {factor} the scene's, interval {between}".replace("inf", "∞")
            left = "the readings leave it open"
            numbers.append(Headline(NAMES[name], NOT_DETERMINED, left, best))
            continue
        apart = _apart_words(fit, number)
        if not values:
            sure = f"95 % interval {between}{apart}"
            numbers.append(Headline(NAMES[name], f"{factor} the scene's", sure, ""))
        numbers += [
            Headline(
                NAMES[name],
                _value_words(fit, one),
                f"95 % interval {_interval_words(one)}{apart}",
                f"{_field_name(one)}, {factor} the scene's ({between})",
            )
            for one in values
        ]
    for product in fit.knowledge.products:
        value, interval = _product_words(found, product)
        name = " times ".join(NAMES[part] for part in product.names)
        numbers.append(Headline(name, value, f"95 % interval {interval}", ""))
    return numbers


def _useless_values(found: FittedScene) -> list[str]:
    """Why a fitted field is not given for the scene, and readings that look wrong."""
    sentences: list[str] = []
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
            found.fitted[rows],
            found.before[rows],
        )
    picture = folder / "fit.png"
    draw_measured(levels, found.run.scene.title, picture)
    pages = write_report(
        folder,
        found.run.scene,
        tables,
        {"contact/fit": picture},
        [*found.run.messages, *fit_sentences(found)],
        found.run.timings,
        page=Page(numbers=fit_headlines(found), stem="report_fit"),
    )
    return [folder / "fit.csv", folder / "fit_readings.csv", picture, *pages]
