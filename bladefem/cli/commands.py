"""What each command does: read the scene, run the pipeline as far as needed, print a table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..scene.kinds import kind_named, load_function
from ..scene.tables import Scene
from ..scene.units import shortened
from ..util.communicator import Communicator
from ..util.picture_files import PICTURES
from . import tables

if TYPE_CHECKING:
    from ..study.modes.survey import Wanted
    from ..study.pipeline.run_records import Run


# after frequencies of one mesh
MESH_ERROR_UNKNOWN = "error of these frequencies by the mesh: not studied, --converge estimates it"


def check(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Print the resolved scene, and what in it is improbable."""
    from geometry.check_parameters import check_file

    from ..io.stage_cache import on_root
    from ..scene.assumed import assumed_physics
    from ..scene.excited_wave import excited_wave
    from ..scene.toml import given_keys, read_tables, resolved_rows, scene_of
    from ..scene.warnings import implausible_values
    from ..study.pipeline.preflight import refuse_run

    file = scene_path(options.scene)

    def table() -> str:
        written = read_tables(file, options.overrides)
        scene = scene_of(written, file.resolve().parent)
        refuse_run(scene)
        given = given_keys(written)
        notes = [*assumed_physics(scene, given), *implausible_values(scene), *check_file(scene)]
        rows = tables.resolved_scene(resolved_rows(scene, given))
        wave = excited_wave(scene)
        implied = [f"excitation: {wave}"] if wave else []
        return "\n".join([rows, *implied, *(f"note: {note}" for note in notes)])

    text = on_root(comm, table)
    if comm is None or comm.rank == 0:
        print(text)


def refuse_picture(file: str) -> None:
    """A file of ``--view`` that no picture can be written to is refused before the work.

    Raises:
        InputError: its name is empty, as an unset variable of a shell leaves it, or does not end
            as that of a picture.
    """
    if not file:
        raise InputError(f"--view '': expected a file name that ends with {' or '.join(PICTURES)}")
    if Path(file).suffix.lower() not in PICTURES:
        raise InputError(
            f"--view {file}: expected a file name that ends with {' or '.join(PICTURES)}"
        )
    make_folder_of(file, "--view")


def make_folder_of(file: str | Path, option: str) -> None:
    """The folder of a file that is written after the work is there and takes files before it.

    Raises:
        InputError: it cannot be made, or not be written.
    """
    folder = Path(file).parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{option} {file}: folder {folder} cannot be made ({error.strerror})"
        ) from None
    try:
        # its rights do not tell: of /proc they allow root what the system then refuses
        TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(
            f"{option} {file}: folder {folder} cannot be written ({error.strerror})"
        ) from None


