"""What must hold between the fields of a scene before any work starts. Each refusal names the field
to change.

These are necessary conditions that need no drawing; what only shows in the drawing is refused by
the geometry.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from pathlib import Path

from geometry.check_parameters import check_names, check_parameters

from ..errors import InputError
from .fields import convert_value, each_field, value_at
from .kinds import kind_named
from .kinds.conditions import at_most
from .material_table import expands, material_at, operating_temperature
from .part_materials import part_materials
from .support import area_springs, held_letters
from .tables import Scene
from .temperature_file import read_temperatures
from .units import show
from .validate_contact import contact_problems, is_frictionless

# letters that fit on a picture
LONGEST_TITLE = 200
# below it the square of a direction's length is lost in rounding
SHORTEST_DIRECTION = 1e-100

# constants of an orthotropic solid
ORTHOTROPIC_CONSTANTS = 9


def validate(scene: Scene) -> None:
    """Check every field and what must hold between them.

    Raises:
        InputError: the first thing that is wrong, in one sentence.
    """
    kind = kind_named(scene.kind)
    for field in each_field():
        if "." not in field.name or kind.reads(field.name):
            convert_value(value_at(scene, field.name), field)
    problems = [
        *_check_title(scene),
        *kind.conditions(scene),
        *_check_crystals(scene),
        *_check_temperature(scene),
        *_check_supports(scene),
        *_check_numerics(scene),
        *contact_problems(scene),
    ]
    if kind.reads("study"):
        problems += _check_study(scene)
    if kind.reads("excitation"):
        problems += _check_excitation(scene)
        check_names(scene)
    if problems:
        raise InputError(problems[0])
    check_parameters(scene)


def _check_title(scene: Scene) -> Iterator[str]:
    """It is drawn on every picture."""
    if len(scene.title) > LONGEST_TITLE:
        yield f"title: {len(scene.title)} letters, expected at most {LONGEST_TITLE}"


def _check_supports(scene: Scene) -> Iterator[str]:
    """Their texts can be read, and a body that turns has a place."""
    springs = list(area_springs(scene.support))
    held_letters(scene.support)
    free = not (scene.support.clamp or springs or scene.support.directions)
    if free and scene.operation.stiffening and scene.operation.speed > 0:
        yield (
            "support.clamp = '': a free body has no steady place under rotation (its in-plane "
            "motions are unstable there), expected operation.stiffening = false"
        )


def _check_crystals(scene: Scene) -> Iterator[str]:
    """Nine constants make an orthotropic solid."""
    for name in ("blade", "damper"):
        constants = getattr(scene.material, name).orthotropic
        if constants is not None and len(constants) != ORTHOTROPIC_CONSTANTS:
            yield (
                f"material.{name}.orthotropic has {len(constants)} values, expected E1, E2, E3, "
                "nu12, nu13, nu23, G12, G13, G23"
            )


def _check_temperature(scene: Scene) -> Iterator[str]:
    """Tables can be read and hold the temperature; an expansion is known where it is needed."""
    given = scene.temperature
    named = {f"material.{name}": getattr(scene.material, name) for name in ("blade", "damper")}
    if "temperature" not in kind_named(scene.kind).tables:
        for name, material in named.items():
            if material.table is not None:
                yield (
                    f"{name}.table: a scene of kind '{scene.kind}' has no temperature, expected "
                    "constants"
                )
        return
    if given.uniform is not None and given.file:
        yield "temperature.file: expected either a file or temperature.uniform, not both"
    hottest = coldest = operating_temperature(scene)
    if given.file:
        read = read_temperatures(given.file)
        values = read.values
        if read.nodes is not None and not _has_node_numbers(scene):
            yield (
                "temperature.file: it gives temperatures of nodes, expected those of places (x, y, "
                "z) where the mesh is no file of its own"
            )
        coldest, hottest = float(values.min()), float(values.max())
    if kind_named(scene.kind).name == "imported":
        named |= {f"imported.materials, {name}": m for name, m in part_materials(scene).items()}
    hot = given.file or (given.uniform is not None and given.uniform != given.reference)
    for name, material in named.items():
        table = f"{name}.table" if name.startswith("material.") else name
        for temperature in (coldest, hottest):
            material_at(material, temperature, table)
        if hot and not expands(material):
            yield (
                f"{name}.expansion is missing: the temperature differs from "
                f"temperature.reference = {show(given.reference, 'K')}, expected the material's "
                "thermal expansion such as 1.2e-5 1/K (0 for none)"
            )


def _has_node_numbers(scene: Scene) -> bool:
    """The mesh is a user's own."""
    kind = kind_named(scene.kind).name
    drawings = (".step", ".stp")
    return kind == "imported" and Path(scene.imported.file).suffix.lower() not in drawings


