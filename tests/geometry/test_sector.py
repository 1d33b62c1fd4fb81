"""The wedge sector: volumes, pairs, directions, the angle of the wedge, element orders,
determinism, refusals.
"""

from dataclasses import replace
from math import cos, pi, sin, tan

import numpy as np
import pytest
from matplotlib.path import Path
from measure import jacobians, volume
from scipy.integrate import simpson

from bladefem.errors import InputError
from geometry.parameters import DEG, Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from geometry.profile import sector_profile, turn_about_axis
from geometry.section import POINTS_PER_SIDE, section_outline
from geometry.section import section_shape as section
from geometry.sector import wedge_sector
from geometry.sector_check import check_sector
from geometry.topology import EDGES, face_normals

PARTS = {
    "aerofoil": Aerofoil(),
    "platform": Platform(),
    "shank": Shank(),
    "disc": Disc(),
    "wedge": Wedge(),
}
# shapes, not how volumes are filled: gmsh's Delaunay takes a fifth of the time of HXT here, for
# cells as good
COARSE = MeshSize(size=7e-3)
# where cells are what is tested
BY_DEFAULT = MeshSize(size=7e-3)


def build(size=COARSE, **changes):
    parts = {name: replace(part, **changes.get(name, {})) for name, part in PARTS.items()}
    return wedge_sector(*parts.values(), size)


