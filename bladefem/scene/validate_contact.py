"""What must hold between the fields of [contact], [contact.left] and [contact.right]."""

from __future__ import annotations

from collections.abc import Iterator

from .kinds import kind_named
from .tables import Scene, Seat
from .units import show

__all__ = ["contact_problems"]

SHAPE = ("crown", "crown_across", "edge_radius", "edge_width")


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
                        "the pressure "
                        "map, expected only one of the two"
                    )
    yield from _interval(scene)
    shaped = [key for key in SHAPE if getattr(contact, key) is not None]
    if shaped and contact.bedded:
        yield (
            f"contact.{shaped[0]} = {show(getattr(contact, shaped[0]), 'm')}: bedded seats have "
            "lost their shape by "
            "wear, expected contact.bedded = false beside it"
        )
    if contact.crown is not None and scene.kind == "plane blades":
        yield (
            "contact.crown: plane blades have no length along the engine axis, expected "
            "contact.crown_across"
        )
    if (contact.edge_radius is None) != (contact.edge_width is None):
        missing = "edge_width" if contact.edge_width is None else "edge_radius"
        yield (
            f"contact.{missing}: expected beside "
            f"contact.{'edge_radius' if missing == 'edge_width' else 'edge_width'}"
        )


def _interval(scene: Scene) -> Iterator[str]:
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
    given = [key for key in (*SHAPE, "wear_coefficient") if getattr(contact, key) is not None]
    given += ["stiffness = 'map'"] if contact.stiffness == "map" else []
    given += [side for side in ("left", "right") if getattr(contact, side) != Seat()]
    for key in given:
        yield f"contact.{key}: {name}, expected it to be left out"
