"""What the reader of a report can do next, from what a run has shown and what it left open."""

from __future__ import annotations

import numpy as np
import pandas as pd

from bladefem.scene.fields import value_at
from bladefem.scene.kinds import kind_named
from bladefem.scene.material_table import operating_materials
from bladefem.scene.tables import Scene

from ..study.pipeline.best_load_remarks import TRUSTED_STRESS
from ..util.percent import percent
from .best_load import found_best
from .statements import best_mass

# of the damper's own load: nearer to the optimum, another mass changes little
NEAR_OPTIMUM = 0.15
# density [kg/m^3] of metals: magnesium to tungsten
METAL_DENSITIES = (1700.0, 20000.0)
# fields by which the load of a damper changes but for its mass
DAMPER_SHAPE = ("damper.length", "damper.base", "damper.angle")


def next_steps(
    scene: Scene,
    cautions: list[str],
    summary: pd.DataFrame | None,
    own: pd.DataFrame | None,
    masses: pd.DataFrame | None = None,
    searched: pd.DataFrame | None = None,
) -> list[str]:
    """Sentences in the order of their worth; none where nothing was answered.

    Args:
        cautions: why the answer may not be the optimum; each says what to change.
        summary: one row a load, SI columns.
        own: one row: mass [kg], speed [rad/s], load [N] of a seat by that mass alone.
        masses: mass [kg] that makes each load [N], where friction takes part in the seating.
        searched: what the exact search for the best load found.
    """
    steps = list(cautions)
    if summary is None or summary.empty:
        return steps
    finite = summary[(summary["load"] > 0) & np.isfinite(summary["load"])]
    if finite.empty:
        return steps
    best = None if searched is None else found_best(searched, summary)
    if best is None:
        best = finite.loc[finite["peak_amplitude"].idxmin()]
    if not cautions:
        steps += _mass_step(scene, best, own, masses, "mass" in finite)
    steps += _stress_step(best)
    steps += _mesh_step(best)
    if scene.contact.normal == "coupled" and not scene.study.stability:
        steps.append(
            "Normal loads follow the motion, so that a point may be unstable: leave "
            "study.stability at true."
        )
    return steps


def _mass_step(
    scene: Scene,
    best: pd.Series,
    own: pd.DataFrame | None,
    masses: pd.DataFrame | None,
    several: bool,
) -> list[str]:
    """Another mass, where the damper's own load is far from the best one."""
    if own is None or several:
        return []
    mass, load = own[["mass", "load"]].iloc[0]
    if abs(best["load"] / load - 1) <= NEAR_OPTIMUM:
        return [
            f"The damper's own {1e3 * mass:.3g} g press it nearly at the optimum: keep its mass."
        ]
    wanted, _ = best_mass(best, mass / load, masses)
    density = _drawn_density(scene) * best["load"] / load
    if density < METAL_DENSITIES[0] or density > METAL_DENSITIES[1]:
        kind = kind_named(scene.kind)
        own_shape = DAMPER_SHAPE if "damper" in kind.tables else ()
        fields = [name for name in own_shape if name not in kind.unread(scene)]
        named = f" ({', '.join(fields)})" if fields else ""
        drawn = (
            "" if scene.study.own_load else "; study.own_load = true reports what it does as drawn"
        )
        return [
            f"No metal damper of this shape makes the best load at this speed: it takes {wanted} "
            f"in place of {1e3 * mass:.3g} g, {density:.3g} kg/m^3 in the shape drawn, where "
            f"metals have {METAL_DENSITIES[0]:g} to {METAL_DENSITIES[1]:g}. Change its size or "
            f"flanks{named}{drawn}."
        ]
    return [
        f"Change the damper's mass from {1e3 * mass:.3g} g to {wanted}, and confirm with "
        f"{kind_named(scene.kind).damper_mass} = '{wanted}' and study.own_load = true."
    ]


def _drawn_density(scene: Scene) -> float:
    """Density [kg/m^3] of the damper as drawn; NaN where its mass is given, whatever its shape."""
    given = value_at(scene, kind_named(scene.kind).damper_mass)
    return operating_materials(scene)[1].rho if given is None else np.nan


def _stress_step(best: pd.Series) -> list[str]:
    """A finer mesh, where that makes the stress that is signed too uncertain."""
    error = best.get("stress_error", np.nan)
    if not error > TRUSTED_STRESS:
        return []
    return [
        f"The mesh leaves {percent(error)} of error in the alternating stress, more than the "
        f"{100 * TRUSTED_STRESS:g} % to rely on: take a finer mesh (mesh.size, mesh.scale), or a "
        "fillet where the place is a sharp edge, before the stress or a utilisation is signed."
    ]


def _mesh_step(best: pd.Series) -> list[str]:
    """How far the meshes move the resonance amplitude, and how to look closer."""
    parts = [
        f"{words} by {percent(share)}"
        for name, words in (
            ("body_mesh", "the estimated error of the body's mesh changes the amplitude"),
            ("halved", "half as many contact points change it"),
        )
        if np.isfinite(share := best.get(name, np.nan)) and share > 0
    ]
    known = f"{'; '.join(parts)}. ".capitalize() if parts else "The mesh's part was not estimated. "
    return [f"{known}Compare meshes with 'bladefem chart SCENE --mesh' before numbers are frozen."]
