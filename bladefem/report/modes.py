"""What ``bladefem modes`` leaves in its folder: tables, pictures, an animated wave, ParaView and
netCDF files.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd

from geometry.mesh import sector_of

from ..data import ModeSet
from ..hbm.parallel import share_work
from ..io.run_folder import given_fields
from ..io.stage_cache import on_root, write_results
from ..scene.tables import Scene
from ..scene.toml import dump_scene
from ..scene.units import show
from ..study.modes.campbell import Campbell
from ..study.modes.comparison import family_table
from ..study.modes.crossings import wave_sense
from ..study.modes.linear_response_report import stress_states, stress_table
from ..study.modes.survey import (
    ORDERS_ABOVE,
    Survey,
    Wanted,
    excited_set,
    order_is_given,
    survey_modes,
)
from ..study.pipeline.run_records import ModalRun, folder_of
from ..study.pipeline.stage_inputs import all_declared
from ..util.communicator import Communicator
from ..util.nodal_diameter import excited_diameter
from ..util.percent import percent
from ..util.progress import Progress, without_progress
from ..view import convergence, forced, mesh, modes, speed
from ..view.live_curves import live_diameters
from ..view.live_shapes import live_shapes
from .datasets import mode_shapes
from .headlines import Headline
from .mode_table import mode_table
from .tables import write_tables
from .write import Page, write_report

# first modes that are drawn large, next to the sheet of the first eight and the one of the
# excitation: each takes as long as the sheet
DRAWN_MODES = 1
# modes whose stresses are computed
MAX_STRESSED_MODES = 4
# frequencies on the first screen
MAX_HEADLINES = 6
# sections of tables and pictures; the others are among the modes
SECTION_OF = {
    "convergence": "mesh",
    "convergence_points": "mesh",
    "forced_response": "response",
    "resonances": "response",
}
# entries of the page whose files have the name of another figure or table
ENTRY_OF = {"forced_response": "forced_response_linear", "stresses": "stresses_of_modes"}
# lowest engine orders, which a Campbell diagram has whatever the scene's own order is
LOWEST_ORDERS = 5
# pictures and files that take longest, by their names
SLOWEST_TO_WRITE = ("wave.gif", "modes.png", "modes.vtu", "mode_1_wheel.png")
# fields [Pa] or [m] by name, at nodes or in cells
Fields: TypeAlias = dict[str, np.ndarray]
# long tables: in CSV files only
UNPRINTED = ("forced_response", "campbell", "convergence_points")
MESH_STEP = (
    "How far the mesh is wrong is not known: ask for three meshes with 'bladefem modes SCENE "
    "--converge' before frequencies are frozen."
)


def report_survey(
    scene: Scene,
    folder: str | Path,
    wanted: Wanted,
    pictures: int = DRAWN_MODES,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> Survey:
    """Survey the modes and write the folder.

    Args:
        pictures: number of first modes drawn large, on the sector and on the wheel, next to the
            one of the excitation; 0 for tables only.

    Raises:
        InputError, NotSolvedError: see :func:`bladefem.study.modes.survey.survey_modes`.
    """
    result = survey_modes(scene, folder, wanted, comm, progress)
    start = time.perf_counter()
    stresses = _stresses(result)
    _write(result, pictures, stresses, comm, progress)
    timings = {**result.run.timings, "tables and pictures": time.perf_counter() - start}
    return replace(result, run=replace(result.run, timings=timings))


def tables_of(result: Survey) -> dict[str, pd.DataFrame]:
    """All tables by file name, SI columns."""
    run = result.run
    excited = excited_set(run)
    out = {
        "frequencies": mode_table(run.modes, run.mesh, result.clamped),
        "excited_modes": family_table(excited, run.mesh, result.clamped),
        "effective_masses": result.masses,
    }
    if excited.nodal_diameter is None:
        out["frequencies"] = out["frequencies"].drop(columns="nodal_diameter")
    if result.campbell is not None:
        found = result.campbell
        out |= {
            "campbell": found.table,
            "crossings": found.crossings,
            "interference": found.interference,
            "margins": found.margins,
        }
    if result.convergence is not None:
        out |= {
            "convergence": result.convergence.summary,
            "convergence_points": result.convergence.points,
        }
    if result.answer is not None:
        out |= {"forced_response": result.answer.points, "resonances": result.answer.resonances}
    if result.mac is not None and result.compared is not None:
        out["mac"] = mac_table(result.mac, excited, result.compared)
    return out


def mac_table(
    match: np.ndarray,
    mine: ModeSet,
    theirs: ModeSet,
) -> pd.DataFrame:
    """One row a mode: its partner in the other run, both frequencies, and the whole row of the MAC
    matrix.
    """
    best = match.argmax(axis=1)
    table = pd.DataFrame(
        {
            "mode": np.arange(1, len(match) + 1),
            "frequency": mine.frequencies,
            "partner": best + 1,
            "frequency_of_partner": theirs.frequencies[best],
            "mac": match.max(axis=1),
        }
    )
    return table.assign(**{f"MAC {j + 1}": match[:, j] for j in range(match.shape[1])})


def _write(
    result: Survey,
    pictures: int,
    stresses: tuple[pd.DataFrame, Fields, Fields],
    comm: Communicator | None,
    progress: Progress,
) -> None:
    """All files, dealt over the ranks; rank 0 writes the report, which holds the pictures."""
    table, fields, inside = stresses
    tables = tables_of(result) | {"stresses": table}
    folder = folder_of(result.run)
    drawings = _drawings(result, tables, pictures) if pictures else {}
    jobs: dict[str, Callable[[], object]] = {
        **{name: partial(draw, folder / name) for name, draw in drawings.items()},
        **_file_writers(result, tables, (fields, inside), pictures),
    }
    # the longest first: what follows goes to the rank that is free
    order = sorted(jobs, key=lambda name: name not in SLOWEST_TO_WRITE)

    def write(name: str) -> None:
        jobs[name]()

    share_work(
        write, order, comm, lambda items: progress(items, "pictures and files"), on_demand=True
    )
    if pictures:
        on_root(comm, lambda: _report(result, tables, list(drawings)))


def _file_writers(
    result: Survey,
    tables: dict[str, pd.DataFrame],
    stresses: tuple[Fields, Fields],
    pictures: int,
) -> dict[str, Callable[[], object]]:
    """Name of a file, or of a set of files -> what writes it."""
    run = result.run
    folder = folder_of(run)
    excited = excited_set(run)

    def write_all_tables() -> None:
        for name, table in tables.items():
            write_tables(table, folder / name, name.replace("_", " "))

    def write_stresses() -> None:
        fields, inside = stresses
        shapes = modes.named_shapes(excited, pictures)
        mesh.save_vtu(run.mesh, folder / "stress.vtu", {**shapes, **fields}, inside)

    out: dict[str, Callable[[], object]] = {
        "tables": write_all_tables,
        "modes.nc": lambda: write_results(
            folder / "modes.nc", {"modes": mode_shapes(run)}, dump_scene(run.scene)
        ),
        # the elements between the nodes of modes.nc
        "mesh.vtu": lambda: mesh.save_vtu(run.mesh, folder / "mesh.vtu"),
    }
    if pictures:
        out["modes.vtu"] = lambda: modes.save_modes_vtu(run.mesh, excited, folder / "modes.vtu")
        out["stress.vtu"] = write_stresses
    return out


def _report(
    result: Survey,
    tables: dict[str, pd.DataFrame],
    pictures: Sequence[str],
) -> None:
    """``report_modes.html`` and ``.md``: frequencies first, shapes to rotate, everything else."""
    run = result.run
    folder = folder_of(run)
    excited = excited_set(run)
    families = [str(name) for name in tables["excited_modes"]["family"]]
    live = {}
    if "nodal_diameter" in tables["frequencies"]:
        live["modes/nodal_diameters"] = live_diameters(tables["frequencies"])
    shapes = live_shapes(run.mesh, excited, families)
    if shapes is not None:
        live["modes/modes"] = shapes
    figures = {_entry(name): folder / name for name in pictures}
    write_report(
        folder,
        run.scene,
        {_entry(name): table for name, table in tables.items() if name not in UNPRINTED},
        figures,
        run.messages,
        run.timings,
        page=Page(
            live,
            _numbers(excited, families, result, run.scene.operation.speed),
            [] if result.convergence is not None else [MESH_STEP],
            "report_modes",
            f"{run.scene.kind}, natural frequencies and mode shapes",
            # damping: of forced responses
            inputs={"operation", *all_declared("survey", run.scene)}
            | all_declared("stress", run.scene),
        ),
    )


def _entry(name: str) -> str:
    """Section and name of a table or picture on the page."""
    stem = Path(name).stem
    return f"{SECTION_OF.get(stem, 'modes')}/{ENTRY_OF.get(stem, stem)}"


def _numbers(
    excited: ModeSet,
    families: Sequence[str],
    result: Survey,
    speed: float,
) -> list[Headline]:
    """The first frequencies above zero with the error of the mesh, where that is known, and the
    speed [rad/s] that they belong to.
    """
    elastic = np.flatnonzero(excited.frequencies > 0)[:MAX_HEADLINES]
    errors = {}
    if result.convergence is not None:
        known = result.convergence.summary
        # of the mesh of the tables, which a study of a file's mesh halves
        if "given_error" in known:
            errors = dict(zip(known["mode"], known["given_error"], strict=True))
        else:
            # sizes that are asked for may end at another mesh
            errors = {
                mode: error + abs(excited.frequencies[mode - 1] / frequency - 1)
                for mode, frequency, error in zip(
                    known["mode"], known["frequency"], known["error"], strict=True
                )
                if mode <= len(excited.frequencies) and frequency > 0
            }
    diameter = (
        "" if excited.nodal_diameter is None else f"nodal diameter {excited.nodal_diameter}; "
    )
    turning = f"at {show(speed, 'rad/s', 5)}" if speed else "at rest"
    return [
        Headline(
            f"mode {i + 1}, {families[i]}",
            f"{excited.frequencies[i]:.5g} Hz",
            f"± {percent(errors[i + 1])} (mesh)" if i + 1 in errors else "mesh error not studied",
            f"{diameter}{turning}; residual {excited.residuals[i]:.0e}",
        )
        for i in elastic
    ]


def _stresses(result: Survey) -> tuple[pd.DataFrame, Fields, Fields]:
    """Table of extremes and fields at nodes or in cells: displacement and stress under the
    rotation, of the first modes and of the resonances; collective.
    """
    states = stress_states(
        result.bodies, excited_set(result.run), MAX_STRESSED_MODES, result.answer
    )
    table, nodes, cells = stress_table(result.bodies, states)
    fields, inside = (
        {
            f"{name}, {kind} [Pa]": field
            for name, values in each.items()
            for kind, field in values.items()
        }
        for each in (nodes, cells)
    )
    for name in nodes:
        if not name.startswith("mode"):
            fields |= _vectors(f"{name}, displacement", states[name])
    return table, fields, inside


def _vectors(name: str, u: np.ndarray) -> dict[str, np.ndarray]:
    """A displacement as one field, or as real and imaginary part."""
    return (
        {f"{name}, real [m]": u.real, f"{name}, imaginary [m]": u.imag}
        if np.iscomplexobj(u)
        else {f"{name} [m]": u}
    )


def _drawings(
    result: Survey,
    tables: dict[str, pd.DataFrame],
    pictures: int,
) -> dict[str, Callable[[Path], object]]:
    """File name to a function that draws it."""
    run = result.run
    excited = excited_set(result.run)
    wheel = len(result.run.modes) > 1
    names = list(tables["excited_modes"]["family"])
    turning = min(run.scene.excitation.mode, len(excited.frequencies)) - 1
    shown = sorted({turning, *range(min(pictures, len(excited.frequencies)))})
    out: dict[str, Callable[[Path], object]] = {
        "modes.png": lambda file: modes.draw_mode_sheet(run.mesh, excited, file, families=names)
    }
    for i in shown:
        one = partial(modes.draw_mode, run.mesh, excited, i, family=names[i])
        out[f"mode_{i + 1}.png"] = one
        if wheel:
            turned = partial(modes.draw_wheel_mode, run.mesh, excited, i, family=names[i])
            out[f"mode_{i + 1}_wheel.png"] = turned
    out["wave.gif"] = lambda file: modes.animate_wave(
        run.mesh, excited, turning, file, family=names[turning], forward=wheel and _is_forward(run)
    )
    if wheel:
        out["nodal_diameters.png"] = lambda file: speed.draw_nodal_diameters(
            tables["frequencies"], file
        )
    if result.answer is not None:
        out["forced_response.png"] = lambda file: forced.draw_forced(
            tables["forced_response"],
            tables["resonances"],
            file,
            title=_response_title(result),
        )
    if result.convergence is not None:
        out["convergence.png"] = lambda file: convergence.draw_convergence(
            tables["convergence_points"], tables["convergence"], file
        )
    return out | _speed_drawings(result, tables)


def _is_forward(run: ModalRun) -> bool:
    """Whether the wave that the engine order excites runs with the rotation."""
    count = sector_of(run.mesh).count
    # the engine order itself turns against the blades
    return count > 0 and wave_sense(run.scene.excitation.engine_order, count) == "against"


def _response_title(result: Survey) -> str:
    """A single blade does not see the engine order, and one that nobody gave is called so."""
    run = result.run
    if len(run.modes) < 2:
        return "linear response to the excitation"
    origin = "" if order_is_given(given_fields(folder_of(run))) else " (default)"
    return f"linear response to engine order {run.scene.excitation.engine_order}{origin}"


def drawn_orders(own: int, found: Campbell) -> list[int]:
    """The lowest engine orders and those next to the scene's own that cross a mode, with its own
    one: more cannot be told apart in a picture.
    """
    crossing = {int(order) for order in found.crossings["engine_order"]}
    near = range(own - ORDERS_ABOVE, own + ORDERS_ABOVE + 1)
    return sorted({own, *(crossing & {*range(1, LOWEST_ORDERS + 1), *near})})


def _speed_drawings(
    result: Survey, tables: dict[str, pd.DataFrame]
) -> dict[str, Callable[[Path], object]]:
    """Campbell and SAFE diagrams."""
    if result.campbell is None:
        return {}
    found = result.campbell
    scene = result.run.scene
    orders = drawn_orders(scene.excitation.engine_order, found)
    crossings = found.crossings[found.crossings["engine_order"].isin(orders)]
    table = found.table
    if "nodal_diameter" in table:
        count = sector_of(result.run.mesh).count
        excited = {excited_diameter(order, count) for order in orders}
        table = table[table["nodal_diameter"].isin(excited)]
    given = order_is_given(given_fields(folder_of(result.run)))
    own = "" if given else f"; engine order {scene.excitation.engine_order} is the default"
    out: dict[str, Callable[[Path], object]] = {
        "campbell.png": lambda file: speed.draw_campbell(
            table,
            orders,
            file,
            crossings=crossings,
            operating=found.speed,
            title=f"Campbell diagram{own}",
        )
    }
    if len(result.run.modes) > 1 and found.speed > 0:
        count = sector_of(result.run.mesh).count
        out["interference.png"] = lambda file: speed.draw_interference(
            tables["frequencies"], count, found.speed, file, orders=orders
        )
    return out
