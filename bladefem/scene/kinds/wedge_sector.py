"""A bladed sector of a wheel with its wedge damper, drawn by parameters."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, tan

from ..tables import Scene
from ..units import show
from .conditions import BLADE_FACES, below_limit, known_diameters
from .record import ENGINE_TABLES, Kind, SceneCall, load_function

SHAPE = ("aerofoil", "platform", "shank", "disc", "damper")
EXTRAS = ("root", "shroud")
FACES = (*BLADE_FACES, "cyclic_low", "cyclic_high", "trailing_edge")


def conditions(scene: Scene) -> Iterator[str]:
    disc = scene.disc
    shank = scene.shank
    platform = scene.platform
    half = pi / disc.sectors
    # more sectors leave less room to every blade: the field to change may be this one
    count = f"disc.sectors = {disc.sectors}"
    yield from below_limit("disc.bore_radius", disc.bore_radius, disc.rim_radius, "disc.rim_radius")
    yield from below_limit(
        "shank.width",
        shank.width,
        2 * disc.rim_radius * tan(half),
        f"the pitch at disc.rim_radius with {count}",
    )
    reach = (disc.rim_radius + shank.height) * tan(half) - platform.gap / 2
    yield from below_limit(
        "platform.gap",
        platform.gap,
        2 * (disc.rim_radius + shank.height) * tan(half),
        f"the pitch at the platform with {count}",
    )
    if shank.width >= 2 * reach:
        yield (
            f"shank.width = {show(shank.width, 'm')}: expected less than {show(2 * reach, 'm')}, "
            f"the width of the platform with {count}"
        )
    yield from known_diameters(scene, disc.sectors)


def thin_parts(scene: Scene) -> dict[str, float]:
    blade = scene.aerofoil
    halfway = (blade.thickness_root * blade.chord_root + blade.thickness_tip * blade.chord_tip) / 2
    return {
        "the aerofoil halfway up": halfway,
        "platform.thickness": scene.platform.thickness,
        "shank.width": scene.shank.width,
        "disc.width": scene.disc.width,
    }


def outer_radii(scene: Scene) -> dict[str, float]:
    """Rim and tip [m]."""
    rim = scene.disc.rim_radius
    return {"rim": rim, "tip": rim + scene.shank.height + scene.aerofoil.span}


def flank_angles(scene: Scene) -> tuple[float, float]:
    """Under this blade and under the next one [rad]."""
    return scene.damper.angles


def face_names(scene: Scene) -> tuple[str, ...]:
    """Faces and node sets of the blade; the fillet is a face where it has a radius."""
    drawn = load_function("geometry.fillet:with_fillet")(
        *(getattr(scene, name) for name in (*SHAPE, "mesh"))
    )
    fillet = ("fillet",) if drawn.fillet_radius > 0 else ()
    shroud = ("shroud_left", "shroud_right") if scene.shroud.thickness > 0 else ()
    return (*FACES, *fillet, *shroud)


def unread(scene: Scene) -> tuple[str, ...]:
    """Fields of parts that the blade does not have."""
    names: tuple[str, ...] = () if scene.aerofoil.fillet != 0 else ("mesh.fillet_elements",)
    if scene.root.lobes == 0:
        parts = ("neck", "pitch", "bearing", "flank_angle", "taper", "clearance")
        names += tuple(f"root.{part}" for part in parts)
    elif scene.root.lobes == 1:
        # deeper necks are narrower, and there is one
        names += ("root.taper",)
    if scene.shroud.thickness == 0:
        names += tuple(f"shroud.{part}" for part in ("at", "length", "width", "gap"))
    return names


KIND = Kind(
    name="wedge sector",
    tables=(*SHAPE, *EXTRAS, "mistuning", "aerodynamics", *ENGINE_TABLES),
    builder="geometry.sector:wedge_sector",
    shape=(*SHAPE, "mesh", *EXTRAS),
    runner="bladefem.report.run:report_run",
    table="bladefem.cli.tables:run_table",
    result="forced responses",
    has_seat_grid=True,
    sectors="disc.sectors",
    flank_angles=flank_angles,
    check=SceneCall("geometry.sector_check:check_sector", (*SHAPE, *EXTRAS)),
    cells=SceneCall("geometry.sizing:count_sector_cells", (*SHAPE, "mesh")),
    face_names=face_names,
    pictures={
        "aerofoil": SceneCall("bladefem.view.parts:draw_aerofoil", ("aerofoil",)),
        "platform": SceneCall(
            "bladefem.view.parts:draw_platform", ("platform", "shank", "disc", "damper")
        ),
        "dampers": SceneCall(
            "bladefem.view.parts:draw_damper_shapes", ("platform", "shank", "disc", "damper")
        ),
        "roots": SceneCall("bladefem.view.root_and_shroud:draw_roots", ("shank", "disc", "root")),
        "shrouds": SceneCall("bladefem.view.root_and_shroud:draw_shrouds", (*SHAPE, "shroud")),
        "sector": SceneCall("bladefem.view.parts:draw_disc", SHAPE),
    },
    conditions=conditions,
    thin_parts=thin_parts,
    radii=outer_radii,
    unread=unread,
)
