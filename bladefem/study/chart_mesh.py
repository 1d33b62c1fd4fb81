"""The mesh's share in speed against accuracy: one resonance on several meshes, drawn, reduced and solved anew."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ..contact.seat import solve as seat
from ..errors import NotSolvedError
from ..hbm.sweep import size as height
from ..scene import Scene
from .choice import covered, peak_of
from .family import member
from .pipeline import EXACT_HARMONICS, Seating, family_of_case, load_cases
from .settings import Settings
from .stages import Bodies, build_mesh, contact_patches, harmonic_diameters, reduce_sector, seat_damper

__all__ = ["Resonance", "default_meshes", "mesh_table", "on_mesh"]

RATIOS = (1.7, 1.3, 1.0)    # of the scene's own element size
HARMONICS = 3       # at the most: what more of them change does not hang on the mesh
PEAK = 0.01         # accuracy at which the sweep looks for the peak: it is found to a tenth of it


@dataclass(frozen=True)
class Resonance:
    """What one mesh tells."""

    frequency: float    # [Hz]
    amplitude: float    # [m]
    dofs: int           # of blade and damper
    seconds: float      # of CPU: drawing, seating, reduction and response


def default_meshes(scene: Scene, own: float) -> list[float]:
    """Element sizes [m] down to that of the scene.

    Args:
        own: mean element size, where the scene leaves it open [m].
    """
    return [ratio * (scene.mesh.size or own) for ratio in RATIOS]


def on_mesh(scene: Scene, settings: Settings, load: float, comm: Any = None) -> Resonance:
    """The resonance under one load on the scene's own mesh, with given settings of the balance.

    Raises:
        InputError: the scene cannot be meshed; NotSolvedError: no point was solved.
    """
    start = time.process_time()
    mesh = build_mesh(scene, comm)
    bodies, patches = Bodies(scene, mesh, comm), contact_patches(mesh)
    problem = seat_damper(bodies, patches)
    maps = seat(problem, scene.operation.speed, normal=load, bedded=scene.contact.bedded)
    case = load_cases(scene, mesh, Seating(problem, {load: maps}))[0]
    diameters = harmonic_diameters(scene, mesh, EXACT_HARMONICS)
    reduced = reduce_sector(bodies, patches, diameters, settings.modes)
    model = member(family_of_case(scene, mesh, reduced, patches, case), settings).model
    points = covered(model, settings, scene.study.band, scene.excitation.mode, PEAK)
    top = peak_of(points)
    return Resonance(top.frequency, height(top), mesh.dimension * len(mesh.points), time.process_time() - start)


def mesh_table(scene: Scene, settings: Settings, load: float, sizes: Sequence[float], budget: float,
               remarks: list[str], comm: Any = None) -> pd.DataFrame:
    """One row a mesh of first and second order: name, family, CPU time [s], dofs, errors against the richest one.

    The richest is the finest of second order that was solved; its own error is its change from the one before.

    Args:
        sizes: element sizes [m].
        settings: of the balance; HARMONICS at the most are used.
        budget: seconds; meshes that are expected to take more than what is left are named and left out.
        remarks: what a reader has to know is added here.
    """
    few = replace(settings, harmonics=min(settings.harmonics, HARMONICS))
    rows = list(_rows(scene, few, load, sorted(sizes, reverse=True), budget, comm))
    rich = [row for row in rows if row["found"] is not None and row["order"] == 2]
    if not rich:
        remarks += [f"mesh {row['name']}: {row['reason']}" for row in rows]
        return pd.DataFrame()
    truth, before = rich[-1]["found"], rich[-2]["found"] if len(rich) > 1 else None
    doubt = abs(before.amplitude / truth.amplitude - 1) if before else np.nan
    remarks.append(f"reference of the meshes: {rich[-1]['name']} of second order, resonance {truth.frequency:.6g} Hz, "
                   f"{truth.amplitude:.6g} m, changed by {doubt:.1e} from the mesh before, its frequency by "
                   f"{abs(before.frequency / truth.frequency - 1) if before else np.nan:.1e}")
    remarks += [f"mesh {row['name']}: {row['reason']}" for row in rows if row["reason"]]
    return pd.DataFrame([_told(row, truth, doubt) for row in rows])


def _rows(scene: Scene, settings: Settings, load: float, sizes: Sequence[float], budget: float,
          comm: Any) -> Iterator[dict[str, Any]]:
    end = time.perf_counter() + budget
    for order in (1, 2):
        last = None
        for size in sizes:
            row = {"name": f"{1e3 * size:.3g} mm", "order": order, "found": None, "reason": "",
                   "chosen": order == scene.mesh.order and size == scene.mesh.size}
            left, expected = end - time.perf_counter(), 0.0 if last is None else _expected(scene, *last, size)
            if expected > left:
                row["reason"] = f"left out: {expected:.2g} s expected, {max(left, 0.0):.2g} s left"
            else:
                row |= _tried(scene, settings, load, size, order, comm)
            if row["found"] is not None:
                last = size, row["found"].seconds
            yield row


def _tried(scene: Scene, settings: Settings, load: float, size: float, order: int, comm: Any) -> dict[str, Any]:
    given = scene.mesh.contact_size
    contact = given if given is None or scene.mesh.size is None else given * size / scene.mesh.size
    other = replace(scene, mesh=replace(scene.mesh, size=size, order=order, contact_size=contact))
    try:
        return {"found": on_mesh(other, settings, load, comm)}
    except NotSolvedError as error:
        return {"reason": str(error)}


def _expected(scene: Scene, size: float, seconds: float, finer: float) -> float:
    """Seconds of a finer mesh, in proportion to its cells."""
    return seconds * (size / finer) ** (2 if scene.kind == "plane blades" else 3)


def _told(row: dict[str, Any], truth: Resonance, doubt: float) -> dict[str, object]:
    found = row["found"]
    return {"name": row["name"], "family": f"order {row['order']}", "time": np.nan if found is None else found.seconds,
            "dofs": 0 if found is None else found.dofs, "chosen": row["chosen"],
            "left_out": row["reason"].startswith("left out"),
            "error": np.nan if found is None else abs(found.amplitude / truth.amplitude - 1),
            "error_frequency": np.nan if found is None else abs(found.frequency / truth.frequency - 1),
            "converged": found is not None, "reference_error": doubt, "reason": row["reason"]}
