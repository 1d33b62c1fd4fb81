"""What must hold between the fields of a scene before any work starts. Each refusal names the field
to change.

These are necessary conditions that need no drawing; what only shows in the drawing is refused by
the geometry.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin, tan
from pathlib import Path

from geometry.joined_files import split_entry

from ..errors import InputError
from .fields import convert, each_field, used_tables, value_at
from .part_materials import part_materials
from .tables import Scene
from .units import show
from .validate_contact import contact_problems

__all__ = ["refuse_response", "validate"]


def validate(scene: Scene) -> None:
    """Check every field and what must hold between them.

    Raises:
        InputError: the first thing that is wrong, in one sentence.
    """
    tables = used_tables(scene.kind)
    for field in each_field():
        if "." not in field.name or field.name.split(".")[0] in tables:
            convert(value_at(scene, field.name), field)
    problems = [
        *_CHECKS.get(scene.kind, _nothing)(scene),
        *_numerics(scene),
        *contact_problems(scene),
    ]
    if "study" in tables:
        problems += _study(scene)
    if "excitation" in tables:
        problems += _excitation(scene)
    if problems:
        raise InputError(problems[0])


def refuse_response(scene: Scene) -> None:
    """What modes can do without and a response cannot: damping, and a force.

    Raises:
        InputError: one of them is zero.
    """
    if "operation" not in used_tables(scene.kind):
        return
    if not scene.operation.damping > 0:
        raise InputError(
            "operation.damping = 0: expected above 0 for a response, a resonance without damping "
            "has no "
            "bounds"
        )
    if not scene.excitation.force > 0:
        raise InputError("excitation.force = 0 N: expected above 0 N for a response")


def _nothing(_: Scene) -> Iterator[str]:
    return iter(())


def _below(name: str, value: float, limit: float, what: str) -> Iterator[str]:
    if value >= limit:
        yield f"{name} = {show(value, 'm')}: expected less than {show(limit, 'm')}, {what}"


def _at_most(name: str, value: float, limit: float, what: str) -> Iterator[str]:
    if value > limit * (1 + 1e-12):
        yield f"{name} = {show(value, 'm')}: expected at most {show(limit, 'm')}, {what}"


def _wedge_sector(scene: Scene) -> Iterator[str]:
    disc = scene.disc
    shank = scene.shank
    platform = scene.platform
    damper = scene.damper
    aerofoil = scene.aerofoil
    half = pi / disc.sectors
    yield from _below("disc.bore_radius", disc.bore_radius, disc.rim_radius, "disc.rim_radius")
    yield from _below(
        "shank.width", shank.width, 2 * disc.rim_radius * tan(half), "the pitch at disc.rim_radius"
    )
    yield from _at_most("shank.length", shank.length, disc.width, "disc.width, on which it stands")
    yield from _at_most(
        "shank.length", shank.length, platform.length, "platform.length, which it carries"
    )
    reach = (disc.rim_radius + shank.height) * tan(half) - platform.gap / 2
    overhang = reach - shank.width / 2
    yield from _below(
        "platform.gap",
        platform.gap,
        2 * (disc.rim_radius + shank.height) * tan(half),
        "the pitch at the platform",
    )
    if overhang <= 0:
        yield (
            f"shank.width = {show(shank.width, 'm')}: expected less than {show(2 * reach, 'm')}, "
            "the width of the platform"
        )
    yield from _at_most(
        "platform.seat_width",
        platform.seat_width,
        max(overhang, 0) / sin(damper.angle),
        "what the overhang of the platform beside the shank leaves at damper.angle",
    )
    yield from _at_most(
        "damper.length", damper.length, platform.length, "platform.length, under which it sits"
    )
    yield from _at_most(
        "aerofoil.chord_root",
        aerofoil.chord_root,
        platform.length / cos(aerofoil.stagger),
        "what fits platform.length at aerofoil.stagger",
    )
    yield from _at_most(
        "aerofoil.fillet", aerofoil.fillet, aerofoil.span / 4, "a quarter of aerofoil.span"
    )
    yield from _nodal_diameters(scene, disc.sectors)


def _plane_blades(scene: Scene) -> Iterator[str]:
    plane = scene.plane
    yield from _below("plane.platform_width", plane.platform_width, plane.pitch, "plane.pitch")
    yield from _below(
        "plane.thickness", plane.thickness, plane.platform_width, "plane.platform_width"
    )
    yield from _at_most(
        "plane.seat_width",
        plane.seat_width,
        (plane.platform_width - plane.thickness) / 2,
        "the overhang of the platform beside the blade",
    )
    yield from _below(
        "plane.platform_height",
        plane.platform_height,
        plane.length - plane.platform_thickness,
        "plane.length minus plane.platform_thickness",
    )
    yield from _below(
        "plane.damper_height", plane.damper_height, plane.platform_height, "plane.platform_height"
    )


def _z_mass(scene: Scene) -> Iterator[str]:
    z = scene.z_mass
    yield from _below("z_mass.bar", z.bar, z.height / 2, "half of z_mass.height")
    yield from _below("z_mass.bar", z.bar, z.width, "z_mass.width")
    skew = scene.foundation.skew
    if abs(skew[0]) + abs(skew[1]) > 1:
        yield f"foundation.skew = {skew[0]:g}, {skew[1]:g}: expected a sum of sizes of at most 1"


def _one_of(name: str, given: float | None, scene: Scene) -> Iterator[str]:
    if given is not None and scene.study.loads is not None:
        yield (
            f"{name} = {show(given, 'm')}: it takes the place of study.loads, expected only one "
            "of the two"
        )


def _hertz(scene: Scene) -> Iterator[str]:
    hertz = scene.hertz
    yield from _one_of("hertz.interference", hertz.interference, scene)
    yield from _below(
        "hertz.contact_radius", hertz.contact_radius, hertz.half_width, "hertz.half_width"
    )
    yield from _at_most("hertz.half_width", hertz.half_width, hertz.radius, "hertz.radius")
    if scene.mesh.contact_size is not None:
        yield from _below(
            "mesh.contact_size",
            scene.mesh.contact_size,
            hertz.contact_radius,
            "hertz.contact_radius",
        )


def _punch(scene: Scene) -> Iterator[str]:
    yield from _one_of("punch.interference", scene.punch.interference, scene)
    yield from _below(
        "punch.radius", scene.punch.radius, scene.punch.half_width, "punch.half_width"
    )
    if scene.mesh.contact_size is not None:
        yield from _below(
            "mesh.contact_size", scene.mesh.contact_size, scene.punch.radius, "punch.radius"
        )


def _imported(scene: Scene) -> Iterator[str]:
    file = scene.imported.file
    part_materials(scene)
    if not file:
        yield (
            "[imported]: a scene of kind 'imported' needs this table with file = \"path to a "
            'mesh or STEP file"'
        )
    elif not Path(file).is_file():
        yield f"imported.file = {file!r}: there is no such file"
    for entry in scene.imported.more or ():
        other = split_entry(entry)[1]
        if not Path(other).is_file():
            yield f"imported.more = {entry!r}: there is no file '{other}'"
    if scene.mesh.order == 1 and Path(file).suffix.lower() not in (".step", ".stp"):
        yield (
            "mesh.order = 1: a mesh file keeps the order of its elements, expected mesh.order = 2; "
            "imported.linear says what becomes of first-order ones"
        )
    if not any(scene.imported.axis):
        yield "imported.axis = 0, 0, 0: expected a direction"
    if scene.imported.sectors in (1, 2):
        yield (
            f"imported.sectors = {scene.imported.sectors}: expected 0 for a single body, or at "
            "least 3"
        )
    elif scene.imported.sectors:
        yield from _nodal_diameters(scene, scene.imported.sectors)


_CHECKS = {
    "wedge sector": _wedge_sector,
    "plane blades": _plane_blades,
    "z mass": _z_mass,
    "hertz": _hertz,
    "punch": _punch,
    "imported": _imported,
}


def _nodal_diameters(scene: Scene, sectors: int) -> Iterator[str]:
    for n in scene.model.nodal_diameters or ():
        if n > sectors // 2:
            yield (
                f"model.nodal_diameters = {n}: expected 0 to {sectors // 2}, half the number of "
                "sectors "
                f"({sectors})"
            )


def _numerics(scene: Scene) -> Iterator[str]:
    mesh = scene.mesh
    model = scene.model
    if mesh.size is not None and mesh.contact_size is not None:
        yield from _at_most("mesh.contact_size", mesh.contact_size, mesh.size, "mesh.size")
    if mesh.seat_elements is not None and scene.kind != "wedge sector":
        yield (
            f"mesh.seat_elements = {mesh.seat_elements}: only the seats of kind 'wedge sector' "
            "are meshed in a grid"
        )
    if model.samples == 0 and scene.kind in ("wedge sector", "z mass"):
        yield (
            "model.samples = 0: changes of contact state are located exactly in plane models "
            "only, expected at "
            "least 16"
        )
    if model.samples is not None and 0 < model.samples < 16:
        yield f"model.samples = {model.samples}: expected 16 to 65536, or 0 in plane models"
    if model.harmonics is not None and model.samples and model.samples <= 2 * model.harmonics:
        yield (
            f"model.samples = {model.samples}: expected more than {2 * model.harmonics} for "
            f"model.harmonics = {model.harmonics}"
        )


def _study(scene: Scene) -> Iterator[str]:
    if scene.study.loads is not None and min(scene.study.loads) == 0:
        pair = scene.kind in ("hertz", "punch")
        why = (
            "nothing presses the two bodies together" if pair else "a damper without load lifts off"
        )
        yield f"study.loads = 0 N: {why}, expected more than 0 N"
    band = scene.study.band
    if band is not None and not band[0] < band[1]:
        yield (
            f"study.band = {show(band[0], 'Hz')}, {show(band[1], 'Hz')}: expected the lower "
            "frequency first"
        )


def _excitation(scene: Scene) -> Iterator[str]:
    if not any(scene.excitation.direction):
        yield "excitation.direction = 0, 0, 0: expected a direction"
    modes = scene.model.modes
    mode = scene.excitation.mode
    if modes is not None and mode > modes:
        yield (
            f"excitation.mode = {mode}: expected at most model.modes = {modes}, the modes that "
            "are kept"
        )
