"""Verdicts on a wave of a wheel of twelve lumped blades, each pair with a wedge damper between
them, against a plain march of all blades and dampers.

Engine order 3 repeats after four blades, in nodal diameters 0, 3 and 6; disturbances of 1, 2, 4 and
5 are a class of their own. Nothing of the library takes part in the march: matrices of the whole
wheel, a return map written here, small explicit steps.
"""

import numpy as np
import pytest
from numba import njit

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.other_diameters import class_angle, class_growth
from bladefem.hbm.sector_modes import blades_of_wave
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve, solve_near
from bladefem.hbm.stability import STABLE, stability_verdict
from bladefem.reduction.assemble import pair_model
from bladefem.reduction.matrices import port_model_from_matrices

SECTORS = 12
ENGINE_ORDER = 3
# platform (x, y, z), and an aerofoil's mass that moves along y
M = np.diag([1.0, 1.0, 1.0, 0.4])
K = np.array(
    [
        [6.0, 0.4, 0.1, 0.0],
        [0.4, 3.0, 0.2, -1.2],
        [0.1, 0.2, 9.0, 0.3],
        [0.0, -1.2, 0.3, 1.6],
    ]
)
# springs of the disk between the platforms of neighbours
DISK = np.diag([0.5, 0.3, 0.4, 0.0])
DAMPING = 0.01
# directions at the two seats of a damper: normal, two tangents; the normal points into the blade
SLOPE = np.pi / 5
LEFT = np.array(
    [
        [np.cos(SLOPE), np.sin(SLOPE), 0.0],
        [-np.sin(SLOPE), np.cos(SLOPE), 0.0],
        [0.0, 0.0, 1.0],
    ]
)
RIGHT = np.array(
    [
        [-np.cos(SLOPE), np.sin(SLOPE), 0.0],
        [np.sin(SLOPE), np.cos(SLOPE), 0.0],
        [0.0, 0.0, 1.0],
    ]
)
DAMPER_MASS = 0.3
KT, KN, MU, N0 = 1.0, 2.0, 0.3, 1.0
LOAD = 0.3
# periods until the wave is steady, and those in which disturbances grow or decay
SETTLING = 110
GROWING = 80
CONTACTS = np.array([LEFT @ np.eye(3, 4), RIGHT @ np.eye(3, 4)])
FORCE = np.array([0.0, 0.0, 0.0, 1.0])


def model_of(force, shift=0, harmonics=31):
    """A blade and a damper, harmonic h in nodal diameter 3 h + shift."""
    ports = {"contact": CONTACTS.reshape(6, 4), "load": FORCE[None], "probe": FORCE[None]}
    sides = []
    for h in range(harmonics + 1):
        phase = 2 * np.pi * (ENGINE_ORDER * h + shift) / SECTORS
        stiff = K + 2 * (1 - np.cos(phase)) * DISK
        body = port_model_from_matrices(M, stiff, ports, C=DAMPING * stiff)
        sides.append(pair_model(body, slice(3, 6), phase))
    contact = Elements(*(np.full(2, x) for x in (KT, KN, MU, N0)), tangents=2)
    damper = RigidBody(DAMPER_MASS * np.eye(3), CONTACTS.reshape(6, 4)[:, :3])
    return ReducedModel(tuple(sides), contact, {1: np.array([force])}, damper=damper)


