"""Shapes of dampers: outlines against closed forms, and meshes whose seats match."""

from __future__ import annotations

import re
from dataclasses import replace
from math import atan2, cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from measure import volume

from bladefem.errors import InputError
from geometry.damper_shapes import SHAPES
from geometry.parameters import DEG, Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from geometry.profile import clearing_shift, sector_profile
from geometry.sector import wedge_sector
from geometry.sector_check import check_sector

PARTS = (Aerofoil(), Platform(), Shank(), Disc())
# few elements on the seats, round which a mesh is fine: outlines are what this is about
COARSE = MeshSize(size=0.012, seat_elements=3)


def outline_area(corners: np.ndarray) -> float:
    """Signed area (shoelace)."""
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def midway_axes(damper: Wedge) -> tuple[np.ndarray, np.ndarray]:
    """Ends (2, 2, 2) of both flanks as (radial, across) midway between the blades, and the outline."""
    shape = sector_profile(*PARTS[1:], damper)
    theta = pi / PARTS[3].sectors
    axes = np.array([[cos(theta), -sin(theta)], [sin(theta), cos(theta)]])
    turn = np.array([[cos(2 * theta), -sin(2 * theta)], [sin(2 * theta), cos(2 * theta)]])
    flanks = np.stack([shape.seats[0], shape.seats[1] @ turn.T])
    return flanks @ axes, shape.damper @ axes


@pytest.mark.parametrize("angles", [(40, None), (55, 35), (30, 60), (90, None)])
@pytest.mark.parametrize("name", list(SHAPES))
def test_flanks_have_their_angles_and_lie_in_the_outline(name, angles):
    first, second = (None if angle is None else angle * DEG for angle in angles)
    damper = Wedge(shape=name, angle=first, angle_next=second)
    if name == "round bar" and second is not None:
        with pytest.raises(InputError, match="no circle fits"):
            sector_profile(*PARTS[1:], damper)
        return
    if name == "plate" and first != pi / 2:
        with pytest.raises(InputError, match="not in one plane, expected damper.angle = '90 deg'"):
            sector_profile(*PARTS[1:], damper)
        return
    if name != "plate" and first == pi / 2:
        with pytest.raises(InputError, match=r"damper\.(angle|shape)"):
            check_sector(*PARTS, damper)
        return
    flanks, corners = midway_axes(damper)
    for (inner, outer), angle in zip(flanks, damper.angles, strict=True):
        radial, across = outer - inner
        assert atan2(abs(across), radial) == pytest.approx(angle, rel=1e-9)
        assert np.hypot(radial, across) == pytest.approx(PARTS[1].seat_width, rel=1e-9)
        rows = [int(np.argmin(np.linalg.norm(corners - end, axis=1))) for end in (inner, outer)]
        assert np.allclose(corners[rows], [inner, outer], atol=1e-12)
        assert abs(rows[0] - rows[1]) in (1, len(corners) - 1)
    assert outline_area(corners) > 0


