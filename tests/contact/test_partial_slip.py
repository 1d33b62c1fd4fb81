"""Partial slip of a pressed sphere by the harmonic balance, against closed forms and against small
static steps.
"""

from __future__ import annotations

import numpy as np
import pytest
from half_space import rectangle_flexibility, square_grid
from scipy.integrate import simpson

from bladefem.contact.complementarity import solve_lcp
from bladefem.contact.partial_slip import slip_step
from bladefem.data import Elements, PortModel
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.solution import Solution
from bladefem.hbm.solve import solve

MODULUS, RADIUS, A, MU = (
    1.0,
    1.0,
    0.1,
    0.3,
)  # E*, sphere radius, contact radius, friction coefficient
LIMIT = MU * 4 * MODULUS * A**3 / (3 * RADIUS)


def shift_of(force: np.ndarray) -> np.ndarray:
    """First loading, 3 mu P / (16 a G*) (1 - (1 - Q / mu P)^(2/3)); 1 / G* = 4 / E* for nu = 0 and
    a rigid sphere.

    Johnson, Contact Mechanics (1985), Sect. 7.2.
    """
    return 3 * LIMIT / (4 * A * MODULUS) * (1 - (1 - force / LIMIT) ** (2 / 3))


def loop_energy(force: float) -> float:
    """Masing: the loop is eight times the area between the first loading and its chord."""
    q = np.linspace(0, force, 4001)
    return 8 * (0.5 * force * shift_of(force) - simpson(shift_of(q), q))


def pressed(n: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Flexibility (n, n) and friction limits (n,) of the pressed nodes, cell size; nu = 0, so that
    C_t = C_n.
    """
    x, y, h = square_grid(n, 1.3 * A)
    C = rectangle_flexibility(x, y, h, h, MODULUS)
    limit = (
        MU * solve_lcp(C, (x**2 + y**2) / (2 * RADIUS), -np.ones((n * n, 1)), [-LIMIT / MU]).force
    )
    on = limit > 0
    return C[np.ix_(on, on)], limit[on], h


def in_balance(C: np.ndarray, limit: np.ndarray, force: float, H: int, stiff: float) -> Solution:
    """A free mass on the elastic contact under force cos(omega t), so slow that its inertia is 1e-4
    of the force.

    Contact springs are ``stiff`` times the stiffness of the half-space at a node: 30 add 0.2 % to
    the shift, but the stiffer they are, the more harmonics it takes.
    """
    n = len(limit)
    residual = np.pad(C, (0, 1))
    ports = {"contact": slice(0, n), "load": slice(n, n + 1), "probe": slice(n, n + 1)}
    body = PortModel(np.zeros(1), np.ones((n + 1, 1)), residual, ports)
    elements = Elements(stiff / np.diag(C), np.zeros(n), np.full(n, MU), limit / MU, 1)
    return solve(
        ReducedModel((body,), elements, {1: np.array([force])}), 1e-2 / np.sqrt(C.mean()), H, 256
    )


def test_cattaneo_and_mindlin_by_the_balance():
    """Stick radius a (1 - Q / mu P)^(1/3), shift and loop energy; the energy falls to its limit
    with the harmonics.
    """
    C, limit, h = pressed(25)
    force = 0.6 * LIMIT
    found = {H: in_balance(C, limit, force, H, 30) for H in (5, 11)}
    assert all(s.converged for s in found.values())
    radius = np.sqrt(found[11].states["stick"] * h**2 / np.pi)
    errors = [s.work.dissipated / loop_energy(force) - 1 for s in found.values()]
    assert radius == pytest.approx(A * (1 - 0.6) ** (1 / 3), rel=0.03)
    assert found[11].amplitude[1, 0] == pytest.approx(
        shift_of(force), rel=0.01
    )  # first harmonic of the shift
    assert abs(errors[1]) < 0.02 < abs(errors[0]) < 0.1  # 5 and 11 harmonics


def test_the_balance_against_static_steps():
    """The same nodes stick as in small static steps, with the springs counted as flexibility, at
    another load.
    """
    C, limit, _ = pressed(21)
    force = 0.8 * LIMIT
    solution = in_balance(C, limit, force, 11, 10)
    soft, energy = C + np.diag(np.diag(C)) / 10, 0.0
    state = slip_step(soft, limit, total=force)
    assert solution.states["stick"] == (state.state == 0).sum()
    for part in [*np.linspace(1, -1, 9)[1:], *np.linspace(-1, 1, 9)[1:]]:
        state = slip_step(soft, limit, state, total=part * force)
        energy += state.work
    assert solution.work.dissipated == pytest.approx(energy, rel=0.01)
