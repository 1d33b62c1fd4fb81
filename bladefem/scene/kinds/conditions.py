"""Conditions that several kinds share."""

from __future__ import annotations

from collections.abc import Iterator

from ..limits import unless_at_most
from ..tables import Scene
from ..units import show

# faces and node sets that a force can act on, of every blade that is drawn here
BLADE_FACES = (
    "clamp",
    "pressure_side",
    "seat_left",
    "seat_right",
    "suction_side",
    "tip",
    "tip_leading",
    "tip_mid",
    "tip_trailing",
)


# what neither a drawing of straight edges nor one without fillets reads
STRAIGHT_FIELDS = ("mesh.curved", "mesh.fillet_elements")
# what a drawing without volumes does not read either
PLANE_FIELDS = (*STRAIGHT_FIELDS, "mesh.algorithm")


def static_fields(*bodies: str) -> tuple[str, ...]:
    """Fields of a material that isotropic bodies without motion and heat do not read."""
    names = ("rho", "expansion", "expansion_axes")
    return tuple(f"material.{body}.{name}" for body in bodies for name in names)


def below_limit(
    name: str,
    value: float,
    limit: float,
    what: str,
) -> Iterator[str]:
    if value >= limit:
        yield f"{name} = {show(value, 'm')}: expected less than {show(limit, 'm')}, {what}"


def at_most(
    name: str,
    value: float,
    limit: float,
    what: str,
) -> Iterator[str]:
    if expected := unless_at_most(value, limit):
        yield f"{name} = {show(value, 'm')}: expected {expected}, {what}"


def one_of(
    name: str,
    given: float | None,
    scene: Scene,
) -> Iterator[str]:
    if given is not None and scene.study.loads is not None:
        yield (
            f"{name} = {show(given, 'm')}: it takes the place of study.loads, expected only one of "
            "the two"
        )


def isotropic(scene: Scene, *bodies: str) -> Iterator[str]:
    """The closed form next to the finite elements is that of isotropic bodies, and a quarter of the
    pair is meshed, whose mirrors a turned crystal has not.
    """
    for body in bodies:
        material = getattr(scene.material, body)
        for name in ("G", "orthotropic"):
            if getattr(material, name) is not None:
                yield (
                    f"material.{body}.{name}: the closed form of kind '{scene.kind}' is that of "
                    "isotropic bodies, expected E and nu alone"
                )


def known_diameters(scene: Scene, sectors: int) -> Iterator[str]:
    listed = scene.model.nodal_diameters or ()
    for n in sorted({n for n in listed if listed.count(n) > 1}):
        yield f"model.nodal_diameters: {n} is listed twice, expected each nodal diameter once"
    for n in listed:
        if n > sectors // 2:
            yield (
                f"model.nodal_diameters = {n}: expected 0 to {sectors // 2}, half the number of "
                f"sectors ({sectors})"
            )
