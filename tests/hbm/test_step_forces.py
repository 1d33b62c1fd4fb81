"""Contact forces of a step in time, where nodes of a stiff layer push each other to and fro."""

import numpy as np
import pytest

from bladefem.friction.time_step import step_2d
from bladefem.hbm.step_forces import contact_forces

NODES = 8
MU = 0.3


def wanted(f, before, case):
    """Forces by the law at the motion that the forces f make, node by node."""
    w = case["c"] - case["F"] @ f.ravel()
    found = np.empty_like(f)
    for i, (kt, kn, mu) in enumerate(case["table"]):
        old = before["w"][3 * i : 3 * i + 3]
        own = w[3 * i : 3 * i + 3]
        loads = case["load"][i] + kn * old[0], case["load"][i] + kn * own[0]
        found[i, 0] = max(loads[1], 0.0)
        found[i, 1:] = step_2d(*before["f"][i, 1:], *(kt * (own - old)[1:]), *loads, mu)[:2]
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
    flexibility = F, np.ascontiguousarray(F.T), F @ preload
    work = np.zeros(1)
    assert contact_forces(
        c, flexibility, w, f, np.zeros((2, *f.shape)), extra, table, load, load, preload, work
    )
    assert work[0] > 0
    law = {"c": c + F @ preload, "F": F, "table": table, "load": load}
    np.testing.assert_allclose(f, wanted(f, start, law), atol=1e-5 * f.max())
    np.testing.assert_allclose(w, c - F @ extra, atol=1e-12)
    np.testing.assert_allclose(extra, f.ravel() - preload)
    assert list(f[:, 0] > 0) == [True, False, False, True] * (NODES // 4)


def contact_forces_of(case, w, f, extra):
    load = case["load"]
    zero = np.zeros(len(extra))
    change = np.zeros((2, *f.shape))
    F = case["F"]
    flexibility = F, np.ascontiguousarray(F.T), F @ zero
    return contact_forces(
        case["c"], flexibility, w, f, change, extra, case["table"], load, load, zero, np.zeros(1)
    )
