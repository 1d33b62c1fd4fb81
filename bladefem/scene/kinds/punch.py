"""A flat punch pressed on a block."""

from __future__ import annotations

from collections.abc import Iterator

from ..tables import Scene
from .conditions import PLANE_FIELDS, below_limit, isotropic, one_of, static_fields
from .record import Kind, SceneCall


def conditions(scene: Scene) -> Iterator[str]:
    yield from one_of("punch.interference", scene.punch.interference, scene)
    yield from isotropic(scene, "blade")
    yield from below_limit(
        "punch.radius", scene.punch.radius, scene.punch.half_width, "punch.half_width"
    )
    if scene.mesh.contact_size is not None:
        yield from below_limit(
            "mesh.contact_size", scene.mesh.contact_size, scene.punch.radius, "punch.radius"
        )


def thin_parts(scene: Scene) -> dict[str, float]:
    """Lengths that an element has to fit into [m]."""
    return {"punch.half_width": scene.punch.half_width}


def unread(scene: Scene) -> tuple[str, ...]:
    """Fields that change nothing; a round punch is drawn with curved elements."""
    drawing = ("mesh.fillet_elements",) if scene.punch.dimension == 3 else PLANE_FIELDS
    return ("accuracy", *drawing, *static_fields("blade"))


KIND = Kind(
    name="punch",
    # the punch is rigid: it has no material
    tables=("punch", "mesh", "material.blade", "study.loads"),
    builder="geometry.contact_pairs:mesh_punch",
    shape=("punch", "mesh"),
    runner="bladefem.report.pair:report_pair",
    table="bladefem.cli.tables:pair_table",
    result="contact pressure",
    has_blade=False,
    has_seats=False,
    has_one_tangent=True,
    without_load="nothing presses the two bodies together",
    check=SceneCall("geometry.contact_pairs:check_punch", ("punch", "mesh")),
    cells=SceneCall("geometry.contact_pairs:count_punch_cells", ("punch", "mesh")),
    pictures={"punch": SceneCall("bladefem.view.pairs:draw_punch", ("punch",))},
    conditions=conditions,
    thin_parts=thin_parts,
    unread=unread,
)
