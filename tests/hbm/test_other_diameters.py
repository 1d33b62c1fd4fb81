"""Disturbances of a wave in the other nodal diameters: against a lumped ring marched in time."""

from dataclasses import replace

import numpy as np
import pytest
from test_stability import largest_multiplier

from bladefem.data import Elements
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.other_diameters import class_angle, class_growth
from bladefem.hbm.sector_modes import blades_of_wave
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import STABLE, stability_verdict
from bladefem.reduction.matrices import port_model_from_matrices

SECTORS = 6
ENGINE_ORDER = 2
M = np.eye(3)
K = np.array([[2.0, -0.3, 0.1], [-0.3, 1.5, 0.2], [0.1, 0.2, 1.2]])
# springs between the same masses of neighbours
COUPLING = np.diag([0.25, 0.1, 0.15])
PORTS = {"contact": [0, 1, 2], "load": [0, 1], "probe": [0]}
FORCE = np.array([0.1, 0.08j])
KT, KN, MU, N0 = 1.0, 2.0, 0.4, 0.15


def ring_model(d=0, damping=0.02, force=1.0):
    """A blade of the ring, its harmonic h in nodal diameter 2 h + d.

    Args:
        damping: over the stiffness [s].
        force: over FORCE.
    """
    angles = 2 * np.pi * (ENGINE_ORDER * np.arange(10) + d) / SECTORS
    stiff = [K + 2 * (1 - np.cos(angle)) * COUPLING for angle in angles]
    sides = tuple(port_model_from_matrices(M, k, PORTS, C=damping * k) for k in stiff)
    contact = Elements(*(np.array([x]) for x in (KT, KN, MU, N0)), tangents=2)
    return ReducedModel(sides, contact, {1: force * FORCE})


def growth_of_odd_diameters(point, damping, force, periods=30, steps=1000):
    """Factor a period of what opposite blades do not do alike, in a plain march of all six."""
    H = point.harmonics
    blade = np.arange(SECTORS)
    turn = np.exp(2j * np.pi * np.outer(np.arange(H + 1), blade) * ENGINE_ORDER / SECTORS)
    motion = np.concatenate([point.w[0, :, :1], point.w[0, :, 1::2] - 1j * point.w[0, :, 2::2]], 1)
    forces = np.concatenate([point.f[0, :, :1], point.f[0, :, 1::2] - 1j * point.f[0, :, 2::2]], 1)
    x = (motion @ turn).real.T
    v = (motion * (1j * point.omega * np.arange(H + 1)) @ turn).real.T
    slider = x[:, 1:] - (forces @ turn).real.T[:, 1:] / KT
    odd = np.random.default_rng(1).normal(size=(3, 3))
    x = x + 1e-6 * np.concatenate([odd, -odd])
    phase = 2 * np.pi * blade * ENGINE_ORDER / SECTORS
    dt = 2 * np.pi / point.omega / steps
    load = force * np.append(FORCE, 0.0)
    left = np.empty(periods)
    for k in range(periods * steps):
        if k % steps == 0:
            left[k // steps] = np.hypot(
                np.linalg.norm(x[:3] - x[3:]), np.linalg.norm(v[:3] - v[3:])
            )
        both = x + damping * v
        inner = both @ K + (2 * both - np.roll(both, 1, 0) - np.roll(both, -1, 0)) @ COUPLING
        normal = np.maximum(N0 + KN * x[:, 0], 0.0)
        trial = KT * (x[:, 1:] - slider)
        size = np.linalg.norm(trial, axis=1)
        trial *= np.minimum(1.0, MU * normal / np.maximum(size, 1e-300))[:, None]
        slider = x[:, 1:] - trial / KT
        drive = (load * np.exp(1j * (point.omega * k * dt + phase))[:, None]).real
        friction = np.column_stack([normal - N0, trial])
        v = v + dt * (drive - inner - friction)
        x = x + dt * v
    settled = np.arange(periods // 2, periods)
    return float(np.exp(np.polyfit(settled, np.log(left[settled]), 1)[0]))


@pytest.mark.parametrize(("damping", "force"), [(0.02, 1.0), (0.01, 2.0)])
def test_disturbances_of_a_lumped_ring(damping, force):
    """With more force the wave is stable by its own diameters, and left by the others."""
    model = ring_model(0, damping, force)
    assert blades_of_wave(model) == 3
    point = solve(model, 1.3, 9, 1024)
    angle = class_angle(1, ENGINE_ORDER, SECTORS)
    found = class_growth(model, point, ring_model(1, damping), angle).multiplier
    assert found == pytest.approx(growth_of_odd_diameters(point, damping, force), rel=0.01)
    assert stability_verdict(model, point).verdict == STABLE
    assert (found > 1.1) == (force == 2.0)


def test_the_class_of_the_wave_itself_is_the_verdict():
    model = ring_model()
    point = solve(model, 1.3, 9, 1024)
    # the instants are a multiple of the three blades after which the wave repeats
    own = largest_multiplier(model, point, 258)
    assert stability_verdict(model, point).multiplier == pytest.approx(own, rel=1e-5)
    assert class_growth(model, point, model, 0.0).multiplier == pytest.approx(own, rel=1e-8)
    # the same wave seen from the next blade of the ring, and the other way round
    same = replace(model, sides=ring_model(ENGINE_ORDER).sides)
    angle = class_angle(ENGINE_ORDER, ENGINE_ORDER, SECTORS)
    assert class_growth(model, point, same, angle).multiplier == pytest.approx(own, rel=1e-8)
    classes = [(ring_model(d), class_angle(d, ENGINE_ORDER, SECTORS)) for d in (1, -1)]
    pair = [class_growth(model, point, *of_class).multiplier for of_class in classes]
    assert pair[0] == pytest.approx(pair[1], rel=1e-8)
