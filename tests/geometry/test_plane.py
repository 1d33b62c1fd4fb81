"""Plane blades: areas, matched seats, directions and names."""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.errors import InputError
from geometry.jacobian import straight_jacobian
from geometry.parameters import MeshSize, Plane
from geometry.plane import plane_blades
from geometry.topology import face_normals

PLANE = Plane()


@pytest.fixture(scope="module")
def mesh():
    return plane_blades(PLANE, MeshSize())


def area(mesh, body):
    return straight_jacobian(mesh.points, mesh.bodies[body], mesh.cell_type).sum() / 2


def test_areas_are_those_of_the_rectangles(mesh):
    blade = PLANE.length * PLANE.thickness + PLANE.platform_thickness * (
        PLANE.platform_width - PLANE.thickness
    )
    damper = PLANE.damper_height * (PLANE.pitch - PLANE.platform_width + 2 * PLANE.seat_width)
    assert area(mesh, "blade") == pytest.approx(blade, rel=1e-12)
    assert area(mesh, "damper") == pytest.approx(damper, rel=1e-12)


@pytest.mark.parametrize("name, shift", [("this", 0.0), ("next", PLANE.pitch)])
def test_seats_match_to_rounding(mesh, name, shift):
    pair = mesh.pairs[name]
    assert pair.shift == pytest.approx([0, shift, 0])
    np.testing.assert_allclose(
        mesh.points[pair.nodes[1]], mesh.points[pair.nodes[0]] + pair.shift, atol=1e-16
    )
    assert set(pair.nodes[0]) == set(np.unique(mesh.faces[pair.master]))
    assert set(pair.nodes[1]) == set(np.unique(mesh.faces[pair.slave]))
    assert not set(mesh.bodies["blade"].ravel()) & set(mesh.bodies["damper"].ravel())


@pytest.mark.parametrize(
    "face, outward",
    [
        ("seat_left", [-PLANE.seat_width, 0]),
        ("seat_right", [-PLANE.seat_width, 0]),
        ("damper_left", [PLANE.seat_width, 0]),
        ("clamp", [-PLANE.thickness, 0]),
        ("tip", [PLANE.thickness, 0]),
    ],
)
def test_edges_look_out_of_their_body(mesh, face, outward):
    total = face_normals(mesh.points, mesh.faces[face], 2).sum(axis=0)
    np.testing.assert_allclose(total[:2], outward, atol=1e-15)


def test_tip_nodes_and_depth(mesh):
    assert mesh.points[mesh.nodes["tip_mid"]].tolist() == [[PLANE.length, 0, 0]]
    assert mesh.depth == PLANE.depth and mesh.sector.count == 0 and mesh.dimension == 2


@pytest.mark.parametrize(
    "change, field",
    [
        ({"platform_width": 0.06}, "plane.platform_width"),
        ({"seat_width": 0.03}, "plane.seat_width"),
        ({"thickness": 0.051}, "plane.thickness"),
        ({"platform_height": 0.149}, "plane.platform_height"),
        ({"damper_height": 0.05}, "plane.damper_height"),
    ],
)
def test_impossible_proportions_name_the_field(change, field):
    with pytest.raises(InputError, match=field):
        plane_blades(replace(PLANE, **change), MeshSize())
