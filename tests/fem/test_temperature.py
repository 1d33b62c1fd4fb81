"""Heated bodies: closed forms, CalculiX on the same mesh (``python benchmarks/fem_decks.py``), and
fields from a file.
"""

import json
from dataclasses import replace
from pathlib import Path

import decks
import numpy as np
import pytest
from structured import box, sector, wheel

from bladefem.errors import InputError, NotSolvedError
from bladefem.fem import rotating_forms
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain, in_step
from bladefem.fem.flexibility import flexible
from bladefem.fem.linear_preload import linear_tangent, thermal_displacement
from bladefem.fem.loads import body_mass
from bladefem.fem.modes import modes
from bladefem.fem.preload import preload, tangent
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.stress import gauss_stress, von_mises
from bladefem.fem.temperature import Temperatures, crystal_rotation
from bladefem.fem.temperature_field import interpolate_temperatures
from bladefem.scene.tables import Material

DECKS = json.loads((Path(__file__).parent / "ccx_decks.json").read_text())
GOLDEN = DECKS["heated"]
COLD = 300.0
STEEL = Material(E=2e11, nu=0.0, rho=8000.0, expansion=1.2e-5)


def uniform(mesh, temperature):
    return Temperatures(np.full(len(mesh.points), temperature), COLD)


def beam_between_walls(slender=0.01):
    """A plane beam of length 1 m that both ends hold."""
    mesh = box((60, 1), (1.0, slender), "quad9", origin=(0.0, -slender / 2), depth=slender)
    both = np.union1d(np.unique(mesh.faces["x0"]), np.unique(mesh.faces["x1"]))
    return replace(mesh, nodes={"clamp": both}, faces={"x0": mesh.faces["x0"]})


def beam_frequency(load, inertia=8000.0 * 1e-4, bending=2e11 * 1e-8 / 12):
    """First frequency [Hz] of a clamped beam of 1 m under an axial load (compression > 0), by the
    characteristic equation of Euler and Bernoulli.
    """
    from scipy.optimize import brentq

    def determinant(omega):
        half = load / (2 * bending)
        root = np.sqrt(half**2 + inertia * omega**2 / bending)
        a, b = np.sqrt(root - half), np.sqrt(root + half)
        return 2 * a * b * (1 - np.cosh(a) * np.cos(b)) + (a**2 - b**2) * np.sinh(a) * np.sin(b)

    guess = 22.3733 * np.sqrt(bending / inertia)
    stretch = np.sqrt(max(1 - load / (4 * np.pi**2 * bending), 0.0))
    return brentq(determinant, 0.97 * stretch * guess, 1.05 * stretch * guess) / (2 * np.pi)


@pytest.mark.parametrize("share", [-0.5, 0.3, 0.6])
def test_heated_beam_between_walls(share):
    """Its axial force is E A alpha dT, a share of the buckling load 4 pi^2 E I / L^2; the frequency
    drops as the beam's characteristic equation says, nearly as sqrt(1 - N / N_cr).
    """
    mesh = beam_between_walls()
    critical = 4 * np.pi**2 * STEEL.E * 1e-8 / 12
    heating = share * critical / (STEEL.E * 1e-4 * STEEL.expansion)
    body = assemble(mesh, "blade", STEEL, MPI.COMM_SELF, heat=uniform(mesh, COLD + heating))
    moved = thermal_displacement(flexible(in_step(body)))
    stress = gauss_stress(body, moved, heated=True).stress
    np.testing.assert_allclose(stress[..., 0], -STEEL.E * STEEL.expansion * heating, rtol=1e-6)
    found = modes(constrain(body_under_rotation(body, 0.0, linear=True)), 1).frequencies[0]
    cold = modes(constrain(body), 1).frequencies[0]
    closed = beam_frequency(share * critical) / beam_frequency(1e-9)
    # shear takes 1e-3 of both frequencies
    assert found / cold == pytest.approx(closed, rel=5e-4)
    assert closed == pytest.approx(np.sqrt(1 - share), rel=0.02)
    large = body_under_rotation(body, 0.0)
    assert modes(constrain(large), 1).frequencies[0] == pytest.approx(found, rel=2e-3)


