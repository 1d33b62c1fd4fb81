"""A block on the aerofoil: tip shroud or snubber, one solid with it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, tan

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.units import show, show_least, show_most
from bladefem.util.arrays import RealArray

from .parameters import Aerofoil, Disc, Shroud
from .section import section_frame, section_outline

# of the shroud's thickness: between the aerofoil's skin and an edge of the block
MARGIN = 0.3
# [m] thinner ones need elements as small all over the block, millions of them; a fifth of a
# millimetre takes three times those of a half
THINNEST = 3e-4
# sections over the thickness that are looked at
SECTIONS = 5


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
    if shroud.thickness < THINNEST:
        raise InputError(
            f"shroud.thickness = {show(shroud.thickness, 'm')}: expected 0 mm for none, or at "
            f"least {show(THINNEST, 'm')}"
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
    if width > room:
        raise InputError(
            f"shroud.width = {show(width, 'm')}: expected at most {show_most(room, 'm')}, what "
            "shroud.gap leaves between neighbours"
        )
    if at_tip:
        _check_cover(shroud, np.array([width, length]), reach, margin)
    else:
        # the outline starts and ends at the trailing edge, the leading one is its middle
        edges = sections[:, [0, sections.shape[1] // 2, -1], 1] - centre[1]
        _check_snubber(width, length, rings - centre, edges, margin)
    size = np.array([shroud.thickness, width, length])
    place = np.array([top + middle, *centre])
    return Block(place - size / 2, place + size / 2, at_tip)


def _check_height(shroud: Shroud, aerofoil: Aerofoil, middle: float) -> None:
    """Clear of platform and tip."""
    above = max(aerofoil.fillet_radius, shroud.thickness)
    free = middle - shroud.thickness / 2 - above
    if free < 0:
        raise InputError(
            f"shroud.thickness = {show(shroud.thickness, 'm')}: the block comes within "
            f"{show(above, 'm', 3)} of the platform, expected a thinner one, or a larger shroud.at"
        )
    if shroud.at < 1 and middle + 1.5 * shroud.thickness > aerofoil.span:
        raise InputError(
            f"shroud.at = {shroud.at:.4g}: the block comes within its thickness of the tip, "
            f"expected 1 or at most {1 - 1.5 * shroud.thickness / aerofoil.span:.3g}"
        )


def _check_cover(
    shroud: Shroud,
    size: np.ndarray,
    reach: np.ndarray,
    margin: float,
) -> None:
    """A tip shroud covers the section; sizes (2,) circumferential and axial."""
    for name, given, needed in zip(("width", "length"), size, 2 * (reach + margin), strict=True):
        if given >= needed:
            continue
        if name == "width" and shroud.width is None:
            raise InputError(
                f"shroud.gap = {show(shroud.gap, 'm')}: leaves a block of {show(given, 'm')}, "
                f"expected {show(needed, 'm')} to cover the tip section; choose fewer "
                "disc.sectors, a smaller aerofoil.chord_tip or less stagger and twist"
            )
        raise InputError(
            f"shroud.{name} = {show(given, 'm')}: expected at least {show_least(needed, 'm')} to "
            "cover the tip section"
        )


def _check_snubber(
    width: float,
    length: float,
    rings: np.ndarray,
    edges: np.ndarray,
    margin: float,
) -> None:
    """A snubber leaves the edges of the aerofoil free, and stands out on both sides.

    Args:
        rings: (n, 2) points of the sections from the block's middle, circumferential and axial [m].
        edges: axial places of leading and trailing edge [m].
    """
    limit = 2 * (np.abs(edges).min() - margin)
    if length > limit:
        raise InputError(
            f"shroud.length = {show(length, 'm')}: expected at most "
            f"{show_most(max(limit, 0.0), 'm')}, between the edges of the aerofoil; or "
            "shroud.at = 1 for a tip shroud"
        )
    inside = np.abs(rings[:, 1]) <= length / 2 + margin
    needed = 2 * (np.abs(rings[inside, 0]).max(initial=0.0) + margin)
    if width < needed:
        raise InputError(
            f"shroud.width = {show(width, 'm')}: expected at least "
            f"{show_least(needed, 'm')}, so that a snubber stands out of both sides of the "
            "aerofoil; or a smaller shroud.length"
        )
