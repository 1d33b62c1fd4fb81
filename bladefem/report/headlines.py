"""Headline numbers of a response study, each with how sure it is.

The errors that a run estimates are those of modes, harmonics, samples, contact points, damper
model and, where it is estimated, of the mesh at the resonance; how finely the loads and frequencies
were studied adds its own.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..scene.units import newton_range, newtons
from .best_load import BALANCES, error_words, found_best, lowest_found, stress_error_words
from .damping import damping_error_words
from .statements import LOWEST_FOUND, ResponseAnswer

# what an answer says in place of a number that the data cannot carry
NOT_DETERMINED = "not determined"


class Headline(NamedTuple):
    """One number on the first screen."""

    what: str
    value: str
    # "± 0.4 %", "between 72 and 120 N", or why there is none
    uncertainty: str
    remark: str


def headlines(
    answer: ResponseAnswer,
    summary: pd.DataFrame | None,
    points: pd.DataFrame | None,
    searched: pd.DataFrame | None = None,
) -> list[Headline]:
    """The numbers of an answer with their uncertainties.

    Args:
        answer: what, value, remark.
        summary: one row a load, SI columns; "error" is the estimated relative error of the
            resonance amplitude (NaN: not estimated, inf: unknown).
        points: one row a response point.
        searched: what the exact search for the best load found, one row a mass.
    """
    sure = {} if summary is None else _uncertainties(summary, points)
    best = None if searched is None or summary is None else found_best(searched, summary)
    if best is not None and summary is not None:
        sure |= _of_search(best, summary, points)
        lowest = lowest_found(best, summary)
        sure["lowest"] = sure["amplitude"] if lowest is best else error_words(lowest)
    found = []
    for what, value, remark in answer.numbers:
        quantity = _quantity(what)
        known = sure.get(quantity, "no estimate")
        if value == NOT_DETERMINED:
            known = "see what to do next"
        elif quantity == "frequency":
            value = _as_known(value, known)
        found.append(Headline(what, value, known, remark))
    return found


def _as_known(value: str, uncertainty: str) -> str:
    """A number with a unit by as many decimals as its uncertainty has in the same unit, none added.

    >>> _as_known("385.64 Hz", "± 5.7 Hz (flat top)"), _as_known("385.64 Hz", "± 0.0021 Hz")
    ('385.6 Hz', '385.64 Hz')
    """
    number, _, unit = value.partition(" ")
    known = re.match(rf"± (\d+)(?:\.(\d+))? {unit}\b", uncertainty)
    if known is None:
        return value
    given = len(number.partition(".")[2])
    return f"{float(number):.{min(given, len(known[2] or ''))}f} {unit}"


def _quantity(what: str) -> str:
    """Which uncertainty belongs to a headline, by the words in its title."""
    words = {
        LOWEST_FOUND: "lowest",
        "amplitude": "amplitude",
        "stress": "stress",
        "frequency": "frequency",
        "work": "amplitude",
        "equivalent damping": "damping",
        "damping ratio": "amplitude",
        "own mass": "own load",
        "mass that makes": "mass",
        "optimum": "load",
        "normal load": "load",
    }
    return next((key for word, key in words.items() if word in what), "")


def _uncertainties(summary: pd.DataFrame, points: pd.DataFrame | None) -> dict[str, str]:
    """How sure each quantity is, in words."""
    finite = summary[(summary["load"] > 0) & np.isfinite(summary["load"])]
    if finite.empty:
        return {}
    best = finite.loc[finite["peak_amplitude"].idxmin()]
    low, high = _bracket(finite, best)
    return {
        "amplitude": error_words(best),
        "lowest": error_words(best),
        "stress": stress_error_words(best),
        "frequency": _frequency_text(best, points),
        "damping": _damping_text(summary, best, points),
        "load": _between_text(low, high),
        "own load": "by equilibrium, no model error",
        "mass": _mass_text(low, high, best["load"]),
    }


def _of_search(
    best: pd.Series,
    summary: pd.DataFrame,
    points: pd.DataFrame | None,
) -> dict[str, str]:
    """How sure the exact search is; the load by where the amplitude stays within the accuracy."""
    total = best.copy()
    # of balances, where the amplitude is the lowest one; others are those of the load itself
    if best.get("compared", BALANCES) == BALANCES:
        total["error"] += best["tolerance"]
    low, high = (
        None if np.isnan(best[name]) else float(best[name])
        for name in ("tolerated_from", "tolerated_to")
    )
    known = low is not None and high is not None
    return {
        "amplitude": error_words(total),
        "stress": stress_error_words(total),
        "frequency": _frequency_text(best, points),
        "damping": _damping_text(summary, total, points),
        "load": _flatness_text(low, high),
        "mass": _mass_text(low, high, best["load"]) if known else "as the optimum load",
    }


def _flatness_text(low: float | None, high: float | None) -> str:
    """Between which loads the amplitude keeps within the accuracy, as far as the search looked."""
    if low is not None and high is not None:
        # where the amplitude crosses the accuracy: three digits of a load that nobody sets
        return _between_text(float(f"{low:.3g}"), float(f"{high:.3g}"))
    if low is not None:
        return f"within the accuracy down to {newtons(low, 4)}; how far up was not found"
    if high is not None:
        return f"within the accuracy up to {newtons(high, 4)}; how far down was not found"
    return "how flat the optimum is was not found"


def _bracket(finite: pd.DataFrame, best: pd.Series) -> tuple[float | None, float | None]:
    """The studied loads on both sides of the best one [N], of the same damper; None at an end."""
    if "mass" in finite and np.isfinite(best.get("mass", np.nan)):
        finite = finite[finite["mass"] == best["mass"]]
    lower = finite.loc[finite["load"] < best["load"], "load"]
    upper = finite.loc[finite["load"] > best["load"], "load"]
    low = float(lower.max()) if len(lower) else None
    high = float(upper.min()) if len(upper) else None
    return low, high


def _between_text(low: float | None, high: float | None) -> str:
    """Two loads [N], where both are known, in words."""
    if low is not None and high is not None:
        return f"between {newton_range(low, high).replace(' to ', ' and ')}"
    for side, end, other in (("above", low, "upper"), ("below", high, "lower")):
        if end is not None:
            return f"{side} {newtons(end, 4)}, no {other} bound studied"
    return "only one load studied"


def _mass_text(
    low: float | None,
    high: float | None,
    load: float,
) -> str:
    """Loads grow in proportion to the mass, and so does their bracket."""
    if low is None or high is None:
        return "bounded on one side only, as the optimum load"
    return f"{100 * (low / load - 1):+.0f} to {100 * (high / load - 1):+.0f} %, as the optimum load"


def _damping_text(
    summary: pd.DataFrame,
    best: pd.Series,
    points: pd.DataFrame | None,
) -> str:
    """How sure the equivalent damping ratio is."""
    error, _ = _frequency_error(best, points)
    return damping_error_words(summary, best, error / best["peak_frequency"])


def _frequency_text(best: pd.Series, points: pd.DataFrame | None) -> str:
    """How sure the frequency is, in words."""
    error, why = _frequency_error(best, points)
    return why if np.isnan(error) else f"± {error:.2g} Hz ({why})"


def _frequency_error(best: pd.Series, points: pd.DataFrame | None) -> tuple[float, str]:
    """How far the highest point may move: to where the amplitude comes within its own estimated
    error of the highest, and half the distance of the points there at least [Hz], with
    the reason; NaN where there is no estimate.
    """
    if points is None or points.empty:
        return np.nan, "no estimate"
    curve = points[points["load"] == best["load"]]
    if "mass" in curve and np.isfinite(best.get("mass", np.nan)):
        curve = curve[curve["mass"] == best["mass"]]
    if curve.empty:
        return np.nan, "no estimate: no response under this load"
    frequency = np.sort(curve["frequency"].unique())
    here = int(np.argmin(abs(frequency - best["peak_frequency"])))
    if not 0 < here < len(frequency) - 1:
        return np.nan, "at the end of the band: no resonance seen"
    spacing = (frequency[here + 1] - frequency[here - 1]) / 2
    error = best.get("error", np.nan)
    if np.isinf(error):
        return np.nan, "no estimate, as of the amplitude"
    least = (1 - np.nan_to_num(error)) * best["peak_amplitude"]
    high = curve.loc[curve["converged"] & (curve["amplitude"] >= least), "frequency"]
    flat = float(abs(high - best["peak_frequency"]).max()) if len(high) else 0.0
    if flat <= spacing:
        return spacing, "spacing of points"
    return flat, "flat top: the amplitude is within its error there"
