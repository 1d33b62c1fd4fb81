"""Tables, pictures and sentences of a mistuned wheel, for the report of a run and for 'bladefem
scatter'.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from ..study.mistuning.pattern_response import PatternResponse
from ..view import wheel as view
from ..wheel.statistics import Amplification, best_load, quantile
from .headlines import Headline

# quantiles of a scatter
SHARES = (0.5, 0.95, 0.99)


def pattern_table(found: Sequence[PatternResponse]) -> pd.DataFrame:
    """One row a load."""
    return pd.DataFrame(
        [
            {
                "load": r.load,
                **({} if r.mass is None else {"mass": r.mass}),
                "tuned_amplitude": r.tuned,
                "highest_amplitude": r.peak.height,
                "highest_blade": r.peak.blade + 1,
                "peak_frequency": r.peak.omega / (2 * np.pi),
                "amplification": r.factor,
                "amplification_free": r.free_factor,
                "alternating_stress": r.stress.largest,
                "estimated_error": r.truncation,
                "unconverged": r.peak.unsolved,
            }
            for r in found
        ]
    )


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
    used: Sequence[tuple[float, float, float]] = (),
) -> list[Headline]:
    """First numbers of the mistuned wheel.

    Args:
        used: of each response the utilisation of its highest blade, the same with the upper ends of
            its errors, and that of the tuned wheel; empty where it is not known.
    """
    numbers = []
    for i, r in enumerate(found):
        error = (
            "error unknown: more harmonics were not solved"
            if np.isnan(r.truncation)
            else f"± {max(100 * r.truncation, 0.01):.2g} % (harmonics and samples)"
        )
        remark = f"blade {r.peak.blade + 1} under {r.load:.4g} N, {r.factor:.3g} times the tuned"
        value = f"{1e6 * r.peak.height:.4g} µm"
        numbers.append(Headline("highest blade of the mistuned wheel", value, error, remark))
        if i < len(used):
            own, highest, tuned = used[i]
            beside = f"under {r.load:.4g} N; {tuned:.3g} on the tuned wheel"
            upper = f"up to {highest:.3g} with the errors of mesh and loading history"
            numbers.append(Headline("utilisation of that blade", f"{own:.3g}", upper, beside))
    return numbers


def pattern_drawings(
    found: Sequence[PatternResponse],
) -> dict[str, Callable[[Path], object]]:
    """Pictures of the load whose highest blade is lowest."""
    r = min(found, key=lambda one: one.peak.height)
    first = r.solution.probe[:, 1, 0]
    title = f"{r.load:g} N: blade {r.peak.blade + 1} is {r.factor:.3g} times the tuned wheel"
    return {
        "wheel/blades": lambda file: view.draw_blades(
            r.peak.by_blade, r.deviation[:, 0], r.tuned, title, file
        ),
        "wheel/wheel_motion": lambda file: view.draw_wheel_motion(
            r.solution.size(), np.angle(first), f"{r.solution.frequency:.5g} Hz, {r.load:g} N", file
        ),
    }


def scatter_table(found: Amplification) -> pd.DataFrame:
    """One row a load: quantiles of the amplification with intervals, and the worst wheel."""
    rows = []
    for i, load in enumerate(found.loads):
        row = {
            "load": load,
            "tuned_amplitude": found.tuned[i],
            "wheels": found.factor.shape[1],
        }
        for share in SHARES:
            q = quantile(found.factor[i], share)
            name = f"p{100 * share:g}"
            row |= {name: q.value, f"{name}_low": q.low, f"{name}_high": q.high}
        row |= {
            "worst": found.factor[i].max(),
            "highest_amplitude": found.peak[i].max(),
            "unconverged": int(found.unsolved[i].sum()),
            "points": int(found.points[i].sum()),
        }
        rows.append(row)
    return pd.DataFrame(rows)


def optima(found: Amplification) -> dict[str, tuple[float, float]]:
    """Name to load [N] and amplitude [m]: of the tuned wheel, and of 95 % of the drawn ones."""
    p95 = np.array([quantile(row, 0.95).value for row in found.peak])
    return {
        "tuned optimum": best_load(found.loads, found.tuned),
        "robust optimum (95 %)": best_load(found.loads, p95),
    }


def scatter_sentences(found: Amplification) -> list[str]:
    """The answer, and what it is worth."""
    best = optima(found)
    sentences = [
        f"{name}: {load:.4g} N, {1e6 * height:.4g} um" for name, (load, height) in best.items()
    ]
    i = int(np.argmin(found.tuned))
    q = quantile(found.factor[i], 0.95)
    high = f"{q.high:.3g}" if np.isfinite(q.high) else "unknown, too few wheels"
    sentences.append(
        f"at {found.loads[i]:g} N, where the tuned wheel is lowest, 95 % of {found.peak.shape[1]} "
        f"wheels stay below {q.value:.3g} times it (95 % interval {q.low:.3g} to {high})"
    )
    lost = int(found.unsolved.sum())
    sentences.append(f"{lost} of {int(found.points.sum())} points not solved")
    return sentences


def scatter_drawings(found: Amplification) -> dict[str, Callable[[Path], object]]:
    """Bands against the load, and the histogram at the tuned optimum."""
    bands = {}
    for share in SHARES[:2]:
        rows = [quantile(row, share) for row in found.peak]
        bands[f"{100 * share:g} % of wheels"] = np.array([[q.value, q.low, q.high] for q in rows])
    i = int(np.argmin(found.tuned))
    marks = {f"{100 * s:g} %": quantile(found.factor[i], s).value for s in SHARES[:2]}
    drawings: dict[str, Callable[[Path], object]] = {
        "wheel/scatter_histogram": partial(
            view.draw_histogram, found.factor[i], marks, f"{found.loads[i]:g} N"
        )
    }
    if len(found.loads) > 1:
        best = [(name, load) for name, (load, _) in optima(found).items()]
        drawings["wheel/scatter_chart"] = partial(
            view.draw_bands, found.loads, found.tuned, bands, best
        )
    return drawings
