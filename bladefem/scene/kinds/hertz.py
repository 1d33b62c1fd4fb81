"""A sphere or a cylinder pressed on a block."""

from __future__ import annotations

from collections.abc import Iterator

from ..tables import Scene
from .conditions import (
    PLANE_FIELDS,
    STRAIGHT_FIELDS,
    below_limit,
    isotropic,
    one_of,
    static_fields,
)
from .record import PRESSED_TABLES, Kind, SceneCall


def conditions(scene: Scene) -> Iterator[str]:
    hertz = scene.hertz
    yield from one_of("hertz.interference", hertz.interference, scene)
    yield from isotropic(scene, "blade", "damper")
    yield from below_limit(
        "hertz.contact_radius", hertz.contact_radius, hertz.half_width, "hertz.half_width"
    )
    if scene.mesh.contact_size is not None:
        yield from below_limit(
            "mesh.contact_size",
            scene.mesh.contact_size,
            hertz.contact_radius,
            "hertz.contact_radius",
        )


def thin_parts(scene: Scene) -> dict[str, float]:
    """Lengths that an element has to fit into [m]."""
    return {"hertz.half_width": scene.hertz.half_width}


def unread(scene: Scene) -> tuple[str, ...]:
    """Fields that change nothing."""
    drawing = STRAIGHT_FIELDS if scene.hertz.dimension == 3 else PLANE_FIELDS
    return ("accuracy", *drawing, *static_fields("blade", "damper"))


KIND = Kind(
    name="hertz",
    tables=("hertz", *PRESSED_TABLES),
    builder="geometry.contact_pairs:hertz_pair",
    shape=("hertz", "mesh"),
    runner="bladefem.report.pair:report_pair",
    table="bladefem.cli.tables:pair_table",
    result="contact pressure",
    has_blade=False,
    has_seats=False,
    has_one_tangent=True,
    without_load="nothing presses the two bodies together",
    check=SceneCall("geometry.contact_pairs:check_hertz", ("hertz", "mesh")),
    cells=SceneCall("geometry.contact_pairs:count_hertz_cells", ("hertz", "mesh")),
    preflight="bladefem.study.kinds.hertz:refuse_loads",
    pictures={"hertz": SceneCall("bladefem.view.pairs:draw_hertz", ("hertz",))},
    conditions=conditions,
    thin_parts=thin_parts,
    unread=unread,
)
