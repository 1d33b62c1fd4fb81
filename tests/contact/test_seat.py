"""A damper seated between its two platforms: statics must hold to round-off, whatever the meshes
and the props.
"""

from dataclasses import replace

import numpy as np
import pytest
from seated_wedge import ALPHA, SPEED, condensed
from wedge import wedge_mesh

import bladefem
from bladefem.contact.interface_law import InterfaceLaw, closure_of
from bladefem.contact.patch import make_patch
from bladefem.contact.rough_layer import TOUCHING_PRESSURE, decay_length
from bladefem.contact.seating import solve_seating
from bladefem.errors import InputError, NotSolvedError
from bladefem.study.pipeline.damper_contact import contact_patches


@pytest.fixture(scope="module")
def solid():
    return condensed(wedge_mesh(ALPHA))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("rigid", [False, True])
def test_wedge_balance(dimension, rigid):
    """N = F / (2 sin alpha) on each flank."""
    problem = condensed(wedge_mesh(ALPHA, dimension=dimension), rigid)
    pull = np.linalg.norm(problem.load[:dimension]) * SPEED**2
    for seat_map in solve_seating(problem, SPEED):
        assert seat_map.force.sum() == pytest.approx(pull / (2 * np.sin(ALPHA)), rel=1e-8)
        assert seat_map.complementarity < 1e-12
        assert (seat_map.gap >= 0).all() and (seat_map.force >= 0).all()


def test_force_on_damper_is_radial_and_through_its_centre(solid):
    """All six balances, moments taken with the consistent port vectors."""
    f = np.concatenate([m.force for m in solve_seating(solid, SPEED)])
    unbalanced = solid.rigid.T @ f + SPEED**2 * solid.load
    assert np.abs(unbalanced).max() < 1e-9 * SPEED**2 * np.abs(solid.load).max()


def test_props_of_the_floating_damper_have_no_influence():
    """The support of the floating damper carries nothing: six decades of its stiffness change
    nothing.
    """
    mesh = wedge_mesh(ALPHA)
    soft, hard = (
        np.concatenate([m.force for m in solve_seating(condensed(mesh, prop=p), SPEED)])
        for p in (1e-3, 1e3)
    )
    assert np.abs(soft - hard).max() < 1e-9 * soft.max()


def test_receding_contact_of_a_drawn_sector_is_linear_in_the_load():
    """The shipped wedge drawn by gmsh, coarse, with rigid faces: at twice the speed the same nodes
    press, each four times as hard.
    """
    scene = bladefem.load_scene(
        "scenes/wedge.toml",
        ["mesh.size=16 mm", "mesh.contact_size=3 mm", "contact.stiffness=map"],
    )
    mesh = bladefem.build_mesh(scene)
    problem = bladefem.seat_damper(bladefem.Bodies(scene, mesh), contact_patches(mesh))
    for one, two in zip(
        solve_seating(problem, SPEED), solve_seating(problem, 2 * SPEED), strict=True
    ):
        assert 0.5 < (one.force == 0).mean() < 0.9  # measured 33 and 32 of 48
        assert np.array_equal(one.force > 0, two.force > 0)
        assert np.abs(4 * one.force - two.force).max() < 1e-8 * two.force.max()  # measured 4e-10


def test_wanted_normal_load_and_damper_mass(solid):
    for seat_map in solve_seating(solid, SPEED, normal=123.0):
        assert seat_map.force.sum() == pytest.approx(123.0, rel=1e-8)
    single = solve_seating(solid, SPEED)[0].force.sum()
    assert solve_seating(solid, SPEED, damper_mass=2 * solid.mass)[0].force.sum() == pytest.approx(
        2 * single, rel=1e-8
    )


def test_clearance_is_taken_up_by_rigid_motion(solid):
    """An even clearance moves the damper outwards by c / sin alpha and changes no force."""
    wide = condensed(wedge_mesh(ALPHA), clearance=1e-4)
    for a, b in zip(solve_seating(solid, SPEED), solve_seating(wide, SPEED), strict=True):
        assert np.abs(a.force - b.force).max() < 1e-8 * a.force.max()


def test_a_wide_even_clearance_under_a_tiny_load(solid):
    """2 mm are 1e10 times what 1 mN bends, and known to 4e-19 m: the travel that closes them is
    taken out first.
    """
    wide = condensed(wedge_mesh(ALPHA), clearance=2e-3)
    for a, b in zip(
        solve_seating(solid, 0.0, normal=1e-3), solve_seating(wide, 0.0, normal=1e-3), strict=True
    ):
        assert np.abs(a.force - b.force).max() < 1e-3 * a.force.max()  # measured 1.3e-4
        assert b.complementarity < 1e-9


