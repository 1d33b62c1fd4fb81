"""Steps of disturbances: bodies by groups of modes, and springs of closed contacts in the bodies."""

from dataclasses import replace

import numpy as np
import pytest
from models import bouncing
from scipy import linalg

from bladefem.hbm.closed_contacts import coupled_groups
from bladefem.hbm.linearised_flow import linear_steps
from bladefem.hbm.sector_modes import sector_modes
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import _leading


def test_groups_of_modes_step_as_all_of_them_together():
    model = bouncing()
    system = sector_modes(model)
    M = len(system.stiffness)
    # the first and the last mode share their damping
    damping = system.damping.copy()
    damping[0, -1] = damping[-1, 0] = 0.3 * damping[0, 0]
    system = replace(system, damping=damping)
    groups = coupled_groups(system.stiffness_matrix, damping)
    assert sorted(len(group) for group in groups) == [1] * (M - 2) + [2]
    dt = 0.7
    E, G0, G1 = linear_steps(system, dt)
    A = np.zeros((2 * M, 2 * M))
    A[:M, M:] = np.eye(M)
    A[M:, :M] = -system.stiffness_matrix
    A[M:, M:] = -damping
    np.testing.assert_allclose(E, linalg.expm(A * dt), atol=1e-12)
    # a force that rises from one to three, by many short steps of the mean force
    start, end = np.ones(M), 3 * np.ones(M)
    parts = 4000
    state = np.zeros(2 * M)
    short = linalg.expm(A * dt / parts)
    for k in range(parts):
        force = start + (k + 0.5) / parts * (end - start)
        half = np.concatenate([np.zeros(M), force * dt / parts / 2])
        state = short @ (state + half) + half
    np.testing.assert_allclose(G0 @ start + G1 @ end, state, rtol=1e-6, atol=1e-9)


def test_stiff_normal_springs_that_stay_closed_need_no_short_steps():
    """A contact that never lifts off is a spring of the bodies: its frequency, some fifty times
    that of the excitation, does not ask for instants. As a force between two instants it is 18 %
    wrong.
    """
    model = bouncing()
    one = np.ones(1)
    elements = replace(model.elements, kn=4000 * one, kt=one, n0=0.2 * one)
    model = replace(model, elements=elements)
    point = solve(model, 1.3, 7, 512)
    assert point.converged and point.states["slip"] == 1
    system = sector_modes(model)
    coarse, fine = (abs(_leading(model, point, system, S, np.inf)) for S in (128, 4096))
    assert coarse == pytest.approx(fine, rel=2e-3)