def shoelace(polygon):
    x, y = polygon.T
    return (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def test_volume_of_the_wedge_is_that_of_its_prism(coarse_sector):
    w, p = Wedge(), Platform()
    top = p.gap
    bottom = top + 2 * p.seat_width * sin(w.angle)
    area = (top + bottom) / 2 * p.seat_width * cos(w.angle) + bottom * w.base
    found = volume(coarse_sector.points, coarse_sector.bodies["damper"])
    assert found == pytest.approx(area * w.length, rel=1e-12)


def test_volume_of_the_blade_is_the_sum_of_its_parts(coarse_sector):
    """Disc segment, shank, platform exactly; the aerofoil by its sections. 1e-3: second-order arcs,
    splined skin.
    """
    d, s, p, a = Disc(), Shank(), Platform(), Aerofoil()
    shape = sector_profile(p, s, d, Wedge())
    ring = pi / d.sectors * (d.rim_radius**2 - d.bore_radius**2) * d.width
    half = s.width / 2
    sag = d.rim_radius**2 * np.arcsin(half / d.rim_radius)
    under = sag + half * np.sqrt(d.rim_radius**2 - half**2)  # of the shank's width, below the rim
    neck = ((d.rim_radius + s.height) * s.width - under) * s.length
    plate = np.vstack([shape.seats[0], shape.corners[:1]])
    slab = abs(shoelace(np.vstack([plate, plate[::-1] * [1, -1]]))) * p.length
    stations = np.linspace(0, 1, 201)
    chords = (1 - stations) * a.chord_root + stations * a.chord_tip
    areas = [c**2 * abs(shoelace(section(a, t))) for t, c in zip(stations, chords, strict=True)]
    expected = ring + neck + slab + simpson(areas, x=stations * a.span)
    assert volume(coarse_sector.points, coarse_sector.bodies["blade"]) == pytest.approx(
        expected, rel=1e-3
    )


def test_seats_stand_at_the_angle_of_the_wedge(coarse_sector):
    """Normals of the blade's seats point into the damper, at alpha against the radial plane between
    two blades.
    """
    alpha, theta = Wedge().angle, pi / Disc().sectors
    radial, across = np.array([cos(theta), sin(theta), 0]), np.array([-sin(theta), cos(theta), 0])
    seat = face_normals(coarse_sector.points, coarse_sector.faces["seat_right"], 3)
    unit = seat / np.linalg.norm(seat, axis=1)[:, None]
    np.testing.assert_allclose(
        unit, np.tile(-sin(alpha) * radial + cos(alpha) * across, (len(unit), 1)), atol=1e-12
    )
    flanks = sum(
        face_normals(coarse_sector.points, coarse_sector.faces[f], 3).sum(axis=0)
        for f in ("damper_left", "damper_right")
    )
    area = Platform().seat_width * Wedge().length
    np.testing.assert_allclose(
        flanks, 2 * sin(alpha) * area * radial, atol=1e-12
    )  # N = F / (2 sin alpha)
    low = face_normals(coarse_sector.points, coarse_sector.faces["cyclic_low"], 3).sum(axis=0)
    assert low[1] < 0


@pytest.mark.parametrize(
    "name, angle", [("cyclic", 2 * pi / 36), ("this", 0.0), ("next", 2 * pi / 36)]
)
def test_pairs_match_to_rounding_with_their_middle_nodes(coarse_sector, name, angle):
    motion = turn_about_axis(angle)
    pair, x = coarse_sector.pairs[name], coarse_sector.points
    np.testing.assert_allclose(pair.rotation, motion, atol=1e-15)
    np.testing.assert_allclose(
        x[pair.nodes[1]], x[pair.nodes[0]] @ motion.T, rtol=0, atol=1e-12 * 0.2
    )
    assert set(pair.nodes[0]) == set(np.unique(coarse_sector.faces[pair.master]))
    assert set(pair.nodes[1]) == set(np.unique(coarse_sector.faces[pair.slave]))


def test_cut_faces_belong_to_the_disc_only(coarse_sector):
    x = coarse_sector.points[np.unique(coarse_sector.faces["cyclic_high"])]
    radius = np.hypot(x[:, 0], x[:, 1])
    assert radius.max() == pytest.approx(Disc().rim_radius) and radius.min() == pytest.approx(
        Disc().bore_radius
    )
    np.testing.assert_allclose(np.arctan2(x[:, 1], x[:, 0]), pi / 36, atol=1e-12)
    on_blade = coarse_sector.points[np.unique(coarse_sector.bodies["blade"])]
    assert np.abs(np.arctan2(on_blade[:, 1], on_blade[:, 0])).max() <= pi / 36 + 1e-12


def test_every_cell_is_positive_inside_and_its_middle_nodes_are_near_the_middle(coarse_sector):
    rng = np.random.default_rng(1)
    where = rng.dirichlet(np.ones(4), 40)
    for cells in coarse_sector.bodies.values():
        assert jacobians(coarse_sector.points, cells, where).min() > 0
        for i, (a, b) in enumerate(EDGES["tetra"]):
            ends = coarse_sector.points[cells[:, [a, b]]]
            off = np.linalg.norm(coarse_sector.points[cells[:, 4 + i]] - ends.mean(axis=1), axis=1)
            assert (off / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)).max() < 0.41


def test_the_leading_edge_is_a_line_of_nodes_on_a_smooth_nose(coarse_sector):
    """Both sides share nodes at the nose of every section, 0.6 of the element size apart, so
    nothing is notched.
    """
    blade, top = (
        Aerofoil(),
        sector_profile(*[PARTS[k] for k in ("platform", "shank", "disc", "wedge")]).top,
    )
    shared = np.intersect1d(
        coarse_sector.faces["suction_side"], coarse_sector.faces["pressure_side"]
    )
    edge = coarse_sector.points[shared[np.argsort(coarse_sector.points[shared, 0])]]
    noses = np.array(
        [
            section_outline(blade, top, (x - top) / blade.span)[POINTS_PER_SIDE - 1]
            for x in edge[:, 0]
        ]
    )
    np.testing.assert_allclose(edge, noses, atol=2e-5)  # the loft is a spline through 5 sections
    assert edge[0, 0] == pytest.approx(top) and edge[-1, 0] == pytest.approx(top + blade.span)
    assert (
        np.linalg.norm(np.diff(edge, axis=0), axis=1).max() < 0.6 * COARSE.size
    )  # middle nodes halve the edges


