"""A block on the aerofoil: tip shroud or snubber, one solid with it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, tan

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.limits import unless_at_least, unless_at_most
from bladefem.scene.units import show, show_least, show_most
from bladefem.util.arrays import RealArray

from .parameters import Aerofoil, Disc, Shroud
from .section import section_frame, section_outline

# of the shroud's thickness: between the aerofoil's skin and an edge of the block
MARGIN = 0.3
# [m] thinner ones need elements as small all over the block, millions of them; a fifth of a
# millimetre takes three times those of a half
THINNEST = 3e-4
# [m], the lower end of the field's range
SHORTEST = float(Shroud.__dataclass_fields__["length"].metadata["low"])
# sections over the thickness that are looked at
SECTIONS = 5


@dataclass(frozen=True)
class Reason:
    """Why a block has a least width, in words of a message."""

    purpose: str
    # what makes it smaller
    cure: str


COVER = Reason("to cover the tip section", "a smaller aerofoil.chord_tip or less stagger and twist")
STAND_OUT = Reason(
    "so that a snubber stands out of both sides of the aerofoil",
    "or a smaller shroud.length or shroud.thickness",
)


@dataclass(frozen=True)
class Block:
    """The box of a shroud, in the axes of the blade."""

    # (3,) corners [m]
    low: RealArray
    high: RealArray
    # it covers the tip
    at_tip: bool


def shroud_block(
    shroud: Shroud,
    aerofoil: Aerofoil,
    disc: Disc,
    top: float,
) -> Block | None:
    """The block; None without a shroud.

    Args:
        top: radius of the platform's top [m].

    Raises:
        InputError: a dimension does not fit the aerofoil or the neighbours.
    """
    if shroud.thickness == 0:
        return None
    if expected := unless_at_least(shroud.thickness, THINNEST):
        raise InputError(
            f"shroud.thickness = {show(shroud.thickness, 'm')}: expected 0 mm for none, or "
            f"{expected}"
        )
    at_tip = shroud.at == 1.0
    half = shroud.thickness / 2
    middle = aerofoil.span - half if at_tip else shroud.at * aerofoil.span
    _check_height(shroud, aerofoil, middle)
    shares = (middle + half * np.linspace(-1, 1, SECTIONS)) / aerofoil.span
    sections = np.array([section_outline(aerofoil, top, t) for t in shares])[:, :, 1:]
    rings = sections.reshape(-1, 2)
    centre = section_frame(aerofoil, top, middle / aerofoil.span)[0][1:]
    reach = np.abs(rings - centre).max(axis=0)
    margin = MARGIN * shroud.thickness
    length = shroud.length
    if length is None:
        length = 2 * (reach[1] + 2 * margin) if at_tip else 2 * reach[1] / 3
    theta = pi / disc.sectors
    between = (top + middle - half) * tan(theta) - shroud.gap / 2 / cos(theta)
    room = 2 * float(between - abs(centre[0]))
    width = room if shroud.width is None else shroud.width
    if at_tip:
        needed = 2 * (reach + margin)
        _check_width(shroud, width, needed[0], room, COVER)
        if expected := unless_at_least(length, needed[1]):
            raise InputError(
                f"shroud.length = {show(length, 'm')}: expected {expected} {COVER.purpose}"
            )
    else:
        # the outline starts and ends at the trailing edge, the leading one is its middle
        edges = sections[:, [0, sections.shape[1] // 2, -1], 1] - centre[1]
        _check_length(length, 2 * (np.abs(edges).min() - margin))
        _check_width(shroud, width, _snubber_width(length, rings - centre, margin), room, STAND_OUT)
    size = np.array([shroud.thickness, width, length])
    place = np.array([top + middle, *centre])
    return Block(place - size / 2, place + size / 2, at_tip)


def _check_height(shroud: Shroud, aerofoil: Aerofoil, middle: float) -> None:
    """Clear of platform and tip."""
    above = max(aerofoil.fillet_radius, shroud.thickness)
    lowest = (shroud.thickness / 2 + above) / aerofoil.span
    highest = 1 - 1.5 * shroud.thickness / aerofoil.span
    fits = lowest <= highest
    if unless_at_least(middle, lowest * aerofoil.span):
        raise InputError(
            f"shroud.thickness = {show(shroud.thickness, 'm')}: the block comes within "
            f"{show(above, 'm', 3)} of the platform, expected a thinner one"
            + (f", or a shroud.at of at least {show_least(lowest, digits=3)}" if fits else "")
        )
    if shroud.at < 1 and (expected := unless_at_most(shroud.at, highest, "1", digits=3)):
        raise InputError(
            f"shroud.at = {shroud.at:.4g}: the block comes within its thickness of the tip, "
            f"expected 1 or {expected if fits else 'a smaller shroud.thickness'}"
        )


def _check_length(length: float, limit: float) -> None:
    """A snubber leaves the edges of the aerofoil free."""
    cure = "or shroud.at = 1 for a tip shroud"
    expected = unless_at_most(length, limit)
    if expected and limit < SHORTEST:
        raise InputError(
            f"shroud.thickness: between the edges of the aerofoil is room for a snubber of "
            f"{show_most(max(limit, 0.0), 'm', 3)}, and shroud.length is {show(SHORTEST, 'm')} or "
            f"more; expected a thinner one, {cure}"
        )
    if expected:
        raise InputError(
            f"shroud.length = {show(length, 'm')}: expected {expected}, between the edges of the "
            f"aerofoil; {cure}"
        )


def _check_width(
    shroud: Shroud,
    width: float,
    needed: float,
    room: float,
    why: Reason,
) -> None:
    """The block is as wide as the aerofoil needs, and leaves the gap to its neighbours."""
    if unless_at_most(needed, room):
        raise InputError(
            f"shroud.gap = {show(shroud.gap, 'm')}: leaves a block of {show(max(room, 0.0), 'm')}, "
            f"expected {show(needed, 'm')} {why.purpose}; choose fewer disc.sectors, {why.cure}"
        )
    if expected := unless_at_least(width, needed):
        raise InputError(f"shroud.width = {show(width, 'm')}: expected {expected} {why.purpose}")
    if expected := unless_at_most(width, room):
        raise InputError(
            f"shroud.width = {show(width, 'm')}: expected {expected}, what shroud.gap leaves "
            "between neighbours"
        )


def _snubber_width(length: float, rings: np.ndarray, margin: float) -> float:
    """Width with which a snubber stands out on both sides of the aerofoil [m].

    Args:
        rings: (n, 2) points of the sections from the block's middle, circumferential and axial [m].
    """
    inside = np.abs(rings[:, 1]) <= length / 2 + margin
    return float(2 * (np.abs(rings[inside, 0]).max(initial=0.0) + margin))
