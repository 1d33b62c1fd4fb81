"""Charts of a whole scene and of the built-in reference blade: from geometry to
:func:`bladefem.study.chart.chart.method_chart`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ...hbm.reference_blade import reference_model
from ...hbm.solution import size
from ...hbm.stability import UNKNOWN
from ...io.stage_cache import cached_stage, on_root
from ...reduction.assemble import folded_diameter
from ...scene.tables import Scene
from ...scene.units import newtons
from ...util.communicator import Communicator
from ...util.message import warning
from ..adaptive.check_points import peak_of
from ..adaptive.checked_curve import CheckedCurve
from ..adaptive.family import Family, family_of
from ..adaptive.settings import first_for, restarted_settings, scene_line
from ..pipeline.bodies import Bodies
from ..pipeline.case_models import family_of_case, load_cases, middle_case, reduced_sector
from ..pipeline.pipeline import run
from ..pipeline.reduced_sector import Reduced
from ..stability.error_in_time import Marches
from ..stability.judged_resonance import judged_resonance
from .chart import Chart, check_budget, method_chart
from .meshes import mesh_table, mesh_variants

REFERENCE_LOAD = 3.0
REFERENCE_BAND = (1150.0, 1600.0)
REFERENCE_POINTS = 4


def scene_chart(
    scene: Scene,
    folder: str | Path,
    budget: float = 120.0,
    comm: Communicator | None = None,
    sizes: Sequence[float] | None = None,
) -> Chart:
    """The chart of a scene under the middle one of its loads; finished stages are picked up from
    the folder.

    Args:
        budget: CPU seconds for the chart, and as much again for the meshes; contact, reduction and
            the automatic choice come on top.
        sizes: element sizes of a comparison of meshes [m], chosen when empty; none when left out.
    """
    check_budget(budget)
    done = run(scene, folder, until="contact", comm=comm)
    variants = [] if sizes is None else mesh_variants(scene, sizes, done.mesh)
    bodies = Bodies(scene, done.mesh, comm)
    patches = list(done.contact.problem.patches)
    cases = load_cases(scene, done.mesh, done.contact)
    case = middle_case(cases)

    def stage(name: str, key: str, make: Callable[[], Reduced]) -> Reduced:
        return cached_stage(folder, name, key, make, comm)[0]

    settings, reduced = reduced_sector(scene, bodies, case, patches, stage)

    def family(known: Reduced) -> Family:
        return family_of_case(scene, done.mesh, known, patches, case)

    models = family(reduced)
    marches = Marches(models)
    made = on_root(
        comm,
        lambda: method_chart(
            models,
            restarted_settings(settings),
            scene.excitation.mode,
            scene.accuracy,
            budget,
            scene.study.band,
            {
                name: family(fewer)
                for name, fewer in _fewer_diameters(reduced, scene.excitation.engine_order)
            },
            marches if scene.study.stability else None,
            # chosen with the reduction, as in a run
            fixed=("modes",),
        ),
    )
    made.remarks.insert(0, f"normal load {newtons(case.load)} on each seat")
    if scene.study.stability and made.curve is not None:
        curve = made.curve
        made.remarks.append(on_root(comm, lambda: _judged_sentence(scene, marches, curve)))
    made.remarks.append(f"take this, at the beginning of the scene: {scene_line(made.settings)}")
    if sizes is None:
        return made
    table = mesh_table(scene, made.settings, case.load, variants, budget, made.remarks, comm)
    return replace(made, meshes=table)


def _judged_sentence(scene: Scene, marches: Marches, curve: CheckedCurve) -> str:
    """Whether the blade keeps to the resonance of the automatic choice, in time: all that a chart
    compares are balances.
    """
    top = peak_of(curve.points)
    judged = judged_resonance(marches, curve, scene)
    balance = f"{1e6 * size(top):.4g} um at {top.frequency:.5g} Hz"
    # what the tables compare lies off the curve where its top is flat: 0.5 % above it for the
    # shipped plane blades at 20 N
    solved = (
        f"the highest point solved with the automatic choice, {balance} (errors compare vertices "
        "of parabolas through three coarser frequencies, which may lie beside it)"
    )
    if judged.march_replaces_balance and judged.march is not None:
        return warning(
            f"the errors above compare balances, {balance}, to which the blade does not keep at "
            f"this load; at {judged.point.frequency:.5g} Hz {judged.march.sentence}"
        )
    skipped = ""
    if judged.strong_drive_skipped:
        skipped = "; motions that only a strong drive leads to were not sought"
    if judged.march is not None:
        said = f"{judged.march.sentence}{skipped}"
        return f"{solved}: {said}"
    verdict = judged.marks.verdict[[p is top for p in curve.points]][0]
    words = "was not judged" if verdict == UNKNOWN else f"is {verdict}"
    return f"{solved}, {words}{skipped}"


def _fewer_diameters(reduced: Reduced, order: int) -> Iterator[tuple[str, Reduced]]:
    """The sector with the nodal diameters of the first harmonics only; the others borrow the
    nearest of them.
    """
    if reduced.sectors:
        met = dict.fromkeys(
            folded_diameter(h, order, reduced.sectors)[0]
            for h in (1, 0, *range(2, reduced.sectors))
        )
        known = [n for n in met if n in reduced.sector]
        for count in range(1, len(known)):
            name = f"{count} of {len(known)} diameters"
            yield name, replace(reduced, sector={n: reduced.sector[n] for n in known[:count]})


def reference_chart(accuracy: float = 0.02, budget: float = 120.0) -> Chart:
    """The chart of mode 2 of the reference blade: 60 g damper, 1e6 N/m and 3 N friction limit a
    side, in phase.
    """
    family = family_of(reference_model(load=REFERENCE_LOAD, points=REFERENCE_POINTS, harmonics=63))
    return method_chart(family, first_for(family.modes), 2, accuracy, budget, REFERENCE_BAND)
