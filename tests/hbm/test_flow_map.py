"""Steps of disturbances: bodies by groups of modes, and springs of closed contacts in the bodies."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from models import block, bouncing, bouncing_wave
from scipy import linalg

from bladefem.hbm.closed_contacts import OpenContacts, coupled_groups
from bladefem.hbm.flow_map import NodeSteps, acting_forces, flow_map
from bladefem.hbm.linearised_flow import group_steps, linear_steps, longest_linear_step
from bladefem.hbm.sector_modes import SectorModes, sector_modes
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import (
    _handed_on,
    _leading,
    begun_at,
    linearised_contacts,
    map_operations,
    verdict_operations,
)


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


@pytest.mark.parametrize("own", [0.0, 1.0, 25.0])
@pytest.mark.parametrize(("share", "mean", "grows"), [(0.98, 0, 0), (1.2, 0, 1), (1.2, 1, 0)])
def test_a_contact_gains_no_energy_in_steps_longer_than_half_its_period(own, share, mean, grows):
    """Of a mass of 1 kg on a spring of its own and one of a contact, beside a flexibility. A force
    that is linear in between feeds it in longer steps, the mean force in none.
    """
    contact, flexibility = 400.0, 1e-3
    joint = 1 / (1 / contact + flexibility)
    one = np.ones((1, 1))
    longest = longest_linear_step(own * one, one, flexibility * one, contact * np.ones(1))
    assert longest == pytest.approx(np.pi / np.sqrt(own + joint))
    system = SectorModes(1, np.array([own]), 0 * one, one, 0 * one, one, one, 0 * one)
    E, G0, G1 = linear_steps(system, share * longest, bool(mean))
    spring = np.array([[joint, 0.0]])
    step = np.linalg.solve(np.eye(2) + G1 @ spring, E - G0 @ spring)
    growth = abs(np.linalg.eigvals(step)).max()
    assert (growth > 1.001) == bool(grows)


def test_contacts_without_springs_ask_for_no_short_steps():
    one = np.ones((1, 1))
    assert longest_linear_step(0 * one, one, 0 * one, np.zeros(1)) == np.inf


def test_a_stiff_contact_that_slips_is_no_instability_of_its_steps():
    """Its frequency, 100 rad/s, is 1.3 times that of half a period in a step: linear forces said
    that a disturbance grows 3e29 times a period, which falls by a sixth.
    """
    model = bouncing()
    one = np.ones(1)
    stiff = replace(model.elements, kt=1e4 * one, n0=0.2 * one)
    model = replace(model, elements=stiff)
    point = solve(model, 0.7, 7, 512)
    assert point.converged and point.states["slip"] == 1
    system = sector_modes(model)
    assert abs(_leading(model, point, system, 128, np.inf)) < 10
    assert abs(_leading(model, point, system, 512, np.inf)) == pytest.approx(0.83, rel=0.01)


def plain_map(contacts: OpenContacts, nodes: NodeSteps, dt: float, steps: int) -> np.ndarray:
    """The map of (q, v, f) with the forces of all nodes in every step, of nodes all of whose
    directions have a force.
    """
    M, m = contacts.push.shape
    every = (np.arange(M),)
    ((_, (E, before, after)),) = group_steps(contacts.stiffness, contacts.damping, every, dt)
    S, n, d, _ = nodes.before.shape
    U, R = contacts.reading, contacts.flexibility
    X, F = np.eye(2 * M, 2 * M + m), np.eye(m, 2 * M + m, 2 * M)
    W = U @ X[:M] - R @ F
    for k in range(1, steps + 1):
        # what acts in a step: the force before it for a share of it, then the one after it
        share = np.repeat(nodes.share[k % S], d)
        start, end = -before @ contacts.push * 2 * share, -after @ contacts.push * 2 * (1 - share)
        of_force, of_end, of_start = (
            linalg.block_diag(*part[k % S])
            for part in (nodes.before, nodes.after_motion, nodes.before_motion)
        )
        X = E @ X + start @ F
        known = of_force @ F + of_start @ W + of_end @ U @ X[:M]
        F = np.linalg.solve(np.eye(m) + of_end @ (R - U @ end[:M]), known)
        X += end @ F
        W = U @ X[:M] - R @ F
    return np.concatenate([X, F])


WITH_LIFT_OFF = [bouncing, bouncing_wave, partial(block, n0=0.02, force=0.5)]


@pytest.mark.parametrize("made", WITH_LIFT_OFF)
def test_operations_are_estimated_from_the_states_of_the_nodes(made):
    """Before anything of the map is made; a verdict with more than are allowed is none."""
    model = made()
    point = solve(model, 1.3, 7, 256)
    system = sector_modes(model)
    contacts, nodes = linearised_contacts(model, point, system, 256)
    exact = map_operations(contacts, acting_forces(contacts, nodes), system.blades)
    assert 0.5 < verdict_operations(model, point) / exact < 1.5
    assert _leading(model, point, system, 256, 0.4 * exact) is None
    assert _leading(model, point, system, 256, 2 * exact) is not None


@pytest.mark.parametrize("made", WITH_LIFT_OFF)
def test_a_period_may_begin_where_most_nodes_are_open(made):
    """With the same multipliers, and fewer disturbances."""
    model = made()
    point = solve(model, 1.3, 7, 256)
    system = sector_modes(model)
    contacts, nodes = linearised_contacts(model, point, system, 128)
    later = begun_at(nodes, int(acting_forces(contacts, nodes).argmin()))
    dt = 2 * np.pi / 1.3 / 128
    maps = [flow_map(contacts, each, dt, 128 // system.blades) for each in (nodes, later)]
    disturbed = [np.count_nonzero(part.any(axis=0)) for part in maps]
    assert disturbed[1] <= disturbed[0]
    one, other = (np.sort(abs(linalg.eigvals(_handed_on(system, part))))[-6:] for part in maps)
    np.testing.assert_allclose(one, other, rtol=1e-8)


@pytest.mark.parametrize("made", WITH_LIFT_OFF)
def test_nodes_that_lift_off_are_left_out_while_they_are_open(made):
    """Against the map with all forces: the same for the forces that a motion has, and the same
    multipliers.
    """
    model = made()
    point = solve(model, 1.3, 7, 256)
    assert point.converged and point.states["lift"] == len(point.w)
    system = sector_modes(model)
    S = 128
    contacts, nodes = linearised_contacts(model, point, system, S)
    steps, dt = S // system.blades, 2 * np.pi / 1.3 / S
    assert 0.2 < acting_forces(contacts, nodes).mean() / contacts.push.shape[1] < 0.9
    found, expected = (carry(contacts, nodes, dt, steps) for carry in (flow_map, plain_map))
    begun = found.any(axis=0)
    np.testing.assert_allclose(found[:, begun], expected[:, begun], rtol=1e-9, atol=1e-11)
    values = [np.sort(abs(linalg.eigvals(_handed_on(system, part)))) for part in (found, expected)]
    np.testing.assert_allclose(*values, atol=1e-7)
    np.testing.assert_allclose(values[0][-4:], values[1][-4:], rtol=1e-9)
