"""Random loading histories against the interval of a resonance, on a coarse wedge scene; and what
the interval costs in addition to the plain curve.

    python benchmarks/history_interval.py [histories]

Each history starts the friction law of every contact point from another force: of its own
direction, the same on a seat, the same on both, or varying linearly across each seat, of any size
up to 1.2 times the friction limit. Measured at 2600 N with 12 points a seat joined from 63: 901
random histories from 2501 to 2887 um, the interval (sampled, 91 points) from 1675 to 2888 um about
2845, none outside; with 194 points from 1523.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from functools import partial

import numpy as np

from bladefem.errors import NotSolvedError
from bladefem.hbm.history_interval import history_interval
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.peak import Peak, find_peak
from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.family import family_member
from bladefem.study.pipeline import case_models, pipeline
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.loads import curve_of
from bladefem.util.progress import without_progress

LOADS = (640.0, 1300.0, 2600.0)
TOLERANCE = 1e-3


def random_start(model: ReducedModel, rng: np.random.Generator) -> np.ndarray:
    """(n, 2) a start of the friction law."""
    n = len(model.elements.kt)
    seat = np.arange(n) < n // 2
    kind = rng.integers(4)
    if kind == 0:
        force = rng.normal(size=(n, 2))
    elif kind == 1:
        force = np.tile(rng.normal(size=2), (n, 1))
    elif kind == 2:
        force = np.where(seat[:, None], rng.normal(size=2), rng.normal(size=2))
    else:
        along = np.linspace(-1, 1, n)[:, None] * rng.normal(size=2)
        force = along + np.where(seat[:, None], rng.normal(size=2), rng.normal(size=2))
    limit = model.elements.mu * np.maximum(model.elements.n0, 0.0)
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    return 1.2 * rng.uniform() * limit[:, None] * unit


def random_heights(model: ReducedModel, peak: Peak, count: int) -> np.ndarray:
    """Heights of the resonance after random histories; those that are not found are left out."""
    rng = np.random.default_rng(0)
    heights = []
    point = peak.solution
    for _ in range(count):
        history = replace(model, start=random_start(model, rng))
        try:
            found = find_peak(
                history,
                peak.omega,
                point.harmonics,
                point.samples,
                near=peak,
                tolerance=TOLERANCE,
            )
        except NotSolvedError:
            continue
        heights.append(found.height)
    return np.array(heights)


def main(count: int) -> None:
    scene = vary(
        load_scene("scenes/wedge.toml"),
        "mesh.size",
        "8 mm",
        "contact.points",
        12,
        "study.own_load",
        False,
        "study.loads",
        LOADS,
    )
    folder = tempfile.mkdtemp()
    ready = pipeline.run(scene, folder, until="reduction")
    patches = list(ready.contact.problem.patches)
    cases = case_models.load_cases(scene, ready.mesh, ready.contact)
    settings, reduced = case_models.reduced_sector(
        scene,
        Bodies(scene, ready.mesh, None, without_progress),
        cases[len(cases) // 2],
        patches,
        lambda name, key, compute: compute(),
    )
    family = partial(case_models.family_of_case, scene, ready.mesh, reduced, patches)
    print("load [N]  sticking  lowest  given  highest [um]  certificate  random histories [um]")
    for case in cases:
        start = time.process_time()
        curve = curve_of(scene, case, family, settings)
        plain = time.process_time() - start
        model = family_member(family(case), curve.settings).model
        chosen = curve.settings
        start = time.process_time()
        peak = find_peak(
            model,
            curve.peak.omega,
            chosen.harmonics,
            chosen.samples,
            near=curve.peak,
            tolerance=TOLERANCE,
        )
        found = history_interval(model, peak, tolerance=TOLERANCE)
        spent = time.process_time() - start
        heights = random_heights(model, peak, count)
        low = found.lowest.height * (1 - 2 * TOLERANCE)
        high = found.highest.height * (1 + 2 * TOLERANCE)
        outside = int(((heights < low) | (heights > high)).sum())
        print(
            f"{case.load:8.4g}  {found.sticking:8d}  {1e6 * found.lowest.height:6.1f}  "
            f"{1e6 * peak.height:6.1f}  {1e6 * found.highest.height:6.1f}  {found.certificate:>11} "
            f" {len(heights)} from {1e6 * heights.min():.1f} to {1e6 * heights.max():.1f}, "
            f"{outside} outside; cost {spent / plain:.2f} times the curve's",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
