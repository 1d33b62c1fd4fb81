"""A mesh or a STEP file of the user's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from geometry.joined_files import split_entry

from ...errors import missing_file
from ..part_materials import part_materials
from ..tables import Scene
from .conditions import known_diameters
from .record import ENGINE_TABLES, Kind, SceneCall

# what draws and meshes, which a mesh file has behind it
MESHING_FIELDS = ("size", "contact_size", "fillet_elements", "algorithm", "scale", "curved")
# what joins the files of a mesh and matches its nodes
MATCHING_FIELDS = ("linear", "tolerance", "cut_gap", "more")
# what draws a damper between imported.seats, but for the angles, which are those of the seats
DRAWN_DAMPER_FIELDS = ("shape", "length", "base")


def conditions(scene: Scene) -> Iterator[str]:
    file = scene.imported.file
    part_materials(scene)
    if not file:
        yield (
            "[imported]: a scene of kind 'imported' needs this table with file = \"path to a "
            'mesh or STEP file"'
        )
    elif not Path(file).is_file():
        yield f"imported.file = {file!r}: {missing_file(file)}"
    for entry in scene.imported.more or ():
        other = split_entry(entry)[1]
        if not Path(other).is_file():
            yield f"imported.more = {entry!r}: there is no file '{other}'"
    if scene.mesh.order == 1 and not is_drawing(scene):
        yield (
            "mesh.order = 1: a mesh file keeps the order of its elements, expected mesh.order = "
            "2; imported.linear says what becomes of first-order ones"
        )
    yield from _seat_conditions(scene)
    if not any(scene.imported.axis):
        yield "imported.axis = 0, 0, 0: expected a direction, not all zero, such as 0, 0, 1"
    if scene.imported.sectors == 1:
        yield "imported.sectors = 1: expected 0 for a single body, or at least 2"
    elif scene.imported.sectors:
        yield from known_diameters(scene, scene.imported.sectors)


def _seat_conditions(scene: Scene) -> Iterator[str]:
    """A damper is drawn between the platforms of a STEP blade on a wheel."""
    imported = scene.imported
    if imported.seats is None:
        if imported.seat_width is not None:
            yield (
                "imported.seat_width: expected together with imported.seats, the faces of the seats"
            )
        return
    if imported.seats[0] == imported.seats[1]:
        yield f"imported.seats = {', '.join(imported.seats)}: expected two faces"
    if not is_drawing(scene):
        yield (
            f"imported.seats: '{Path(imported.file).name}' is a mesh, expected a STEP file, into "
            "whose faces seats can be cut"
        )
    if imported.sectors < 3:
        yield (
            f"imported.sectors = {imported.sectors}: expected the number of blades together with "
            "imported.seats, since the damper sits between two of them"
        )
    if scene.damper.clearance != 0:
        yield (
            "damper.clearance: a damper that is fitted to imported.seats is drawn in contact, "
            "expected 0 mm"
        )


def is_drawing(scene: Scene) -> bool:
    """A STEP file is meshed here, a mesh is given."""
    return Path(scene.imported.file).suffix.lower() in (".step", ".stp")


def unread(scene: Scene) -> tuple[str, ...]:
    """Fields that change nothing: a mesh is not drawn, a drawing is not matched, and a damper of
    the file has its own shape.
    """
    if is_drawing(scene):
        # fillets of a drawing are faces like others
        names = ["mesh.fillet_elements", *(f"imported.{name}" for name in MATCHING_FIELDS)]
    else:
        names = [f"mesh.{name}" for name in MESHING_FIELDS]
    if scene.imported.seats is None:
        names += [f"damper.{name}" for name in DRAWN_DAMPER_FIELDS]
    return (*names, "damper.angle", "damper.angle_next")


def whole_paths(scene: Scene, folder: Path) -> Scene:
    """The scene with whole paths of its files."""
    imported = scene.imported
    if not imported.file:
        return scene
    more = []
    for entry in imported.more or ():
        body, path = split_entry(entry)
        whole = str((folder / path).resolve())
        more.append(f"{body} = {whole}" if body else whole)
    file = str((folder / imported.file).resolve())
    return replace(scene, imported=replace(imported, file=file, more=tuple(more) or None))


def input_files(scene: Scene) -> tuple[Path, ...]:
    """The geometry's files."""
    return (Path(scene.imported.file),)


KIND = Kind(
    name="imported",
    tables=("imported", "damper", "mistuning", "aerodynamics", *ENGINE_TABLES),
    builder="geometry.imported:read_geometry",
    shape=("imported", "mesh", "damper"),
    runner="bladefem.report.run:report_run",
    table="bladefem.cli.tables:run_table",
    result="forced responses",
    has_one_tangent=True,
    sectors="imported.sectors",
    clearance_is_meshed=False,
    check=SceneCall("geometry.imported_check:check_imported", ("imported",)),
    file_names=SceneCall("geometry.imported:file_names", ("imported", "damper")),
    meshed_here=is_drawing,
    whole_paths=whole_paths,
    files=input_files,
    conditions=conditions,
    unread=unread,
)