def test_a_beam_heated_beyond_buckling_is_told():
    mesh = beam_between_walls()
    critical = 4 * np.pi**2 * STEEL.E * 1e-8 / 12
    heating = 1.5 * critical / (STEEL.E * 1e-4 * STEEL.expansion)
    body = assemble(mesh, "blade", STEEL, MPI.COMM_SELF, heat=uniform(mesh, COLD + heating))
    with pytest.raises(NotSolvedError, match="of the heat.*buckling"):
        preload(body, 0.0)
    with pytest.raises(NotSolvedError):
        modes(constrain(body_under_rotation(body, 0.0, linear=True)), 1)


def test_a_free_block_is_without_stress():
    """Also under a temperature that is linear in space; it grows by expansion times heating."""
    mesh = box((3, 2, 2), (0.1, 0.06, 0.05), "tetra10")
    material = Material(nu=0.3, expansion=1.5e-5)
    for nodal in (np.full(len(mesh.points), 800.0), 500.0 + 3000.0 * mesh.points[:, 0]):
        body = assemble(mesh, "blade", material, MPI.COMM_SELF, heat=Temperatures(nodal, COLD))
        moved = thermal_displacement(flexible(constrain(body, None)))
        stress = von_mises(gauss_stress(body, moved, heated=True).stress)
        assert stress.max() < 1e-6 * material.E * material.expansion * 500
    hot = assemble(mesh, "blade", material, MPI.COMM_SELF, heat=uniform(mesh, 800.0))
    state = preload(hot, 0.0, None)
    x = mesh.points + state.displacement
    np.testing.assert_allclose(np.ptp(x, axis=0), (1 + 7.5e-3) * np.array([0.1, 0.06, 0.05]))


def held_bar():
    mesh, _ = decks.bar()
    both = np.union1d(np.unique(mesh.faces["x0"]), np.unique(mesh.faces["x1"]))
    return replace(mesh, nodes={"both": both})


@pytest.mark.parametrize("kind", ["uniform", "field"])
def test_same_frequencies_as_calculix(kind):
    """A bar between walls, with tables for E, nu, density and expansion; measured 3e-7, of the
    seven digits that ccx prints. What the heat changes is 0.1 to 2 %.
    """
    mesh = held_bar()
    nodal = decks.temperature(mesh.points) if kind == "field" else np.full(len(mesh.points), 450.0)
    heat = Temperatures(nodal, decks.REFERENCE)
    material = Material(table=decks.heat_table())
    body = assemble(mesh, "blade", material, quadrature="ccx", heat=heat)
    u0 = thermal_displacement(flexible(in_step(body, "both")), "ccx")
    assert abs(u0).max() == pytest.approx(GOLDEN[kind]["largest"], rel=1e-5)
    linear = replace(body, K=linear_tangent(body, u0, 0.0, quadrature="ccx"))
    found = modes(constrain(linear, "both"), 6).frequencies
    np.testing.assert_allclose(found, GOLDEN[kind]["linear"], rtol=1e-6)


def test_nonlinear_preload_against_calculix():
    """Measured 2.5e-5; the two differ in the thermal strain's second order."""
    mesh = held_bar()
    heat = Temperatures(np.full(len(mesh.points), 450.0), decks.REFERENCE)
    body = assemble(mesh, "blade", Material(table=decks.heat_table()), quadrature="ccx", heat=heat)
    state = preload(body, 0.0, "both", quadrature="ccx")
    exact = replace(body, K=tangent(body, state, quadrature="ccx"))
    found = modes(constrain(exact, "both"), 6).frequencies
    np.testing.assert_allclose(found, GOLDEN["uniform"]["NLGEOM"], rtol=1e-4)


