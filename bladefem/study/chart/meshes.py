"""The mesh's share in speed against accuracy: one resonance on several meshes, drawn, reduced and
solved anew.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from geometry.mesh import Mesh
from geometry.parameters import MeshSize
from geometry.sizing import MIN_ELEMENTS_ACROSS_SEAT, seat_length

from ...contact.frictional_seating import normal_part
from ...contact.seating import solve_seating as seat
from ...errors import NotSolvedError
from ...hbm.solution import size as height
from ...io.stage_cache import on_root
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...scene.validate import refuse_given_mesh
from ...util.communicator import Communicator
from ...util.percent import percent
from ..adaptive.band_sweep import covered_band
from ..adaptive.check_points import peak_of
from ..adaptive.family import family_member
from ..adaptive.settings import Settings
from ..pipeline.bodies import Bodies
from ..pipeline.case_models import EXACT_HARMONICS, family_of_case, load_cases
from ..pipeline.coriolis import with_coriolis
from ..pipeline.damper_contact import contact_patches, on_layer, seat_damper
from ..pipeline.damper_coriolis import with_damper_coriolis
from ..pipeline.history import FRICTIONLESS, condense_friction, seat_by_history
from ..pipeline.normal_modes import harmonic_diameters
from ..pipeline.reduced_sector import reduce_sector
from ..pipeline.run_records import Seating
from ..pipeline.scene_mesh import build_mesh
from .cpu_clock import running_clock

# of the scene's own element sizes, when none are given
SIZE_RATIOS = (1.7, 1.3, 1.0)
# at the most: what more of them change does not depend on the mesh
MAX_HARMONICS = 3
# accuracy at which the sweep looks for the peak: it is found to a tenth of it
SEARCH_ACCURACY = 0.01
# of the elements
ORDER_WORDS = {1: "first", 2: "second"}


@dataclass(frozen=True)
class MeshResonance:
    """What one mesh gives."""

    # [Hz]
    frequency: float
    # [m]
    amplitude: float
    # of blade and damper
    dofs: int
    # of CPU: drawing, seating, reduction and response
    seconds: float


@dataclass(frozen=True)
class MeshVariant:
    """Element sizes everywhere, those on the seats included."""

    name: str
    mesh: MeshSize
    order: int
    # about how many, over those of another variant
    cells: float
    # the mesh of the scene
    own: bool

    def of(self, scene: Scene) -> Scene:
        """The scene with this mesh."""
        return replace(scene, mesh=self.mesh)


def mesh_variants(
    scene: Scene,
    sizes: Sequence[float],
    drawn: Mesh,
) -> list[MeshVariant]:
    """Meshes of first and then of second order, from coarse to fine; seats are refined as
    everything else is.

    Args:
        sizes: element sizes [m]; where the scene leaves its own open the seats of the finest are as
            fine as they would be by default. When empty the scene's own sizes are scaled, and last
            its seats alone are halved.
        drawn: the mesh of the scene.

    Raises:
        InputError: a scene whose mesh is given.
    """
    refuse_given_mesh(scene)
    power = drawn.dimension
    own = scene.mesh
    if sizes:
        base = own.size or min(sizes)
        listed = [
            (f"{1e3 * size:.3g} mm", size / base, replace(own, size=base))
            for size in sorted(sizes, reverse=True)
        ]
    else:
        listed = [(_size_name(own.size, ratio), ratio, own) for ratio in SIZE_RATIOS]
    made = [
        MeshVariant(
            name,
            replace(mesh, order=order, scale=own.scale * ratio),
            order,
            ratio**-power,
            ratio == 1.0 and (mesh, order) == (own, own.order),
        )
        for order in (1, 2)
        for name, ratio, mesh in listed
    ]
    if not sizes:
        across = own.seat_elements
        if across is None and own.contact_size is None and kind_named(scene.kind).has_seat_grid:
            across = MIN_ELEMENTS_ACROSS_SEAT
        if across:
            along = own.contact_size or seat_length(scene.damper)
            halved = replace(own, order=2, seat_elements=2 * across, contact_size=along / 2)
        else:
            halved = replace(own, order=2, contact_size=_seat_size(drawn) / (2 * own.scale))
        made.append(MeshVariant("own size, seats halved", halved, 2, 2.0 ** (power - 1), False))
    return made


def _seat_size(mesh: Mesh) -> float:
    """Usual length of an edge on the seats [m]."""
    facets = np.concatenate([mesh.faces[name] for name in ("seat_left", "seat_right")])
    return float(
        np.median(np.linalg.norm(mesh.points[facets[:, 1]] - mesh.points[facets[:, 0]], axis=1))
    )


def on_mesh(
    scene: Scene,
    settings: Settings,
    load: float,
    comm: Communicator | None = None,
) -> MeshResonance:
    """The resonance under one load on the scene's own mesh, with given settings of the balance.

    Raises:
        InputError: the scene cannot be meshed; NotSolvedError: no point was solved.
    """
    with running_clock() as clock:
        start = clock.now()
        found = _resonance(scene, settings, load, comm)
        return replace(found, seconds=clock.now() - start)


def _resonance(
    scene: Scene,
    settings: Settings,
    load: float,
    comm: Communicator | None,
) -> MeshResonance:
    """On one mesh, its time left open."""
    mesh = build_mesh(scene, comm)
    bodies = Bodies(scene, mesh, comm)
    patches = contact_patches(mesh)
    if scene.contact.history == FRICTIONLESS:
        problem = seat_damper(bodies, patches)
        maps = seat(problem, scene.operation.speed, normal=load, bedded=scene.contact.bedded)
    else:
        rough = condense_friction(bodies, patches)
        problem = on_layer(scene, normal_part(rough))
        maps = seat_by_history(scene, rough, load).maps
    case = load_cases(scene, mesh, Seating(problem, {load: maps}))[0]
    diameters = harmonic_diameters(scene, mesh, EXACT_HARMONICS)
    reduced = with_coriolis(scene, reduce_sector(bodies, patches, diameters, settings.modes))
    reduced = with_damper_coriolis(scene, mesh, reduced, patches, case)
    model = family_member(family_of_case(scene, mesh, reduced, patches, case), settings).model
    points = covered_band(model, settings, scene.study.band, scene.excitation.mode, SEARCH_ACCURACY)
    top = peak_of(points)
    return MeshResonance(top.frequency, height(top), mesh.dimension * len(mesh.points), np.nan)


def mesh_table(
    scene: Scene,
    settings: Settings,
    load: float,
    variants: Sequence[MeshVariant],
    budget: float,
    remarks: list[str],
    comm: Communicator | None = None,
) -> pd.DataFrame:
    """One row a mesh: name, family, CPU time [s], dofs, errors against the richest one.

    The richest is the last of second order that was solved; its own error is its change from the
    one before.

    Args:
        settings: of the balance; MAX_HARMONICS at the most are used, and all contact points.
        budget: CPU seconds; meshes that are expected to take more than what is left are named and
            left out.
        remarks: what a reader has to know is added here.
    """
    few = replace(settings, harmonics=min(settings.harmonics, MAX_HARMONICS), points=None)
    rows = list(_rows(scene, few, load, variants, budget, comm))
    rich = [row for row in rows if row["found"] is not None and row["order"] == 2]
    missing = [
        f"mesh of {ORDER_WORDS[row['order']]} order, {row['name']}: {row['reason']}"
        for row in rows
        if row["reason"]
    ]
    if not rich:
        remarks += [
            "meshes are not compared: none of second order was solved, the reference of the others",
            *missing,
        ]
        return pd.DataFrame()
    truth = rich[-1]["found"]
    before = rich[-2]["found"] if len(rich) > 1 else None
    doubt = abs(before.amplitude / truth.amplitude - 1) if before else np.nan
    moved = (
        f"changed by {percent(doubt)} from the mesh before, its frequency by "
        f"{percent(abs(before.frequency / truth.frequency - 1))}"
        if before
        else "the only one, whose own error is not known"
    )
    remarks.append(
        f"reference of the meshes: {rich[-1]['name']} of second order, resonance "
        f"{truth.frequency:.6g} Hz, {1e6 * truth.amplitude:.6g} um, {moved}"
    )
    remarks += missing
    return pd.DataFrame([_told(row, truth, doubt) for row in rows])


def _size_name(size: float | None, ratio: float) -> str:
    return f"{1e3 * size * ratio:.3g} mm" if size else f"own size x {ratio:g}"


def _rows(
    scene: Scene,
    settings: Settings,
    load: float,
    variants: Sequence[MeshVariant],
    budget: float,
    comm: Communicator | None,
) -> Iterator[dict[str, Any]]:
    end = time.process_time() + budget
    last = None
    for variant in variants:
        last = last if last and last[0].order == variant.order else None
        row: dict[str, Any] = {
            "name": variant.name,
            "order": variant.order,
            "found": None,
            "reason": "",
            "chosen": variant.own,
        }
        expected = 0.0 if last is None else last[1] * variant.cells / last[0].cells
        left, expected = on_root(comm, partial(_left_and, end, expected))
        if left <= 0:
            row["reason"] = "left out: the budget was used up"
        elif expected > left:
            row["reason"] = f"left out: {expected:.2g} s expected, {left:.2g} s left"
        else:
            row |= _tried(variant.of(scene), settings, load, comm)
        if row["found"] is not None:
            last = variant, row["found"].seconds
        yield row


def _left_and(end: float, expected: float) -> tuple[float, float]:
    """Seconds that are left and that are expected, for all ranks to decide by."""
    return end - time.process_time(), expected


def _tried(
    scene: Scene,
    settings: Settings,
    load: float,
    comm: Communicator | None,
) -> dict[str, Any]:
    try:
        return {"found": on_mesh(scene, settings, load, comm)}
    except NotSolvedError as error:
        return {"reason": str(error)}


def _told(
    row: dict[str, Any],
    truth: MeshResonance,
    doubt: float,
) -> dict[str, object]:
    found = row["found"]
    # a reference of which nothing is known is not exact
    compared = found is not None and not (found is truth and np.isnan(doubt))
    return {
        "name": row["name"],
        "family": f"order {row['order']}",
        "time": np.nan if found is None else found.seconds,
        "dofs": np.nan if found is None else found.dofs,
        "chosen": row["chosen"],
        "left_out": row["reason"].startswith("left out"),
        "error": abs(found.amplitude / truth.amplitude - 1) if compared else np.nan,
        "error_frequency": abs(found.frequency / truth.frequency - 1) if compared else np.nan,
        "converged": found is not None,
        "reference_error": doubt,
        "reason": row["reason"],
    }
