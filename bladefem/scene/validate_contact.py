"""What must hold between the fields of [contact], [contact.left] and [contact.right]."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan

from .kinds import kind_named
from .tables import Contact, Scene, Seat
from .units import show

SEAT_SHAPE_FIELDS = ("crown", "crown_across", "edge_radius", "edge_width")


def contact_problems(scene: Scene) -> Iterator[str]:
    """One sentence for each thing that is wrong."""
    contact = scene.contact
    sides = {"contact.left": contact.left, "contact.right": contact.right}
    if not kind_named(scene.kind).has_seats:
        yield from _seats_only(scene)
    if contact.stiffness == "map":
        for name, side in {"contact": contact, **sides}.items():
            for key in ("kn_area", "kn"):
                if getattr(side, key) is not None:
                    yield (
                        f"{name}.{key}: contact.stiffness = 'map' takes the normal stiffness from "
                        "the pressure map, expected only one of the two"
                    )
    yield from _check_interval(scene)
    yield from _without_layer(scene)
    yield from _check_history(scene)
    shaped = [key for key in SEAT_SHAPE_FIELDS if getattr(contact, key) is not None]
    if shaped and contact.bedded:
        yield (
            f"contact.{shaped[0]} = {show(getattr(contact, shaped[0]), 'm')}: bedded seats have "
            "lost their shape by wear, expected contact.bedded = false with it"
        )
    if contact.crown is not None and kind_named(scene.kind).is_plane:
        yield (
            f"contact.crown: {scene.kind} have no length along the engine axis, expected "
            "contact.crown_across"
        )
    if (contact.edge_radius is None) != (contact.edge_width is None):
        missing = "edge_width" if contact.edge_width is None else "edge_radius"
        yield (
            f"contact.{missing}: expected together with "
            f"contact.{'edge_radius' if missing == 'edge_width' else 'edge_width'}"
        )


def _without_layer(scene: Scene) -> Iterator[str]:
    """Fields of an interface layer given for faces that have none, or that have another."""
    contact = scene.contact
    sides = {"contact.left": contact.left, "contact.right": contact.right}
    if contact.roughness is not None:
        given = [
            f"contact.{key}"
            for key in ("kt_area", "kt", "kn_area", "kn")
            if getattr(contact, key) is not None
        ]
        given += (
            [] if contact.stiffness == "given" else [f"contact.stiffness = '{contact.stiffness}'"]
        )
        if given:
            yield (
                f"contact.roughness: {given[0]} says how stiff the layer is, expected only one of "
                "the two"
            )
    if contact.stiffness == "rigid":
        for name, side in {"contact": contact, **sides}.items():
            for key in ("kt_area", "kt", "kn_area", "kn"):
                if getattr(side, key) is not None:
                    yield (
                        f"{name}.{key}: contact.stiffness = 'rigid' has no interface layer, "
                        "expected only one of the two"
                    )
    if contact.stiffness != "given" and contact.stiffening is not None:
        yield (
            f"contact.stiffening: contact.stiffness = '{contact.stiffness}' has no layer that "
            "could stiffen, expected contact.stiffness = 'given' with it"
        )


def _check_history(scene: Scene) -> Iterator[str]:
    """Histories that cannot press the damper on its seats, or leave it held by friction alone."""
    contact = scene.contact
    history = contact.history
    if history == "frictionless":
        return
    name = f"contact.history = {history!r}"
    if not isinstance(history, str):
        name = "contact.history"
        if min(history) == 0:
            yield (
                "contact.history: a speed of 0 rpm lifts the damper off its seats, which forgets "
                "what came before; expected positive speeds"
            )
            return
    if not kind_named(scene.kind).has_seats:
        yield f"{name}: a scene of kind '{scene.kind}' has no two seats, expected 'frictionless'"
        return
    if not scene.operation.speed > 0:
        yield f"{name}: operation.speed = 0 rpm presses nothing, expected a positive speed"
    if contact.stiffness == "map":
        yield f"{name}: expected contact.stiffness = 'given', friction acts on a layer known before"
    if not max(friction_of_seats(contact)) > 0:
        yield f"{name}: contact.mu = 0 leaves no friction, expected 'frictionless'"
    locked = self_locking(scene)
    if locked:
        yield f"{locked}, so that {name} does not determine its load; expected a larger angle"


def friction_of_seats(contact: Contact) -> tuple[float, float]:
    """Friction coefficients of the left and of the right seat."""
    left, right = (
        contact.mu if seat.mu is None else seat.mu for seat in (contact.left, contact.right)
    )
    return left, right


def is_frictionless(scene: Scene) -> bool:
    """Two seats without friction: the damper couples the blades, and dissipates nothing."""
    return kind_named(scene.kind).has_seats and not max(friction_of_seats(scene.contact)) > 0


def self_locking(scene: Scene) -> str:
    """What says that friction alone holds the damper between its seats; empty where it does not."""
    flank_angles = kind_named(scene.kind).flank_angles
    if flank_angles is None:
        return ""
    both = friction_of_seats(scene.contact)
    # both reactions may lie on one line, within the friction cone of either seat
    angle = sum(flank_angles(scene)) / 2
    limit = (atan(both[0]) + atan(both[1])) / 2
    if angle > limit:
        return ""
    return (
        f"damper.angle = {show(angle, 'rad')}: with contact.mu = {min(both):g} friction alone "
        f"holds the damper between its seats (self-locking up to {show(limit, 'rad')})"
    )


def _check_interval(scene: Scene) -> Iterator[str]:
    """Models whose response no loading history changes."""
    if not scene.study.interval:
        return
    if not kind_named(scene.kind).has_seats:
        yield (
            f"study.interval = true: a scene of kind '{scene.kind}' has no forced response, "
            "expected it to be left out"
        )
        return
    fixed = {
        "contact.normal = 'prescribed'": scene.contact.normal == "prescribed",
        "model.damper = 'mass'": scene.model.damper == "mass",
        "model.static = 'uncoupled'": scene.model.static == "uncoupled",
    }
    for name, holds in fixed.items():
        if holds:
            yield (
                f"study.interval = true: with {name} no loading history changes the response, so "
                "that the interval is a point; expected study.interval = false"
            )


def _seats_only(scene: Scene) -> Iterator[str]:
    """Fields that need the two seats of a damper."""
    contact = scene.contact
    name = f"a scene of kind '{scene.kind}' has no two seats"
    given = [
        key for key in (*SEAT_SHAPE_FIELDS, "wear_coefficient") if getattr(contact, key) is not None
    ]
    given += ["stiffness = 'map'"] if contact.stiffness == "map" else []
    given += [side for side in ("left", "right") if getattr(contact, side) != Seat()]
    for key in given:
        yield f"contact.{key}: {name}, expected it to be left out"