def test_constants_are_a_table_of_equal_rows():
    """Quadrature points and cells give the same matrices; isotropic and crystal."""
    mesh = box((3, 2, 1), (0.1, 0.03, 0.02), "tetra10")
    nodal = 400.0 + 2000.0 * mesh.points[:, 0]
    for row, constants in (
        ("E=110 GPa; nu=0.33; rho=4400", {"E": 1.1e11, "nu": 0.33, "rho": 4400.0}),
        (
            "E=128 GPa; nu=0.38; G=130 GPa",
            {"E": 1.28e11, "nu": 0.38, "G": 1.3e11, "angles": (0.2, -0.3, 0.6)},
        ),
    ):
        plain = Material(**constants)
        table = replace(plain, E=1e11, table=(f"300 K: {row}", f"1000 K: {row}"))
        hot = assemble(mesh, "blade", table, heat=Temperatures(nodal, COLD))
        cold = assemble(mesh, "blade", plain)
        ours, theirs = (modes(constrain(body), 4).frequencies for body in (hot, cold))
        np.testing.assert_allclose(ours, theirs, rtol=1e-9)
        assert body_mass(hot) == pytest.approx(body_mass(cold), rel=1e-12)


def test_hot_sector_equals_hot_wheel():
    """Rotation and a temperature that varies along the radius."""
    mesh = sector(5, (3, 2, 1), bump=0.2)
    whole, _ = wheel(mesh)

    def hot(some):
        radius = np.hypot(*some.points[:, :2].T)
        heat = Temperatures(300.0 + 2000.0 * (radius - 0.1), COLD)
        body = assemble(some, "blade", Material(expansion=1.2e-5), heat=heat)
        return body_under_rotation(body, 2000.0, linear=True)

    part = hot(mesh)
    every = modes(constrain(hot(whole)), 12).frequencies
    found = [
        np.repeat(modes(constrain(part, "clamp", n), 8).frequencies, 1 + (n > 0)) for n in range(3)
    ]
    np.testing.assert_allclose(np.sort(np.concatenate(found))[:12], every, rtol=1e-8)


@pytest.mark.mpi
@pytest.mark.several_ranks
@pytest.mark.two_ranks
def test_heat_does_not_depend_on_ranks():
    mesh = held_bar()
    heat = Temperatures(decks.temperature(mesh.points), decks.REFERENCE)
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        body = assemble(mesh, "blade", Material(table=decks.heat_table()), comm, heat=heat)
        found.append(
            modes(
                constrain(body_under_rotation(body, 0.0, "both", linear=True), "both"), 4
            ).frequencies
        )
    np.testing.assert_allclose(found[0], found[1], rtol=1e-10)


def test_temperatures_between_given_places():
    """A linear field is exact; places that do not fill the body are refused."""
    mesh = box((3, 2, 2), (0.1, 0.06, 0.05), "tetra10")
    rng = np.random.default_rng(1)
    corners = np.array([[x, y, z] for x in (0, 0.1) for y in (0, 0.06) for z in (0, 0.05)])
    places = np.vstack([corners, rng.random((50, 3)) * [0.1, 0.06, 0.05]])

    def field(x):
        return 400.0 + x @ [1000.0, -500.0, 300.0]

    np.testing.assert_allclose(
        interpolate_temperatures(mesh, places, field(places)), field(mesh.points)
    )
    with pytest.raises(InputError, match="do not span a volume"):
        interpolate_temperatures(mesh, places * [1, 1, 0], field(places))
    with pytest.raises(InputError, match="away from all given places"):
        interpolate_temperatures(mesh, 0.5 * places, field(places))
    with pytest.raises(InputError, match="units of x, y, z"):
        interpolate_temperatures(mesh, 1e3 * places, field(places))


