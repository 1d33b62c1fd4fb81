"""What each stage depends on, declared once: the key of a stored stage follows from it.

A changed friction coefficient does not redo the mesh. A stage may read no other field of the scene
than those that it declares; `tests/io/test_stage_inputs.py` watches what each one reads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any

from geometry.abaqus_deck import included_files
from geometry.joined_files import split_entry

from ...io.stage_cache import code_of, key_of
from ...scene.fields import value_at
from ...scene.kinds import kind_named
from ...scene.tables import Scene


@dataclass(frozen=True)
class StageInputs:
    """What the result of one stage depends on."""

    # stages whose results it takes
    after: tuple[str, ...] = ()
    # fields of the scene, or whole tables
    fields: tuple[str, ...] = ()
    # fields of those tables that it does not read
    without: tuple[str, ...] = ()
    # packages whose program makes it
    code: tuple[str, ...] = ()


STAGE_INPUTS = {
    # its fields are those of the kind, see `declared_fields`
    "mesh": StageInputs(without=("damper.mass", "damper.axial"), code=("geometry",)),
    "modes": StageInputs(
        after=("mesh",),
        fields=(
            "imported.materials",
            "material.blade",
            "operation.speed",
            "operation.stiffening",
            "operation.preload",
            "temperature",
            "excitation.engine_order",
            "model.nodal_diameters",
            "solver",
            "support",
        ),
        code=("bladefem.fem",),
    ),
    "survey": StageInputs(after=("modes",), code=("bladefem.study",)),
    # speeds come with the key
    "campbell": StageInputs(
        after=("modes",),
        fields=("excitation.engine_order",),
        code=("bladefem.contact", "bladefem.study"),
    ),
    # element sizes come with the key
    "mesh_refinement": StageInputs(
        after=("modes",),
        fields=("excitation.engine_order",),
        code=("geometry", "bladefem.study"),
    ),
    "stress": StageInputs(
        after=("modes",), fields=("operation.speed", "excitation"), code=("bladefem.study",)
    ),
    # blade, damper and their patches, whatever the shape of the seats
    "bodies": StageInputs(
        after=("mesh",),
        fields=(
            "kind",
            "imported.materials",
            "material",
            "operation.speed",
            "operation.stiffening",
            "operation.preload",
            "temperature",
            "support",
            "damper.mass",
            "plane.damper_mass",
        ),
        code=("bladefem.fem", "bladefem.contact"),
    ),
    "contact": StageInputs(
        after=("bodies",),
        fields=(
            "contact.crown",
            "contact.crown_across",
            "contact.edge_radius",
            "contact.edge_width",
            "damper.axial",
            "damper.clearance",
        ),
    ),
    "reduction": StageInputs(
        after=("bodies",),
        fields=("excitation.at", "excitation.direction", "model.reduction", "solver"),
        code=("bladefem.fem",),
    ),
    # what the mesh leaves uncertain of the modes that are excited, seen from the ports
    "mode errors": StageInputs(
        after=("modes", "reduction"),
        fields=("excitation.engine_order",),
        code=("bladefem.study",),
    ),
    "response": StageInputs(
        after=("contact", "reduction"),
        fields=(
            "accuracy",
            "aerodynamics",
            "contact",
            "damper.axial",
            "operation",
            "excitation",
            "study",
            "model",
        ),
        # each load is a stage of its own
        without=("study.loads", "study.masses", "study.own_load"),
        code=("bladefem.hbm", "bladefem.friction", "bladefem.reduction", "bladefem.study"),
    ),
    # the sector in all nodal diameters, with the coordinates of its blade-alone modes
    "wheel": StageInputs(
        after=("modes", "reduction"), fields=("mistuning.families",), code=("bladefem.study",)
    ),
    # aerofoils of another shape
    "other blades": StageInputs(
        after=("modes",),
        fields=("mistuning.blades", "mistuning.families"),
        code=("bladefem.fem", "bladefem.study"),
    ),
    # all blades under one load; the deviations of a pattern file come with the key
    "whole wheel": StageInputs(
        after=("wheel", "response", "stress"),
        fields=("mistuning",),
        # of the draws of many wheels
        without=(
            "mistuning.pattern",
            "mistuning.wheels",
            "mistuning.level",
            "mistuning.checks",
        ),
        code=("bladefem.wheel",),
    ),
    "damped motion": StageInputs(
        after=("modes", "contact", "reduction"),
        fields=("accuracy", "aerodynamics", "operation", "excitation", "damper.axial"),
        code=("bladefem.study",),
    ),
    # many drawn wheels under one load
    "scatter": StageInputs(
        after=("wheel", "response"),
        fields=("mistuning",),
        without=("mistuning.pattern",),
        code=("bladefem.wheel",),
    ),
    "mass pressure": StageInputs(
        after=("mesh",),
        fields=("material", "foundation.skew", "study.loads"),
        code=("bladefem.fem", "bladefem.contact"),
    ),
    "pair pressure": StageInputs(
        after=("mesh",),
        fields=("material", "study.loads"),
        code=("bladefem.fem", "bladefem.contact", "bladefem.study"),
    ),
}


def stage_key(name: str, scene: Scene, *more: Any) -> str:
    """The key of a stage's result.

    Args:
        more: what it depends on besides the scene, such as one load of many.
    """
    values = [_without(scene, field, STAGE_INPUTS[name]) for field in declared_fields(name, scene)]
    keys = [stage_key(earlier, scene) for earlier in STAGE_INPUTS[name].after]
    stamp = _file_stamp(scene) if name == "mesh" else []
    if "temperature" in STAGE_INPUTS[name].fields and scene.temperature.file:
        stamp = [Path(scene.temperature.file).stat().st_mtime]
    return key_of(name, keys, values, code_of(*STAGE_INPUTS[name].code), stamp, *more)


def same_mesh(one: Scene, other: Scene) -> bool:
    """Whether two scenes have the same mesh: the same stored one serves both."""
    return stage_key("mesh", one) == stage_key("mesh", other)


def all_declared(name: str, scene: Scene) -> set[str]:
    """The fields and tables of a stage and of those before it."""
    fields = set(declared_fields(name, scene))
    return fields.union(*(all_declared(before, scene) for before in STAGE_INPUTS[name].after))


def declared_fields(name: str, scene: Scene) -> Iterator[str]:
    """The fields and tables that a stage itself declares; those of the mesh depend on the kind."""
    if name == "mesh":
        yield "kind"
        yield from kind_named(scene.kind).shape
    yield from STAGE_INPUTS[name].fields


def _without(
    scene: Scene,
    field: str,
    inputs: StageInputs,
) -> Any:
    """The value of a field; of a table without what the stage does not read."""
    value = value_at(scene, field)
    left_out = [name for name in inputs.without if name.startswith(f"{field}.")]
    if not left_out or not is_dataclass(value) or isinstance(value, type):
        return value
    return replace(value, **{name.rpartition(".")[2]: None for name in left_out})


def _file_stamp(scene: Scene) -> list[float]:
    """Imported files, and those that decks include, count by their times of change too."""
    if not scene.imported.file:
        return []
    entries = [split_entry(entry)[1] for entry in scene.imported.more or ()]
    files = [Path(name) for name in (scene.imported.file, *entries)]
    decks = [file for file in files if file.suffix.lower() == ".inp" and file.exists()]
    files += [inner for deck in decks for inner in included_files(deck)]
    return [file.stat().st_mtime if file.exists() else 0.0 for file in files]
