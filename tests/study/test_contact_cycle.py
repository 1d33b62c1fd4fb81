"""What contact nodes do in a period at the resonance: maps of work and states against closed
forms.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.data import Elements, Patch
from bladefem.friction.closed_form import circular_orbit_work
from bladefem.friction.states import GROSS_SLIP, STICK
from bladefem.report.linear import harmonic_table, linear_sentence
from bladefem.report.nodes import (
    draw_wear,
    loop_table,
    node_table,
    save_cycles_vtu,
    seat_loops,
    wear_sentence,
    wear_table,
)
from bladefem.report.tables import units_of
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.contact_cycle import contact_cycle
from bladefem.view.hysteresis import loop_energy

KT, MU, N = 2e6, 0.3, 10.0


def strip(name: str, shift: float) -> Patch:
    """Two by four nodes, 1 mm apart, of equal areas."""
    x, z = np.meshgrid(np.arange(2), np.arange(4), indexing="ij")
    points = 1e-3 * np.stack([x.ravel(), np.full(8, shift), z.ravel()], axis=1)
    faces = np.array([[i, i + 1, i + 5] for i in range(3)] + [[i, i + 5, i + 4] for i in range(3)])
    frame = np.tile(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), (8, 1, 1))
    return Patch(
        name=name,
        blade_nodes=np.arange(8),
        points=points,
        frame=frame,
        area=np.full(8, 1e-6),
        faces=faces,
    )


def orbits(radius: np.ndarray, directions: int) -> np.ndarray:
    """(nodes, directions, 7) circular orbits [m], with no normal motion."""
    w = np.zeros((len(radius), directions, 7))
    w[:, -2, 1] = w[:, -1, 2] = radius
    return w


def at_resonance(radius: np.ndarray, directions: int, joined: int | None):
    patches = [strip("this", 0.0), strip("next", 1.0)]
    elements = Elements(np.full(16, KT), np.full(16, KT), np.full(16, MU), np.full(16, N), 2)
    curve = curve_of(orbits(radius, directions), joined)
    return patches, contact_cycle(LoadCase(8 * N, elements, None), curve, patches, None)


def curve_of(w, points=None, **given):
    """A curve whose resonance is this motion of its balance, at 250 Hz."""
    return SimpleNamespace(
        settings=SimpleNamespace(points=points),
        peak=SimpleNamespace(w=w, samples=64, frequency=250.0),
        **{"peak_frequency": 250.0, "work_over_balance": 1.0, "is_march": False} | given,
    )


def test_wear_of_a_march_is_as_large_as_its_friction_work():
    """The map is that of the balance; its loops are called so."""
    radius = np.full(16, 3.0) * MU * N / KT
    patches, balance = at_resonance(radius, 3, None)
    elements = Elements(np.full(16, KT), np.full(16, KT), np.full(16, MU), np.full(16, N), 2)
    march = curve_of(orbits(radius, 3), peak_frequency=249.0, work_over_balance=0.7, is_march=True)
    cycle = contact_cycle(LoadCase(8 * N, elements, None), march, patches, None)
    np.testing.assert_allclose(cycle.work, 0.7 * balance.work, rtol=1e-12)
    assert cycle.frequency == 249.0
    assert cycle.wear(1e-14) == pytest.approx(0.7 * 249 / 250 * balance.wear(1e-14))
    assert [name.endswith("its balance") for name in seat_loops([balance, cycle])] == [False, True]


@pytest.mark.parametrize("directions", [2, 3])
def test_work_and_states_of_circular_orbits(directions):
    """Half of the nodes stick; a model without normal motion (2 directions) keeps its static
    load.
    """
    radius = np.r_[np.full(8, 0.5), np.full(8, 3.0)] * MU * N / KT
    patches, cycle = at_resonance(radius, directions, None)
    exact = [circular_orbit_work(r, KT, MU * N) for r in radius]
    np.testing.assert_allclose(1e-6 * cycle.work, exact, rtol=1e-10, atol=1e-18)
    assert list(cycle.state) == [STICK] * 8 + [GROSS_SLIP] * 8
    table = node_table(patches, [cycle])
    assert (table["area"] * table["work"]).sum() == pytest.approx(sum(exact), rel=1e-10)
    assert list(table["patch"]) == ["right"] * 8 + ["left"] * 8
    np.testing.assert_allclose(
        table[["mu", "kt", "kn", "n0"]], np.tile([MU, KT, KT * (directions == 3), N], (16, 1))
    )


def test_joined_nodes_share_the_work_of_their_element():
    """One element on each patch, as the choice of the model may leave: 8 springs and loads in
    one.
    """
    radius = np.array([0.5, 3.0]) * MU * N / KT
    patches, cycle = at_resonance(radius, 3, 1)
    np.testing.assert_allclose(cycle.work[:8], 0, atol=1e-12)
    np.testing.assert_allclose(
        8e-6 * cycle.work[8:], circular_orbit_work(radius[1], 8 * KT, 8 * MU * N), rtol=1e-10
    )
    sums = node_table(patches, [cycle]).groupby("patch")[["kt", "kn", "n0"]].sum()
    np.testing.assert_allclose(sums, np.tile([8 * KT, 8 * KT, 8 * N], (2, 1)))
    np.testing.assert_allclose(cycle.elements.mu, MU)


@pytest.mark.parametrize("joined", [None, 1])
def test_optimal_approximation_of_circular_orbits(joined):
    """The force of size F lags by asin(W / 2 pi F A): K = F cos / A, omega C = F sin / A; stuck
    nodes have K = k_t.
    """
    radius = (
        (np.r_[np.full(8, 0.5), np.full(8, 3.0)] if joined is None else np.array([0.5, 3.0]))
        * MU
        * N
        / KT
    )
    patches, cycle = at_resonance(radius, 3, joined)
    sine = circular_orbit_work(radius[-1], KT, MU * N) / (2 * np.pi * MU * N * radius[-1])
    K, C = (
        MU * N / radius[-1] * np.sqrt(1 - sine**2),
        MU * N / radius[-1] * sine / (2 * np.pi * 250.0),
    )
    np.testing.assert_allclose(
        cycle.linear.stiffness, np.repeat([[KT], [K]], 8, axis=0) * [1, 1], rtol=1e-9
    )
    np.testing.assert_allclose(
        cycle.linear.damping, np.repeat([[0.0], [C]], 8, axis=0) * [1, 1], atol=1e-9 * C
    )
    np.testing.assert_allclose(cycle.linear.constant, 0, atol=1e-9 * MU * N)
    table, harmonics = node_table(patches, [cycle]), harmonic_table(patches, [cycle])
    np.testing.assert_allclose(table["k_ad_t2"], cycle.linear.stiffness[:, 1])
    assert {"c_ad_t1", "c_ad_t2", "f_c0_t1", "f_c0_t2"} <= set(table)
    assert len(harmonics) == 16 * 2 * 3
    first = harmonics[harmonics["harmonic"] == 1]
    np.testing.assert_allclose(
        first["c_ad"].to_numpy().reshape(16, 2), cycle.linear.damping, atol=1e-9 * C
    )
    assert (
        harmonics[harmonics["harmonic"] > 1]["k_ad"].isna().all()
    )  # the orbit has the first one only
    assert cycle.mismatch < 1e-12
    assert "apart by" in linear_sentence([cycle])


def test_a_node_at_rest_has_no_approximation():
    _, cycle = at_resonance(np.r_[np.zeros(8), np.full(8, 3.0)] * MU * N / KT, 3, None)
    assert np.isnan(cycle.linear.stiffness[:8]).all()
    assert np.isfinite(cycle.linear.stiffness[8:]).all()
    assert cycle.mismatch < 1e-12


def test_pictures_and_paraview(tmp_path):
    import pyvista

    patches, cycle = at_resonance(np.full(16, 3.0) * MU * N / KT, 3, None)
    draw_wear(patches, cycle, tmp_path / "work.png")
    assert (tmp_path / "work.png").stat().st_size > 10_000
    grid = pyvista.read(save_cycles_vtu(patches, [cycle], tmp_path / "work.vtu"))
    np.testing.assert_allclose(grid["friction work [J/m^2] at 80 N"], cycle.work)
    np.testing.assert_allclose(grid["share of slip at 80 N"], 1)


def test_hysteresis_of_a_patch_is_the_loop_of_its_springs():
    """All nodes of a patch move alike along one line: a loop of the textbook, 4 mu N (X - mu N /
    kt), forces add up.
    """
    patches = [strip("this", 0.0), strip("next", 1.0)]
    elements = Elements(np.full(16, KT), np.full(16, KT), np.full(16, MU), np.full(16, N), 2)
    w = np.zeros((16, 3, 7))
    w[:8, 1, 1], w[:8, 2, 1], w[8:, 2, 2] = 1.8 * MU * N / KT, 2.4 * MU * N / KT, 0.5 * MU * N / KT
    loops = contact_cycle(LoadCase(8 * N, elements, None), curve_of(w), patches, None).loops
    sliding, stuck = loops["this"], loops["next"]
    limit = 8 * MU * N
    assert loop_energy(sliding.displacement, sliding.force) == pytest.approx(
        4 * limit * 2 * MU * N / KT, rel=1e-3
    )
    assert abs(sliding.displacement).max() == pytest.approx(3 * MU * N / KT, rel=1e-12)
    assert abs(sliding.force).max() == pytest.approx(limit, rel=0.02)  # the corners of 63 harmonics
    np.testing.assert_allclose(stuck.force, 8 * KT * stuck.displacement, atol=1e-9 * limit)


def test_the_columns_of_loops_have_units():
    _, cycle = at_resonance(np.full(16, 3.0) * MU * N / KT, 3, None)
    units = units_of(loop_table([cycle]))
    assert units == {"load": "N", "phase": "rad", "displacement": "m", "force": "N"}


def test_wear_is_archards_law_on_circular_orbits(tmp_path):
    """Depth in an hour: k_Archard pressure times sliding path, 2 pi sqrt(r^2 - (mu N / k_t)^2) a
    period at 250 Hz.
    """
    import pyvista

    radius = np.r_[np.full(8, 0.5), np.full(8, 3.0)] * MU * N / KT
    patches, cycle = at_resonance(radius, 3, None)
    archard = 3e-15  # m^3 for each newton and metre
    path = 2 * np.pi * np.sqrt(np.clip(radius**2 - (MU * N / KT) ** 2, 0, None))
    exact = archard * N / 1e-6 * path * 250.0 * 3600
    np.testing.assert_allclose(cycle.wear(archard / MU), exact, rtol=1e-10, atol=1e-20)
    table = node_table(patches, [cycle], archard / MU)
    np.testing.assert_allclose(table["wear_per_hour"], exact, rtol=1e-10, atol=1e-20)
    assert "wear_per_hour" not in node_table(patches, [cycle])
    faces = wear_table(patches, [cycle], archard / MU)
    assert list(faces["patch"]) == ["right", "left"] and faces["largest_wear"][0] == pytest.approx(
        0, abs=1e-20
    )
    assert (
        faces["largest_wear"][1] == pytest.approx(faces["mean_wear"][1]) == pytest.approx(exact[-1])
    )
    assert faces["wear_volume"][1] == pytest.approx(8e-6 * exact[-1])
    assert f"up to {1e6 * exact[-1]:.3g} µm in an hour" in wear_sentence([cycle], archard / MU)
    grid = pyvista.read(save_cycles_vtu(patches, [cycle], tmp_path / "work.vtu", archard / MU))
    np.testing.assert_allclose(grid["wear in an hour [m] at 80 N"], exact, rtol=1e-10, atol=1e-20)
