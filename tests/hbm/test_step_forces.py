"""Contact forces of a step in time, where nodes of a stiff layer push each other to and fro."""

import numpy as np
import pytest
from numba import njit

from bladefem.friction.simd.node_steps import node_steps
from bladefem.friction.time_step import step_1d, step_2d
from bladefem.hbm.blade_forces import no_factors
from bladefem.hbm.ring_contacts import (
    in_places,
    places_of_directions,
    places_of_nodes,
    ring_contacts,
)
from bladefem.hbm.ring_contacts import violation as one_violation
from bladefem.hbm.step_forces import contact_forces, step_room

NODES = 8
MU = 0.3


def wanted(f, before, case):
    """Forces by the law at the motion that the forces f make, node by node."""
    w = case["c"] - case["F"] @ f.ravel()
    found = np.empty_like(f)
    loads = case.get("load0", case["load"]), case["load"]
    for i, (kt, kn, mu) in enumerate(case["table"]):
        old = before["w"][3 * i : 3 * i + 3]
        own = w[3 * i : 3 * i + 3]
        N0, N1 = loads[0][i] + kn * old[0], loads[1][i] + kn * own[0]
        found[i, 0] = max(N1, 0.0)
        found[i, 1:] = step_2d(*before["f"][i, 1:], *(kt * (own - old)[1:]), N0, N1, mu)[:2]
    return found


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("stiffness", [1e8, 1e9, 1e10])
def test_forces_are_those_of_the_motion_that_they_make(seed, stiffness):
    generator = np.random.default_rng(seed)
    m = 3 * NODES
    shapes = generator.standard_normal((m, 4))
    flexibility = 1e-8 * (shapes @ shapes.T + 0.02 * np.eye(m))
    f = np.zeros((NODES, 3))
    f[:, 0] = generator.uniform(5.0, 20.0, NODES)
    f[:, 1] = 0.9 * MU * f[:, 0]
    w = 1e-9 * generator.standard_normal(m)
    table = np.tile([0.8 * stiffness, stiffness, MU], (NODES, 1))
    load = f[:, 0] - stiffness * w[::3]
    c = w + flexibility @ f.ravel() + 2e-7 * generator.standard_normal(m)
    case = {"c": c, "F": flexibility, "table": table, "load": load}
    before = {"f": f.copy(), "w": w.copy()}
    extra = f.ravel().copy()
    assert contact_forces_of(case, w, f, extra)
    np.testing.assert_allclose(f, wanted(f, before, case), atol=1e-5 * f.max())
    np.testing.assert_allclose(extra, f.ravel())


