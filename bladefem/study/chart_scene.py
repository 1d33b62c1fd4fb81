"""Charts of a whole scene and of the built-in reference blade: from geometry to :func:`bladefem.study.chart.chart`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..hbm.reference import reference_model
from ..scene import Scene
from ..store import stage
from .chart import Chart, chart
from .family import family_of
from .pipeline import family_of_case, load_cases, reduced_sector, run
from .settings import first_for, restarted
from .stages import Bodies

__all__ = ["reference_chart", "scene_chart"]

REFERENCE_LOAD, REFERENCE_BAND, REFERENCE_POINTS = 3.0, (1150.0, 1600.0), 4


def scene_chart(scene: Scene, folder: str | Path, budget: float = 120.0, comm: Any = None) -> Chart:
    """The chart of a scene under the middle one of its loads; finished stages are picked up from the folder.

    Args:
        budget: seconds for the chart; mesh, contact and reduction come on top.
    """
    done = run(scene, folder, until="contact", comm=comm)
    bodies, patches = Bodies(scene, done.mesh, comm), list(done.contact.problem.patches)
    cases = load_cases(scene, done.mesh, done.contact)
    case = cases[len(cases) // 2]
    settings, reduced = reduced_sector(scene, bodies, case, patches,
                                       lambda name, key, make: stage(folder, name, key, make, comm)[0])
    family = family_of_case(scene, done.mesh, reduced, patches, case)
    made = chart(family, restarted(settings), scene.excitation.mode, scene.accuracy, budget, scene.study.band)
    made.remarks.insert(0, f"normal load {case.load:g} N on each seat")
    return made


def reference_chart(accuracy: float = 0.02, budget: float = 120.0) -> Chart:
    """The chart of mode 2 of the reference blade: 60 g damper, 1e6 N/m and 3 N friction limit a side, in phase."""
    family = family_of(reference_model(load=REFERENCE_LOAD, points=REFERENCE_POINTS, harmonics=63))
    return chart(family, first_for(family.modes), 2, accuracy, budget, REFERENCE_BAND)
