"""A row of plane blades with flat dampers under their platforms, in two dimensions."""

from __future__ import annotations

from collections.abc import Iterator

from ..tables import Scene
from .conditions import BLADE_FACES, PLANE_FIELDS, below_limit
from .record import ENGINE_TABLES, Kind, SceneCall


def conditions(scene: Scene) -> Iterator[str]:
    plane = scene.plane
    yield from below_limit("plane.platform_width", plane.platform_width, plane.pitch, "plane.pitch")
    yield from below_limit(
        "plane.thickness", plane.thickness, plane.platform_width, "plane.platform_width"
    )
    yield from below_limit(
        "plane.platform_height",
        plane.platform_height,
        plane.length - plane.platform_thickness,
        "plane.length minus plane.platform_thickness",
    )
    yield from below_limit(
        "plane.damper_height", plane.damper_height, plane.platform_height, "plane.platform_height"
    )


def thin_parts(scene: Scene) -> dict[str, float]:
    """Lengths that an element has to fit into [m]."""
    return {
        f"plane.{name}": getattr(scene.plane, name)
        for name in ("thickness", "platform_thickness", "damper_height")
    }


def face_names(_: Scene) -> tuple[str, ...]:
    """Faces and node sets of the blade."""
    return BLADE_FACES


def unread(_: Scene) -> tuple[str, ...]:
    """Fields that change nothing."""
    return PLANE_FIELDS


KIND = Kind(
    name="plane blades",
    tables=("plane", *ENGINE_TABLES),
    builder="geometry.plane:plane_blades",
    shape=("plane", "mesh"),
    runner="bladefem.report.run:report_run",
    table="bladefem.cli.tables:run_table",
    result="forced responses",
    has_one_tangent=True,
    damper_mass="plane.damper_mass",
    is_plane=True,
    check=SceneCall("geometry.plane:check_plane", ("plane",)),
    cells=SceneCall("geometry.plane:count_plane_cells", ("plane", "mesh")),
    face_names=face_names,
    pictures={"plane": SceneCall("bladefem.view.parts:draw_plane", ("plane",))},
    conditions=conditions,
    thin_parts=thin_parts,
    unread=unread,
)