def test_nodes_that_open_or_close_in_a_step_are_found_from_the_rest():
    """Under a preload, with a flexibility that is not symmetric, as coupled damping makes it."""
    generator = np.random.default_rng(3)
    m = 3 * NODES
    F = 1e-9 * (generator.standard_normal((m, m)) + 8 * np.eye(m))
    table = np.tile([4e7, 5e7, MU], (NODES, 1))
    preload = generator.uniform(0.0, 5.0, m)
    w = np.zeros(m)
    # half of them open before, a quarter and another after
    w[::3] = np.tile([1e-7, -1e-6], NODES // 2)
    after = np.tile([1e-7, -1e-6, -1e-6, 2e-7], NODES // 4)
    load = np.zeros(NODES)
    f = np.zeros((NODES, 3))
    f[:, 0] = np.maximum(5e7 * w[::3], 0.0)
    start = {"f": f.copy(), "w": w.copy()}
    c = 1e-8 * generator.standard_normal(m)
    c[::3] = after
    extra = f.ravel() - preload
    case = {"c": c, "F": F, "table": table, "load": load}
    assert contact_forces_of(case, w, f, extra, preload)
    law = {**case, "c": c + F @ preload}
    np.testing.assert_allclose(f, wanted(f, start, law), atol=1e-5 * f.max())
    np.testing.assert_allclose(w, c - F @ extra, atol=1e-12)
    np.testing.assert_allclose(extra, f.ravel() - preload)
    assert list(f[:, 0] > 0) == [True, False, False, True] * (NODES // 4)


@pytest.mark.parametrize("blades", [1, 3, 4])
def test_blades_of_a_ring_push_each_other(blades):
    """Five nodes a blade, which do not fill a block."""
    generator = np.random.default_rng(blades)
    nodes = 5
    m = 3 * nodes
    # of all blades by the forces on the first; the same from every blade
    first = 2e-9 * generator.standard_normal((blades, m, m))
    first[0] += 3e-8 * np.eye(m)
    F = np.block([[first[(a - b) % blades] for b in range(blades)] for a in range(blades)])
    f = np.zeros((blades * nodes, 3))
    f[:, 0] = generator.uniform(5.0, 20.0, len(f))
    f[:, 1] = 0.9 * MU * f[:, 0]
    w = 1e-9 * generator.standard_normal(blades * m)
    table = np.tile([8e7, 1e8, MU], (blades * nodes, 1))
    load0 = f[:, 0] - 1e8 * w[::3]
    c = w + F @ f.ravel() + 2e-7 * generator.standard_normal(blades * m)
    case = {"c": c, "F": F, "table": table, "load0": load0, "load": load0 + 1.0}
    before = {"f": f.copy(), "w": w.copy()}
    extra = f.ravel().copy()
    assert contact_forces_of(case, w, f, extra, blades=blades)
    np.testing.assert_allclose(f, wanted(f, before, case), atol=1e-5 * f.max())
    np.testing.assert_allclose(w, c - F @ extra, atol=1e-12)


@njit
def block_steps(table, flexibility, before, old, load0, load1, w, f, step):
    node_steps(0, f.shape[1], table, flexibility, before, old, load0, load1, w, f, step)


@njit
def violation(w, f, i, table, before, load1):
    return one_violation(w, f, i, table, before, load1)


def nodes_of_eight(generator):
    """Table, forces, displacements and loads before a step, and the last two after it, in every
    state and change of state, with and without friction.
    """
    table = np.array([1e8, 1.3e8, 0.0])[:, None] * np.ones(8)
    table[2] = generator.choice([0.0, 0.1, 0.5], 8)
    old, w = 1e-8 * generator.standard_normal((2, 24))
    w[8:] = np.where(generator.random(16) < 0.1, old[8:], w[8:])
    load0, load1 = generator.uniform(-0.5, 2.0, (2, 8))
    normal = np.maximum(load0 + table[1] * old[:8], 0.0)
    friction = generator.choice([0.0, 0.5, 1.0], 8) * table[2] * normal
    turn = generator.uniform(0, 2 * np.pi, 8)
    before = np.array([normal, friction * np.cos(turn), friction * np.sin(turn)])
    return table, before, old, load0, w, load1


@pytest.mark.parametrize("seed", range(20))
def test_steps_of_eight_nodes_are_those_of_each(seed):
    """Forces to rounding; their derivatives, by which the steps are shortened, nearly."""
    generator = np.random.default_rng(seed)
    table, before, old, load0, w, load1 = nodes_of_eight(generator)
    f = before + 0.1 * generator.standard_normal((3, 8))

    def steps(flexibility):
        step, after = np.zeros((3, 8)), f.copy()
        block_steps(table, flexibility, before, old, load0, load1, w, after, step)
        np.testing.assert_allclose(after, f + step)
        return step

    gap = steps(np.zeros((9, 8)))
    apart = []
    for i in range(8):
        one, slopes = violation(w, f, i, table, (before, old, load0), load1)
        assert gap[:, i] == pytest.approx(one, abs=1e-12)
        b00, b10, b20, b11, b12, b22 = slopes
        B = np.array([[b00, 0, 0], [b10, b11, b12], [b20, b12, b22]])
        for k in range(3):
            flexibility = np.zeros((9, 8))
            flexibility[4 * k] = 1e-9
            step = steps(flexibility)[:, i]
            # (1 + B F) x = gap
            apart.append((gap[:, i] - step) / step[k] - 1e-9 * B[:, k])
    # of up to 0.13; how long a node slips in the step is taken a little differently
    assert abs(np.array(apart)).max() < 0.06
    assert abs(np.array(apart)).mean() < 0.002


@pytest.mark.parametrize("turned", [False, True])
def test_eight_nodes_that_move_on_lines_have_the_law_of_one_tangent(turned):
    """With loads that fall and rise faster than the forces, so that these lie against the motion."""
    generator = np.random.default_rng(7)
    for _ in range(100):
        table, before, old, load0, w, load1 = nodes_of_eight(generator)
        table[1] = 0.0
        turn = generator.uniform(0, 2 * np.pi, 8) * turned
        line = np.array([np.cos(turn), np.sin(turn)])
        limits = table[2] * np.maximum(load0, 0.0)
        force = generator.choice([-1.0, -0.6, 0.0, 1.0], 8) * limits
        way = 0.3 * generator.standard_normal(8)
        before[0], before[1:] = np.maximum(load0, 0.0), force * line
        old[8:] = 0.0
        w[8:] = (way / table[0] * line).ravel()
        f, step = before.copy(), np.zeros((3, 8))
        block_steps(table, np.zeros((9, 8)), before, old, load0, load1, w, f, step)
        nodes = zip(force + way, load0, load1, table[2], strict=True)
        wanted = [step_1d(*node) for node in nodes]
        np.testing.assert_allclose(f[1:], np.array(wanted) * line, atol=1e-11)
        np.testing.assert_allclose(f[0], np.maximum(load1, 0.0))


@pytest.mark.parametrize("seed", range(6))
def test_steps_blade_by_blade_are_found_with_factors_of_earlier_ones(seed):
    """A kept inverse may take a node for stuck that slips by now, and make too small a step: of 200
    steps of these rings the worst violations were 2e-5 of the largest force, and are 2e-6.
    """
    generator = np.random.default_rng(seed)
    blades, nodes = 3, 6
    m = 3 * nodes
    shapes = generator.standard_normal((m, 3))
    across = generator.standard_normal((m, m))
    across = 3e-11 * (across + across.T)
    first = [2e-8 * (shapes @ shapes.T + 0.05 * np.eye(m)), across, across]
    F = np.block([[first[(a - b) % blades] for b in range(blades)] for a in range(blades)])
    table = np.tile([8e8, 1e9, MU], (blades * nodes, 1))
    f = np.zeros((blades * nodes, 3))
    f[:, 0] = generator.uniform(5.0, 20.0, len(f))
    w = 1e-9 * generator.standard_normal(blades * m)
    load = f[:, 0] - 1e9 * w[::3]
    kept = no_factors(blades, 3 * len(places_of_nodes(nodes)))
    # node by node is not tried
    kept.steps[0] = 1000
    change = np.zeros(blades * m)
    for _ in range(200):
        change = 0.9 * change + 1e-10 * generator.standard_normal(blades * m)
        case = {"c": w + F @ f.ravel() + change, "F": F, "table": table, "load": load}
        before = {"f": f.copy(), "w": w.copy()}
        assert contact_forces_of(case, w, f, f.ravel().copy(), blades=blades, kept=kept)
        np.testing.assert_allclose(f, wanted(f, before, case), atol=5e-6 * f.max())
    assert kept.steps[0] == 800 and (kept.pivots >= 0).any()


def contact_forces_of(case, w, f, extra, preload=None, blades=1, kept=None):
    """The forces by `contact_forces`, all that it changes counted node by node."""
    n = len(f) // blades
    preload = np.zeros(3 * n * blades) if preload is None else preload
    nodes, places = places_of_nodes(n), places_of_directions(n, 3)
    contacts = ring_contacts(case["table"][:n], case["F"][:, : 3 * n], preload[: 3 * n])
    loads = [
        in_places(load.reshape(blades, n), nodes, -1.0)
        for load in (case.get("load0", case["load"]), case["load"])
    ]
    rows = in_places(f.reshape(blades, n, 3).swapaxes(1, 2), nodes)
    moved, more, c = (in_places(x.reshape(blades, -1), places) for x in (w, extra, case["c"]))
    change, work = np.zeros((2, *rows.shape)), np.zeros(1)
    kept = kept or no_factors(blades, len(places))
    room = step_room(blades, len(nodes))
    found = contact_forces(c, contacts, kept, moved, rows, change, more, *loads, work, room)
    assert work[0] > 0
    there = places >= 0
    for row in range(blades):
        w.reshape(blades, -1)[row, places[there]] = moved[row, there]
        extra.reshape(blades, -1)[row, places[there]] = more[row, there]
        f.reshape(blades, n, 3)[row, nodes[nodes >= 0]] = rows[row][:, nodes >= 0].T
    return found
