"""Stresses against closed forms: bar, beam, thick ring under pressure (Lame), rotating disc,
harmonic combinations.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, sector

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain, expand_to_mesh, in_step, restrict_load
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.linear_preload import unit_speed_displacement
from bladefem.fem.loads import surface_load
from bladefem.fem.modes import modes
from bladefem.fem.preload import preload
from bladefem.fem.stress import (
    gauss_and_nodal_stress,
    gauss_stress,
    nodal_stress,
    principal_stresses,
    von_mises,
)
from bladefem.scene.tables import Material

STEEL = Material()
ALL = ["tetra", "tetra10", "hexahedron", "hexahedron27"]


def static(body, load, clamp="clamp"):
    con = in_step(body, clamp)
    return expand_to_mesh(con, compliance(flexible(con), restrict_load(con, load.reshape(-1, 1))))[
        :, :, 0
    ]


@pytest.mark.parametrize("cell_type", [*ALL, "triangle6", "quad9", "quad", "triangle"])
def test_uniform_strain_is_exact(cell_type):
    """Every element represents a linear field; the stress is Hooke's law to rounding, at points and
    nodes.
    """
    d = 2 if cell_type.startswith(("tri", "quad")) else 3
    body = assemble(
        box((2,) * d, (1.0,) * d, cell_type), "blade", STEEL, MPI.COMM_SELF, plane="strain"
    )
    slope = np.zeros((3, 3))
    slope[:d, :d] = np.random.default_rng(0).standard_normal((d, d)) * 1e-4
    u = body.mesh.points @ slope.T
    strain = (slope + slope.T) / 2
    lam = STEEL.E * STEEL.nu / (1 + STEEL.nu) / (1 - 2 * STEEL.nu)
    exact = STEEL.E / (1 + STEEL.nu) * strain + lam * np.trace(strain) * np.eye(3)
    exact = exact[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
    found = gauss_stress(body, u)
    np.testing.assert_allclose(
        found.stress, np.broadcast_to(exact, found.stress.shape), atol=1e-11 * abs(exact).max()
    )
    np.testing.assert_allclose(
        nodal_stress(body, u), np.tile(exact, (len(u), 1)), atol=1e-11 * abs(exact).max()
    )
    assert found.volume.sum() == pytest.approx(1.0)


def test_bar_under_tension():
    material = replace(STEEL, nu=0.0)
    body = assemble(box((3, 1, 1), (1.0, 0.1, 0.1)), "blade", material, MPI.COMM_SELF)
    u = static(body, surface_load(body, "x1", traction=(1e6, 0, 0)))
    s = nodal_stress(body, u)
    np.testing.assert_allclose(von_mises(s), 1e6, rtol=1e-9)
    np.testing.assert_allclose(principal_stresses(s), np.tile([1e6, 0, 0], (len(s), 1)), atol=1e-3)


def test_cantilever_under_a_tip_force():
    """Bending stress F (L - x) y / I away from the ends, and the parabolic shear; P2 hexahedra,
    measured 4e-4.
    """
    L, b, h, force = 1.0, 0.05, 0.1, 1000.0
    body = assemble(
        box((12, 4, 1), (L, h, b), "hexahedron27", origin=(0, -h / 2, 0)),
        "blade",
        replace(STEEL, nu=0.0),
        MPI.COMM_SELF,
    )
    u = static(body, surface_load(body, "x1", traction=(0, force / (b * h), 0)))
    x, y = body.mesh.points[:, 0], body.mesh.points[:, 1]
    middle = abs(x - L / 2) < 0.2
    s = nodal_stress(body, u)[middle]
    inertia = b * h**3 / 12
    peak = force * L / 2 * h / 2 / inertia
    np.testing.assert_allclose(
        s[:, 0], -force * (L - x[middle]) * y[middle] / inertia, atol=2e-3 * peak
    )
    shear = 1.5 * force / (b * h)
    assert s[abs(y[middle]) < 1e-12, 3] == pytest.approx(shear, rel=0.05)


@pytest.mark.parametrize("cell_type, tolerance", [("tetra10", 0.02), ("hexahedron27", 0.02)])
def test_thick_ring_under_pressure(cell_type, tolerance):
    """Lame: hoop stress at the bore p (b^2 + a^2) / (b^2 - a^2), radial -p; plane stress by free
    sides.

    Nodal values of a 6 by 4 mesh: measured 1.4 % of the largest hoop stress.
    """
    a, b, p = 0.1, 0.2, 1e7
    mesh = sector(8, (6, 4, 1), cell_type, inner=a, outer=b, width=0.01)
    body = assemble(mesh, "blade", replace(STEEL, nu=0.3), MPI.COMM_SELF)
    u = static(body, surface_load(body, "x0", pressure=p), None)
    r = np.hypot(*mesh.points[:, :2].T)
    big = principal_stresses(nodal_stress(body, u))
    hoop = p * a**2 / (b**2 - a**2) * (1 + b**2 / r**2)
    radial = p * a**2 / (b**2 - a**2) * (1 - b**2 / r**2)
    np.testing.assert_allclose(big[:, 0], hoop, atol=tolerance * hoop.max())
    np.testing.assert_allclose(big[:, 2], radial, atol=1.5 * tolerance * hoop.max())
    exact = von_mises(np.stack([hoop, radial, *[0 * r] * 4], 1))
    np.testing.assert_allclose(
        von_mises(nodal_stress(body, u)), exact, atol=2 * tolerance * exact.max()
    )


def test_rotating_ring_keeps_its_hoop_stress():
    """rho Omega^2 R^2 in a thin ring; after large displacements rho Omega^2 R r, the section stays
    with nu = 0.
    """
    ring = Material(E=2e11, nu=0.0, rho=8000.0)
    mesh = sector(8, (1, 4, 1), "hexahedron27", inner=0.995, outer=1.005, width=0.01)
    body = assemble(mesh, "blade", ring, MPI.COMM_SELF)
    speed = 200.0

    def hoop(u, large=False):
        found = gauss_stress(body, u, large=large)
        return (principal_stresses(found.stress)[..., 0] * found.volume).sum() / found.volume.sum()

    linear = hoop(speed**2 * unit_speed_displacement(flexible(in_step(body, None))))
    assert linear == pytest.approx(ring.rho * speed**2, rel=1e-4)
    strain = linear / ring.E
    assert hoop(preload(body, speed, None).displacement, True) == pytest.approx(
        linear * (1 + strain), rel=2e-5
    )


def test_largest_stress_of_a_period():
    """The closed form of the von Mises stress against a fine sampling of the period."""
    rng = np.random.default_rng(3)
    s = rng.standard_normal((50, 6)) + 1j * rng.standard_normal((50, 6))
    turns = np.exp(2j * np.pi * np.arange(2000) / 2000)
    sampled = np.max([von_mises((s * t).real) for t in turns], axis=0)
    np.testing.assert_allclose(von_mises(s), sampled, rtol=1e-5)
    tensors = [np.array([[x[0], x[3], x[5]], [x[3], x[1], x[4]], [x[5], x[4], x[2]]]) for x in s]
    exact = [
        np.max([np.linalg.eigvalsh((x * t).real)[::-1] for t in turns[::25]], axis=0)
        for x in tensors
    ]
    largest = np.array(exact)[:, 0]  # the others have corners over the period, sampled less exactly
    np.testing.assert_allclose(principal_stresses(s)[:, 0], largest, rtol=5e-3)
    swinging = np.linalg.eigvalsh(np.array(tensors).real)[:, ::-1]
    np.testing.assert_allclose(
        principal_stresses(s.real + 0j)[:, 0],
        np.maximum(swinging[:, 0], -swinging[:, 2]),
        rtol=1e-7,
    )
    assert (principal_stresses(s)[:, 0] >= principal_stresses(s.real)[:, 0]).all()
    real = s.real + 0j
    np.testing.assert_allclose(von_mises(real), von_mises(s.real))


def test_modes_of_a_wheel_have_complex_stress():
    body = assemble(sector(6, (2, 2, 1), bump=0.2), "blade", STEEL, MPI.COMM_SELF)
    shape = modes(constrain(body, "clamp", 2), 1).shapes[0]
    s = nodal_stress(body, shape)
    assert np.iscomplexobj(s)
    turned = nodal_stress(body, shape * np.exp(0.7j))
    np.testing.assert_allclose(von_mises(turned), von_mises(s))


def test_two_materials_keep_their_own_stress():
    """In series both carry the same traction; where they meet no mixture of their cells may appear
    across them.
    """
    mesh = box((2, 2, 1), (1.0, 0.2, 0.1), "hexahedron27")
    cells = mesh.bodies["blade"]
    low = mesh.points[cells].mean(1)[:, 1] < 0.1
    mesh = replace(mesh, bodies={"a": cells[low], "b": cells[~low]})
    body = assemble(
        mesh, ("a", "b"), {"a": Material(nu=0.0), "b": Material(E=1e11, nu=0.0)}, MPI.COMM_SELF
    )
    u = np.zeros_like(mesh.points)
    u[:, 0] = 1e-5 * mesh.points[:, 0]
    s = nodal_stress(body, u)[:, 0]
    assert (
        set(np.round(s / 1e5, 6)) == {21.0, 10.0}
        and (s[mesh.points[:, 1] == 0.1] / 1e5).round(6).min() == 21.0
    )


def test_both_stresses_at_once():
    """At Gauss points and nodes, of a complex field."""
    mesh = sector(9, (2, 2, 1), "tetra10", bump=0.2)
    body = assemble(mesh, "blade", STEEL, MPI.COMM_SELF)
    rng = np.random.default_rng(2)
    u = rng.normal(size=mesh.points.shape) + 1j * rng.normal(size=mesh.points.shape)
    at_points, at_nodes = gauss_and_nodal_stress(body, u)
    np.testing.assert_array_equal(at_points.stress, gauss_stress(body, u).stress)
    np.testing.assert_array_equal(at_points.volume, gauss_stress(body, u).volume)
    np.testing.assert_array_equal(at_nodes, nodal_stress(body, u))


def test_wrong_fields():
    body = assemble(box((1, 1, 1), (1, 1, 1), "tetra"), "blade", STEEL, MPI.COMM_SELF)
    with pytest.raises(InputError, match="shape"):
        gauss_stress(body, np.zeros((3, 3)))
    with pytest.raises(InputError, match="complex"):
        gauss_stress(body, np.zeros((8, 3), complex), large=True)
    with pytest.raises(InputError, match="not finite"):
        gauss_stress(body, np.full((8, 3), np.nan))