def test_middle_nodes_of_the_seats_are_exactly_in_the_middle(coarse_sector):
    for name in ("seat_left", "seat_right", "damper_left", "damper_right"):
        x = coarse_sector.points[coarse_sector.faces[name]]
        np.testing.assert_allclose(x[:, 3:], (x[:, [0, 1, 2]] + x[:, [1, 2, 0]]) / 2, atol=1e-16)


@pytest.mark.parametrize(
    ("given", "across", "along"),
    [
        ({"seat_elements": 8}, 8, 6),
        ({"seat_elements": 5, "contact_size": 5e-3}, 5, 8),
        ({"seat_elements": 8, "scale": 2.0}, 4, 3),
    ],
)
def test_seats_in_a_grid_have_equal_elements_across_and_along(coarse_sector, given, across, along):
    """Corner nodes of both sides stand where they should; volumes stay what they are but for curved
    faces.
    """
    mesh, length, width = build(replace(COARSE, **given)), Wedge().length, Platform().seat_width
    for body in ("blade", "damper"):
        expected = volume(coarse_sector.points, coarse_sector.bodies[body])
        assert volume(mesh.points, mesh.bodies[body]) == pytest.approx(expected, rel=1e-3)
    for name in ("seat_left", "seat_right", "damper_left", "damper_right"):
        corners = mesh.points[np.unique(mesh.faces[name][:, :3])]
        slope = corners - corners[np.argmin(corners[:, 0])]
        places = np.column_stack(
            [slope[:, 2] - slope[:, 2].min(), np.linalg.norm(slope[:, :2], axis=1)]
        )
        grid = np.stack(
            np.meshgrid(
                np.linspace(0, length, along + 1), np.linspace(0, width, across + 1), indexing="ij"
            ),
            axis=-1,
        ).reshape(-1, 2)
        assert len(places) == len(grid)
        np.testing.assert_allclose(sorted(map(tuple, np.round(places, 9))), grid, atol=2e-9)
    assert mesh.pairs["this"].nodes.shape == mesh.pairs["next"].nodes.shape
    cells = mesh.points[mesh.faces["seat_right"][:, :3]]
    parts = np.linalg.norm(np.cross(cells[:, 1] - cells[:, 0], cells[:, 2] - cells[:, 0]), axis=1)
    corners = mesh.faces["seat_right"][:, :3]
    area = np.bincount(corners.ravel(), np.repeat(parts / 6, 3))[np.unique(corners)]
    # inner nodes stand for one cell each, whatever the diagonals' direction
    inner = np.isclose(area, length * width / across / along, rtol=1e-6)
    assert inner.sum() == (across - 1) * (along - 1)


