"""Load vectors against closed forms."""

import numpy as np
import pytest
from structured import box, sector

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.loads import body_mass, body_volume, centrifugal, surface_load
from bladefem.scene.tables import Material


@pytest.mark.parametrize("cell_type", ["tetra10", "hexahedron27", "tetra", "triangle6", "quad9"])
def test_volume_and_centrifugal_resultant(cell_type):
    divisions = (3, 2, 2) if cell_type[0] in "th" and not cell_type.startswith("tri") else (3, 2)
    mesh = box(divisions, (2.0, 1.0, 0.5)[: len(divisions)], cell_type, depth=0.5)
    body = assemble(mesh, "blade", Material(rho=1000.0))
    assert body_volume(mesh, "blade") == pytest.approx(1.0, rel=1e-13)
    assert body_mass(body) == pytest.approx(1000.0, rel=1e-13)
    force = centrifugal(body, 3.0).reshape(-1, body.dim).sum(0)  # m w^2 r of the centre of mass
    np.testing.assert_allclose(force[:2], 1000 * 9 * np.array([1.0, 0.5]), rtol=1e-12)


@pytest.mark.parametrize("cell_type", ["tetra10", "hexahedron27", "tetra", "hexahedron"])
def test_closed_surface_under_pressure(cell_type):
    """Pressure on all six faces gives no resultant; on one face p A, towards the body."""
    mesh = box((2, 2, 1), (2.0, 1.0, 0.5), cell_type)
    body = assemble(mesh, "blade", Material())
    loads = {
        face: surface_load(body, face, pressure=7.0).reshape(-1, 3).sum(0)
        for face in ("x0", "x1", "y0", "y1", "z0", "z1")
    }
    np.testing.assert_allclose(sum(loads.values()), 0, atol=1e-12)
    np.testing.assert_allclose(loads["x0"], [7 * 0.5, 0, 0], atol=1e-12)
    top = surface_load(body, "z1", traction=(1, 2, 3)).reshape(-1, 3).sum(0)
    np.testing.assert_allclose(top, [2, 4, 6], rtol=1e-12)


def test_pressure_on_a_curved_face():
    """Inside of a ring sector: the resultant is p times the projected area (the P2 arc is 3e-6 off
    the circle).
    """
    mesh = sector(8, (2, 3, 1), "tetra10", inner=0.2, width=0.1)
    body = assemble(mesh, "blade", Material())
    force = surface_load(body, "x0", pressure=1.0).reshape(-1, 3).sum(0)
    np.testing.assert_allclose(
        force, 0.2 * 0.1 * np.array([np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), 0]), atol=1e-7
    )


def test_unknown_face_is_suggested():
    body = assemble(box((1, 1, 1), (1.0, 1.0, 1.0), "tetra"), "blade", Material())
    with pytest.raises(InputError, match="no face 'clmp'; did you mean 'clamp'"):
        surface_load(body, "clmp", pressure=1.0)
    with pytest.raises(InputError, match="exactly one"):
        surface_load(body, "clamp")