def test_a_load_too_light_for_uneven_gaps_is_told(solid):
    """Faces that miss each other by 20 um need a load that bends them; this one leaves the damper
    on single points.
    """
    rough = replace(solid, clearance=2e-5 * np.random.default_rng(3).random(len(solid.clearance)))
    assert sum(m.force.sum() for m in solve_seating(rough, 0.0, normal=100.0)) == pytest.approx(
        200.0
    )
    with pytest.raises(
        NotSolvedError, match=r"load 1e-09 N .*hardly touches; expected a larger study\.loads"
    ):
        solve_seating(rough, 0.0, normal=1e-9)


def test_a_stiffening_layer_under_gaps_far_wider_than_its_closure(solid):
    """Crowned by 100 um, rough by 0.8 um and pressed with a hundredth of a newton: rounding of the
    gaps keeps Newton's steps from getting ever smaller, the conditions hold all the same.
    """
    area = np.concatenate([p.area for p in solid.patches])
    z = np.concatenate([p.points[:, 2] for p in solid.patches])
    law = InterfaceLaw(TOUCHING_PRESSURE / decay_length(8e-7) * area, TOUCHING_PRESSURE * area)
    crowned = replace(solid, layer=law, clearance=1e-4 * (z / abs(z).max()) ** 2)
    force = np.concatenate([m.force for m in solve_seating(crowned, 0.0, normal=0.01)])
    assert force.sum() == pytest.approx(0.02, rel=1e-9)
    opened = crowned.clearance + crowned.flexibility @ force + closure_of(law, force)
    pressed = force > 0
    motion = np.linalg.lstsq(crowned.rigid[pressed], -opened[pressed], rcond=1e-9)[0]
    gap = opened + crowned.rigid @ motion
    # the damper's own deformation by its load, which is left out here, has 1e-6
    assert abs(gap[pressed]).max() < 1e-5 * closure_of(law, force).max()
    assert gap.min() > -1e-5 * closure_of(law, force).max()


def test_bedded_faces_forget_gaps_and_rotation(solid):
    """Worn faces: only the load's direction and size are left of the rotation."""
    slow = solve_seating(solid, SPEED, normal=50.0, bedded=True)
    fast = solve_seating(
        condensed(wedge_mesh(ALPHA), clearance=np.linspace(0, 1e-5, 50)),
        3 * SPEED,
        normal=50.0,
        bedded=True,
    )
    for a, b in zip(slow, fast, strict=True):
        assert np.abs(a.force - b.force).max() < 1e-9 * a.force.max()


def test_warm_start_gives_the_same(solid):
    first = solve_seating(solid, SPEED)
    cold, warm = solve_seating(solid, 0.9 * SPEED), solve_seating(solid, 0.9 * SPEED, start=first)
    for a, b in zip(cold, warm, strict=True):
        assert np.abs(a.force - b.force).max() < 1e-11 * a.force.max()


def test_a_load_that_lifts_off_is_refused(solid):
    with pytest.raises(NotSolvedError, match="lifts the body off"):
        solve_seating(replace(solid, load=-solid.load), SPEED)


def test_a_load_that_slides_sideways_is_refused(solid):
    axial = solid.load.copy()
    axial[2] = np.linalg.norm(axial)
    with pytest.raises(NotSolvedError, match="frictionless seats"):
        solve_seating(replace(solid, load=axial), SPEED)


@pytest.mark.parametrize(
    ("speed", "given", "word"),
    [
        (0.0, {}, "speed is 0.0 rad/s"),
        (np.nan, {}, "speed is nan"),
        (SPEED, {"normal": -1.0}, "normal load is -1"),
        (SPEED, {"normal": np.inf}, "normal load is inf"),
        (SPEED, {"damper_mass": np.inf}, "damper_mass is inf"),
        (SPEED, {"damper_mass": -1.0}, "damper_mass is -1"),
        (SPEED, {"approach": np.full(50, np.nan)}, r"approach\[0\] is nan"),
        (SPEED, {"approach": np.zeros(49)}, r"approach has shape \(49,\), expected \(50\)"),
    ],
)
def test_no_load_is_bad_input(solid, speed, given, word):
    with pytest.raises(InputError, match=word):
        solve_seating(solid, speed, **given)


@pytest.mark.parametrize("clearance", [np.nan, np.zeros(3)])
def test_clearance_that_does_not_fit_is_bad_input(clearance):
    with pytest.raises(InputError, match="clearance"):
        condensed(wedge_mesh(ALPHA, dimension=2), clearance=clearance)


def test_unknown_pair_and_empty_patch_are_bad_input():
    mesh = wedge_mesh(ALPHA)
    with pytest.raises(InputError, match="not in the mesh"):
        make_patch(mesh, "other")
    faces = {**mesh.faces, "seat_right": mesh.faces["clamp"]}
    with pytest.raises(InputError, match="no matched faces"):
        make_patch(replace(mesh, faces=faces), "this")
