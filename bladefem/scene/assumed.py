"""Physical values that a scene left to their defaults and that change every frequency."""

from __future__ import annotations

from collections.abc import Collection

from .fields import display_value, field_at, value_at
from .kinds import kind_named
from .material_table import property_table
from .tables import Scene

# of the blade; a table of temperatures or constants of a crystal take the place of the first two
ELASTIC = ("material.blade.E", "material.blade.nu")


def assumed_physics(scene: Scene, given: Collection[str] | None) -> list[str]:
    """One sentence that names the speed and the constants of the blade which were not given.

    A blade of a file without ``operation.speed`` turns at its default: a cantilever of 100 mm had
    447.4 Hz in place of 422.9 Hz at rest.

    Args:
        given: dotted names of the fields that the user gave; None where that is not known.
    """
    kind = kind_named(scene.kind)
    if given is None or "operation" not in kind.tables:
        return []
    blade = scene.material.blade
    wanted = ["operation.speed"]
    # constants of named volumes may be all that there are
    if not scene.imported.materials:
        known = property_table(blade).values if blade.table else {}
        crystal = blade.orthotropic or "orthotropic" in known
        names = [*(() if crystal else ELASTIC), "material.blade.rho"]
        wanted += [name for name in names if name.rsplit(".", 1)[1] not in known]
    assumed = [
        f"{name} = {display_value(value_at(scene, name), field_at(name))}"
        for name in wanted
        if name not in given
    ]
    if not assumed:
        return []
    return [f"not given, and taken by default: {', '.join(assumed)}"]
