"""Springs on faces, single directions, free bodies: closed forms and limits."""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, sector

from bladefem.data import ModeSet
from bladefem.errors import InputError
from bladefem.fem.all_diameters import all_diameters
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain, transformation
from bladefem.fem.flexibility import flexible
from bladefem.fem.linear_preload import linear_tangent, thermal_displacement
from bladefem.fem.modes import modes
from bladefem.fem.preload import preload
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.supports import AreaSpring, supported
from bladefem.fem.temperature import Temperatures
from bladefem.scene.support import area_springs, held_letters
from bladefem.scene.tables import Material, Support
from bladefem.scene.toml import scene_of
from bladefem.study.modes.survey import rigid_mode_remarks

SIZE = (0.04, 0.02, 0.03)
STEEL = Material()


@pytest.fixture(scope="module")
def bar():
    return assemble(box((4, 2, 2), SIZE, "tetra10"), "blade", STEEL)


def test_a_stiff_block_bounces_on_its_springs(bar):
    """Along the normal of the face: omega^2 = kn A / m; the five other motions are near zero."""
    normal = 1e9
    body = supported(bar, "", [AreaSpring("x0", normal, 0.0)])
    found = 2 * np.pi * modes(constrain(body), 6).frequencies
    mass = STEEL.rho * np.prod(SIZE)
    bounce = np.sqrt(normal * SIZE[1] * SIZE[2] / mass)
    assert abs(found / bounce - 1).min() < 1e-3


def test_stiff_springs_are_a_clamp(bar):
    """From below, and the nearer the stiffer."""
    clamped = modes(constrain(bar), 3).frequencies
    errors = []
    for stiffness in (1e15, 1e17):
        body = supported(bar, "", [AreaSpring("clamp", stiffness, stiffness)])
        found = modes(constrain(body), 3).frequencies
        errors.append((1 - found / clamped).max())
        assert (found < clamped * (1 + 1e-9)).all()
    assert errors[1] < 0.02 * errors[0] and errors[1] < 1e-3


def test_three_directions_are_a_clamp(bar):
    held = modes(constrain(supported(bar, "", directions=[("x0", "xyz")])), 4).frequencies
    np.testing.assert_allclose(held, modes(constrain(bar), 4).frequencies, rtol=1e-10)


def test_one_direction_leaves_the_others(bar):
    """A bar on rollers: two translations and one rotation stay rigid."""
    found = modes(constrain(supported(bar, "", directions=[("x0", "x")])), 6).frequencies
    assert np.count_nonzero(found == 0) == 3


