"""Elements, resultants and state tables made from pressure maps."""

from dataclasses import replace

import numpy as np
import pytest
from seated_wedge import ALPHA, SPEED, condensed
from wedge import wedge_mesh

import bladefem
from bladefem.contact.interface_elements import (
    friction_elements,
    normal_stiffness,
    pair_ratio,
)
from bladefem.contact.joined_points import aggregation_matrix
from bladefem.contact.patch import patch_means
from bladefem.contact.resultants import resultant
from bladefem.contact.seating import solve_seating
from bladefem.contact.state_table import interpolate_states, quasi_static, state_table
from bladefem.data import PressureMap
from bladefem.errors import InputError
from bladefem.scene.tables import Contact, Material, Seat
from bladefem.study.pipeline import state_check
from bladefem.study.pipeline.state_check import (
    StateCheck,
    check_states,
    platform_tilt,
    state_sentence,
)


@pytest.fixture(scope="module")
def problem():
    return condensed(wedge_mesh(ALPHA))


@pytest.fixture(scope="module")
def maps(problem):
    return solve_seating(problem, SPEED)


def mindlin_ratio(nu):
    """k_t / k_n of two bodies of one material (Mindlin 1949)."""
    return 2 * (1 - nu) / (2 - nu)


def test_ratio_of_two_materials_is_that_of_mindlin_for_equal_bodies():
    steel = Material()
    assert pair_ratio(steel, steel) == pytest.approx(mindlin_ratio(0.3), rel=1e-14)
    # a rigid partner: the ratio of one body alone is the same for equal nu
    stiff = replace(steel, E=1e13)
    assert pair_ratio(steel, stiff) == pytest.approx(mindlin_ratio(0.3), rel=1e-14)


@pytest.mark.parametrize("points", [None, 1, 2, 3, 7, 24])
def test_totals_do_not_depend_on_the_number_of_elements(maps, points):
    contact = Contact(kt_area=4e10, points=points)
    e, S = friction_elements(None, maps, contact, mindlin_ratio(0.3))
    area = sum(m.patch.area.sum() for m in maps)
    assert e.kt.sum() == pytest.approx(4e10 * area, rel=1e-12)
    assert e.kn.sum() == pytest.approx(4e10 * area * 1.7 / 1.4, rel=1e-12)
    assert e.n0.clip(min=0).sum() == pytest.approx(sum(m.force.sum() for m in maps), rel=1e-12)
    assert S.shape == (3 * sum(len(m.force) for m in maps), 3 * len(e.kt))
    if points and points < 10:
        assert len(e.kt) == 2 * points
        assert e.kt.max() / e.kt.min() < 3  # halving by area keeps the elements alike


