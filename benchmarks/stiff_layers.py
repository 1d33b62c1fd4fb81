"""Time and error of forced responses of the shipped wedge over the stiffness of its layer.

    python benchmarks/stiff_layers.py [folder] [stiffness in N/mm^3, "default" or "rigid", ...]

Stages up to the reduction are kept in the folder and serve all layers: only seating and balance
depend on the layer. The sector keeps MODES modes; harmonics, samples, contact points and the damper
model are chosen for each response. Times are CPU seconds of one process without compilation.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from bladefem.io.stage_cache import cached_stage
from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.settings import Settings, first_settings
from bladefem.study.chart.cpu_clock import running_clock
from bladefem.study.pipeline import case_models, pipeline
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.loads import curve_of
from bladefem.study.pipeline.normal_modes import harmonic_diameters
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.stage_inputs import stage_key
from bladefem.util.progress import without_progress

LAYERS = ("40", "400", "4000", "10000", "40000", "100000", "rigid", "default")
LOADS = (80.0, 320.0)
MODES = 20


@dataclass(frozen=True)
class Layer:
    """The responses of one layer, ready to be solved."""

    scene: Scene
    cases: list[LoadCase]
    family_of: Any
    settings: Settings


def prepared(folder: str, stiffness: str) -> Layer:
    """The scene with this layer, seated under both loads, on the kept reduction."""
    scene = vary(
        load_scene("scenes/wedge.toml"),
        "model.modes",
        MODES,
        "study.own_load",
        False,
        "study.loads",
        LOADS,
    )
    if stiffness == "rigid":
        scene = vary(scene, "contact.kt_area", None, "contact.stiffness", "rigid")
    elif stiffness == "default":
        scene = vary(scene, "contact.kt_area", None)
    else:
        scene = vary(scene, "contact.kt_area", 1e9 * float(stiffness))
    ready = pipeline.run(scene, folder, until="contact")
    patches = list(ready.contact.problem.patches)
    bodies = Bodies(scene, ready.mesh, None, without_progress)
    diameters = harmonic_diameters(scene, ready.mesh, case_models.EXACT_HARMONICS)
    key = stage_key("reduction", scene, np.array(diameters), MODES)
    compute = partial(reduce_sector, bodies, patches, diameters, MODES)
    reduced, _ = cached_stage(folder, "reduction", key, compute)
    cases = case_models.load_cases(scene, ready.mesh, ready.contact)
    family_of = partial(case_models.family_of_case, scene, ready.mesh, reduced, patches)
    settings = first_settings(scene)
    settings = replace(settings, most=case_models.affordable_harmonics(cases[0]))
    return Layer(scene, cases, family_of, settings)


def print_response(layer: Layer, name: str, case: LoadCase) -> float:
    """One row of the table; its CPU seconds."""
    family = layer.family_of(case)
    with running_clock() as clock:
        begin = clock.now()
        curve = curve_of(layer.scene, case, lambda case: family, layer.settings)
        seconds = clock.now() - begin
    chosen = curve.settings
    lost = int((~curve.converged).sum())
    print(
        f"| {name} | {case.load:g} | {seconds:.1f} | {len(curve.frequency)} | {lost} | "
        f"{1e6 * curve.peak_amplitude:.1f} | {curve.peak_frequency:.2f} | "
        f"{100 * curve.error:.1f} | {chosen.harmonics}, {chosen.samples}, {chosen.points}, "
        f"{chosen.damper} | {curve.peak.states['lift']} of {len(curve.peak.w)} |",
        flush=True,
    )
    return seconds


def main(folder: str, layers: list[str]) -> None:
    print(
        "| layer [N/mm^3] | load [N] | CPU [s] | points | lost | resonance [um] | at [Hz] | "
        "estimated error [%] | harmonics, samples, points, damper | lift off |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    totals = {}
    for name in layers:
        layer = prepared(folder, name)
        totals[name] = sum(print_response(layer, name, case) for case in layer.cases)
    first = totals[layers[0]]
    ratios = ", ".join(f"{name} {total / first:.1f}" for name, total in totals.items())
    print(f"CPU of both loads over that of the first layer: {ratios}")


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp()
    main(folder, sys.argv[2:] or list(LAYERS))