@pytest.mark.parametrize("n, rigid", [(0, 2), (1, 4), (2, 0)])
def test_a_free_wheel(n, rigid):
    """Axial shift and turn in nodal diameter 0; two shifts and two tilts, as waves, in 1."""
    body = supported(assemble(sector(9, (3, 2, 1), bump=0.2), "blade", STEEL), "")
    found = all_diameters(body, 6, [n])[0].frequencies
    # of a wave, one vector stands for both directions
    assert np.count_nonzero(found == 0) == (rigid if n == 0 else rigid // 2)


def test_an_elastic_root_under_rotation(bar):
    """Springs stay in the stiffness under rotation, and lower what a clamp gives."""
    springs = [AreaSpring("clamp", 1e13, 1e13)]
    body = supported(bar, "", springs)
    still, turning = (
        modes(constrain(some), 2).frequencies
        for some in (body, body_under_rotation(body, 500.0, linear=True))
    )
    clamped = modes(constrain(body_under_rotation(bar, 500.0, linear=True)), 2).frequencies
    assert (turning < clamped).all() and abs(turning / still - 1).max() < 0.05


def test_a_block_on_soft_springs_flies_outwards():
    """k A u = m Omega^2 (x + u), far beyond small displacements, and Newton's steps are few."""
    mesh = box((4, 2, 2), SIZE, "tetra10")
    # its centre on the x axis
    mesh = replace(mesh, points=mesh.points - [0, SIZE[1] / 2, SIZE[2] / 2])
    soft = 2e9
    body = supported(assemble(mesh, "blade", STEEL), "", [AreaSpring("clamp", soft, soft)])
    mass, stiffness = STEEL.rho * np.prod(SIZE), soft * SIZE[1] * SIZE[2]
    speed = np.sqrt(stiffness / mass) / 2
    state = preload(body, speed)
    # mass Omega^2 is a quarter of the stiffness, and the centre is in the middle
    flight = SIZE[0] / 2 / (4 - 1)
    assert state.displacement[:, 0].mean() == pytest.approx(flight, rel=2e-3)
    assert abs(state.displacement[:, 1:]).max() < 1e-3 * flight
    # in each of the steps of its load
    assert state.iterations <= 3 * state.steps


@pytest.mark.parametrize("speed, tolerance", [(20.0, 1e-7), (100.0, 2e-6)])
def test_springs_under_a_nonlinear_preload_that_is_small(bar, speed, tolerance):
    """Both preloads agree, but for the square of the displacement."""
    body = supported(bar, "", [AreaSpring("clamp", 1e13, 1e13)])
    near, exact = (
        modes(constrain(body_under_rotation(body, speed, linear=linear)), 4).frequencies
        for linear in (True, False)
    )
    np.testing.assert_allclose(near, exact, rtol=tolerance)


def test_stiff_springs_are_a_clamp_under_a_nonlinear_preload(bar):
    """Its displacement and its frequencies come nearer as the springs grow stiffer."""
    speed = 3000.0
    clamped = modes(constrain(body_under_rotation(bar, speed)), 3).frequencies
    rest = preload(bar, speed).displacement
    errors = []
    for stiffness in (1e15, 1e17):
        body = supported(bar, "", [AreaSpring("clamp", stiffness, stiffness)])
        found = modes(constrain(body_under_rotation(body, speed)), 3).frequencies
        moved = preload(body, speed).displacement
        errors.append(
            [(1 - found / clamped).max(), abs(moved - rest).max() / abs(rest).max()],
        )
    assert (np.array(errors[1]) < 0.02 * np.array(errors[0])).all() and max(errors[1]) < 2e-3


def test_what_turns_with_the_sector_is_not_held_on_its_cut():
    body = assemble(sector(9, (3, 2, 1)), "blade", STEEL)
    with pytest.raises(InputError, match="turn from sector to sector"):
        transformation(supported(body, "", directions=[("z0", "x")]), "clamp", True)
    assert transformation(supported(body, "", directions=[("z0", "z")]), "clamp", True)


def test_springs_and_directions_are_read_from_texts():
    support = Support(springs=("root: normal=2 N/mm^3; tangential=1e9",), directions=("rim: y, z",))
    assert list(area_springs(support)) == [("root", 2e9, 1e9)]
    assert held_letters(support) == [("rim", "yz")]
    for bad in ("root", "root: normal=-1", "root: stiff=1"):
        with pytest.raises(InputError, match=r"support\.springs"):
            list(area_springs(Support(springs=(bad,))))
    with pytest.raises(InputError, match=r"support\.directions"):
        held_letters(Support(directions=("rim: w",)))
    body = assemble(box((1, 1, 1), SIZE), "blade", STEEL)
    with pytest.raises(InputError, match="no face 'clmap'.*did you mean 'clamp'"):
        supported(body, "", [AreaSpring("clmap", 1.0, 1.0)])


def test_a_free_body_under_rotation_is_refused():
    tables = {"kind": "wedge sector", "support": {"clamp": ""}}
    with pytest.raises(InputError, match=r"expected operation\.stiffening = false"):
        scene_of(tables)
    assert scene_of(tables | {"operation": {"stiffening": False}}).support.clamp == ""


def test_torsion_of_a_tube_between_two_sleeves():
    """Radial and axial displacement held at the bore and outside leave turning, clamped at one end:
    f = sqrt(G / rho) / (4 L), a closed form.
    """
    length = 0.3
    mesh = sector(12, (1, 2, 4), "hexahedron27", width=length)
    body = supported(
        assemble(mesh, "blade", STEEL), "z0", directions=[("x0", "ra"), ("x1", "r"), ("x1", "a")]
    )
    found = modes(constrain(body, "z0", 0), 1).frequencies[0]
    shear = STEEL.E / (2 * (1 + STEEL.nu))
    assert found == pytest.approx(np.sqrt(shear / STEEL.rho) / (4 * length), rel=2e-4)


@pytest.mark.parametrize("letters", ["r", "t", "rt", "ta"])
def test_directions_at_the_nodes_turn_with_the_body(letters):
    """Another place of the sector on the wheel, where other components follow: the same modes."""
    mesh = sector(9, (3, 2, 1), bump=0.2)
    c, s = np.cos(0.9), np.sin(0.9)
    turned = replace(mesh, points=mesh.points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]))
    for n in (0, 2):
        found = [
            modes(
                constrain(
                    supported(assemble(some, "blade", STEEL), "", directions=[("x1", letters)]),
                    "clamp",
                    n,
                ),
                5,
            ).frequencies
            for some in (mesh, turned)
        ]
        np.testing.assert_allclose(*found, rtol=1e-8, atol=1e-3)


