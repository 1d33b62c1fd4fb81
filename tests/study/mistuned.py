"""The shipped mistuned wheel on a mesh that a test can afford, and one of fewer blades."""

from functools import cache
from pathlib import Path
from typing import NamedTuple

from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.settings import Settings, first_settings
from bladefem.study.mistuning.whole_wheel import WheelSector, reduce_wheel
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.run_records import ReducedRun

MISTUNED = Path(__file__).parents[2] / "scenes" / "mistuned.toml"
COARSE_MISTUNED = (
    "mesh.size=16 mm",
    "mesh.seat_elements=2",
    "study.loads=80 N",
    "contact.points=2",
    "model.modes=6",
    "model.static=uncoupled",
    # which motion a sector's curve keeps, and what its best load depends on, is no wheel's question
    "study.stability=false",
    "study.influences=false",
)
# A third of the blades, as close to each other and with the same phase between neighbours.
SECTORS, ORDER = 12, 3
SMALL_MISTUNED = (
    *COARSE_MISTUNED,
    f"disc.sectors={SECTORS}",
    "disc.bore_radius=40 mm",
    "disc.rim_radius=66.7 mm",
    f"excitation.engine_order={ORDER}",
    f"mistuning.pattern={Path(__file__).parent / 'mistuned_pattern.csv'}",
)
# On elements half as large again.
ROUGH_MISTUNED = (*SMALL_MISTUNED, "mesh.scale=1.5")


class ReducedWheel(NamedTuple):
    """A coarse wheel, reduced, and what a response begins with."""

    scene: Scene
    run: ReducedRun
    patches: list[str]
    sector: WheelSector
    case: LoadCase
    settings: Settings


@cache
def reduced_wheel(overrides: tuple[str, ...]) -> ReducedWheel:
    """Six modes of the sector in every nodal diameter, three blade-alone families."""
    scene = load_scene(MISTUNED, overrides)
    run = pipeline.run(scene, None, until="reduction")
    patches = list(run.contact.problem.patches)
    sector = reduce_wheel(Bodies(scene, run.mesh), patches, 6, run.clamped, 3)
    (case,) = load_cases(scene, run.mesh, run.contact)
    return ReducedWheel(scene, run, patches, sector, case, first_settings(scene))
