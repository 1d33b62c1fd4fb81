"""A number that a message expects at most, or at least, is taken when it is typed: over random
sizes of every part, each with one field far beyond its limit.
"""

from __future__ import annotations

import re
from dataclasses import fields, replace
from math import pi, sin
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.contact.face_profile import _check_crown, _check_width
from bladefem.errors import InputError
from bladefem.scene.kinds.conditions import at_most
from bladefem.scene.units import parse
from geometry.contact_pairs import check_hertz, check_punch
from geometry.fitted_wedge import _common_extent, _seat_width
from geometry.parameters import (
    Aerofoil,
    Disc,
    HertzPair,
    MeshSize,
    Plane,
    Platform,
    Punch,
    Root,
    Shank,
    Shroud,
    Wedge,
    ZMass,
)
from geometry.plane import check_plane
from geometry.profile import sector_profile
from geometry.seat_room import widest_seat
from geometry.sector_check import check_sector
from geometry.zmass import check_z_mass

SIZES = 60
# "at most 21.375 mm", "at least 8 deg"
NAMED = re.compile(r"at (?:most|least) (-?[\d.]+(?:e[-+]\d+)?(?: [a-z]+\b)?)")
# as the parts of a scene are called, in the order of check_sector
SECTOR = {
    "aerofoil": Aerofoil(),
    "platform": Platform(),
    "shank": Shank(length=0.036),
    "disc": Disc(),
    "damper": Wedge(),
    "root": Root(),
    "shroud": Shroud(),
}


def sector(parts):
    check_sector(*parts.values())


def field_of(table, name):
    return next(f for f in fields(table) if f.name == name)


def random_size(table, name, rng, digits):
    """A number of some digits within a tenth of the table's, and within the range of the field."""
    value, meta = getattr(table, name), field_of(table, name).metadata
    if not isinstance(value, float) or value == 0:
        return value
    drawn = np.clip(value * rng.uniform(0.9, 1.1), meta["low"], meta["high"])
    return float(f"{drawn:.{digits}g}")


def refusal(check, parts):
    try:
        check(parts)
    except InputError as refused:
        return str(refused)
    return ""


SNUBBER = {"shroud": Shroud(thickness=0.004, at=0.6)}
TIP = {"shroud": Shroud(thickness=0.003)}
ROOT = {"root": Root(lobes=1)}
# a platform that the largest fillet fits on
ROOMY = SECTOR | {"platform": Platform(length=0.25), "disc": Disc(sectors=10)}
LONG_PITCH = SECTOR | {"disc": Disc(sectors=6, rim_radius=0.45)}
HERTZ = {"hertz": HertzPair(), "mesh": MeshSize()}
PUNCH = {"punch": Punch(), "mesh": MeshSize()}
CASES = [
    ("z_mass.bar", 0.15, {"z_mass": ZMass()}, lambda p: check_z_mass(p["z_mass"])),
    ("plane.seat_width", 0.09, {"plane": Plane()}, lambda p: check_plane(p["plane"])),
    ("hertz.contact_radius", 0.03, HERTZ, lambda p: check_hertz(*p.values())),
    ("hertz.half_width", 0.2, HERTZ, lambda p: check_hertz(*p.values())),
    ("punch.radius", 0.04, PUNCH, lambda p: check_punch(*p.values())),
    ("disc.bore_radius", 1.9, SECTOR, sector),
    ("shank.width", 0.09, SECTOR, sector),
    ("shank.length", 0.3, SECTOR, sector),
    ("damper.length", 0.4, SECTOR, sector),
    ("damper.base", 0.05, SECTOR, sector),
    ("damper.angle", 1.5, SECTOR, sector),
    ("platform.thickness", 0.002, SECTOR | {"platform": Platform(length=0.4)}, sector),
    ("platform.thickness", 0.002, LONG_PITCH, sector),
    ("platform.seat_width", 0.04, SECTOR, sector),
    ("aerofoil.fillet", 0.03, ROOMY, sector),
    ("root.neck", 0.0162, SECTOR | ROOT, sector),
    ("root.bearing", 0.02, SECTOR | ROOT, sector),
    ("root.clearance", 0.004, SECTOR | ROOT, sector),
    ("shroud.at", 0.96, SECTOR | SNUBBER, sector),
    ("shroud.at", 0.3, SECTOR | {"shroud": Shroud(thickness=0.03, at=0.6)}, sector),
    ("shroud.length", 0.2, SECTOR | SNUBBER, sector),
    ("shroud.width", 0.004, SECTOR | SNUBBER, sector),
    ("shroud.width", 0.3, SECTOR | SNUBBER, sector),
    ("shroud.width", 0.02, SECTOR | TIP, sector),
    ("shroud.width", 0.3, SECTOR | TIP, sector),
    ("shroud.length", 0.01, SECTOR | TIP, sector),
]