def test_cut_faces_are_equally_hot():
    mesh = sector(9, (3, 2, 1))
    angle = np.arctan2(mesh.points[:, 1], mesh.points[:, 0])
    radius = np.hypot(*mesh.points[:, :2].T)
    interpolate_temperatures(mesh, mesh.points, 300 + 100 * radius)
    with pytest.raises(InputError, match="cut faces.* differ"):
        interpolate_temperatures(mesh, mesh.points, 300 + 100 * angle)


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("table", [False, True])
def test_a_free_crystal_expands_along_its_axes(large, table):
    """Evenly heated it takes the shape R (1 + a dT) R^T x and stays free of stress, also after large
    displacements.
    """
    spread = (2e-4 if large else 2e-5) * np.array([1.0, 0.4, -0.3])
    angles = (0.3, -0.5, 0.9)
    mesh = box((2, 2, 1), (0.1, 0.06, 0.05), "tetra10")
    corner = np.flatnonzero(np.linalg.norm(mesh.points, axis=1) < 1e-9)
    material = Material(E=1.28e11, nu=0.38, G=1.3e11, angles=angles, expansion_axes=tuple(spread))
    if table:
        text = ", ".join(f"{a} 1/K" for a in spread)
        rows = (f"290 K: expansion_axes={text}", f"900 K: expansion_axes={text}")
        material = replace(material, expansion_axes=None, table=rows)
    heat = Temperatures(np.full(len(mesh.points), COLD + 250.0), COLD)
    body = assemble(mesh, "blade", material, heat=heat)
    axes = crystal_rotation(angles)
    exact = mesh.points @ (axes * (250.0 * spread)) @ axes.T
    stress = gauss_stress(body, exact, large=large, heated=True).stress
    assert abs(stress).max() < 1e-9 * material.E * abs(spread).max() * 250.0
    if large:
        # the residual of the nonlinear balance is zero in that shape
        force = unbalanced_force(body, exact)
        cold = unbalanced_force(body, np.zeros_like(exact))
        assert abs(force).max() < 1e-9 * abs(cold).max()
    else:
        con = constrain(replace(body, hold=""), None)
        moved = thermal_displacement(flexible(con))
        strain = (moved - moved[corner]) - (exact - exact[corner])
        turned, *_ = np.linalg.lstsq(rigid(mesh.points), strain.ravel(), rcond=None)
        left = strain.ravel() - rigid(mesh.points) @ turned
        assert abs(left).max() < 1e-8 * abs(exact).max()


def unbalanced_force(body, u):
    """(n_points*dim,) of the whole heat, at rest."""
    forms = rotating_forms.potential_forms(body, (0.0, 0.0, 1.0), "exact")
    rotating_forms.set_heating(forms, 1.0)
    return rotating_forms.unbalanced_force(body, forms, u, 0.0)


def rigid(points):
    """(n_points*3, 6) rigid motions."""
    columns = [np.tile(np.eye(3)[i], len(points)) for i in range(3)]
    columns += [np.cross(np.eye(3)[i], points).ravel() for i in range(3)]
    return np.stack(columns, axis=1)


def test_an_unevenly_heated_crystal_is_that_of_calculix():
    """Expansion along the axes of an orthotropic solid: static displacement and modes about it."""
    mesh, m = decks.bar()
    given = decks.CRYSTALS["orthotropic"]
    material = Material(**given, expansion_axes=decks.EXPANSIONS)
    heat = Temperatures(decks.temperature(m.points), decks.REFERENCE)
    body = assemble(mesh, "blade", material, quadrature="ccx", heat=heat)
    moved = thermal_displacement(flexible(constrain(body)), quadrature="ccx")
    size = np.linalg.norm(moved, axis=1)
    golden = DECKS["heated_crystal"]
    np.testing.assert_allclose(moved[size.argmax()], golden["largest"], atol=2e-6 * size.max())
    K = linear_tangent(body, moved, 0.0, quadrature="ccx")
    ours = modes(constrain(replace(body, K=K)), 6).frequencies
    np.testing.assert_allclose(ours, golden["frequencies"], rtol=1e-6)


def test_crystal_axes_need_a_solid():
    flat = box((1, 1), (0.1, 0.06), "triangle6")
    body = assemble(flat, "blade", Material(expansion_axes=(1e-5,) * 3), heat=uniform(flat, 800.0))
    with pytest.raises(InputError, match="expansion_axes: a plane mesh"):
        thermal_displacement(flexible(constrain(body)))


def test_missing_expansion():
    mesh = box((1, 1, 1), (0.1, 0.06, 0.05), "tetra10")
    body = assemble(mesh, "blade", Material(), heat=uniform(mesh, 800.0))
    with pytest.raises(InputError, match="expansion is missing"):
        thermal_displacement(flexible(constrain(body)))
    flat = box((1, 1), (0.1, 0.06), "triangle6")
    with pytest.raises(InputError, match="plane strain"):
        assemble(flat, "blade", STEEL, plane="strain", heat=uniform(flat, 800.0))