def refuse_response(scene: Scene) -> None:
    """What modes can do without and a response cannot: damping, a force, and loads or friction by
    which the best load is found.

    Raises:
        InputError: one of them is zero.
    """
    if "operation" not in kind_named(scene.kind).tables:
        return
    if not scene.operation.damping > 0:
        raise InputError(
            "operation.damping = 0: expected above 0 for a response, a resonance without damping "
            "has no bounds"
        )
    if not scene.excitation.force > 0:
        raise InputError("excitation.force = 0 N: expected above 0 N for a response")
    if is_frictionless(scene) and scene.study.loads is None:
        raise InputError(
            "contact.mu = 0: the seats dissipate nothing, so that no load is the best one; "
            "expected friction, or loads to study such as study.loads = '20 N, 80 N'"
        )


def refuse_bladeless(name: str) -> None:
    """Modes and responses need a blade.

    Args:
        name: of a kind of scene.

    Raises:
        InputError: it has none; the sentence says what commands do with it.
    """
    kind = kind_named(name)
    if not kind.has_blade:
        raise InputError(
            f"kind '{name}' has no blade to vibrate: 'bladefem run' computes its {kind.result}, "
            "'bladefem mesh' draws it"
        )


def refuse_given_mesh(scene: Scene) -> None:
    """A study of meshes needs a scene that is meshed here.

    Raises:
        InputError: its mesh comes from a file.
    """
    if not kind_named(scene.kind).meshed_here(scene):
        raise InputError(
            f"kind '{scene.kind}': its mesh is given, expected a scene that is meshed here"
        )


def _check_numerics(scene: Scene) -> Iterator[str]:
    mesh = scene.mesh
    model = scene.model
    if mesh.size is not None and mesh.contact_size is not None:
        yield from at_most("mesh.contact_size", mesh.contact_size, mesh.size, "mesh.size")
    if mesh.seat_elements is not None and not kind_named(scene.kind).has_seat_grid:
        yield (
            f"mesh.seat_elements = {mesh.seat_elements}: only the seats of kind 'wedge sector' are "
            "meshed in a grid"
        )
    if model.samples == 0 and not kind_named(scene.kind).has_one_tangent:
        yield (
            "model.samples = 0: changes of contact state are located exactly in plane models "
            "only, expected at least 16"
        )
    if model.samples is not None and 0 < model.samples < 16:
        yield f"model.samples = {model.samples}: expected 16 to 65536, or 0 in plane models"
    if model.harmonics is not None and model.samples and model.samples <= 2 * model.harmonics:
        yield (
            f"model.samples = {model.samples}: expected more than {2 * model.harmonics} for "
            f"model.harmonics = {model.harmonics}"
        )


def _check_study(scene: Scene) -> Iterator[str]:
    if scene.study.loads is not None and min(scene.study.loads) == 0:
        why = kind_named(scene.kind).without_load
        yield f"study.loads = 0 N: {why}, expected more than 0 N"
    for name, unit in (("loads", "N"), ("masses", "kg")):
        values = getattr(scene.study, name) or ()
        twice = next((value for value in values if values.count(value) > 1), None)
        if twice is not None:
            yield f"study.{name} = {show(twice, unit)}: given twice, expected each value once"
    band = scene.study.band
    if band is not None and not band[0] < band[1]:
        yield (
            f"study.band = {show(band[0], 'Hz')}, {show(band[1], 'Hz')}: expected the lower "
            "frequency first"
        )


def _check_excitation(scene: Scene) -> Iterator[str]:
    # its length must not vanish in rounding
    if not hypot(*scene.excitation.direction) > SHORTEST_DIRECTION:
        yield "excitation.direction = 0, 0, 0: expected a direction, not all zero, such as 0, 1, 0"
    elif kind_named(scene.kind).is_plane and not any(scene.excitation.direction[:2]):
        yield (
            f"excitation.direction: {scene.kind} do not move along z, expected a direction with a "
            "part in their plane, such as 0, 1, 0"
        )
    modes = scene.model.modes
    mode = scene.excitation.mode
    if modes is not None and mode > modes:
        yield (
            f"excitation.mode = {mode}: expected at most model.modes = {modes}, the modes that are "
            "kept"
        )
