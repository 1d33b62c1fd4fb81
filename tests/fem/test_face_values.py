"""Values at places on the faces of a mesh from its nodes."""

import numpy as np
import pytest
from structured import box, sector

from bladefem.errors import InputError
from bladefem.fem.face_values import face_values


@pytest.mark.parametrize("cell_type", ["tetra", "tetra10", "hexahedron", "hexahedron27"])
def test_polynomials_of_the_elements_come_through(cell_type):
    """Linear ones of first order, quadratic ones of second; forces keep resultant and moment."""
    mesh = box((3, 2, 2), (1.0, 0.7, 0.4), cell_type)
    inside = np.random.default_rng(1).uniform(0, 1, size=(40, 3)) * [1.0, 0.7, 0.0]
    P = face_values(mesh, ["z0"], inside)
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    second = cell_type in ("tetra10", "hexahedron27")
    values = x**2 - 2 * x * y + 3 * y if second else 2 * x - y + 1
    a, b = inside[:, 0], inside[:, 1]
    expected = a**2 - 2 * a * b + 3 * b if second else 2 * a - b + 1
    np.testing.assert_allclose(P @ values, expected, atol=1e-10)
    forces = np.random.default_rng(2).normal(size=(40, 3))
    moved = P.T @ forces
    np.testing.assert_allclose(moved.sum(axis=0), forces.sum(axis=0), atol=1e-10)
    moment = np.cross(mesh.points, moved).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross(inside, forces).sum(axis=0), atol=1e-10)


def test_nodes_are_themselves_on_curved_faces():
    mesh = sector(6, (3, 2, 1), "tetra10", bump=0.1)
    nodes = np.unique(mesh.faces["cyclic_low"])
    P = face_values(mesh, ["cyclic_low"], mesh.points[nodes])
    np.testing.assert_array_equal(P.indices, nodes)
    assert (P.data == 1).all()


def test_place_off_the_faces_is_refused():
    mesh = sector(6, (3, 2, 1), "tetra10")
    away = mesh.points[mesh.faces["cyclic_low"][0]] + [0.0, 0.0, 0.1]
    with pytest.raises(InputError, match="mm away from them, expected the same faces"):
        face_values(mesh, ["cyclic_low"], away)
