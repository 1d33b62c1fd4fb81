"""Proportions with which a wedge sector cannot be drawn, refused by arithmetic before any CAD: one
sentence with the field to change.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians, sin, tan

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.limits import unless_at_least, unless_at_most
from bladefem.scene.units import LIMIT_TOLERANCE, show, show_most

from .fillet import platform_room
from .parameters import Aerofoil, Disc, Platform, Root, Shank, Shroud, Wedge
from .profile import Profile, clearing_shift, sector_profile
from .root import check_root
from .seat_room import widest_seat
from .section import section_outline, section_shape
from .shroud import shroud_block

PLAIN = Root()
NO_SHROUD = Shroud()
# of a length: a strip of this width keeps the shape quality of its elements above 0.05
MIN_STRIP_SHARE = 0.02
# thickness of the platform over its length or its pitch: at 1/290 a quarter of the cells stays flat
THINNEST_PLATE = 1 / 150
# [m], the lower ends of the ranges of the fields
NARROWEST_SEAT = float(Platform.__dataclass_fields__["seat_width"].metadata["low"])
LOWEST_BASE = float(Wedge.__dataclass_fields__["base"].metadata["low"])
# of a width that is sought by bisection: below what six digits show
SEAT_ACCURACY = 1e-9

# sections along the span that are compared with those of the next blade
CHECKED_HEIGHTS = 9


def check_sector(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    root: Root = PLAIN,
    shroud: Shroud = NO_SHROUD,
) -> None:
    """Refuse proportions that overlap or leave the sector.

    Raises:
        InputError: the first rule that is broken, with the value found and the limit.
    """
    check_disc(disc, shank, platform)
    theta = pi / disc.sectors
    for name, angle in zip(("angle", "angle_next"), wedge.angles, strict=True):
        # refused by the shape where it is no right angle
        if wedge.shape == "plate":
            continue
        _at_most(
            f"damper.{name}",
            angle,
            radians(85) - theta,
            f"85 deg minus half the sector angle of {_count(disc)}",
            "rad",
        )
    section = sector_profile(platform, shank, disc, wedge)
    check_platform(section, platform, shank, disc, wedge)
    check_pocket(section, shank, disc, wedge)
    check_aerofoil(aerofoil, platform, section)
    check_neighbours(aerofoil, disc, section)
    check_root(root, shank, disc)
    shroud_block(shroud, aerofoil, disc, section.top)


def _at_most(
    name: str,
    value: float,
    limit: float,
    meaning: str,
    unit: str = "m",
) -> None:
    if expected := unless_at_most(value, limit, unit):
        raise InputError(
            f"{name} = {show(value, unit)} is too large: expected {expected} ({meaning})"
        )


def _no_strip(name: str, value: float, limits: dict[str, float]) -> None:
    """Two ends that nearly coincide leave a strip that no good element fits into.

    Args:
        limits: lengths that the value may not exceed, by the names of their fields [m].
    """
    clear = [(1 - MIN_STRIP_SHARE) * limit for limit in limits.values()]
    fitting = [length for length in (*limits.values(), *clear) if _leaves_no_strip(length, limits)]
    other, limit = min(limits.items(), key=lambda item: item[1])
    if unless_at_most(value, limit):
        # to LIMIT_TOLERANCE: rounded, the very length would leave a strip
        named, strip = show(limit, "m", 13), ""
        if limit not in fitting:
            named, strip = show_most(max(fitting), "m"), ", less a strip as wide as an element"
        raise InputError(
            f"{name} = {show(value, 'm')} is too large: expected at most {named} ({other}{strip})"
        )
    for other, limit in limits.items():
        if not _leaves_no_strip(value, {other: limit}):
            same = "the same length or " if _leaves_no_strip(limit, limits) else ""
            below = max(length for length in fitting if length < limit)
            raise InputError(
                f"{name} = {show(value, 'm')} ends {show(limit - value, 'm', 3)} before {other}, "
                f"expected {same}at most {show_most(below, 'm')}"
            )


def _leaves_no_strip(value: float, limits: dict[str, float]) -> bool:
    """Whether a length ends with every limit, or clearly before it."""
    return all(
        abs(value - limit) <= LIMIT_TOLERANCE * limit
        or not unless_at_most(value, (1 - MIN_STRIP_SHARE) * limit)
        for limit in limits.values()
    )


def _count(disc: Disc) -> str:
    """The number of sectors as a scene gives it: it sets the pitch, and with it most limits."""
    return f"disc.sectors = {disc.sectors}"


def check_disc(
    disc: Disc,
    shank: Shank,
    platform: Platform,
) -> None:
    """Ring and neck."""
    theta = pi / disc.sectors
    _at_most(
        "disc.bore_radius", disc.bore_radius, 0.95 * disc.rim_radius, "95 % of disc.rim_radius"
    )
    _at_most(
        "shank.width",
        shank.width,
        1.9 * disc.rim_radius * sin(theta),
        f"95 % of the sector's width at the rim with {_count(disc)}",
    )
    _no_strip(
        "shank.length",
        shank.length,
        {"platform.length": platform.length, "disc.width": disc.width},
    )


def check_platform(
    section: Profile,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
) -> None:
    """The plate fits into the pitch and holds the seat next to the shank."""
    half = section.corners[0, 1] + platform.gap / 2
    _at_most(
        "platform.gap", platform.gap, half, f"half the pitch at the platform with {_count(disc)}"
    )
    # no mesh of a thinner one has cells that are not flat; its pitch, at the top, grows with it
    slope = 2 * tan(section.theta)
    pitch = (2 * half - slope * platform.thickness) / (1 - slope * THINNEST_PLATE)
    thinnest = THINNEST_PLATE * max(platform.length, pitch)
    if expected := unless_at_least(platform.thickness, thinnest):
        raise InputError(
            f"platform.thickness = {show(platform.thickness, 'm')} is too small: expected "
            f"{expected}, a {1 / THINNEST_PLATE:.0f}th of the platform's length and of its pitch"
        )
    _check_seat(platform, shank, disc, wedge)
    _no_strip("damper.length", wedge.length, {"platform.length": platform.length})


def _check_seat(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
) -> None:
    """The seat fits next to the shank."""
    widest = widest_seat(platform, shank, disc, wedge)
    where = f"the platform's overhang next to the shank with {_count(disc)}"
    cure = "fewer disc.sectors, or a smaller shank.width or damper.angle"
    if not unless_at_most(platform.seat_width, widest):
        return
    if widest < NARROWEST_SEAT:
        raise InputError(
            f"platform.seat_width = {show(platform.seat_width, 'm')}: no seat fits, {where} has "
            f"room for {show_most(max(widest, 0.0), 'm', 3)} and a seat has "
            f"{show(NARROWEST_SEAT, 'm')} or more; choose {cure}"
        )
    clear = _clear_seat(platform, shank, disc, wedge, widest)
    if clear < widest:
        where = f"so that the damper keeps clear of the shank with {_count(disc)}"
        cure = "fewer disc.sectors, or a smaller shank.width, damper.angle or damper.base"
    raise InputError(
        f"platform.seat_width = {show(platform.seat_width, 'm')} is too large: expected at most "
        f"{show_most(clear, 'm')} ({where}); or choose {cure}"
    )


def _clear_seat(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    widest: float,
) -> float:
    """The widest seat up to one [m] with which the damper keeps clear of shank and rim, by
    bisection; that one where it does so with none.
    """

    def keeps_clear(width: float) -> bool:
        section = sector_profile(replace(platform, seat_width=width), shank, disc, wedge)
        try:
            check_pocket(section, shank, disc, wedge)
        except InputError:
            return False
        return True

    if keeps_clear(widest) or not keeps_clear(NARROWEST_SEAT):
        return widest
    low, high = NARROWEST_SEAT, widest
    while high - low > SEAT_ACCURACY * high:
        middle = (low + high) / 2
        low, high = (middle, high) if keeps_clear(middle) else (low, middle)
    return low


def check_pocket(
    section: Profile,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
) -> None:
    """The damper stays clear of shank and rim, also after it is moved by its clearance."""
    sunk = wedge.clearance / sin(min(wedge.angles))
    room = 0.95 * shank.height - sunk
    if room < LOWEST_BASE:
        raise InputError(
            f"damper.clearance = {show(wedge.clearance, 'm')}: it lowers the damper by "
            f"{show(sunk, 'm', 3)}, expected less than 95 % of shank.height = "
            f"{show(shank.height, 'm')}"
        )
    _at_most(
        "damper.base",
        wedge.base,
        room,
        "95 % of shank.height, less what damper.clearance lowers the damper by",
    )
    radial = np.array([np.cos(section.theta), np.sin(section.theta)])
    across = np.array([-radial[1], radial[0]])
    moved = section.damper + clearing_shift(wedge, section)
    # what lies on the next blade's side is seen as that blade sees it
    corners = np.outer(moved @ radial, radial) - np.outer(np.abs(moved @ across), across)
    below = corners[moved @ radial < section.underside]
    inside = shank.width / 2 - below[:, 1].min(initial=np.inf)
    if inside > 0:
        raise InputError(
            f"damper.base = {show(wedge.base, 'm')}: the {wedge.shape} does not fit between shank "
            f"and platform (it enters the shank by {show(inside, 'm', 3)}); choose a smaller "
            "damper.base, shank.width or platform.seat_width"
        )
    if np.hypot(*corners.T).min() < disc.rim_radius:
        raise InputError(
            f"damper.base = {show(wedge.base, 'm')}: the {wedge.shape} enters the rim of the disc; "
            "choose a smaller damper.base or a larger shank.height"
        )


def check_aerofoil(
    blade: Aerofoil,
    platform: Platform,
    section: Profile,
) -> None:
    """Sections that do not cross themselves, and a root that lies on the platform."""
    for t, name in ((0.0, "thickness_root"), (1.0, "thickness_tip")):
        if crosses_itself(section_shape(blade, t)):
            raise InputError(
                f"aerofoil.{name}: the section crosses itself, expected less thickness or less "
                "aerofoil.camber"
            )
    smaller = "aerofoil.chord_root or aerofoil.fillet" if blade.fillet else "aerofoil.chord_root"
    rules = (
        ("axially", f"{smaller} or a larger platform.length"),
        (
            "circumferentially",
            f"{smaller} or aerofoil.stagger or platform.gap, or fewer disc.sectors",
        ),
    )
    for room, (what, cure) in zip(platform_room(blade, platform, section), rules, strict=True):
        if room < 0:
            raise InputError(
                f"aerofoil.chord_root = {show(blade.chord_root, 'm')}: the root section, with a "
                f"tenth of platform.thickness round it, overhangs the platform {what} by "
                f"{show(-room, 'm', 3)}; choose a smaller {cure}"
            )
    _at_most(
        "aerofoil.fillet",
        blade.fillet_radius,
        min(blade.thickness_root * blade.chord_root, blade.span / 4),
        "the thickness of the root section, and a quarter of aerofoil.span",
    )


def check_neighbours(
    blade: Aerofoil,
    disc: Disc,
    section: Profile,
) -> None:
    """Aerofoils that stay clear of each other: root and tip may fit where long twisted chords do
    not.
    """
    for t in np.linspace(0, 1, CHECKED_HEIGHTS):
        x, y, z = section_outline(blade, section.top, t).T
        # seen along the radius; points at the same angle have nearly the same radius
        own = np.column_stack([np.arctan2(y, x), z / section.top])
        if polygons_cross(own, own + np.array([2 * section.theta, 0.0])):
            end = "root" if t < 0.5 else "tip"
            chord = getattr(blade, f"chord_{end}")
            raise InputError(
                f"aerofoil.chord_{end} = {show(chord, 'm')}: {100 * t:.0f} % up the span the "
                "aerofoil runs into the next one, expected a smaller chord, thickness or "
                f"aerofoil.twist, or fewer than {_count(disc)}"
            )


def crosses_itself(polygon: np.ndarray) -> bool:
    """Do two edges of the closed polygon (n, 2) cross?"""
    return polygons_cross(polygon, polygon)


def polygons_cross(first: np.ndarray, second: np.ndarray) -> bool:
    """Does an edge of one closed polygon (n, 2) cross one of the other (m, 2)?"""

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    ai = first[:, None]
    bi = np.roll(first, -1, axis=0)[:, None]
    aj = second[None]
    bj = np.roll(second, -1, axis=0)[None]
    crossing = (side(ai, bi, aj) * side(ai, bi, bj) < 0) & (side(aj, bj, ai) * side(aj, bj, bi) < 0)
    return bool(crossing.any())
