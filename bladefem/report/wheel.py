"""Blades of a wheel with one given pattern of deviations: tables, headlines and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.units import newtons
from ..study.mistuning.pattern_response import PatternResponse
from ..util.percent import percent
from ..view import wheel as view
from .fatigue import WorstUse
from .headlines import Headline

# all blades at the highest point
WHEEL_FIGURE = "wheel/wheel_motion"


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