def test_aggregation_keeps_uniform_motion_and_total_force(maps):
    """S^T of a uniform displacement is uniform; S spreads an element's force over its nodes without
    loss.
    """
    _, S = friction_elements(None, maps, Contact(points=5), 1.0)
    motion = np.tile([1.0, 2.0, 3.0], S.shape[0] // 3)
    assert np.allclose(S.T @ motion, np.tile([1.0, 2.0, 3.0], 10), rtol=1e-13)
    assert np.allclose(np.asarray(S.sum(axis=0)).ravel(), 1.0, rtol=1e-13)


def test_total_stiffness_wins_over_areal(maps):
    e, _ = friction_elements(None, maps, Contact(kt=1e6, kn_area=1e10), 1.0)
    whole, _ = friction_elements(None, maps, Contact(kn=2e6, kn_area=1e10), 0.5)
    assert whole.kn.sum() == pytest.approx(4e6, rel=1e-13) and whole.kt.sum() == pytest.approx(
        2e6, rel=1e-13
    )
    n = len(maps[0].force)
    assert e.kt[:n].sum() == pytest.approx(1e6, rel=1e-13) and e.kt[n:].sum() == pytest.approx(
        1e6, rel=1e-13
    )
    assert e.kn == pytest.approx(1e10 * np.concatenate([m.patch.area for m in maps]), rel=1e-13)


def test_tangential_stiffness_by_mindlin_from_the_normal_one(maps):
    """Given kn alone; a measured kt wins."""
    ratio, area = mindlin_ratio(0.3), np.concatenate([m.patch.area for m in maps])
    found = {
        name: friction_elements(None, maps, contact, ratio)[0]
        for name, contact in {
            "kn": Contact(kn_area=3e10),
            "both": Contact(kn_area=3e10, kt_area=1e10),
        }.items()
    }
    np.testing.assert_allclose(found["kn"].kt, ratio * found["kn"].kn, rtol=1e-14)
    np.testing.assert_allclose(found["kn"].kn, 3e10 * area, rtol=1e-14)
    np.testing.assert_allclose(found["both"].kt, 1e10 * area, rtol=1e-14)


def test_seats_have_values_of_their_own(maps):
    """mu, k_t and k_n of the left and right seat; a total of a seat wins over the areal value of
    both.
    """
    contact = Contact(mu=0.3, kt_area=4e10, left=Seat(mu=0.1, kt=2e6), right=Seat(kn_area=1e10))
    e, _ = friction_elements(None, maps, contact, 0.8)
    right, left = np.split(np.arange(len(e.kt)), 2)  # "this" is the right seat, "next" the left one
    areas = [m.patch.area for m in maps]
    np.testing.assert_allclose(e.mu, np.repeat([0.3, 0.1], len(right)))
    np.testing.assert_allclose(e.kt[right], 4e10 * areas[0], rtol=1e-14)
    np.testing.assert_allclose(e.kn[right], 1e10 * areas[0], rtol=1e-14)
    np.testing.assert_allclose(e.kt[left], 2e6 * areas[1] / areas[1].sum(), rtol=1e-14)
    np.testing.assert_allclose(e.kn[left], e.kt[left] / 0.8, rtol=1e-14)


@pytest.mark.parametrize("points", [None, 3])
def test_stiffness_from_the_map(problem, maps, points):
    """k_n of the pressed nodes is Eq. 23, k_t follows by Mindlin or is given; open nodes have their
    patch's mean.
    """
    ratio = mindlin_ratio(0.3)
    e, _ = friction_elements(problem, maps, Contact(stiffness="map", points=points), ratio)
    np.testing.assert_allclose(e.kt, ratio * e.kn, rtol=1e-14)
    force, eq23 = np.concatenate([m.force for m in maps]), normal_stiffness(problem, maps)
    if points is None:
        np.testing.assert_allclose(
            e.kn[force > 0] * (problem.flexibility @ force)[force > 0], force[force > 0]
        )
        assert (force == 0).any() and (e.kn > 0).all()
    for side in np.split(np.arange(len(force)), 2):
        area, pressed = maps[0].patch.area, eq23[side] > 0
        whole = eq23[side].sum() * area.sum() / area[pressed].sum()
        part = np.split(e.kn, 2)[int(side[0] > 0)]
        assert part.sum() == pytest.approx(whole, rel=1e-12)
    given, _ = friction_elements(
        problem, maps, Contact(stiffness="map", kt=1e6, points=points), ratio
    )
    np.testing.assert_array_equal(given.kn, e.kn)
    assert given.kt.sum() == pytest.approx(2e6, rel=1e-13)


def test_open_nodes_keep_their_gap(maps):
    e, _ = friction_elements(None, maps, Contact(), 1.0)
    gap = np.concatenate([m.gap for m in maps])
    open_ = e.n0 <= 0
    assert open_.any() and np.allclose(-e.n0[open_] / e.kn[open_], gap[open_], rtol=1e-12)
    e, _ = friction_elements(None, maps, Contact(normal="prescribed"), 1.0)
    assert (e.kn == 0).all() and (e.n0 >= 0).all()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
@pytest.mark.parametrize("name", ["kn_area", "kt_area"])
def test_a_layer_without_stiffness_is_refused(maps, name, value):
    """Also where the normal load is prescribed: the seating needs the layer."""
    contact = Contact(**{name: value}, normal="prescribed")
    with pytest.raises(InputError, match=r"stiffness is .* N/m, expected a positive"):
        friction_elements(None, maps, contact, 1.0)


def test_elements_of_a_patch_are_connected_halves(maps):
    patch = maps[0].patch
    G = aggregation_matrix(patch, 2)
    label = np.asarray(G.argmax(axis=1)).ravel()
    # the shorter side of this seat is along its slope
    slope = patch.points @ patch.frame.mean(axis=0)[1:].T
    across = slope[:, np.argmin(np.ptp(slope, axis=0))]
    # a row of nodes may be shared by both halves
    assert across[label == 0].max() <= across[label == 1].min() + 1e-9 or (
        across[label == 1].max() <= across[label == 0].min() + 1e-9
    )


@pytest.mark.parametrize(("points", "across"), [(2, 2), (4, 2), (8, 4), (16, 4)])
def test_parts_of_a_patch_resist_a_roll_about_its_longer_side(maps, points, across):
    """As `across` springs side by side do at least: with one point across the seat a damper that
    rolls would meet no stiffness.
    """
    patch = maps[0].patch
    x = patch.points @ patch.frame.mean(axis=0)[1:].T
    x = x[:, np.argmin(np.ptp(x, axis=0))]
    x = x - patch.area @ x / patch.area.sum()
    G = aggregation_matrix(patch, points).toarray()
    label = G.argmax(axis=1)
    area = np.bincount(label, patch.area)
    found = area @ (G.T @ x) ** 2
    # a strip of this width in equal parts
    expected = patch.area.sum() * np.ptp(x) ** 2 / 12 * (1 - 1 / across**2)
    assert 0.95 * expected <= found <= patch.area @ x**2


def test_normal_stiffness_of_eq_23(problem, maps):
    k = normal_stiffness(problem, maps)
    force = np.concatenate([m.force for m in maps])
    assert (k[force > 0] > 0).all() and (k[force == 0] == 0).all()
    pressed = force > 0
    assert force[pressed] / k[pressed] == pytest.approx(
        (problem.flexibility @ force)[pressed], rel=1e-12
    )


def test_resultants_balance_the_pull(problem, maps):
    """Next blade's seat turned back into this sector's frame: both forces and the pull, which is
    radial, add up to zero, and so do their moments; with forces at the nodes' own places these
    would miss by 2e-4 here.
    """
    turn = wedge_mesh(ALPHA).sector.rotation
    this, following = (resultant(m) for m in maps)
    total = this.force + turn @ following.force + SPEED**2 * problem.load[:3]
    assert np.abs(total).max() < 1e-9 * np.linalg.norm(this.force)
    assert np.abs(this.moment + turn @ following.moment).max() < 1e-9 * np.linalg.norm(this.moment)
    assert this.normal == pytest.approx(np.linalg.norm(this.force), rel=1e-12)
    assert this.share < 1 and this.peak > this.normal / this.area


def tilted(problem):
    """Direct solves over (normal load, opposite approach of the two platforms)."""
    lean = platform_tilt(problem)

    def direct(load, tilt):
        return np.concatenate(
            [m.force for m in solve_seating(problem, SPEED, normal=load, approach=tilt * lean)]
        )

    return direct


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tilt_of_one_platform_is_linear_in_place(dimension):
    """As port means: the chi-weighted means of the place along the slope, scaled to -1 and 1;
    nothing on the other.
    """
    mesh = wedge_mesh(ALPHA, dimension=dimension)
    problem = condensed(mesh)
    patch, tilt = problem.patches[0], platform_tilt(problem)
    place = patch_means(patch, mesh).T @ (mesh.points @ patch.frame[0, 1])
    exact = np.interp(place, [place.min(), place.max()], [-1.0, 1.0])
    n = len(place)
    assert min(np.abs(tilt[:n] - exact).max(), np.abs(tilt[:n] + exact).max()) < 1e-12
    assert (tilt[n:] == 0).all()


def test_what_the_floating_damper_follows_moves_no_force(problem):
    """Both platforms lifted, shifted and tilted alike along the axis; a tilt of one alone does move
    the pressure.
    """
    before, mesh = direct_force(problem, np.zeros(50)), wedge_mesh(ALPHA)
    z = np.concatenate([patch_means(p, mesh).T @ mesh.points[:, 2] for p in problem.patches])
    for common in (
        z / np.abs(z).max(),
        np.ones(len(z)),
        *(problem.rigid.T / np.abs(problem.rigid).max()),
    ):
        assert np.abs(direct_force(problem, 9e-6 * common) - before).max() < 1e-10 * before.max()
    assert (
        np.abs(direct_force(problem, 1e-6 * platform_tilt(problem)) - before).max()
        > 0.01 * before.max()
    )


def direct_force(problem, approach):
    return np.concatenate(
        [
            m.force
            for m in solve_seating(problem, SPEED, normal=80.0, approach=approach, bedded=True)
        ]
    )


def test_a_seat_that_faces_the_axis_and_one_without_extent(problem):
    """The turn about the axis moves nothing there: another one does, or none, and no 0/0."""
    n = len(problem.patches[0].area)
    facing, point = problem.rigid.copy(), np.ones_like(problem.rigid)
    facing[:, -1] = 0.0
    other = platform_tilt(replace(problem, rigid=facing))
    assert np.ptp(other[:n]) == 2 and (other[n:] == 0).all()
    assert (platform_tilt(replace(problem, rigid=point)) == 0).all()


def test_a_table_of_open_states_has_no_error():
    table = state_table(lambda load, lift: np.zeros(4), [[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]])
    force, indicator = interpolate_states(table, (0.5, 1.5))
    assert (force == 0).all() and indicator == 0


def test_table_of_states_and_its_indicator(problem):
    """Halving the steps divides the error by two or more (kinks), and the indicator lies above the
    true error.
    """
    direct = tilted(problem)
    points = [(120.0, 0.4e-6), (170.0, -0.3e-6), (199.0, 0.9e-6), (133.0, 0.1e-6)]
    errors, indicators = [], []
    for steps in (2, 4, 8, 16):
        table = state_table(
            direct, [np.linspace(100, 200, steps + 1), np.linspace(-1e-6, 1e-6, steps + 1)]
        )
        found = [interpolate_states(table, p) for p in points]
        errors.append(
            max(np.abs(f - direct(*p)).max() for (f, _), p in zip(found, points, strict=True))
            / table.force.max()
        )
        indicators.append(max(i for _, i in found))
    errors, indicators = np.array(errors), np.array(indicators)
    assert errors[-1] < errors[0] / 10
    assert (indicators > errors).all() and (
        indicators < 6 * errors
    ).all()  # measured 2.0 to 3.4 times


def test_the_user_is_told_whether_the_table_is_enough(problem):
    """A narrow range of loads without tilt is linear to 1 %; micrometres of tilt move the contact
    area.
    """
    scene = bladefem.load_scene("scenes/wedge.toml", ["contact.bedded=true"])
    narrow = check_states(scene, problem, [100.0, 110.0], 1e-10)
    wide = check_states(scene, problem, [20.0, 200.0], 5e-6)
    assert narrow.states == 25 and narrow.enough and narrow.error < 1e-3
    assert not wide.enough and wide.indicator > wide.error > 0.05
    assert "is enough" in state_sentence(scene, problem, [100.0, 110.0], 1e-10)
    assert "is NOT enough" in state_sentence(scene, problem, [20.0, 200.0], 5e-6)


def test_an_interpolation_off_by_rounding_is_given_without_its_zeros(problem, monkeypatch):
    """It was 0.000000000000056 % of the largest force."""
    scene = bladefem.load_scene("scenes/wedge.toml")
    for error, said in ((5.6e-16, "by less than 0.000001 % of"), (0.012, "by up to 1.2 % of")):
        check = StateCheck(25, error, error, 1e-3)
        monkeypatch.setattr(state_check, "check_states", lambda *_, found=check: found)
        assert said in state_sentence(scene, problem, [100.0, 110.0], 1e-10)


@pytest.mark.parametrize("kink", [0.4, 0.5, 0.55])
def test_indicator_of_a_kink_and_of_a_parabola(kink):
    """Exact for the largest error of one kink in the cell; four times that of a smooth force."""
    axes = [np.linspace(0, 1, 6), np.linspace(0, 1, 3)]
    bent = state_table(lambda x, y: np.array([abs(x - kink), 1.0]), axes)
    force, error = interpolate_states(bent, (0.5, 0.0))
    assert error == pytest.approx((kink - 0.4) * (0.6 - kink) * 2 / 0.2, abs=1e-15)
    if kink == 0.5:
        assert error == pytest.approx(force[0])
    curved = state_table(lambda x, y: np.array([x**2, 1.0]), axes)
    force, error = interpolate_states(curved, (0.5, 0.0))
    assert error == pytest.approx(4 * (force[0] - 0.25))


def test_table_is_exact_on_its_points(problem):
    direct = tilted(problem)
    table = state_table(direct, [[100.0, 150.0, 200.0], [-1e-6, 0.0, 1e-6]])
    force, indicator = interpolate_states(table, (150.0, 1e-6))
    assert np.allclose(force, direct(150.0, 1e-6), atol=1e-9) and indicator == 0
    with pytest.raises(InputError, match="inside the table"):
        interpolate_states(table, (99.0, 0.0))
    with pytest.raises(InputError, match="ascending"):
        state_table(direct, [[1.0, 2.0], [0.0, 1.0, 2.0]])


def test_quasi_static_condition(maps):
    """c = 5172 m/s for steel; the seat is about 33 mm across, so T = 10 D / c at some 16 kHz."""
    slow, fast = (quasi_static(maps[0].patch, Material(), f) for f in (1000.0, 50000.0))
    extent = np.hypot(0.03, 0.01 / np.cos(ALPHA))
    assert slow.transit == pytest.approx(extent / np.sqrt(2.1e11 / 7850), rel=1e-12)
    assert slow.holds and not fast.holds and "NOT" in fast.sentence


def test_pressure_is_force_over_area(maps):
    m = maps[0]
    assert isinstance(m, PressureMap) and np.array_equal(m.pressure, m.force / m.patch.area)
