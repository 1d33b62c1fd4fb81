"""Drawn wheels in words: headlines, sentences and what they are worth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..scene.units import newton_range, newtons
from ..study.mistuning.scatter_use import ScatteredUse
from ..study.mistuning.sector_comparison import SectorComparison, comparison_words
from ..util.message import warning
from ..util.percent import percent
from ..wheel.statistics import (
    CONFIDENCE_LEVEL,
    WHEEL_SHARE,
    Amplification,
    RobustOptimum,
)
from .headlines import NOT_DETERMINED, Headline
from .scatter_tables import lowest_known, optima_of_scatter, optimum_is_known

# the first headline of a scatter
ROBUST_OPTIMUM = "robust optimum of the load of a seat"
# what stands before the ends of an interval, and the share of the wheels that a design is made for
INTERVAL = f"{100 * CONFIDENCE_LEVEL:g} % interval"
WHEELS = f"{100 * WHEEL_SHARE:g} %"
# from so many on intervals of the load by the bootstrap hold what they promise: of wheels with
# optima of their own 95 % intervals held 69, 87, 94 and 97 % by 4, 10, 30 and 100 wheels
FEWEST_WHEELS = 30


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
    i = lowest_known(found)
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
    i = lowest_known(found)
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
