"""Roots in the disc and blocks on the aerofoil: volumes and areas in closed form, names, refusals."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from measure import volume
from scipy.integrate import simpson

from bladefem.errors import InputError
from geometry.parameters import Aerofoil, Disc, MeshSize, Platform, Root, Shank, Shroud, Wedge
from geometry.profile import sector_profile
from geometry.root import check_root, root_corners, root_slots
from geometry.section import section_shape as section
from geometry.sector import wedge_sector
from geometry.sector_check import check_sector
from geometry.shroud import shroud_block
from geometry.topology import face_normals

PARTS = (Aerofoil(), Platform(), Shank(), Disc(), Wedge())
# few elements on the seats, round which a mesh is fine: nothing here is about them
COARSE = MeshSize(size=9e-3, seat_elements=3)


@pytest.fixture(scope="module")
def plain():
    return volume_of(wedge_sector(*PARTS, COARSE))


def volume_of(mesh):
    return volume(mesh.points, mesh.bodies["blade"])


def area_below_the_rim(outline, rim):
    """Of a polygon in (x, y) where x < sqrt(rim^2 - y^2): clipped along fine strips in y."""
    y = np.linspace(outline[:, 1].min(), outline[:, 1].max(), 4001)
    following = np.roll(outline, -1, axis=0)
    total = np.zeros_like(y)
    for a, b in zip(outline, following, strict=True):
        if a[1] == b[1]:
            continue
        inside = (y >= min(a[1], b[1])) & (y < max(a[1], b[1]))
        x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        below = np.minimum(x, np.sqrt(rim**2 - y**2))
        total += np.where(inside, np.sign(b[1] - a[1]) * below, 0.0)
    return abs(simpson(total, x=y))


@pytest.mark.parametrize(
    "root",
    [
        Root(lobes=1, pitch=0.01, bearing=0.005),
        Root(lobes=2),
        Root(lobes=3, neck=0.018, taper=0.1, flank_angle=0.8),
    ],
)
def test_a_root_takes_the_slots_out_of_the_sector(plain, root):
    mesh = wedge_sector(*PARTS, COARSE, root)
    slots = root_slots(root, PARTS[2], PARTS[3])
    assert len(slots) == 2 * root.lobes + 1
    areas = [area_below_the_rim(slot, PARTS[3].rim_radius) for slot in slots]
    taken = plain - volume_of(mesh)
    assert taken == pytest.approx(sum(areas) * PARTS[3].width, rel=5e-3)
    assert mesh.report["min scaled jacobian"] > 0.1
    assert mesh.report["worst quality"] > 0.03
    assert set(mesh.pairs) == {"cyclic", "this", "next"}


def test_bearing_flanks_have_their_angle_and_width():
    """Bonded from where the slot above ends to where the slot below begins: width less clearance."""
    root = Root(lobes=2, flank_angle=0.9, taper=0.0)
    start, end = root_corners(root, PARTS[2], PARTS[3])
    np.testing.assert_allclose(
        end - start, np.tile(root.bearing * np.array([-cos(0.9), sin(0.9)]), (2, 1)), atol=1e-15
    )
    np.testing.assert_allclose(start[0] - start[1], [root.pitch, 0.0], atol=1e-15)
    assert 2 * start[0, 1] == PARTS[2].width
    first, second = root_slots(root, PARTS[2], PARTS[3])[:2]
    assert np.linalg.norm(first[2] - end[0]) == pytest.approx(root.bearing - root.clearance)
    np.testing.assert_allclose(second[0], end[0])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"neck": 0.014}, "root.neck = 14 mm: expected shank.width"),
        ({"neck": 0.0161}, "root.neck = 16.1 mm: expected shank.width"),
        ({"neck": 0.028}, "too thin a post of the disc"),
        ({"bearing": 0.008}, "root.bearing = 8 mm is too large"),
        ({"clearance": 0.0015}, "root.clearance = 1.5 mm is too large"),
        ({"pitch": 0.03}, "the root is 118.872 mm deep, expected at most 48 mm"),
        ({"taper": 0.5, "lobes": 4}, "the innermost neck is"),
    ],
)
def test_impossible_roots_name_the_field(changes, said):
    with pytest.raises(InputError, match=said):
        check_root(replace(Root(lobes=3), **changes), PARTS[2], PARTS[3])
    check_root(replace(Root(lobes=0), **changes | {"lobes": 0}), PARTS[2], PARTS[3])


def top():
    return sector_profile(*PARTS[1:]).top


def aerofoil_inside(low, high):
    """Volume of the aerofoil between two heights above the platform."""
    blade = PARTS[0]
    heights = np.linspace(low, high, 41)
    areas = []
    for t in heights / blade.span:
        x, y = section(blade, t).T
        chord = (1 - t) * blade.chord_root + t * blade.chord_tip
        areas.append(chord**2 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
    return simpson(areas, x=heights)


def test_a_tip_shroud_is_a_block_over_the_tip(plain):
    given = Shroud(thickness=4e-3, length=42e-3, width=40e-3)
    mesh = wedge_sector(*PARTS, COARSE, Root(), given)
    span = PARTS[0].span
    added = 4e-3 * 42e-3 * 40e-3 - aerofoil_inside(span - 4e-3, span)
    assert volume_of(mesh) - plain == pytest.approx(added, rel=5e-3)
    tip = mesh.points[np.unique(mesh.faces["tip"])]
    np.testing.assert_allclose(tip[:, 0], top() + span, rtol=1e-9)
    assert np.ptp(tip[:, 1]) == pytest.approx(40e-3)
    for side, name in ((-1, "shroud_left"), (1, "shroud_right")):
        area = face_normals(mesh.points, mesh.faces[name], 3).sum(axis=0)
        np.testing.assert_allclose(area, [0, side * 4e-3 * 42e-3, 0], atol=1e-12)
    # the nodes of the tip are still those of the section
    for name in ("tip_leading", "tip_mid", "tip_trailing"):
        assert mesh.points[mesh.nodes[name]][0, 0] == pytest.approx(top() + span)


def test_a_snubber_stands_out_of_both_sides_and_leaves_the_edges(plain):
    given = Shroud(thickness=5e-3, at=0.6, length=12e-3, width=36e-3)
    mesh = wedge_sector(*PARTS, COARSE, Root(lobes=1), given)
    bare = wedge_sector(*PARTS, COARSE, Root(lobes=1))
    block = shroud_block(given, PARTS[0], PARTS[3], top())
    np.testing.assert_allclose(block.high - block.low, [5e-3, 36e-3, 12e-3])
    # the aerofoil's part of the block: less than the whole block
    assert 0.6 < (volume_of(mesh) - volume_of(bare)) / (5e-3 * 36e-3 * 12e-3) < 0.95
    assert set(bare.faces) | {"shroud_left", "shroud_right"} == set(mesh.faces)
    assert mesh.report["min scaled jacobian"] > 0.1


def test_left_out_sizes_cover_the_tip_and_reach_the_gap():
    given = Shroud(thickness=3e-3, gap=2e-3)
    block = shroud_block(given, PARTS[0], PARTS[3], top())
    inner = top() + PARTS[0].span - 3e-3
    # the inner corner's distance from the radial plane midway between two blades
    assert inner * sin(pi / 36) - block.high[1] * cos(pi / 36) == pytest.approx(2e-3 / 2)
    check_sector(*PARTS, Root(), given)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"width": 0.07}, "shroud.width = 70 mm: expected at most 61.5"),
        ({"width": 0.02}, "shroud.width = 20 mm: expected at least 32.1.* to cover the tip"),
        ({"length": 0.02}, "shroud.length = 20 mm: expected at least 39.2.* to cover the tip"),
        ({"thickness": 1e-5}, "shroud.thickness = 10 um: expected 0 mm for none, or at least"),
        ({"gap": 0.04}, "shroud.gap = 40 mm: leaves a block of"),
        ({"at": 0.97}, "shroud.at = 0.97: the block comes within its thickness of the tip"),
        ({"at": 0.5, "length": 0.06}, "shroud.length = 60 mm: expected at most"),
        ({"at": 0.5, "width": 0.004}, "shroud.width = 4 mm: expected at least"),
        ({"at": 0.3, "thickness": 0.05}, "comes within 50 mm of the platform"),
    ],
)
def test_impossible_shrouds_name_the_field(changes, said):
    with pytest.raises(InputError, match=said):
        check_sector(*PARTS, Root(), replace(Shroud(thickness=3e-3), **changes))