def mesh(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Mesh, its files, quality table, picture."""
    if options.view is not None:
        refuse_picture(options.view)
    scene, folder, bars = prepared(options, comm)
    from ..io.stage_cache import on_root
    from ..study.pipeline import pipeline

    run = pipeline.run(scene, folder, until="mesh", comm=comm, progress=bars)
    on_root(comm, partial(save_mesh, run.mesh, folder))
    if options.view is not None and (comm is None or comm.rank == 0):
        draw(run.mesh, options.view)
    tell(options, comm, lambda: tables.mesh_quality(run.mesh), run)


def modes(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Natural frequencies and shapes of all nodal diameters; Campbell diagram, mesh refinement,
    comparison.
    """
    from ..report import modes as report

    refuse_pdf(options)
    if options.pdf and not options.pictures:
        raise InputError("--pdf: with --pictures 0 there are tables only, expected one of the two")
    scene, folder, bars = prepared(options, comm)
    found = report.report_survey(scene, folder, modes_wanted(options), options.pictures, comm, bars)
    unknown = "" if found.convergence is not None else f"\n\n{MESH_ERROR_UNKNOWN}"
    page = "report_modes.html" if options.pictures else None
    tell(options, comm, lambda: f"{tables.survey_tables(found)}{unknown}", found.run, page)
    print_report(options, comm, folder / "report_modes.html")


def modes_wanted(options: argparse.Namespace) -> Wanted:
    """What the options of ``modes`` ask for."""
    from ..study.modes.campbell import read_speeds
    from ..study.modes.linear_response_report import read_damping, read_loads
    from ..study.modes.survey import Wanted

    if options.pictures < 0:
        raise InputError(f"--pictures {options.pictures}: expected a number of modes, 0 for none")
    sizes = _parse_sizes(options.converge, "converge")
    speeds = None if options.campbell is None else read_speeds(options.campbell)
    loads = None if options.forced is None else read_loads(options.forced)
    for name, expected in (
        ("compare", "the folder of an earlier run"),
        ("damping", "texts like 'ratio=0.1 %'"),
    ):
        if getattr(options, name) == "":
            raise InputError(f"--{name} '': expected {expected}")
    if loads is None and options.damping:
        raise InputError("--damping: expected together with --forced")
    return Wanted(
        speeds,
        sizes,
        Path(options.compare) if options.compare else None,
        options.direct,
        loads,
        read_damping(options.damping) if options.damping else None,
    )


def _parse_sizes(text: str | None, option: str) -> list[float] | None:
    """Element sizes [m] as given to an option; empty where they are to be chosen."""
    from ..scene.fields import convert_value, field_at, split_values

    if text is None:
        return None
    size = field_at("mesh.size")._replace(name=f"--{option}")
    sizes = [convert_value(item, size) for item in split_values(text)]
    if len(set(sizes)) < len(sizes):
        raise InputError(f"--{option} {text}: a size is given twice, expected each once")
    return sizes


def contact(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Seat the damper: force and pressure of each face under each load, with tables, picture and
    ParaView file.
    """
    scene, folder, bars = prepared(options, comm)
    if not kind_named(scene.kind).has_blade:
        return run_kind(scene, folder, options, comm, bars)
    from ..report import pressure

    run = pressure.report_pressure(scene, folder, comm, bars)
    tell(
        options,
        comm,
        lambda: tables.pressure_table(run.contact.maps),
        run,
        "report_contact.html",
    )


def reduce(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Blade and damper reduced to their contact, load and probe points; a later response starts
    from there.
    """
    scene, folder, bars = prepared(options, comm, responds=True)
    from ..study.pipeline import pipeline

    run = pipeline.run(scene, folder, until="reduction", comm=comm, progress=bars)
    tell(options, comm, lambda: tables.reduction_table(run.reduced), run)


def response(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Forced response for each load."""
    scene, folder, bars = prepared(options, comm, responds=True)
    from ..study.pipeline import pipeline

    run = pipeline.run(scene, folder, until="response", comm=comm, progress=bars)
    tell(options, comm, lambda: tables.response_tables(run.response), run)


def report(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Everything, with figures and report."""
    refuse_pdf(options)
    scene, folder, bars = prepared(options, comm, responds=True)
    run_kind(scene, folder, options, comm, bars)
    print_report(options, comm, folder / "report.html")


def refuse_pdf(options: argparse.Namespace) -> None:
    """A missing browser is reported before long work."""
    from ..report.pdf import require_browser

    if options.pdf:
        require_browser()


def print_report(
    options: argparse.Namespace,
    comm: Communicator | None,
    page: Path,
) -> None:
    """The report as PDF, where that is wanted."""
    from ..io.stage_cache import on_root
    from ..report.pdf import print_pdf

    if options.pdf:
        file = on_root(comm, lambda: print_pdf(page))
        tell(options, comm, lambda: f"written: {file}")


def run_kind(
    scene: Scene,
    folder: Path,
    options: argparse.Namespace,
    comm: Communicator | None,
    progress: Any,
) -> None:
    """All that `bladefem run` does for a scene, by the record of its kind, and its table."""
    kind = kind_named(scene.kind)
    found = load_function(kind.runner)(scene, folder, comm, progress)
    tell(options, comm, lambda: load_function(kind.table)(found), found)


def chart(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Speed against accuracy of methods and models: tables and picture."""
    from ..io.stage_cache import on_root
    from ..report.chart import write_chart
    from ..study.chart.chart import check_budget
    from ..study.chart.scene import reference_chart, scene_chart

    check_budget(options.budget)
    if options.reference:
        _refuse_with_reference(options)
        folder = Path(options.output or "runs/reference")
        scene = None
        accuracy = 0.02
        title = "reference blade"
        made = on_root(comm, lambda: reference_chart(accuracy, options.budget))
    elif options.scene is None:
        raise InputError("chart: expected a scene file, or --reference")
    else:
        sizes = _parse_sizes(options.mesh, "mesh")
        scene, folder, _ = prepared(options, comm, responds=True)
        made = scene_chart(scene, folder, options.budget, comm, sizes)
        accuracy = scene.accuracy
        title = scene.title
    files = on_root(comm, lambda: write_chart(made, folder, accuracy, title, scene))
    tell(
        options, comm, lambda: "\n".join([*made.remarks, "written: " + ", ".join(map(str, files))])
    )


def _refuse_with_reference(options: argparse.Namespace) -> None:
    """What would change nothing of the built-in blade, which has no scene.

    Raises:
        InputError: a scene, a field or meshes are given.
    """
    given = {
        "scene": options.scene,
        "--set": " ".join(options.overrides),
        "--mesh": None if options.mesh is None else options.mesh or "chosen sizes",
    }
    for name, value in given.items():
        if value:
            raise InputError(
                f"chart --reference: {name} ({value}) does not change the built-in blade, expected "
                "either a scene or --reference"
            )


def info(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Versions and threads."""
    from .info import installation_facts

    rows = installation_facts()
    if comm is None or comm.rank == 0:
        print(tables.plain_table(rows))


def prepared(
    options: argparse.Namespace,
    comm: Communicator | None,
    responds: bool = False,
) -> tuple[Scene, Path, Any]:
    """The scene, the run folder with a copy of it, kept for this command, and progress bars;
    collective.

    Args:
        responds: a forced response is to come.
    """
    from ..io.stage_cache import on_root
    from ..util.progress import progress_wanted, with_progress

    folder = run_folder(options)
    if comm is not None:
        # it loads PETSc, which takes all ranks: not inside what rank 0 does alone
        from ..study.pipeline import preflight  # noqa: F401

    def prepare() -> Scene:
        from ..io.run_folder import keep_given, lock_run_folder, take_folder
        from ..study.pipeline.stage_inputs import same_mesh

        scene = given_scene(options, responds)
        given = _given_fields(options)

        def tell_of_moves(sentence: str) -> None:
            if not options.quiet:
                print(f"bladefem: {sentence}", file=sys.stderr, flush=True)

        options.held.enter_context(lock_run_folder(folder, tell_of_moves))
        take_folder(folder, scene, same_mesh, tell_of_moves)
        keep_given(folder, given)
        return scene

    scene = on_root(comm, prepare)
    rank = 0 if comm is None else comm.rank
    shown = progress_wanted(options.quiet, rank)
    logged = not options.quiet and rank == 0
    return scene, folder, partial(with_progress, shown=shown, logged=logged)


def _given_fields(options: argparse.Namespace) -> set[str]:
    """Dotted names of the fields that the user gave; a run folder remembers its own."""
    from ..io.run_folder import given_fields
    from ..scene.toml import given_keys, read_tables

    path = Path(options.scene)
    changed = {override.partition("=")[0].strip() for override in options.overrides}
    known = given_fields(path) if path.is_dir() else None
    if known is not None:
        return {*known, *changed}
    return given_keys(read_tables(scene_path(options.scene), options.overrides))


def given_scene(options: argparse.Namespace, responds: bool) -> Scene:
    """The scene of the file and the options, checked."""
    from ..scene.toml import load_scene
    from ..scene.validate import refuse_response

    scene = load_scene(scene_path(options.scene), options.overrides)
    if responds:
        refuse_response(scene)
    if responds or options.command == "contact":
        from ..study.pipeline.preflight import refuse_run

        refuse_run(scene)
    return scene


def tell(
    options: argparse.Namespace,
    comm: Communicator | None,
    table: Callable[[], str],
    run: Run | None = None,
    page: str | None = "report.html",
) -> None:
    """A table and the summary of a run, on rank 0 unless quiet.

    Args:
        page: of the run's folder, named where it is there; None names none.
    """
    if options.quiet or (comm is not None and comm.rank > 0):
        return
    print(table())
    if run is not None:
        print("\n" + tables.run_summary(run, page), flush=True)


def scene_path(given: str) -> Path:
    """The scene file, also of a run folder.

    Raises:
        InputError: an empty name, as an unset variable of a shell leaves it, or one too long.
    """
    if not given:
        raise InputError("scene '': expected the name of a scene file or of a run folder")
    path = Path(given)
    try:
        return path / "scene.toml" if path.is_dir() else path
    except OSError as error:
        raise InputError(f"{shortened(given)}: {error.strerror}, expected a scene file") from None


def run_folder(options: argparse.Namespace) -> Path:
    """The folder that is named, or else that of the earlier run, or one with the scene's name.

    Raises:
        InputError: an empty name, as an unset variable of a shell leaves it.
    """
    if options.output == "":
        raise InputError("--output '': expected the name of a folder")
    if options.output is not None:
        return Path(options.output)
    path = scene_path(options.scene)
    return path.parent if path != Path(options.scene) else Path("runs") / path.stem


def save_mesh(mesh_made: Any, folder: Path) -> None:
    """``mesh.vtu`` for ParaView, and ``named_mesh.msh`` with the names of bodies, faces and node
    sets for gmsh and for scenes of kind ``imported``.
    """
    from geometry.export import write_msh

    from ..io.run_folder import NAMED_MESH
    from ..io.stage_cache import write_atomically
    from ..view.mesh import save_vtu

    with write_atomically(folder / "mesh.vtu") as file:
        save_vtu(mesh_made, file)
    with write_atomically(folder / NAMED_MESH) as file:
        write_msh(mesh_made, file, binary=True)


def draw(mesh_made: Any, file: str) -> None:
    """The picture of the mesh."""
    from ..io.stage_cache import open_folder
    from ..view.mesh import draw_mesh

    open_folder(Path(file).parent)
    draw_mesh(mesh_made, file)
