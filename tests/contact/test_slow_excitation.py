"""Excitation far below the first resonance: the balance follows the sequence of static states with
friction history, between a soft, a stiff and a split layer.
"""

import numpy as np
import pytest
from small_patch import FRICTION, blade_side, layer_elements, patch_model, patch_on_half_space

from bladefem.hbm.solve import solve

# a thousandth of the first resonance [rad/s]
OMEGA = 2 * np.pi * 0.38
STEPS = 240
PERIODS = 3
HARMONICS = 31


def return_map(elements, old, shift, w_n):
    """Forces (n, 3) and their derivatives (n, 3, 3) by the displacements after a tangential shift
    (n, 2) from the state that carried the friction forces old (n, 2); written for this test.
    """
    n = len(w_n)
    f = np.zeros((n, 3))
    D = np.zeros((n, 3, 3))
    normal = elements.n0 + elements.kn * w_n
    for i in np.flatnonzero(normal > 0):
        kt = elements.kt[i]
        limit = FRICTION * normal[i]
        trial = old[i] + kt * shift[i]
        size = np.linalg.norm(trial)
        f[i, 0] = normal[i]
        D[i, 0, 0] = elements.kn[i]
        if size <= limit:
            f[i, 1:] = trial
            D[i, 1:, 1:] = kt * np.eye(2)
        else:
            along = trial / size
            f[i, 1:] = limit * along
            D[i, 1:, 0] = FRICTION * elements.kn[i] * along
            D[i, 1:, 1:] = limit * kt / size * (np.eye(2) - np.outer(along, along))
    return f, D


def static_sequence(side, elements, force):
    """Motion of the probe (STEPS,) and friction work over the last of PERIODS of the force, each
    state by Newton from the one before; statics alone, layer not split.
    """
    ports = side.ports["contact"].stop
    n = ports // 3
    modal = side.shapes / side.omega
    static = modal @ modal.T + side.residual
    G = static[:ports, :ports]
    by_force = static[:ports, side.ports["load"]][:, 0]
    probe = static[side.ports["probe"]][0]
    rest = np.column_stack([elements.n0, np.zeros((n, 2))])
    w = np.zeros((n, 3))
    f = rest
    motion = []
    work = 0.0
    for step in range(1, PERIODS * STEPS + 1):
        before = w
        held = f
        for _ in range(60):
            f, D = return_map(elements, held[:, 1:], (w - before)[:, 1:], w[:, 0])
            free = by_force * force * np.cos(2 * np.pi * step / STEPS)
            residual = w.ravel() - free + G @ (f - rest).ravel()
            if np.linalg.norm(residual) < 1e-12 * np.linalg.norm(by_force * force):
                break
            blocks = np.zeros((ports, ports))
            for i in range(n):
                blocks[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = D[i]
            w = w - np.linalg.solve(np.eye(ports) + G @ blocks, residual).reshape(n, 3)
        else:
            raise AssertionError(f"static step {step} was not solved")
        if step > (PERIODS - 1) * STEPS:
            excited = probe[side.ports["load"]][0] * force * np.cos(2 * np.pi * step / STEPS)
            motion.append(excited - probe[:ports] @ (f - rest).ravel())
            work += float(np.sum((f + held)[:, 1:] / 2 * (w - before)[:, 1:]))
    return np.array(motion), work


@pytest.mark.parametrize("areal", [4e10, 4e12, 4e13])
@pytest.mark.parametrize("force", [60.0, 200.0])
def test_slow_excitation_follows_the_sequence_of_static_states(areal, force):
    """All contacts slip, and all but the softest under the smaller force lift off."""
    patch, local = patch_on_half_space()
    side = blade_side(patch, local)
    motion, work = static_sequence(side, layer_elements(patch, areal), force)
    model = patch_model(areal, force)
    assert (model.series is None) == (areal == 4e10)
    point = solve(model, OMEGA, HARMONICS, 1024)
    assert point.converged and point.states["stick"] == 0
    assert (point.states["lift"] > 0) == (areal > 4e10 or force > 60.0)
    assert point.work.dissipated == pytest.approx(work, rel=3e-3)
    # the sequence begins one step after the top of the force
    turn = np.exp(-2j * np.pi * np.arange(4) / STEPS)
    harmonics = np.fft.fft(motion)[:4] / STEPS * turn * np.array([1.0, 2.0, 2.0, 2.0])
    assert abs(harmonics - point.probe[:4, 0]).max() < 1e-3 * abs(harmonics[1])
