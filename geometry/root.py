"""Blade roots: dovetail and fir-tree as slots that part blade and disc everywhere but on the
bearing flanks.

Blade and disc are one solid. What a bonded root changes is where forces pass: through the bearing
flanks alone, over necks and lobes that bend.
"""

from __future__ import annotations

from math import cos, pi, sin, tan

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.limits import unless_at_least, unless_at_most
from bladefem.scene.units import LIMIT_TOLERANCE, show, show_most

from .parameters import Disc, Root, Shank

# of root.pitch: radial height of a bearing flank
HIGHEST_BEARING = 0.7
# of root.bearing, and of the part of the pitch that bears nothing
WIDEST_SLOT = 0.4
# of the uppermost neck's width
NARROWEST_NECK = 0.3
# of the half pitch of the sector: what the disc's post between two roots keeps
POST = 0.15
# of the height of the disc
DEEPEST = 0.6
# of the neck: a narrower step beside the shank leaves a strip that no good element fits into
STEP = 0.05


def root_corners(root: Root, shank: Shank, disc: Disc) -> tuple[np.ndarray, np.ndarray]:
    """Where each bearing flank starts and ends, (lobes, 2) each [m], on the side y > 0 (x radial,
    y circumferential), from the rim inwards.
    """
    bearing = root.bearing * _along_flank(root)
    number = np.arange(root.lobes)
    depth = _idle_height(root) + number * root.pitch
    half = _neck(root, shank) / 2 - number * root.pitch * tan(root.taper)
    start = np.column_stack([disc.rim_radius - depth, half])
    return start, start + bearing


def root_slots(root: Root, shank: Shank, disc: Disc) -> list[np.ndarray]:
    """Outlines (n, 2) [m] of the slots on both sides, and of the one below the root."""
    if root.lobes == 0:
        return []
    start, end = root_corners(root, shank, disc)
    wide = root.clearance * _along_flank(root)
    above = disc.rim_radius + shank.height / 10
    side = [
        np.array(
            [
                [above, start[0, 1]],
                start[0],
                start[0] + wide,
                [above, start[0, 1] + wide[1]],
            ]
        )
    ]
    side += [
        np.array([upper, lower, lower + wide, upper + wide])
        for upper, lower in zip(end[:-1], start[1:], strict=True)
    ]
    mirror = np.array([1.0, -1.0])
    foot = end[-1] - [_idle_height(root), 0.0]
    half = np.array([end[-1], foot])
    floor = foot + np.array([-root.clearance, wide[1]])
    around = np.array([floor, end[-1] + wide])
    bottom = np.vstack([half, half[::-1] * mirror, around[::-1] * mirror, around])
    return [*side, *(one * mirror for one in side), bottom]


def check_root(root: Root, shank: Shank, disc: Disc) -> None:
    """Refuse roots whose parts leave no room for each other.

    Raises:
        InputError: the first rule that is broken, with the field to change.
    """
    if root.lobes == 0:
        return
    _check_neck(root, shank, disc)
    limit = HIGHEST_BEARING * root.pitch / cos(root.flank_angle)
    _at_most("bearing", root.bearing, limit, "70 % of root.pitch at this root.flank_angle")
    widest = WIDEST_SLOT * min(root.bearing, _idle_height(root))
    _at_most("clearance", root.clearance, widest, "40 % of a flank's width")
    _check_room(root, shank, disc)


def _check_neck(root: Root, shank: Shank, disc: Disc) -> None:
    """As wide as the shank, or clearly wider where the disc's posts have room for it."""
    neck = _neck(root, shank)
    widened = shank.width / (1 - 2 * STEP)
    expected = unless_at_least(neck, widened)
    if not expected or abs(neck - shank.width) <= LIMIT_TOLERANCE * neck:
        return
    widest = neck + 2 * _spare_post(root, shank, disc)
    if shank.width > widest:
        raise InputError(
            f"shank.width = {show(shank.width, 'm')}: the shank stands on the root, whose lobes "
            f"leave the disc its posts up to a root.neck of {show_most(max(widest, 0.0), 'm', 3)}; "
            "choose a smaller shank.width, a smaller root.bearing or fewer disc.sectors"
        )
    wider = f" or {expected}" if widened <= widest else ""
    raise InputError(
        f"root.neck = {show(neck, 'm')}: expected shank.width = {show(shank.width, 'm', 13)}"
        f"{wider}, since the shank stands on the root"
    )


def _spare_post(root: Root, shank: Shank, disc: Disc) -> float:
    """What half a post of the disc between two roots has more than it needs [m]; half of the neck's
    width takes as much from it.
    """
    end = root_corners(root, shank, disc)[1]
    reach = end + root.clearance * _along_flank(root)
    # the groove's floor is as wide as its last flank, further in
    deepest = end[-1, 0] - _idle_height(root) - root.clearance
    reach = np.vstack([reach, [deepest, reach[-1, 1]]])
    return float(((1 - POST) * reach[:, 0] * tan(pi / disc.sectors) - reach[:, 1]).min())


def _check_room(root: Root, shank: Shank, disc: Disc) -> None:
    """Necks, disc posts and depth."""
    start, end = root_corners(root, shank, disc)
    deepest = disc.rim_radius - end[-1, 0] + _idle_height(root) + root.clearance
    limit = DEEPEST * (disc.rim_radius - disc.bore_radius)
    if deepest > limit:
        raise InputError(
            f"root.lobes = {root.lobes}: the root is {show(deepest, 'm')} deep, expected at most "
            f"{show(limit, 'm')} (60 % of the height of the disc); choose fewer lobes or a smaller "
            "root.pitch"
        )
    if start[-1, 1] < NARROWEST_NECK * start[0, 1]:
        raise InputError(
            f"root.taper = {show(root.taper, 'rad')}: the innermost neck is "
            f"{show(2 * start[-1, 1], 'm', 3)} wide, expected at least "
            f"{show(2 * NARROWEST_NECK * start[0, 1], 'm', 3)}; choose less taper or fewer lobes"
        )
    spare = _spare_post(root, shank, disc)
    if spare < 0:
        raise InputError(
            f"root.neck = {show(_neck(root, shank), 'm')}: the lobes leave too thin a post of the "
            f"disc between two roots, by {show(-spare, 'm', 3)}; choose a narrower neck (and "
            "shank.width), a smaller root.bearing or fewer disc.sectors"
        )


def _at_most(name: str, value: float, limit: float, meaning: str) -> None:
    if expected := unless_at_most(value, limit):
        raise InputError(
            f"root.{name} = {show(value, 'm')} is too large: expected {expected} ({meaning})"
        )


def _neck(root: Root, shank: Shank) -> float:
    """Width of the uppermost neck [m]."""
    return shank.width if root.neck is None else root.neck


def _along_flank(root: Root) -> np.ndarray:
    """Direction (2,) of the bearing flanks, inwards and away from the middle."""
    return np.array([-cos(root.flank_angle), sin(root.flank_angle)])


def _idle_height(root: Root) -> float:
    """Radial height of the part of a lobe that bears nothing [m]."""
    return root.pitch - root.bearing * cos(root.flank_angle)
