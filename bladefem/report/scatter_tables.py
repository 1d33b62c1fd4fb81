"""Drawn wheels as tables: a row a load, a row a wheel, and the optima."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..study.mistuning.scatter_use import ScatteredUse
from ..wheel.statistics import (
    WHEEL_SHARE,
    Amplification,
    RobustOptimum,
    best_load,
    robust_optimum,
)

# quantiles of a scatter
SCATTER_QUANTILES = (0.5, 0.95, 0.99)


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
    i = lowest_known(found)
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


def lowest_known(found: Amplification) -> int | None:
    """Number of the load with the lowest tuned wheel among those whose amplification is known."""
    known = np.flatnonzero(found.is_known)
    return int(known[np.argmin(found.tuned[known])]) if len(known) else None


def optimum_is_known(found: Amplification) -> bool:
    """There are several loads, and amplifications are known where the wheels are lowest."""
    heights = np.quantile(found.peak, WHEEL_SHARE, axis=1)
    return len(found.loads) > 1 and bool(found.is_known[np.argmin(heights)])
