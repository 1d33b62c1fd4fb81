"""Tables, pictures and sentences of a mistuned wheel, for the report of a run and for 'bladefem
scatter'.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.units import newton_range, newtons
from ..study.mistuning.pattern_response import PatternResponse
from ..study.mistuning.scatter_use import ScatteredUse
from ..study.mistuning.sector_comparison import SectorComparison, comparison_words
from ..util.message import warning
from ..util.percent import percent
from ..view import wheel as view
from ..wheel.statistics import (
    CONFIDENCE_LEVEL,
    WHEEL_SHARE,
    Amplification,
    RobustOptimum,
    best_load,
    robust_optimum,
)
from .fatigue import WorstUse
from .headlines import NOT_DETERMINED, Headline

# all blades at the highest point
WHEEL_FIGURE = "wheel/wheel_motion"
# the first headline of a scatter
ROBUST_OPTIMUM = "robust optimum of the load of a seat"
# what stands before the ends of an interval, and the share of the wheels that a design is made for
INTERVAL = f"{100 * CONFIDENCE_LEVEL:g} % interval"
WHEELS = f"{100 * WHEEL_SHARE:g} %"
# from so many on intervals of the load by the bootstrap hold what they promise: of wheels with
# optima of their own 95 % intervals held 69, 87, 94 and 97 % by 4, 10, 30 and 100 wheels
FEWEST_WHEELS = 30
# quantiles of a scatter
SCATTER_QUANTILES = (0.5, 0.95, 0.99)


def pattern_table(found: Sequence[PatternResponse]) -> pd.DataFrame:
    """One row a load."""
    return pd.DataFrame(
        [
            {
                "load": r.load,
                **({} if r.mass is None else {"mass": r.mass}),
                "tuned_amplitude": r.tuned,
                "highest_amplitude": r.peak.height,
                **_held_amplitude(r),
                "highest_blade": r.peak.blade + 1,
                "peak_frequency": r.peak.omega / (2 * np.pi),
                "amplification": r.factor,
                "amplification_free": r.free_factor,
                "alternating_stress": r.highest.worst.largest,
                "estimated_error": r.truncation,
                "unconverged": r.peak.unsolved,
            }
            for r in found
        ]
    )


def _held_amplitude(r: PatternResponse) -> dict[str, float]:
    """The column of the highest amplitude with held means, where it is another one."""
    return {} if r.free_means is None else {"highest_amplitude_held": r.free_means.held}


def blade_table(found: Sequence[PatternResponse]) -> pd.DataFrame:
    """One row a blade and load."""
    parts = []
    for r in found:
        count = len(r.deviation)
        parts.append(
            pd.DataFrame(
                {
                    "load": r.load,
                    "blade": np.arange(1, count + 1),
                    "deviation": r.deviation[:, 0],
                    "amplitude": r.peak.by_blade,
                    "dissipated": r.solution.dissipated,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def pattern_headlines(
    found: Sequence[PatternResponse],
    used: Sequence[WorstUse] = (),
) -> list[Headline]:
    """First numbers of the mistuned wheel.

    Args:
        used: of each response the highest utilisation; empty where it is not known.
    """
    numbers = []
    for i, r in enumerate(found):
        error = (
            "error unknown: more harmonics were not solved"
            if np.isnan(r.truncation)
            else f"± {percent(max(r.truncation, 1e-4))} (harmonics and samples; mesh and "
            "contact points apart, as of the tuned resonance)"
        )
        remark = (
            f"blade {r.peak.blade + 1} under {newtons(r.load, 4)}, {r.factor:.3g} times the "
            f"{1e6 * r.tuned:.4g} µm of the tuned wheel by the same balance of all blades"
        )
        value = f"{1e6 * r.peak.height:.4g} µm"
        numbers.append(Headline("highest blade of the mistuned wheel", value, error, remark))
        if i < len(used):
            use = used[i]
            remark = f"under {newtons(r.load, 4)}; {use.tuned:.3g} on the tuned wheel"
            upper = f"up to {use.bound:.3g} with the errors of mesh and loading history"
            name = "utilisation of that blade"
            if use.blade != r.peak.blade:
                name = f"utilisation of blade {use.blade + 1}, whose shape uses most"
            numbers.append(Headline(name, f"{use.value:.3g}", upper, remark))
    return numbers


def shown_response(found: Sequence[PatternResponse]) -> PatternResponse:
    """The response under the load whose highest blade is lowest."""
    return min(found, key=lambda one: one.peak.height)


def pattern_drawings(
    found: Sequence[PatternResponse],
) -> dict[str, Callable[[Path], object]]:
    """Pictures of `shown_response`."""
    r = shown_response(found)
    title = f"{newtons(r.load)}: blade {r.peak.blade + 1} is {r.factor:.3g} times the tuned wheel"
    return {
        "wheel/blades": lambda file: view.draw_blades(
            r.peak.by_blade, r.deviation[:, 0], r.tuned, title, file
        ),
        WHEEL_FIGURE: lambda file: view.draw_wheel_motion(
            r.solution.size(), r.phase, f"{r.frequency:.5g} Hz, {newtons(r.load)}", file
        ),
    }


def scatter_table(found: Amplification) -> pd.DataFrame:
    """One row a load: quantiles of the amplification with intervals, and the worst wheel, NaN where
    the amplification is not known.
    """
    rows = []
    for i, load in enumerate(found.loads):
        row = {
            "load": load,
            "tuned_amplitude": found.tuned[i],
            **_comparison_columns(found, i),
            **_free_columns(found, i),
            "wheels": found.factor.shape[1],
        }
        known = 1.0 if found.is_known[i] else float("nan")
        for share in SCATTER_QUANTILES:
            q = found.quantile(i, share)
            name = f"p{100 * share:g}"
            row |= {
                name: known * q.value,
                f"{name}_low": known * q.low,
                f"{name}_high": known * q.high,
            }
        if found.checked.shape[1]:
            row["calibration"] = known * found.calibration[i]
            row["law_error"] = known * abs(found.check_errors[i]).max()
        if len(found.harmonics):
            row |= {"harmonics": int(found.harmonics[i]), "truncation": found.truncation[i]}
        row |= {
            "worst": known * found.factor[i].max(),
            "highest_amplitude": known * found.peak[i].max(),
            "unconverged": int(found.unsolved[i].sum()),
            "points": int(found.points[i].sum()),
        }
        rows.append(row)
    return pd.DataFrame(rows)


def wheel_table(found: Amplification, seed: int) -> pd.DataFrame:
    """One row a load and drawn wheel: its highest blade; NaN where the amplification is not known.

    Args:
        seed: of the draws, which with the wheel's number gives the wheel again.
    """
    parts = []
    wheels = found.factor.shape[1]
    for i, load in enumerate(found.loads):
        known = 1.0 if found.is_known[i] else float("nan")
        parts.append(
            pd.DataFrame(
                {
                    "load": load,
                    "seed": seed,
                    "wheel": np.arange(1, wheels + 1),
                    "highest_amplitude": known * found.peak[i],
                    "highest_blade": found.blade[i] + 1,
                    "amplification": known * found.factor[i],
                    "peak_frequency": known * found.omega[i] / (2 * np.pi),
                    "solved_by": _solved_by(found, i),
                    "unconverged": found.unsolved[i],
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _solved_by(found: Amplification, load: int) -> list[str]:
    """What the amplification of each wheel comes from; blade and frequency of a wheel that checks
    the damper law are the law's too.
    """
    if not found.is_known[load]:
        return ["not solved"] * found.factor.shape[1]
    if not found.checked.shape[1]:
        return ["whole wheel"] * found.factor.shape[1]
    whole = set(found.checked[load].tolist())
    return [
        "whole wheel, place by the law" if wheel in whole else "damper law, calibrated"
        for wheel in range(found.factor.shape[1])
    ]


def shown_wheels(found: Amplification, seed: int) -> pd.DataFrame:
    """The rows of `wheel_table` under the load with the lowest tuned wheel, the highest first."""
    i = _lowest_known(found)
    table = wheel_table(found, seed)
    if i is None:
        return table.iloc[:0]
    rows = table[table["load"] == found.loads[i]]
    return rows.sort_values("highest_amplitude", ascending=False, ignore_index=True)


def _comparison_columns(found: Amplification, load: int) -> dict[str, float]:
    """The tuned wheel by both ways, and whether these agree; empty where they were not compared."""
    if not len(found.agrees):
        return {}
    return {
        "tuned_amplitude_balance": found.tuned_balance[load],
        "tuned_amplitude_sector": found.tuned_sector[load],
        "amplification_known": bool(found.is_known[load]),
    }


def _free_columns(found: Amplification, load: int) -> dict[str, float]:
    """The tuned wheel with held means, what free ones change in the amplification of wheels solved
    in full, at most, and how many of these keep held ones; empty where these were not asked for.
    """
    if not len(found.tuned_held) or np.isnan(found.tuned_held[load]):
        return {}
    return {
        "tuned_amplitude_held": found.tuned_held[load],
        "free_change": abs(found.released_change[load]).max(initial=0.0),
        "kept_held": int(np.count_nonzero(~found.mean_released[load])),
    }


def optima_of_scatter(
    found: Amplification, searched: float | None = None
) -> tuple[tuple[float, float], RobustOptimum]:
    """Load [N] and amplitude [m] of the tuned wheel's optimum, and the optimum of 95 % of the drawn
    wheels.

    Args:
        searched: best load of the tuned wheel by a search [N], where it is among those studied: a
            parabola between these is less than the search.
    """
    there = np.flatnonzero(found.loads == (np.nan if searched is None else searched))
    if len(there):
        tuned = float(found.loads[there[0]]), float(found.tuned[there[0]])
    else:
        tuned = best_load(found.loads, found.tuned)
    return tuned, robust_optimum(found)


def optimum_table(found: Amplification, searched: float | None = None) -> pd.DataFrame:
    """The tuned optimum, which knows no scatter, and the robust one with its intervals; arguments
    as those of `optima_of_scatter`.
    """
    (load, height), robust = optima_of_scatter(found, searched)
    rows = [
        {"optimum": "tuned wheel", "load": load, "highest_amplitude": height},
        {
            "optimum": f"{100 * robust.share:g} % of wheels",
            "load": robust.load.value,
            "load_low": robust.load.low,
            "load_high": robust.load.high,
            "highest_amplitude": robust.height.value,
            "highest_amplitude_low": robust.height.low,
            "highest_amplitude_high": robust.height.high,
        },
    ]
    return pd.DataFrame(rows)


def use_table(used: Sequence[ScatteredUse]) -> pd.DataFrame:
    """One row a load whose tuned wheel has a known stress."""
    return pd.DataFrame(
        [
            {
                "load": one.load,
                "tuned_utilisation": one.tuned,
                "p95_utilisation": one.share.value,
                "p95_utilisation_low": one.share.low,
                "p95_utilisation_high": one.share.high,
                "utilisation_bound": one.highest,
                "stress_margin": one.margin,
            }
            for one in used
        ]
    )


def use_headlines(used: Sequence[ScatteredUse]) -> list[Headline]:
    """The utilisation that nearly all wheels stay below, at the load where that is lowest."""
    if not used:
        return []
    one = min(used, key=lambda row: row.share.value)
    return [
        Headline(
            f"utilisation that {WHEELS} of wheels stay below",
            f"{one.share.value:.3g}",
            f"{_up_to(one.highest)} with the errors of sample, mesh and loading history",
            f"under {newtons(one.load, 4)}; {one.tuned:.3g} on the tuned wheel",
        )
    ]


def use_sentences(used: Sequence[ScatteredUse]) -> list[str]:
    """The utilisation with scatter in words, with what it assumes."""
    return [
        f"utilisation under {newtons(one.load, 4)}: {WHEELS} of wheels stay below "
        f"{one.share.value:.3g} ({INTERVAL} {one.share.low:.3g} to {_upper(one.share.high)}), "
        f"the tuned wheel uses {one.tuned:.3g}; with the upper ends of the errors of mesh and "
        f"loading history {_upper(one.highest)}; the highest blade is taken to move in the tuned "
        "wheel's shape"
        for one in used
    ]


def scatter_headlines(found: Amplification, searched: float | None = None) -> list[Headline]:
    """First numbers of the statistics, as far as they are known; one load alone has no optimum.

    Args:
        searched: as that of `optima_of_scatter`.
    """
    numbers = []
    if optimum_is_known(found):
        numbers = _optimum_headlines(found, searched)
    elif len(found.loads) > 1:
        why = "amplifications are not known where the drawn wheels are lowest"
        numbers = [Headline(ROBUST_OPTIMUM, NOT_DETERMINED, why, "")]
    i = _lowest_known(found)
    if i is None:
        return numbers
    factor = found.quantile(i, WHEEL_SHARE)
    return [
        *numbers,
        Headline(
            f"amplification at {newtons(found.loads[i], 4)}, where the tuned wheel is lowest",
            f"{factor.value:.3g}",
            f"{INTERVAL} {factor.low:.3g} to {_upper(factor.high)}",
            f"highest blade over the tuned wheel, {WHEELS} of {found.peak.shape[1]} "
            "wheels stay below",
        ),
    ]


def _optimum_headlines(found: Amplification, searched: float | None) -> list[Headline]:
    """Best loads with scatter and without, and the highest blade at the first."""
    (load, height), robust = optima_of_scatter(found, searched)
    by_search = searched is not None and load == searched
    words = f"{100 * robust.share:g} % of {found.peak.shape[1]} wheels"
    return [
        Headline(
            ROBUST_OPTIMUM,
            newtons(robust.load.value, 4),
            f"{INTERVAL} {newton_range(robust.load.low, robust.load.high)}",
            f"lowest amplitude that {words} stay below, by the bootstrap over the wheels",
        ),
        Headline(
            "optimum of the tuned wheel",
            newtons(load, 4),
            "by search, and studied" if by_search else loads_on_both_sides(found, load),
            f"{1e6 * height:.4g} µm where all blades are alike",
        ),
        Headline(
            "highest blade at the robust optimum",
            f"{1e6 * robust.height.value:.4g} µm",
            f"{INTERVAL} {_height_interval(robust, 'µm')}",
            f"{words} stay below{_left_by_balance(found, robust.load.value)}",
        ),
    ]


def _left_by_balance(found: Amplification, load: float) -> str:
    """What an interval by the sample leaves out of an amplitude between two loads studied; empty
    where nothing estimated it.
    """
    if not len(found.truncation):
        return ""
    order = np.argsort(found.loads)
    place = np.clip(np.searchsorted(found.loads[order], load), 1, len(order) - 1)
    error = found.truncation[order][place - 1 : place + 1].max()
    words = "an unknown share" if np.isnan(error) else f"up to {percent(error)}"
    return (
        f"; the interval leaves out what harmonics and samples are estimated to leave, {words}, "
        "and mesh and contact points"
    )


def loads_on_both_sides(found: Amplification, load: float) -> str:
    """The loads studied on both sides."""
    lower = found.loads[found.loads < load]
    upper = found.loads[found.loads > load]
    if not len(lower) or not len(upper):
        return "an end of the loads studied"
    ends = newton_range(lower.max(), upper.min()).replace(" to ", " and ")
    return f"between {ends} studied"


def _height_interval(robust: RobustOptimum, unit: str = "um") -> str:
    """Ends of the interval of the highest blade at the robust optimum."""
    low, high = 1e6 * robust.height.low, 1e6 * robust.height.high
    if np.isfinite(high):
        return f"{low:.4g} to {high:.4g} {unit}"
    return f"from {low:.4g} {unit}, upper end {_upper(high)}"


def _up_to(value: float) -> str:
    return f"up to {_upper(value)}" if np.isfinite(value) else f"upper end {_upper(value)},"


def _upper(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "unknown, too few wheels"


def scatter_sentences(
    found: Amplification, held_means: bool = False, searched: float | None = None
) -> list[str]:
    """The answer, and what it is worth.

    Args:
        held_means: the scene holds the dampers' mean displacements.
        searched: as that of `optima_of_scatter`.
    """
    sentences = _optimum_sentences(found, searched)
    i = _lowest_known(found)
    if i is not None:
        q = found.quantile(i, WHEEL_SHARE)
        sentences.append(
            f"at {newtons(found.loads[i])}, where the tuned wheel is lowest, {WHEELS} of "
            f"{found.peak.shape[1]} wheels stay below {q.value:.3g} times it ({INTERVAL} "
            f"{q.low:.3g} to {_upper(q.high)})"
        )
    sentences.extend(_comparison_sentences(found))
    if found.checked.shape[1]:
        sentences.extend(_law_sentences(found))
    sentences.extend(_mean_sentences(found, held_means))
    if len(found.harmonics):
        parts = [
            f"{newtons(load)}: {H} ({'unknown' if np.isnan(error) else percent(error)})"
            for load, H, error in zip(found.loads, found.harmonics, found.truncation, strict=True)
        ]
        sentences.append(
            "harmonics of whole wheels, and the estimated error that these and the samples leave "
            f"in an amplitude: {', '.join(parts)}"
        )
    lost = int(found.unsolved.sum())
    sentences.append(f"{lost} of {int(found.points.sum())} points not solved")
    return sentences


def _lowest_known(found: Amplification) -> int | None:
    """Number of the load with the lowest tuned wheel among those whose amplification is known."""
    known = np.flatnonzero(found.is_known)
    return int(known[np.argmin(found.tuned[known])]) if len(known) else None


def optimum_is_known(found: Amplification) -> bool:
    """There are several loads, and amplifications are known where the wheels are lowest."""
    heights = np.quantile(found.peak, WHEEL_SHARE, axis=1)
    return len(found.loads) > 1 and bool(found.is_known[np.argmin(heights)])


def _comparison_sentences(found: Amplification) -> list[str]:
    """Loads under which the balance of all blades does not describe the wheel."""
    return [
        warning(
            f"{newtons(found.loads[i])}: "
            + comparison_words(
                SectorComparison(found.tuned_balance[i], found.tuned_sector[i], agrees=False)
            )
            + ", and the amplification of mistuned wheels under this load is not known"
        )
        for i in np.flatnonzero(~found.is_known)
    ]


def _law_sentences(found: Amplification) -> list[str]:
    """What the damper law is off by, and what was done about it; one a load."""
    checks, wheels = found.checked.shape[1], found.factor.shape[1]
    said = []
    for known, load, harmonics, factor, error, rest in zip(
        found.is_known,
        found.loads,
        found.law_harmonics,
        found.calibration,
        100 * found.check_errors,
        100 * (found.calibration_bounds - 1),
        strict=True,
    ):
        if not known:
            continue
        text = (
            f"{newtons(load)}: wheels by the law of one damper, {_harmonics_up_to(harmonics)}; "
            f"{checks} of them solved in full, from the lowest to the highest: the law is off by "
            f"{error.min():+.2g} to {error.max():+.2g} % in amplification"
        )
        if checks < wheels:
            text += (
                f", so that the amplifications of the others are multiplied by {factor:.4g}; the "
                f"intervals take in what the solved ones are still off, {rest[0]:+.2g} to "
                f"{rest[1]:+.2g} %; how often another wheel is further off is not known"
            )
        said.append(text)
    return said


def _harmonics_up_to(highest: int) -> str:
    return "harmonic 1" if highest == 1 else f"harmonics 1 to {highest}"


def _mean_sentences(found: Amplification, held_means: bool) -> list[str]:
    """How the mean displacements of the dampers count; one a load, or one for all."""
    if held_means:
        return [
            "mean displacements are held in the preload state (model.static): what free ones "
            "change is not known"
        ]
    said: list[str] = []
    for i, held in enumerate(found.tuned_held):
        if np.isnan(held):
            continue
        known = found.mean_released[i]
        if not found.is_known[i]:
            # said by `_comparison_sentences`
            continue
        if not known.any():
            said.append(
                f"{newtons(found.loads[i])}: mean displacements are held in the preload state, no "
                "balance with free ones was found"
            )
            continue
        change = 100 * found.released_change[i][known]
        kept = np.count_nonzero(~known)
        lost = f"; {kept} of these wheels keep their amplification with held ones" if kept else ""
        said.append(
            f"{newtons(found.loads[i])}: wheels solved in full have free mean displacements, "
            "dampers walk where friction alone holds them, and so has the tuned wheel; against "
            "held ones this changes the tuned amplitude by "
            f"{100 * (found.tuned[i] / held - 1):+.2g} % and "
            f"the amplification of {len(change)} wheels by {change.min():+.2g} to "
            f"{change.max():+.2g} %{lost}"
        )
    return said


def _optimum_sentences(found: Amplification, searched: float | None) -> list[str]:
    """Both optima; one load alone has none."""
    if len(found.loads) < 2:
        return ["one load has no optimum, expected several in study.loads"]
    if not optimum_is_known(found):
        return [
            warning(
                "no robust optimum is given: under the load at which the drawn wheels are lowest "
                "their amplification is not known"
            )
        ]
    (load, height), robust = optima_of_scatter(found, searched)
    by_search = searched is not None and load == searched
    both = "the robust optimum is that" if by_search else "both optima are those"
    sentences = [
        f"tuned optimum{', by search' if by_search else ''}: {newtons(load, 4)}, "
        f"{1e6 * height:.4g} um",
        f"robust optimum ({100 * robust.share:g} % of {found.peak.shape[1]} wheels below): "
        f"{newtons(robust.load.value, 4)} ({INTERVAL} "
        f"{newton_range(robust.load.low, robust.load.high)}), {1e6 * robust.height.value:.4g} um "
        f"({_height_interval(robust)})",
        f"between the loads studied {both} of a parabola, whose error the intervals "
        f"leave out: robust optimum {loads_on_both_sides(found, robust.load.value)}",
    ]
    wheels = found.peak.shape[1]
    if wheels < FEWEST_WHEELS:
        sentences.append(
            warning(
                f"{wheels} wheels are too few for a bootstrap: the interval of the robust "
                "optimum's load is too narrow, expected mistuning.wheels = "
                f"{FEWEST_WHEELS} at least"
            )
        )
    unknown = found.loads[~found.is_known]
    if len(unknown):
        sentences.append(
            f"under {', '.join(f'{load:g}' for load in unknown)} N, where amplifications are not "
            "known, each drawn wheel counts as high as the tuned one, and is higher"
        )
    if robust.at_end > (1 - CONFIDENCE_LEVEL) / 2:
        sentences.append(
            f"in {100 * robust.at_end:.0f} % of the resamples the robust optimum is the smallest "
            "or the largest load: the interval is open there, expected a wider study.loads"
        )
    return sentences


def marked_optima(
    found: Amplification, searched: float | None
) -> list[tuple[str, float, float, float]]:
    """Name, load and interval of the optima, for the chart."""
    (load, _), robust = optima_of_scatter(found, searched)
    name = f"robust optimum ({100 * robust.share:g} %)"
    own = robust.load
    return [("tuned optimum", load, load, load), (name, own.value, own.low, own.high)]


def scatter_drawings(
    found: Amplification, searched: float | None = None
) -> dict[str, Callable[[Path], object]]:
    """Bands against the load, and the histogram under the load with the lowest tuned wheel, where
    amplifications are known.

    Args:
        searched: as that of `optima_of_scatter`.
    """
    drawings: dict[str, Callable[[Path], object]] = {}
    i = _lowest_known(found)
    if i is not None:
        marks = {f"{100 * s:g} %": found.quantile(i, s).value for s in SCATTER_QUANTILES[:2]}
        drawings["wheel/scatter_histogram"] = partial(
            view.draw_histogram, found.factor[i], marks, newtons(found.loads[i])
        )
    if len(found.loads) > 1:
        optima = marked_optima(found, searched) if optimum_is_known(found) else []
        drawings["wheel/scatter_chart"] = partial(
            view.draw_bands, found.loads, found.tuned, _known_bands(found), optima
        )
    return drawings


def _known_bands(found: Amplification) -> dict[str, np.ndarray]:
    """(L, 3) quantiles of the highest blade with their intervals [m], NaN where not known."""
    bands = {}
    for share in SCATTER_QUANTILES[:2]:
        rows = np.array([[q.value, q.low, q.high] for q in found.quantiles(share)])
        rows[~found.is_known] = np.nan
        bands[f"{100 * share:g} % of wheels"] = found.tuned[:, None] * rows
    return bands
