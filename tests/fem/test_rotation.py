"""Rotation against closed forms and tables: rotating cantilever (Wright 1982), ring, sector against
full wheel.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, sector, wheel
from twisted import twisted

from bladefem.errors import InputError, NotSolvedError
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain, in_step
from bladefem.fem.flexibility import flexible
from bladefem.fem.linear_preload import linear_tangent, unit_speed_displacement
from bladefem.fem.modes import modes
from bladefem.fem.preload import preload, tangent
from bladefem.fem.rotation import body_under_rotation
from bladefem.scene.tables import Material

# First flap of a cantilever on the axis, mu = omega sqrt(rho A L^4 / E I) over eta = Omega sqrt(rho
# A L^4 / E I): Wright, Smith, Thresher and Wang, J. Appl. Mech. 49 (1982), doi:10.1115/1.3161966.
WRIGHT = {
    0: 3.5160,
    1: 3.6816,
    2: 4.1373,
    3: 4.7973,
    4: 5.5850,
    5: 6.4495,
    6: 7.3604,
    8: 9.2568,
    10: 11.2023,
    12: 13.1702,
}
BEAM = Material(E=2.1e11, nu=0.0, rho=7850.0)
SLENDER = (
    0.004  # thickness over length: shear, rotary inertia and stretch stay below 3e-5 up to eta = 12
)
UNIT = np.sqrt(BEAM.E * SLENDER**2 / 12 / BEAM.rho)  # [rad/s] of mu and eta for a length of 1 m
# CalculiX 2.20 on the twisted blade at 300 rad/s, seven digits (benchmarks/fem_ccx_rotation.py)
# [Hz]
CCX = {
    "linear": [153.4875, 662.0591, 1109.722, 1440.447, 2719.943, 4646.438],
    "NLGEOM": [153.5018, 661.0102, 1107.281, 1443.117, 2718.222, 4636.246],
}


@pytest.fixture(scope="module")
def cantilever():
    return assemble(
        box((200, 1), (1.0, SLENDER), "quad9", origin=(0.0, -SLENDER / 2)),
        "blade",
        BEAM,
        MPI.COMM_SELF,
    )


def first(body, **keys):
    return modes(constrain(body, **keys), 1).frequencies[0] * 2 * np.pi / UNIT


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("eta", [0, 1, 3, 6, 12])
def test_flap_of_a_rotating_cantilever(cantilever, eta, linear):
    """Measured: within 1.2e-5 for all of the table, of which 1.4e-5 is its rounding."""
    frequency = first(body_under_rotation(cantilever, eta * UNIT, axis=(0, 1, 0), linear=linear))
    assert frequency == pytest.approx(WRIGHT[eta], rel=3e-5)


@pytest.mark.parametrize("linear", [False, True])
def test_a_cantilever_along_the_axis_holds_up_to_its_first_frequency(cantilever, linear):
    """Beyond, spin softening outweighs its stiffness: bad input, with the field that decides; it was
    "not positive definite" with exit code 1.
    """
    along = {"axis": (1, 0, 0), "linear": linear}
    held = first(body_under_rotation(cantilever, 0.99 * WRIGHT[0] * UNIT, **along))
    assert held == pytest.approx(WRIGHT[0] * np.sqrt(1 - 0.99**2), rel=1e-3)
    speed = 1.01 * WRIGHT[0] * UNIT
    with pytest.raises((InputError, NotSolvedError), match=r"operation\.speed = .* rpm: .*preload"):
        first(body_under_rotation(cantilever, speed, **along))


def test_lead_lag_is_softer_by_the_speed(cantilever):
    """Motion in the plane of rotation: omega^2 = omega_flap^2 - Omega^2, but for the thickness
    (measured 4e-6).
    """
    flap, lag = (
        first(body_under_rotation(cantilever, 4 * UNIT, axis=axis))
        for axis in ((0, 1, 0), (0, 0, 1))
    )
    assert lag**2 == pytest.approx(flap**2 - 16, rel=2e-5)


@pytest.mark.parametrize("linear", [False, True])
def test_sector_equals_full_wheel_under_rotation(linear):
    """Same mesh, same arithmetic up to rounding and Newton's tolerance, at a speed that changes
    frequencies by 3 %.
    """
    mesh = sector(5, (3, 2, 1), bump=0.2)
    part = body_under_rotation(assemble(mesh, "blade", Material()), 3000.0, linear=linear)
    whole = body_under_rotation(
        assemble(wheel(mesh)[0], "blade", Material()), 3000.0, linear=linear
    )
    every = modes(constrain(whole), 20).frequencies
    found = np.sort(
        np.concatenate(
            [
                np.repeat(modes(constrain(part, "clamp", n), 10).frequencies, 1 if n == 0 else 2)
                for n in range(3)
            ]
        )
    )[:20]
    np.testing.assert_allclose(found, every, rtol=1e-8)


def test_twisted_blade_agrees_with_calculix():
    """Measured 3.6e-7 and 2.4e-6; the two kinds of preload differ by up to 2.2e-3."""
    body = assemble(twisted(), "blade", Material(), MPI.COMM_SELF, quadrature="ccx")
    u0 = 300.0**2 * unit_speed_displacement(flexible(in_step(body)))
    linear = replace(body, K=linear_tangent(body, u0, 300.0, quadrature="ccx"))
    np.testing.assert_allclose(modes(constrain(linear), 6).frequencies, CCX["linear"], rtol=1e-6)
    exact = replace(body, K=tangent(body, preload(body, 300.0, quadrature="ccx"), quadrature="ccx"))
    np.testing.assert_allclose(modes(constrain(exact), 6).frequencies, CCX["NLGEOM"], rtol=1e-5)


def test_linear_preload_is_close_to_the_nonlinear_one():
    """They agree on what the speed adds within 3 % on a straight sector (measured 0.9 %)."""
    body = assemble(sector(6, (3, 2, 1), bump=0.2), "blade", Material())
    still, exact, linear = (
        modes(constrain(b, "clamp", 2), 1).frequencies[0]
        for b in (
            body,
            body_under_rotation(body, 3000.0),
            body_under_rotation(body, 3000.0, linear=True),
        )
    )
    assert linear - still == pytest.approx(exact - still, rel=0.03)


def test_newton_reaches_equilibrium_in_few_steps():
    state = preload(assemble(sector(6, (3, 2, 1), bump=0.2), "blade", Material()), 3000.0)
    assert state.residual < 1e-9 and state.steps == 1 and state.iterations <= 6


def test_swell_of_a_thin_ring():
    """u_r = rho Omega^2 R^3 / E; the wall of 1 % adds an error of its square."""
    ring = Material(E=2e11, nu=0.3, rho=8000.0)
    mesh = sector(8, (1, 4, 1), "hexahedron27", inner=0.995, outer=1.005, width=0.01)
    body = assemble(mesh, "blade", ring)
    u1 = unit_speed_displacement(flexible(in_step(body, None)))
    radial = np.einsum("ni,ni->n", u1[:, :2], mesh.points[:, :2]) / np.hypot(*mesh.points[:, :2].T)
    assert radial.mean() == pytest.approx(ring.rho / ring.E, rel=1e-4)
    large = preload(body, 1000.0, None).displacement
    strain = (
        ring.rho * 1e6 / ring.E
    )  # Saint Venant-Kirchhoff ring: e (1 + e/2) (1 + e) = strain (1 + e)
    stretch = np.sqrt(1 + 2 * strain) - 1
    radial = np.einsum("ni,ni->n", large[:, :2], mesh.points[:, :2]) / np.hypot(
        *mesh.points[:, :2].T
    )
    assert radial.mean() == pytest.approx(stretch, rel=2e-4)


def test_wrong_speeds_and_states_without_equilibrium():
    body = assemble(box((4, 1, 1), (1.0, 0.1, 0.1), "tetra10"), "blade", Material(E=1e6))
    with pytest.raises(InputError, match="speed is -1"):
        preload(body, -1.0)
    with pytest.raises(InputError, match="speed is nan"):
        body_under_rotation(body, np.nan)
    for speed in (20.0, 100.0):  # pushed towards its clamp until it collapses, or turns inside out
        with pytest.raises(NotSolvedError, match="of the speed"):
            preload(body, speed, "x1")
    assert body_under_rotation(body, 0.0) is body


@pytest.mark.mpi
@pytest.mark.several_ranks
@pytest.mark.parametrize("linear", [False, pytest.param(True, marks=pytest.mark.two_ranks)])
def test_rotation_does_not_depend_on_ranks(linear):
    mesh = sector(6, (4, 2, 1), bump=0.2)
    f, u = [], []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        body = assemble(mesh, "blade", Material(), comm)
        f.append(
            modes(
                constrain(body_under_rotation(body, 3000.0, linear=linear), "clamp", 1), 6
            ).frequencies
        )
        u.append(preload(body, 3000.0).displacement)
    np.testing.assert_allclose(f[0], f[1], rtol=1e-10)
    np.testing.assert_allclose(u[0], u[1], atol=1e-10 * abs(u[1]).max())
