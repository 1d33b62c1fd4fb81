"""A Z-shaped mass held by friction on a vibrating foundation."""

from __future__ import annotations

from collections.abc import Iterator

from ..tables import Scene
from .conditions import STRAIGHT_FIELDS, below_limit, static_fields
from .record import PRESSED_TABLES, Kind, SceneCall


def conditions(scene: Scene) -> Iterator[str]:
    z = scene.z_mass
    yield from below_limit("z_mass.bar", z.bar, z.height / 2, "half of z_mass.height")
    yield from below_limit("z_mass.bar", z.bar, z.width, "z_mass.width")
    skew = scene.foundation.skew
    if abs(skew[0]) + abs(skew[1]) > 1:
        yield f"foundation.skew = {skew[0]:g}, {skew[1]:g}: expected a sum of sizes of at most 1"
    loads = scene.study.loads
    if loads is not None and len(loads) > 1:
        yield f"study.loads: {len(loads)} values, expected one, the mean load on the mass"
    yield from _unread_contact(scene)


def _unread_contact(scene: Scene) -> Iterator[str]:
    """Fields of [contact] that a damper's seats have and the footprint of the mass has not."""
    contact = scene.contact
    why = "what the foundation carries is no seat of a damper"
    if contact.stiffness == "rigid":
        yield "contact.stiffness = 'rigid': the mass is held by contact.kt, expected 'given'"
    if contact.normal != "coupled":
        yield f"contact.normal = '{contact.normal}': {why}, expected it to be left out"
    if not contact.bedded:
        yield f"contact.bedded = false: {why}, expected it to be left out"


def thin_parts(scene: Scene) -> dict[str, float]:
    """Lengths that an element has to fit into [m]."""
    return {f"z_mass.{name}": getattr(scene.z_mass, name) for name in ("bar", "thickness")}


def unread(scene: Scene) -> tuple[str, ...]:
    """Fields that change nothing: only the mass moves, held along its faces."""
    contact = scene.contact
    known = contact.kt is not None or contact.kt_area is not None
    normal = ("contact.kn", "contact.kn_area") if known else ()
    phase = () if all(scene.foundation.amplitude) else ("foundation.phase",)
    moves = "material.damper.rho"
    still = [name for name in static_fields("blade", "damper") if name != moves]
    return ("accuracy", *STRAIGHT_FIELDS, *normal, *phase, *still)


KIND = Kind(
    name="z mass",
    tables=("z_mass", "foundation", "contact", *PRESSED_TABLES),
    builder="geometry.zmass:z_mass",
    shape=("z_mass", "mesh", "foundation.depth"),
    runner="bladefem.report.zmass:report_zmass",
    table="bladefem.cli.tables:mass_table",
    result="pressure and motion",
    has_blade=False,
    has_seats=False,
    check=SceneCall("geometry.zmass:check_z_mass", ("z_mass",)),
    cells=SceneCall("geometry.zmass:count_z_mass_cells", ("z_mass", "mesh")),
    pictures={"z_mass": SceneCall("bladefem.view.parts:draw_z_mass", ("z_mass",))},
    conditions=conditions,
    thin_parts=thin_parts,
    unread=unread,
)
