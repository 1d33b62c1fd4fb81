"""What the search for the best load found, and whether the data can carry it as a headline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..scene.units import newtons
from ..study.pipeline.best_load import BestLoad, studied_load
from ..study.pipeline.curve import Curve
from ..study.pipeline.design_table import design_table
from ..study.pipeline.loads import lower_studied
from ..study.pipeline.run_records import Response
from ..util.percent import percent
from .response_points import points_of

# share of the excitation's work that friction takes at an optimum that is one of damping; below it
# the amplitude is low for another reason, such as a stiffer blade
MIN_FRICTION_REDUCTION = 0.05
# of the ends of the range of a search: a load nearer to one lies at it
AT_END = 0.01
# relative difference below which a best load was studied: tables have nine digits
STUDIED_LOAD = 1e-6
# what a search compared
BALANCES = "balances"
KEPT_MOTIONS = "motions kept"
# parts of the error of a load that the balances of the search do not show: they are those of the
# nearest load that was studied
UNSEEN_PARTS = ("halved", "body_mesh", "layer_law")


class LowestResonance(NamedTuple):
    """The load with the lowest resonance amplitude, and whether it may be called the optimum."""

    # of the design table
    row: pd.Series
    # by the exact search; else among the loads studied
    searched: bool
    # why it must not be called the optimum; empty where it may
    against: list[str]


def lowest_resonance(
    summary: pd.DataFrame,
    points: pd.DataFrame | None = None,
    searched: pd.DataFrame | None = None,
) -> LowestResonance:
    """What the search found, or the best of the loads studied where it found nothing.

    Args:
        summary: the design table, with the linear limits and at least one load between them.
        points: response table.
        searched: ``best_load_table``.
    """
    found = None if searched is None else found_best(searched, summary)
    finite = summary[(summary["load"] > 0) & np.isfinite(summary["load"])]
    row = finite.loc[finite["peak_amplitude"].idxmin()] if found is None else found
    return LowestResonance(row, found is not None, reasons_against(row, summary, points, searched))


def lowest_found(row: pd.Series, summary: pd.DataFrame) -> pd.Series:
    """The row, or that of a load studied whose resonance is lower: what the errors do not separate
    from the load of a search takes no optimum's place, and is the lowest all the same.
    """
    finite = summary[(summary["load"] > 0) & np.isfinite(summary["load"])]
    if finite.empty:
        return row
    lowest = finite.loc[finite["peak_amplitude"].idxmin()]
    return lowest if lowest["peak_amplitude"] < row["peak_amplitude"] else row


def lowest_of_response(response: Response) -> LowestResonance:
    """`lowest_resonance` of responses that are not tables yet."""
    return lowest_resonance(
        pd.DataFrame(design_table(response.curves, response.limits)),
        pd.concat([points_of(curve) for curve in response.curves], ignore_index=True),
        best_load_table(response.best, response.curves) if response.best else None,
    )


def best_load_table(found: Sequence[BestLoad], curves: Sequence[Curve] = ()) -> pd.DataFrame:
    """One row a mass of the damper, SI units; no rows where nothing was searched.

    The search compares balances. What the blade does under the load that it found is given by the
    response there, as under every other load.

    Args:
        curves: responses; those under the best loads among them.
    """
    rows = []
    for best in found:
        row = asdict(best)
        row["searched_amplitude"] = best.amplitude
        row["lowest_searched"], row["highest_searched"] = row.pop("searched")
        kept = row.pop("kept")
        row["compared"] = BALANCES if kept is None else KEPT_MOTIONS
        if kept is not None:
            row |= {"tolerance": kept["tolerance"], "between": kept["between"]}
        row["tolerated_from"], row["tolerated_to"] = row.pop("between")
        settings = row.pop("settings")
        error = settings["error"]
        row["error"] = np.nan if error is None else error
        row["harmonics"] = settings["harmonics"]
        here = (studied_load(best), best.mass)
        curve = next((c for c in curves if (c.load, c.mass) == here), None)
        if curve is not None:
            row |= _judged(curve, row["error"])
            lower = lower_studied(curve, curves)
            if lower is not None:
                row |= {"amplitude": np.nan, "reason": _passed_over(curve, lower)}
        del row["tried"], row["heights"]
        rows.append(row)
    table = pd.DataFrame(rows)
    return table.drop(columns="mass") if len(table) and table["mass"].isna().all() else table


def _judged(curve: Curve, searched: float) -> dict[str, float]:
    """Columns of a best load by the response there.

    Args:
        searched: the estimated error of the search; where that is infinite another load may be
            better, whatever is known of this one.
    """
    error = np.nan if curve.error is None else curve.error
    return {
        "load": curve.load,
        "frequency": curve.peak_frequency,
        "amplitude": curve.peak_amplitude,
        "dissipated": curve.friction_work,
        "input_work": curve.input_work,
        "error": np.inf if np.isinf(searched) else error,
    }


def _passed_over(there: Curve, lower: Curve) -> str:
    """Why the load of a search is not the best one."""
    return (
        f"it compares balances, and the blade keeps {1e6 * there.peak_amplitude:.4g} um under "
        f"{newtons(there.load, 4)}, {1e6 * lower.peak_amplitude:.4g} um under "
        f"{newtons(lower.load, 4)}"
    )


def found_best(searched: pd.DataFrame, summary: pd.DataFrame) -> pd.Series | None:
    """The best of all masses as a row of the design table; None where no search succeeded.

    Where its response was not studied, its stress is in proportion to the amplitude as under the
    nearest load that was, and its error has what meshes and the layer's law change there.
    """
    good = searched[searched["amplitude"].notna()]
    if good.empty:
        return None
    row = good.loc[good["amplitude"].idxmin()]
    best = row.rename({"amplitude": "peak_amplitude", "frequency": "peak_frequency"})
    near = _nearest_studied(best, summary)
    if near is None:
        return best
    added = {name: near[name] for name in UNSEEN_PARTS if name in near}
    studied = np.isclose(near["load"], best["load"], rtol=STUDIED_LOAD)
    if "error" in best and not studied:
        unseen = sum(part for part in added.values() if np.isfinite(part))
        best["error"] = best["error"] + unseen
    if "alternating_stress" in near:
        per_metre = near["alternating_stress"] / near["peak_amplitude"]
        added["alternating_stress"] = per_metre * best["peak_amplitude"]
        added["stress_error"] = near.get("stress_error", np.nan)
    return pd.concat([best, pd.Series(added, dtype=float)])


def of_same_damper(rows: pd.DataFrame, best: pd.Series) -> pd.DataFrame:
    """The rows of a design table of the same damper mass, where several are studied, and those
    without damper.
    """
    mass = best.get("mass", np.nan)
    if "mass" not in rows or not np.isfinite(mass):
        return rows
    return rows[rows["mass"].isna() | np.isclose(rows["mass"], mass)]


def _nearest_studied(best: pd.Series, summary: pd.DataFrame) -> pd.Series | None:
    """The row of the nearest finite load, of the same damper where several are studied."""
    rows = summary[(summary["load"] > 0) & np.isfinite(summary["load"])]
    if "mass" in rows and np.isfinite(best.get("mass", np.nan)):
        rows = rows[np.isclose(rows["mass"], best["mass"])]
    if rows.empty:
        return None
    return rows.loc[np.log(rows["load"] / best["load"]).abs().idxmin()]


def error_words(row: pd.Series) -> str:
    """ "± 3 % (model and mesh)": the estimated error of a resonance amplitude, and whether the mesh
    has a part in it.
    """
    error = row.get("error", np.nan)
    if np.isnan(error):
        return "not estimated"
    if np.isinf(error):
        return "error unknown: neither richer models nor an integration in time give it"
    parts = "model and mesh" if np.isfinite(row.get("body_mesh", np.nan)) else "model; mesh apart"
    return f"± {percent(max(error, 1e-4))} ({parts})"


def stress_error_words(row: pd.Series) -> str:
    """ "± 30 % (24 % by the mesh there)": that of the amplitude, and of the stress by the mesh at
    its place.
    """
    mesh = row.get("stress_error", np.nan)
    if not np.isfinite(mesh):
        return f"{error_words(row)}, error by the mesh there apart"
    by_mesh = f"{percent(mesh)} by the mesh there"
    error = row.get("error", np.nan)
    if not np.isfinite(error):
        return f"{error_words(row)}; {by_mesh}"
    return f"± {percent(error + mesh)} ({by_mesh})"


def flat_range(best: pd.Series) -> str:
    """What the loads around the best one are, which are given with it as its uncertainty."""
    low, high = best.get("tolerated_from", np.nan), best.get("tolerated_to", np.nan)
    by = "by exact search"
    if best.get("compared", BALANCES) == KEPT_MOTIONS:
        by = "of those studied, by the motions that the blade keeps"
    if np.isfinite(low) and np.isfinite(high):
        return f"{by}; under these loads the amplitude keeps within the accuracy of it"
    return by


def certainty(best: pd.Series) -> str:
    """The estimated error of the amplitude and the tolerance of the search."""
    if "tolerance" not in best:
        return ""
    return (
        f"estimated error {percent(best['error'])}, "
        f"search ended within {percent(best['tolerance'])} of the minimum"
    )


def reasons_against(
    best: pd.Series,
    summary: pd.DataFrame,
    points: pd.DataFrame | None,
    searched: pd.DataFrame | None = None,
) -> list[str]:
    """Why the lowest resonance that was found must not be called the optimum; empty where it may.

    Args:
        best: row of the lowest resonance, by the search or among the loads studied.
        summary: the design table, with the linear limits.
        points: response table.
        searched: what the search found.
    """
    found = []
    if searched is not None and len(searched):
        # why, without every way that was tried: the run's remarks have those
        found += [
            f"the exact search failed ({reason.partition(': ')[0]})"
            for reason in searched["reason"]
            if isinstance(reason, str) and reason
        ]
    found += _at_end(best)
    found += _without_friction(best)
    found += _below_error(best, summary)
    found += _beside_missing(best, points)
    return found


def _at_end(best: pd.Series) -> list[str]:
    low = best.get("lowest_searched", np.nan)
    high = best.get("highest_searched", np.nan)
    for bound, near, side in (
        (low, best["load"] <= (1 + AT_END) * low, "falls to the lowest"),
        (high, best["load"] >= (1 - AT_END) * high, "falls to the highest"),
    ):
        if near:
            return [
                f"the resonance amplitude {side} load searched, {newtons(bound, 3)}, so that no "
                "minimum lies between"
            ]
    return []


def _without_friction(best: pd.Series) -> list[str]:
    work = best.get("input_work", np.nan)
    if not work > 0 or best["dissipated"] >= MIN_FRICTION_REDUCTION * work:
        return []
    return [
        f"friction takes only {percent(best['dissipated'] / work)} of the excitation's work "
        "there: the amplitude is not lowered by friction"
    ]


def _below_error(best: pd.Series, summary: pd.DataFrame) -> list[str]:
    error = best.get("error", np.nan)
    limits = of_same_damper(summary[(summary["load"] == 0) | np.isinf(summary["load"])], best)
    if limits.empty:
        return []
    if np.isinf(error):
        return [
            "the error of its amplitude is unknown: neither richer models nor an integration in "
            "time give it"
        ]
    gain = 1 - best["peak_amplitude"] / limits["peak_amplitude"].min()
    if gain < 0:
        # whatever its error is
        return [f"it lies {percent(-gain)} above the better of the free and the stuck blade"]
    if np.isnan(error) or gain > error:
        return []
    return [
        f"it lies {percent(gain)} below the better of the free and the stuck blade, which is no "
        f"more than its estimated error of {percent(error)}"
    ]


def _beside_missing(best: pd.Series, points: pd.DataFrame | None) -> list[str]:
    """Whether the curve of this load has an unsolved point next to its highest one."""
    if points is None or points.empty:
        return []
    here = np.isclose(points["load"], best["load"], rtol=1e-3)
    if "mass" in points and "mass" in best:
        here &= np.isclose(points["mass"], best["mass"])
    curve = points[here].sort_values("frequency")
    good = curve["converged"].to_numpy(bool)
    if not good.any() or good.all():
        return []
    top = int(np.argmax(np.where(good, curve["amplitude"], -np.inf)))
    if good[max(top - 1, 0) : top + 2].all():
        return []
    return ["a point next to its highest one was not solved, so that the resonance may be higher"]