def test_round_bar_is_a_circle_with_two_flats():
    """All corners on one circle; the polygon misses the arcs by less than 3 % of the area."""
    damper = Wedge(shape="round bar", angle=50 * DEG)
    _, corners = midway_axes(damper)
    # the circle through three points, by the perpendicular bisectors
    a, b, c = corners[[0, 1, len(corners) // 2]]
    centre = np.linalg.solve(2 * np.array([b - a, c - a]), [b @ b - a @ a, c @ c - a @ a])
    radius = np.linalg.norm(corners - centre, axis=1)
    assert np.ptp(radius) < 1e-12
    half = np.arcsin(PARTS[1].seat_width / 2 / radius[0])
    exact = radius[0] ** 2 * (pi - 2 * half + 2 * sin(half) * cos(half))
    assert 0.97 * exact < outline_area(corners) < exact


@pytest.mark.parametrize(
    "damper",
    [
        Wedge(angle=55 * DEG, angle_next=40 * DEG),
        Wedge(angle=45 * DEG, angle_next=60 * DEG, clearance=5e-5),
        Wedge(shape="round bar", angle=50 * DEG),
        Wedge(shape="plate", angle=90 * DEG, base=4e-3),
        Wedge(shape="plate", angle=90 * DEG, base=4e-3, clearance=5e-5),
    ],
    ids=["asymmetric", "asymmetric with clearance", "round bar", "plate", "plate with clearance"],
)
def test_meshes_match_on_both_seats(damper):
    mesh = wedge_sector(*PARTS, damper, COARSE)
    area = outline_area(sector_profile(*PARTS[1:], damper).damper)
    assert volume(mesh.points, mesh.bodies["damper"]) == pytest.approx(
        area * damper.length, rel=1e-9
    )
    for name in ("this", "next"):
        pair = mesh.pairs[name]
        master, slave = pair.nodes
        moved = mesh.points[master] @ pair.rotation.T + pair.shift
        assert np.abs(moved - mesh.points[slave]).max() < 1e-12
        assert len(master) >= 9


def test_a_plate_is_a_rectangle_pressed_radially():
    """As wide as both seats and the gap; its clearance moves it along the radial line midway."""
    damper = Wedge(shape="plate", angle=90 * DEG, base=4e-3, clearance=1e-4)
    flanks, corners = midway_axes(damper)
    assert np.ptp(flanks[..., 0]) < 1e-12
    width = np.ptp(corners[:, 1])
    platform, theta = PARTS[1], pi / PARTS[3].sectors
    # the gap is measured across the radial line midway, where the edges of the platforms end
    assert width == pytest.approx(2 * platform.seat_width + platform.gap, rel=1e-9)
    assert outline_area(corners) == pytest.approx(width * damper.base, rel=1e-9)
    shift = clearing_shift(damper, sector_profile(*PARTS[1:], damper))
    assert shift == pytest.approx(-damper.clearance * np.array([cos(theta), sin(theta)]))


def test_clearance_opens_both_flanks_alike():
    """The damper moves so that each flank leaves its seat by the clearance, along its normal."""
    damper = Wedge(angle=55 * DEG, angle_next=35 * DEG, clearance=1e-4)
    mesh = wedge_sector(*PARTS, damper, COARSE)
    closed = wedge_sector(*PARTS, replace(damper, clearance=0.0), COARSE)
    shift = mesh.points[mesh.bodies["damper"][0]] - closed.points[closed.bodies["damper"][0]]
    for name in ("damper_left", "damper_right"):
        facet = mesh.points[mesh.faces[name][0][:3]]
        normal = np.cross(facet[1] - facet[0], facet[2] - facet[0])
        normal /= np.linalg.norm(normal)
        assert abs(shift[0] @ normal) == pytest.approx(damper.clearance, rel=1e-9)


def test_angles_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match=r"damper\.angle_next"):
        wedge_sector(*PARTS[:3], replace(PARTS[3], sectors=12), Wedge(angle_next=74 * DEG), COARSE)


def test_shape_of_the_page_is_meshed(monkeypatch):
    """docs/extending.md: a shape added to the list is drawn and its seats match."""
    page = (Path(__file__).parents[2] / "docs/extending.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    source = next(block for block in blocks if "DamperShape(" in block)
    monkeypatch.setattr("geometry.damper_shapes.SHAPES", dict(SHAPES))
    names: dict = {}
    exec(source, names)
    monkeypatch.setattr("geometry.profile.SHAPES", names["SHAPES"])
    damper = Wedge(shape="chamfered wedge")
    mesh = wedge_sector(*PARTS, damper, COARSE)
    plain = outline_area(sector_profile(*PARTS[1:], Wedge()).damper)
    area = outline_area(sector_profile(*PARTS[1:], damper).damper)
    # each chamfer takes a triangle of base / 2 by base / 2
    assert area == pytest.approx(plain - (damper.base / 2) ** 2, rel=1e-9)
    assert volume(mesh.points, mesh.bodies["damper"]) == pytest.approx(area * damper.length)
