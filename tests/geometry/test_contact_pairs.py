"""Blocks for the verification of contact, and the Z-shaped mass: shapes, matched nodes, gaps,
refusals.
"""

import numpy as np
import pytest
from measure import volume

from bladefem.errors import InputError
from geometry.contact_pairs import hertz_pair, mesh_punch
from geometry.jacobian import straight_jacobian
from geometry.parameters import HertzPair, MeshSize, Punch, ZMass
from geometry.topology import face_normals
from geometry.zmass import z_mass

COARSE = MeshSize(size=4e-3, contact_size=4e-4)


@pytest.mark.parametrize("dimension", [2, 3])
def test_hertz_gap_is_that_of_the_sphere(dimension):
    hertz = HertzPair(dimension=dimension)
    mesh = hertz_pair(hertz, COARSE)
    pair, x = mesh.pairs["this"], mesh.points
    assert (pair.master, pair.slave) == ("seat_right", "damper_left")
    gap = x[pair.nodes[1]] - x[pair.nodes[0]]
    np.testing.assert_allclose(np.delete(gap, dimension - 1, axis=1), 0, atol=1e-15)
    r2 = np.square(x[pair.nodes[0]]).sum(axis=1)
    np.testing.assert_allclose(
        gap[:, dimension - 1], hertz.radius - np.sqrt(hertz.radius**2 - r2), atol=1e-12
    )
    assert r2.max() == pytest.approx((2 * hertz.contact_radius) ** 2)
    up = face_normals(x, mesh.faces["seat_right"], dimension)
    assert (up[:, dimension - 1] > 0).all() and np.abs(
        np.delete(up, dimension - 1, axis=1)
    ).max() < 1e-15
    assert mesh.report["min scaled jacobian"] > 0.5


def test_hertz_volume_of_the_bent_block():
    """The indenter loses the integral of its sag over the height, half of it on average:
    second-order cells to 1e-5.
    """
    hertz = HertzPair()
    mesh = hertz_pair(hertz, COARSE)
    w, R = hertz.half_width, hertz.radius
    x, weight = np.polynomial.legendre.leggauss(12)
    x, weight = (x + 1) * w / 2, weight * w / 2
    sag = R - np.sqrt(R**2 - x[:, None] ** 2 - x[None] ** 2)
    assert volume(mesh.points, mesh.bodies["blade"]) == pytest.approx(w**3, rel=1e-10)
    assert volume(mesh.points, mesh.bodies["damper"]) == pytest.approx(
        w**3 - weight @ sag @ weight, rel=1e-5
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_punch_has_its_area_pair_and_faces(dimension):
    block = Punch(dimension=dimension)
    mesh = mesh_punch(block, COARSE)
    area = np.linalg.norm(
        face_normals(mesh.points, mesh.faces["seat_right"], dimension), axis=1
    ).sum()
    assert area == pytest.approx(
        block.radius if dimension == 2 else np.pi * block.radius**2 / 4, rel=1e-2
    )
    pair = mesh.pairs["this"]
    np.testing.assert_allclose(mesh.points[pair.nodes[0]], mesh.points[pair.nodes[1]], atol=1e-16)
    for axis, name in enumerate(("symmetry_x", "symmetry_y")[: dimension - 1]):
        assert np.abs(mesh.points[np.unique(mesh.faces[name])][:, axis]).max() < 1e-15
    far = mesh.points[np.unique(mesh.faces["clamp"])][:, dimension - 1]
    np.testing.assert_allclose(far, -block.half_width, rtol=1e-12)


def test_a_z_mass_has_its_volume_and_faces():
    z = ZMass()
    mesh = z_mass(z, MeshSize())
    area = 2 * z.width * z.bar + (z.height - 2 * z.bar) * z.bar
    assert volume(mesh.points, mesh.bodies["damper"]) == pytest.approx(
        area * z.thickness, rel=1e-12
    )
    assert straight_jacobian(mesh.points, mesh.bodies["damper"], "tetra").min() > 0
    for name, height, sense in (("footprint", 0.0, -1), ("top", z.thickness, 1)):
        assert np.abs(mesh.points[np.unique(mesh.faces[name])][:, 2] - height).max() < 1e-15
        assert face_normals(mesh.points, mesh.faces[name], 3).sum(axis=0)[2] == pytest.approx(
            sense * area
        )


@pytest.mark.parametrize(
    "build, part, field",
    [
        (z_mass, ZMass(bar=0.031), "z_mass.bar"),
        (hertz_pair, HertzPair(contact_radius=6e-3), "hertz.contact_radius"),
        (hertz_pair, HertzPair(radius=0.012), "hertz.half_width"),
        (mesh_punch, Punch(radius=0.015), "punch.radius"),
    ],
)
def test_parts_that_do_not_fit_into_each_other_are_refused(build, part, field):
    with pytest.raises(InputError, match=field):
        build(part, MeshSize())


def test_contact_size_larger_than_the_contact():
    with pytest.raises(InputError, match=r"mesh\.contact_size"):
        mesh_punch(Punch(), MeshSize(contact_size=3e-3))
