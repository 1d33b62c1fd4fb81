"""The estimated error of a largest stress is a promise: not below half of the true one."""

from __future__ import annotations

import numpy as np
import pytest
from structured import box

from bladefem.fem.alternating_stress import alternating_stress
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain, expand_to_mesh, restrict_load
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.stress import nodal_stress, von_mises
from bladefem.scene.tables import Material

LENGTH, HEIGHT = 0.1, 0.01


def bent(cells):
    """Largest stress of a short cantilever under a force at its tip, and its estimated error."""
    mesh = box(cells, (LENGTH, HEIGHT), "triangle6")
    body = assemble(mesh, "blade", Material(nu=0.0), None)
    con = constrain(body, "x0")
    tip = np.unique(mesh.faces["x1"])
    load = np.zeros((len(mesh.points), 2))
    load[tip, 1] = 1.0 / len(tip)
    u = expand_to_mesh(con, compliance(flexible(con), restrict_load(con, load.reshape(-1, 1))))[
        :, :, 0
    ]
    touched = np.zeros(len(mesh.points), bool)
    touched[np.concatenate([np.unique(mesh.faces["x0"]), tip])] = True
    return alternating_stress(body, np.array([u + 0j]), touched)


@pytest.fixture(scope="module")
def exact():
    """At the clamped corner, by a fine mesh."""
    return bent((160, 16)).largest


@pytest.mark.parametrize("cells", [(5, 1), (10, 1), (10, 2), (20, 2), (40, 4)])
def test_estimated_error_is_not_below_half_of_the_true_one(cells, exact):
    found = bent(cells)
    assert found.mesh_error >= 0.5 * abs(found.largest / exact - 1)


def test_estimated_error_falls_with_the_mesh():
    assert bent((40, 4)).mesh_error < 0.5 * bent((5, 1)).mesh_error


@pytest.mark.parametrize("turn", [0.0, 1 / 64, 1 / 32, 0.3])
def test_the_largest_stress_of_one_harmonic_does_not_depend_on_its_phase(turn):
    """In closed form of the complex stress; whole instants of the period need not meet it."""
    mesh = box((10, 2), (LENGTH, HEIGHT), "triangle6")
    body = assemble(mesh, "blade", Material(), None)
    x, y = mesh.points[:, :2].T
    u = 1e-3 * np.exp(2j * np.pi * turn) * np.column_stack([-2 * x * y, x**2]) / LENGTH
    exact = von_mises(nodal_stress(body, u)).max()
    assert alternating_stress(body, u[None]).largest == pytest.approx(exact, rel=2e-3)