@pytest.mark.parametrize(("name", "beyond", "tables", "check"), CASES, ids=lambda v: str(v)[:22])
def test_a_limit_that_is_named_is_taken(name, beyond, tables, check):
    rng = np.random.default_rng(7)
    path, own = name.split(".")
    named = 0
    for i in range(SIZES):
        # limits of round sizes are round but for round-off, others are cut to be named
        digits = (2, 3, 16)[i % 3]
        parts = {
            key: replace(
                table, **{f.name: random_size(table, f.name, rng, digits) for f in fields(table)}
            )
            for key, table in tables.items()
        }
        parts[path] = replace(parts[path], **{own: beyond})
        said = refusal(check, parts)
        found = NAMED.search(said)
        if not found or name not in said[: found.start()]:
            continue
        named += 1
        meta = field_of(parts[path], own).metadata
        value = parse(found[1], meta["unit"], name)
        assert meta["low"] <= value <= meta["high"], said
        again = refusal(check, {**parts, path: replace(parts[path], **{own: value})})
        assert not re.match(rf"{path}\.{own}\b", again), (said, again)
    assert named > SIZES / 5, (name, beyond, said)


@pytest.mark.parametrize(("platform", "disc"), [(0.046, 0.0452), (0.0452, 0.046), (0.06, 0.045)])
def test_a_shank_leaves_no_strip_on_either_side(platform, disc):
    """The number named for one neighbour is none that the other refuses."""
    parts = SECTOR | {"platform": Platform(length=platform), "disc": Disc(width=disc)}
    for length in (0.08, max(platform, disc), min(platform, disc) - 1e-4):
        tried = {**parts, "shank": Shank(length=length), "damper": Wedge(length=0.03)}
        said = refusal(sector, tried)
        if not said.startswith("shank.length"):
            assert length == min(platform, disc) and "shank" not in said
            continue
        value = parse(NAMED.search(said)[1], "m")
        taken = refusal(sector, {**tried, "shank": Shank(length=value)})
        assert not taken.startswith("shank.length"), (said, taken)


def test_a_clearance_that_leaves_no_height_for_a_damper_is_named():
    """It was a base of at most -3 mm that was expected."""
    low = SECTOR | {
        "shank": Shank(length=0.036, height=0.005),
        "damper": Wedge(angle=0.27, clearance=0.002),
    }
    assert refusal(sector, low).startswith(
        "damper.clearance = 2 mm: it lowers the damper by 7.5 mm"
    )


def test_limits_of_seats_and_faces_are_taken():
    """Of checks that are given more than the tables of a scene."""
    rng = np.random.default_rng(8)
    for limit in rng.uniform(0.002, 0.09, 400):
        square = np.array([[0.0, 0.0, z] for z in (0.0, limit)])
        face = SimpleNamespace(corners=square)
        along = np.array([0.0, 0.0, 1.0])
        patch = SimpleNamespace(area=np.full(5, limit**2), faces=np.zeros((2, 3)))
        checks = [
            (2.0, lambda w, limit=limit: _seat_width([(0.0, limit), (0.0, 1.0)], w)),
            (2.0, lambda w, face=face, along=along: _common_extent((face, face), along, w)),
            (1e-4, lambda w, limit=limit: _check_crown("crown", w, limit)),
            (
                1e-4,
                lambda w, patch=patch: _check_width(patch, SimpleNamespace(depth=0.0), w),
            ),
        ]
        for beyond, check in checks:
            said = refusal(check, beyond)
            assert refusal(check, parse(NAMED.search(said)[1], "m")) == "", said
        said = next(at_most("a.b", 2.0, limit, "c"))
        assert not list(at_most("a.b", parse(NAMED.search(said)[1], "m"), limit, "c"))


@pytest.mark.parametrize("sectors", [24, 36, 48, 60, 70])
@pytest.mark.parametrize("angle_next", [None, 0.9])
def test_the_widest_seat_is_where_it_takes_the_overhang(sectors, angle_next):
    """By bisection on the drawn section: what the seat spans of the circumference against 98 % of
    what the platform overhangs the shank by.
    """
    disc, shank, damper = Disc(sectors=sectors), Shank(), Wedge(angle_next=angle_next)

    def spare(width):
        drawn = sector_profile(Platform(seat_width=width), shank, disc, damper)
        overhang = np.abs(drawn.seats[:, 1, 1]).min() - shank.width / 2
        return 0.98 * overhang - width * sin(max(damper.angles) + pi / sectors)

    low, high = 1e-5, 0.5
    assert spare(low) > 0 > spare(high)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if spare(middle) > 0 else (low, middle)
    assert widest_seat(Platform(), shank, disc, damper) == pytest.approx(low, rel=1e-9)
    # a platform that does not reach the shank carries none
    assert widest_seat(Platform(), Shank(width=0.1), disc, damper) < 0