# in loops: expressions of whole arrays take 11 s to compile, loops 1 s
@njit(cache=True)
def march(state, slider, old, matrices, steps, omega, force):
    """Symplectic Euler steps of one period; returns the aerofoils' motion (steps, blades).

    state: x, v (blades, 4) and y, u (blades, 3) of blades and dampers; slider, old (blades, 2, 2)
    friction forces and tangential displacements of the two seats of each damper.
    """
    x, v, y, u = state
    alone, disk, contacts, inertia = matrices
    blades = len(x)
    dt = 2 * np.pi / omega / steps
    out = np.empty((steps, blades))
    z = np.empty((blades, 4))
    push = np.empty((blades, 4))
    lift = np.empty((blades, 3))
    w = np.empty(3)
    f = np.empty(3)
    for i in range(steps):
        for b in range(blades):
            for a in range(4):
                z[b, a] = x[b, a] + DAMPING * v[b, a]
            for a in range(3):
                lift[b, a] = 0.0
        for b in range(blades):
            after = (b + 1) % blades
            for a in range(4):
                push[b, a] = disk[a] * (z[b - 1, a] + z[after, a])
                for c in range(4):
                    push[b, a] -= alone[a, c] * z[b, c]
            push[b, 3] += force * np.cos(omega * i * dt + 2 * np.pi * ENGINE_ORDER * b / blades)
        for b in range(blades):
            for k in range(2):
                blade = (b + k) % blades
                for d in range(3):
                    w[d] = 0.0
                    for a in range(3):
                        w[d] += contacts[k, d, a] * (x[blade, a] - y[b, a])
                normal = max(N0 + KN * w[0], 0.0)
                f[0] = normal - N0
                f[1] = slider[b, k, 0] + KT * (w[1] - old[b, k, 0])
                f[2] = slider[b, k, 1] + KT * (w[2] - old[b, k, 1])
                limit = MU * normal / max(np.sqrt(f[1] ** 2 + f[2] ** 2), 1e-300)
                for d in (1, 2):
                    f[d] *= min(limit, 1.0)
                    slider[b, k, d - 1] = f[d]
                    old[b, k, d - 1] = w[d]
                for a in range(3):
                    for d in range(3):
                        push[blade, a] -= f[d] * contacts[k, d, a]
                        lift[b, a] += f[d] * contacts[k, d, a]
        for b in range(blades):
            for a in range(4):
                v[b, a] += dt * push[b, a] / inertia[a]
                x[b, a] += dt * v[b, a]
            for a in range(3):
                u[b, a] += dt * lift[b, a] / DAMPER_MASS
                y[b, a] += dt * u[b, a]
            out[i, b] = x[b, 3]
    return out


def parts(values):
    """Of values (blades, ...), what moves in the wave's nodal diameters 0, 3, 6 and the rest."""
    lines = np.fft.fft(values, axis=0)
    lines[np.arange(SECTORS) % ENGINE_ORDER > 0] = 0
    own = np.fft.ifft(lines, axis=0).real
    return own, values - own


class Wheel:
    """The wheel at rest, and its march."""

    def __init__(self, force, omega, steps=1200):
        self.state = tuple(np.zeros((SECTORS, n)) for n in (4, 4, 3, 3))
        self.slider = np.zeros((SECTORS, 2, 2))
        self.old = np.zeros((SECTORS, 2, 2))
        self.drive = steps, omega, force
        self.matrices = K + 2 * DISK, np.diag(DISK).copy(), CONTACTS, np.diag(M).copy()

    def period(self):
        """The amplitude of each aerofoil over the next period."""
        out = march(self.state, self.slider, self.old, self.matrices, *self.drive)
        lines = 2 / len(out) * np.fft.rfft(out, axis=0)[1:8]
        return np.linalg.norm(abs(lines), axis=0)

    def keep_the_wave(self):
        """Take away what moves in the other nodal diameters."""
        for values in (*self.state, self.slider, self.old):
            values[:] = parts(values)[0]

    def disturb(self, relative):
        rng = np.random.default_rng(0)
        x = self.state[0]
        x += parts(relative * abs(x).max() * rng.standard_normal(x.shape))[1]

    def left(self):
        """Size of what moves in the other nodal diameters."""
        return np.sqrt(sum(np.sum(parts(values)[1] ** 2) for values in self.state))


@pytest.mark.parametrize(("omega", "growth"), [(1.4805, 1.119), (1.536, 1.0)])
def test_a_wave_is_left_by_other_nodal_diameters_as_its_verdict_says(omega, growth):
    """Stable in its own diameters; the rest grows by the class's multiplier, or decays."""
    model = model_of(LOAD)
    assert blades_of_wave(model) == 4
    point = solve_near(model, omega, 31, 512, solve(model, omega, 7, 128))
    assert point.converged and point.states["slip"] == 2
    assert stability_verdict(model, point).verdict == STABLE
    angle = class_angle(1, ENGINE_ORDER, SECTORS)
    found = class_growth(model, point, model_of(LOAD, shift=1), angle)
    assert found.multiplier == pytest.approx(growth, abs=0.002)
    wheel = Wheel(LOAD, omega)
    for _ in range(SETTLING):
        heights = wheel.period()
        wheel.keep_the_wave()
    assert heights == pytest.approx(np.full(SECTORS, size(point)), rel=2e-3)
    wheel.disturb(1e-9)
    left = np.array([(wheel.period(), wheel.left())[1] for _ in range(GROWING)])
    last = left[GROWING // 2 :]
    marched = np.exp(np.polyfit(np.arange(len(last)), np.log(last), 1)[0])
    if growth > 1:
        assert marched == pytest.approx(found.multiplier, rel=0.02)
        assert left[-1] > 100 * left[0]
    else:
        assert marched < 1
        assert left[-1] < left[0]