def test_tip_nodes_stand_on_the_section_whatever_the_mesh(coarse_sector):
    x = {name: coarse_sector.points[nodes[0]] for name, nodes in coarse_sector.nodes.items()}
    top = sector_profile(*[PARTS[k] for k in ("platform", "shank", "disc", "wedge")]).top
    section_points = section_outline(Aerofoil(), top, 1)
    np.testing.assert_allclose(x["tip_trailing"], section_points[0], atol=1e-9)
    np.testing.assert_allclose(
        x["tip_leading"], section_points[len(section_points) // 2], atol=1e-9
    )
    middle = (section_points[0] + section_points[-1]) / 2
    assert np.linalg.norm(x["tip_leading"] - middle) == pytest.approx(
        Aerofoil().chord_tip, rel=1e-9
    )
    assert np.linalg.norm(x["tip_mid"] - (x["tip_leading"] + middle) / 2) == pytest.approx(
        Aerofoil().camber * Aerofoil().chord_tip, rel=1e-9
    )
    assert all(len(nodes) == 1 for nodes in coarse_sector.nodes.values())


def test_eight_elements_across_are_those_of_the_size_left_open(coarse_sector):
    given = build(replace(COARSE, seat_elements=8))
    np.testing.assert_array_equal(given.points, coarse_sector.points)


def test_a_mesh_is_the_same_twice(coarse_sector):
    np.testing.assert_array_equal(build().points, coarse_sector.points)
    first, second = build(BY_DEFAULT), build(BY_DEFAULT)
    np.testing.assert_array_equal(first.points, second.points)


def test_the_default_mesh_is_fine_enough():
    mesh = build(MeshSize())
    assert 3 * len(mesh.points) >= 60_000
    for name in ("seat_left", "seat_right"):
        assert len(np.unique(mesh.faces[name][:, :3])) >= 30
    # frequencies are more accurate than with HXT's cells, whose worst is 0.1
    assert mesh.report["min scaled jacobian"] > 0.1 and mesh.report["worst quality"] > 0.05


def test_first_order_and_straight_meshes():
    assert build(replace(COARSE, order=1)).cell_type == "tetra"
    straight = build(replace(COARSE, curved=False))
    assert straight.report["straightened"] == 0
    assert straight.report["min scaled jacobian"] == pytest.approx(1, abs=1e-6)


def test_clearance_moves_the_wedge_inwards():
    gap = 2e-4
    mesh = build(wedge={"clearance": gap})
    for name, seat in (("this", "seat_right"), ("next", "seat_left")):
        pair = mesh.pairs[name]
        normal = face_normals(mesh.points, mesh.faces[seat], 3).sum(axis=0)
        normal = pair.rotation @ normal / np.linalg.norm(normal)
        opening = (
            mesh.points[pair.nodes[1]] - mesh.points[pair.nodes[0]] @ pair.rotation.T
        ) @ normal
        np.testing.assert_allclose(opening, gap, atol=1e-15)
        np.testing.assert_allclose(
            mesh.points[pair.nodes[1]],
            mesh.points[pair.nodes[0]] @ pair.rotation.T + pair.shift,
            atol=1e-14,
        )


@pytest.mark.parametrize(
    "changes",
    [
        {"wedge": {"length": 0.06}},
        {"aerofoil": {"section": "biconvex"}},
        {"aerofoil": {"lean": 0.15, "sweep": -0.2}},
        {"disc": {"sectors": 30}},
    ],
)
def test_variants_are_meshed(changes):
    mesh = build(BY_DEFAULT, **changes)
    assert mesh.report["min scaled jacobian"] > 0
    assert set(mesh.pairs) == {"cyclic", "this", "next"}


def test_a_thin_straight_part_of_the_damper_gets_shorter_elements():
    """0.2 mm below the flanks: with seats of six elements, 6.7 mm long, flat cells were left."""
    size = MeshSize(size=1.4e-2, seat_elements=3)
    mesh = build(size, wedge={"base": 2e-4})
    assert mesh.report["worst quality"] > 0.04
    assert "notes" not in mesh.report


def test_fillet_is_a_quarter_groove_round_the_root():
    """Its nodes lie on the outline moved outwards by the arc; a spline between its points is off it
    by 3.9 %.
    """
    radius, blade = 2e-3, Aerofoil()
    mesh = build(replace(BY_DEFAULT, size=5e-3), aerofoil={"fillet": radius})
    top = sector_profile(*[PARTS[k] for k in ("platform", "shank", "disc", "wedge")]).top
    for point in mesh.points[np.unique(mesh.faces["fillet"][:, :3])]:
        height = (point[0] - top) * cos(pi / 12)
        out = radius * (1 - np.sqrt(max(0.0, 1 - (cos(pi / 12) - height / radius) ** 2)))
        ring = section_outline(blade, top, (point[0] - top) / blade.span, out)
        fine = np.vstack(
            [np.linspace(a, b, 60) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
        )
        assert np.linalg.norm(fine - point, axis=1).min() < 0.045 * radius
    assert mesh.report["min scaled jacobian"] > 0.1


@pytest.mark.parametrize(("asked", "over"), [({}, 2), ({"fillet_elements": 3}, 3)])
def test_fillet_is_a_grid_of_elements_over_its_arc(asked, over):
    """A closed grid of n rows has (n + 1) / (2 n) corner nodes a triangle. Where the number is left
    open it is 4 at the automatic size, 3.1 mm, and in proportion otherwise.
    """
    faces = build(replace(COARSE, size=6e-3, **asked), aerofoil={"fillet": 2e-3}).faces["fillet"]
    assert 2 * over * len(np.unique(faces[:, :3])) == (over + 1) * len(faces)


@pytest.mark.parametrize(
    "changes, field",
    [
        ({"disc": {"bore_radius": 0.2}}, "disc.bore_radius"),
        ({"shank": {"width": 0.04}}, "shank.width"),
        ({"shank": {"length": 0.05}}, "shank.length"),
        ({"shank": {"length": 0.0448}}, "shank.length.*before disc.width"),
        ({"platform": {"gap": 0.03}}, "platform.gap"),
        ({"platform": {"seat_width": 0.02}}, "platform.seat_width"),
        ({"wedge": {"length": 0.061}}, "damper.length"),
        ({"wedge": {"base": 0.029}}, "damper.base"),
        ({"aerofoil": {"chord_root": 0.09}}, "aerofoil.chord_root"),
        ({"aerofoil": {"stagger": 1.2}}, "aerofoil.stagger"),
        ({"disc": {"sectors": 60}}, "platform|shank"),
        ({"aerofoil": {"fillet": 0.009}}, "aerofoil.fillet|overhangs"),
        ({"aerofoil": {"chord_root": 0.056}}, "chord_root = 56 mm: .* axially by 498 um"),
        # where the gap is too wide, the gap is among what to change
        (
            {"platform": {"gap": 0.019}, "shank": {"width": 0.01}},
            "circumferentially .* or platform.gap, or fewer disc.sectors",
        ),
        ({"wedge": {"angle": 81 * DEG}}, "damper.angle = 81 deg is too large.* 80 deg"),
    ],
)
def test_impossible_proportions_name_the_field(changes, field):
    with pytest.raises(InputError, match=field) as caught:
        build(**changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("chord, clear", [(0.075, True), (0.085, False), (0.1, False)])
def test_aerofoils_that_run_into_each_other_are_refused(chord, clear):
    """Nearly circumferential tips, 63 mm apart. Points along the edges of one tip, turned to the next
    blade, are in its polygon or not.
    """
    blade = replace(Aerofoil(), twist=60 * DEG, chord_tip=chord)
    parts = (blade, *[PARTS[k] for k in ("platform", "shank", "disc", "wedge")])
    corners = section_outline(blade, sector_profile(*parts[1:]).top, 1.0)
    ends = np.roll(corners, -1, axis=0)
    edge = np.vstack(
        [a + np.linspace(0, 1, 20)[:, None] * (b - a) for a, b in zip(corners, ends, strict=True)]
    )
    turned = edge @ turn_about_axis(2 * pi / Disc().sectors).T
    assert Path(corners[:, 1:]).contains_points(turned[:, 1:]).any() != clear
    if clear:
        check_sector(*parts)
    else:
        with pytest.raises(
            InputError, match=f"aerofoil.chord_tip = {1e3 * chord:g} mm: .* next one"
        ):
            check_sector(*parts)


def test_slope_of_the_platform_at_the_midplane():
    """The corner points of the profile: edge at half the gap from the radial plane between the
    blades.
    """
    shape = sector_profile(*[PARTS[k] for k in ("platform", "shank", "disc", "wedge")])
    for x, y in (shape.seats[0, 1], shape.corners[0]):
        assert (x * tan(shape.theta) - y) * cos(shape.theta) == pytest.approx(Platform().gap / 2)
    assert np.linalg.norm(shape.seats[0, 1] - shape.seats[0, 0]) == pytest.approx(
        Platform().seat_width
    )
