"""Tables and picture of the waves in a scene's flow, for the report of a run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.units import newtons
from ..study.pipeline.flutter import growing_words, wave_words
from ..study.pipeline.run_records import SolvedRun
from ..view.wheel import draw_waves
from .headlines import Headline


def flow_tables(run: SolvedRun) -> dict[str, pd.DataFrame]:
    """Damping of each wave, and the limit cycles of the fed ones; empty without a flow."""
    found = run.flutter
    if found is None:
        return {}
    order = np.argsort(found.diameters)
    tables = {
        "response/flow": pd.DataFrame(
            {
                "nodal_diameter": found.diameters[order],
                "frequency_shift": found.shift[order],
                "flow_damping": found.flow_damping[order],
                "net_damping": found.net_damping[order],
            }
        )
    }
    if found.held:
        tables["response/flutter"] = pd.DataFrame(
            [
                {
                    "load": one.load,
                    **({} if one.mass is None else {"mass": one.mass}),
                    "nodal_diameter": one.wave,
                    "frequency": one.frequency,
                    "limit_cycle": one.amplitude,
                    "flutter_amplitude": one.stability_limit,
                    "most_friction": one.largest_friction_damping,
                }
                for one in found.held
            ]
        )
    return tables


def flow_drawing(run: SolvedRun) -> dict[str, Callable[[Path], object]]:
    """Damping over the nodal diameters; empty without a flow."""
    found = run.flutter
    if found is None:
        return {}
    order = np.argsort(found.diameters)
    own = run.scene.excitation.engine_order % len(found.net_damping)
    return {
        "response/flow_damping": lambda file: draw_waves(
            found.diameters[order],
            found.net_damping[order],
            float((found.net_damping - found.flow_damping)[0]),
            int(found.diameters[own]),
            [one.largest_friction_damping for one in found.held],
            file,
        )
    }


def flow_headlines(run: SolvedRun) -> list[Headline]:
    """The largest limit cycle under the load where it is smallest."""
    found = run.flutter
    if found is None or not found.held:
        return []
    one = min(found.largest_cycles, key=lambda held: held.amplitude)
    grows = growing_words(one)
    wave = wave_words(one.wave, len(found.net_damping))
    loads = {held.load for held in found.largest_cycles}
    among = f", of {len(loads)} loads the one that keeps it smallest" if len(loads) > 1 else ""
    return [
        Headline(
            "flutter held by friction",
            f"{1e6 * one.amplitude:.4g} µm",
            "in one harmonic, by the nonlinear mode",
            f"largest of fed waves: {wave}, under {newtons(one.load, 4)}{among}{grows}",
        )
    ]
