"""The run folder of a verification pair, kinds "hertz" and "punch": pressures next to their closed
forms.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd

from bladefem.io.stage_cache import on_root, write_results
from bladefem.scene.tables import Scene
from bladefem.scene.toml import dump_scene
from bladefem.scene.warnings import implausible_values
from bladefem.study.kinds.contact_pairs import (
    COMPARED_RADIUS_SHARE,
    PairState,
    node_radii,
    solve_pair,
)
from bladefem.study.kinds.hertz import hertz_pressure
from bladefem.study.kinds.punch import johnson_pressure
from bladefem.util.message import warning
from bladefem.util.progress import Progress, without_progress
from bladefem.view import contact, indentation, mesh
from geometry.mesh import Mesh
from geometry.quality import quality_rows

from ..util.communicator import Communicator
from ..util.percent import percent
from .datasets import resultants, table_dataset
from .tables import write_tables
from .write import write_report


@dataclass(frozen=True)
class PairRun:
    """What a run of a pair has; the same on every rank."""

    folder: Path
    mesh: Mesh
    states: list[PairState]
    # stage to seconds
    timings: dict[str, float]
    messages: list[str]


def report_pair(
    scene: Scene,
    folder: str | Path,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> PairRun:
    """Mesh and pressures on all ranks, the folder on rank 0.

    Raises:
        InputError, NotSolvedError: see ``study.kinds.contact_pairs.solve_pair``.
    """
    start = perf_counter()
    found, states = solve_pair(scene, folder, comm)
    timings = {"mesh and pressure": perf_counter() - start}
    messages = [*map(warning, implausible_values(scene)), *_messages(scene, states)]
    result = PairRun(Path(folder), found, states, timings, messages)
    start = perf_counter()
    on_root(comm, lambda: _write(scene, result))
    timings["pictures and report"] = perf_counter() - start
    return result


def pair_summary(states: list[PairState]) -> pd.DataFrame:
    """One row a load: contact radius, pressure in the middle and approach, computed and closed
    form; error.
    """
    rows = []
    for state in states:
        middle = int(np.argmin(np.linalg.norm(state.seat.patch.points, axis=1)))
        rows.append(
            {
                "load": state.load,
                "middle_pressure": state.seat.pressure[middle],
                "middle_pressure_exact": state.exact[middle],
                "contact_radius": state.radius[0],
                "contact_radius_exact": state.radius[1],
                "approach": state.approach[0],
                "approach_exact": np.nan if state.approach[1] is None else state.approach[1],
                "pressure_error": state.error,
                "complementarity": state.seat.complementarity,
            }
        )
    table = pd.DataFrame(rows)
    # a punch has its own
    if all(state.radius[0] == state.radius[1] for state in states):
        table = table.drop(columns=["contact_radius", "contact_radius_exact"])
    return table.drop(columns="approach_exact") if table["approach_exact"].isna().all() else table


def _messages(scene: Scene, states: list[PairState]) -> list[str]:
    where = (
        f" within {COMPARED_RADIUS_SHARE:g} of the punch's radius" if scene.kind == "punch" else ""
    )
    worst = max(state.error for state in states)
    solid = scene.hertz.dimension == 3 if scene.kind == "hertz" else scene.punch.dimension == 3
    known = (
        "the closed form is that of half spaces, the blocks are held at their far faces"
        if solid
        else "plane strain; loads act on a metre of depth, and the approach, which has no closed "
        "form, on the blocks' size"
    )
    return [
        f"pressure within {percent(worst)} (L2{where}) of the closed form",
        f"approach: {known}" if solid else known,
    ]


def _points(result: PairRun) -> pd.DataFrame:
    """One row a contact node of each load."""
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "load": s.load,
                    "radius": node_radii(s.seat, result.mesh.dimension),
                    "area": s.seat.patch.area,
                    "pressure": s.seat.pressure,
                    "pressure_exact": s.exact,
                    "gap": s.seat.gap,
                }
            )
            for s in result.states
        ],
        ignore_index=True,
    )


def _resultants(states: list[PairState]) -> pd.DataFrame:
    """One row a load: force, moment, centre, area and peak of the meshed quarter, or half in the
    plane.
    """
    table = contact.pressure_summary([s.seat for s in states])
    table.insert(0, "load", [s.load for s in states])
    return table


def _write(scene: Scene, result: PairRun) -> None:
    folder = result.folder
    states = result.states
    tables = {
        "mesh/quality": pd.DataFrame(quality_rows(result.mesh), columns=["what", "value"]),
        "contact/summary": pair_summary(states),
        "contact/points": _points(result),
        "contact/resultants_of_the_meshed_part": _resultants(states),
    }
    for name, table in tables.items():
        write_tables(table, folder / name.split("/")[1], name.split("/")[1])
    write_results(
        folder / "results.nc",
        {
            "summary": table_dataset(tables["contact/summary"], "load_case"),
            "resultants": resultants(tables["contact/resultants_of_the_meshed_part"]),
            "points": table_dataset(tables["contact/points"], "point"),
        },
        dump_scene(scene),
    )
    figures = {
        name: folder / f"{name.split('/')[1]}.png" for name in ("mesh/mesh", "contact/pressure")
    }
    mesh.draw_mesh(result.mesh, figures["mesh/mesh"], title=scene.title)
    _draw(scene, result, figures["contact/pressure"])
    mesh.save_vtu(result.mesh, folder / "mesh.vtu")
    contact.save_pressure_vtu({s.load: [s.seat] for s in states}, folder / "pressure.vtu")
    write_report(
        folder,
        scene,
        {k: v for k, v in tables.items() if k != "contact/points"},
        figures,
        result.messages,
        result.timings,
    )


def _draw(
    scene: Scene,
    result: PairRun,
    file: Path,
) -> None:
    """Pressure over the radius, with the closed form drawn as a curve of its own."""
    largest = max(result.states, key=lambda s: s.load)
    edge = largest.radius[1]
    solid = result.mesh.dimension == 3
    radius = node_radii(largest.seat, result.mesh.dimension)

    def exact(load: float) -> tuple[np.ndarray, np.ndarray]:
        if scene.kind == "hertz":
            r = np.linspace(0, radius.max(), 400)
            return r, hertz_pressure(scene, load, r)
        r = np.linspace(0, 0.999 * edge, 400)
        return r, johnson_pressure(r, edge, load, not solid)

    indentation.draw_indentation(
        {s.load: s.seat for s in result.states}, radius, exact, edge, file, title=scene.title
    )