def test_a_wheel_that_may_turn_under_its_bore_is_refused_under_rotation():
    """Held radially, it is pulled along the tangents that its nodes move on; at rest it turns
    freely, one mode of frequency 0 in nodal diameter 0.
    """
    body = supported(assemble(sector(12, (2, 2, 1)), "blade", Material()), "", [], [("x0", "ra")])
    still = modes(constrain(body, None, 0), 3).frequencies
    assert (still == 0).tolist() == [True, False, False]
    turning = body_under_rotation(body, 800.0, None, linear=True)
    with pytest.raises(InputError, match=r"free to turn or slide.*operation.stiffening = false"):
        modes(constrain(turning, None, 0), 3)
    held = supported(assemble(sector(12, (2, 2, 1)), "blade", Material()), "", [], [("x0", "rta")])
    assert modes(constrain(body_under_rotation(held, 800.0, None, linear=True), None, 0), 3)


def test_a_free_bar_with_thermal_stress_keeps_its_rigid_motions():
    """Uneven heat loads it in itself: turned, its deformation turns along, which no linear rigid
    motion does; the residuals of all modes stay small.
    """
    mesh = box((6, 2, 1), (0.1, 0.03, 0.02), "tetra10")
    place = mesh.points / [0.1, 0.03, 0.02]
    heat = Temperatures(300.0 + 200.0 * place[:, 1] ** 2 + 100.0 * place[:, 0] ** 2, 300.0)
    body = assemble(mesh, "blade", Material(expansion=1.2e-5), heat=heat)
    body = replace(body, hold="")
    moved = thermal_displacement(flexible(constrain(body, None)))
    found = modes(constrain(replace(body, K=linear_tangent(body, moved, 0.0)), None), 8)
    assert np.count_nonzero(found.frequencies == 0) == 6
    assert found.residuals.max() < 1e-5


def test_rigid_modes_are_counted_in_words():
    sets = [
        ModeSet(np.array([0.0, 0.0, 5.0]), np.zeros((3, 1, 3)), 0, np.zeros(3)),
        ModeSet(np.array([4.0, 5.0]), np.zeros((2, 1, 3)), 1, np.zeros(2)),
    ]
    (said,) = rigid_mode_remarks(sets)
    assert "2 in nodal diameter 0;" in said
    assert rigid_mode_remarks(sets[1:]) == []


def test_directions_that_are_not_there_are_refused():
    body = assemble(box((1, 1, 1), SIZE), "blade", STEEL)
    with pytest.raises(InputError, match="a node on the z axis"):
        constrain(supported(body, "", directions=[("x0", "r")]))
    plane = assemble(box((1, 1), (1.0, 1.0), "quad"), "blade", STEEL)
    with pytest.raises(InputError, match="a plane mesh has no direction 'z'"):
        supported(plane, "", directions=[("x0", "z")])
