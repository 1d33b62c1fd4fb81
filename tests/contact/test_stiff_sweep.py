"""A patch between rigid faces: no point of a sweep is lost where all contacts slip and lift off."""

import numpy as np
import pytest
from half_space import rectangle_flexibility, square_grid

from bladefem.contact.numerical_stiffness import (
    numerical_stiffness,
    split_stiffness,
    stiffest_layer,
)
from bladefem.contact.seating import ContactProblem
from bladefem.data import Elements, Patch, PortModel, PressureMap
from bladefem.hbm.model import Damping, ReducedModel, in_series
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.sweep import sweep
from bladefem.scene.tables import Contact

HALF_WIDTH = 3e-3
NODES_A_SIDE = 4
LOAD = 80.0
FORCE = 60.0


def patch_on_half_space():
    """The patch, its area, and the local compliance (n, n) [m/N] of two steel bodies."""
    x, y, h = square_grid(NODES_A_SIDE, HALF_WIDTH)
    n = len(x)
    frame = np.tile(np.eye(3), (n, 1, 1))
    points = np.column_stack([np.zeros(n), x, y])
    nodes = np.arange(n)
    patch = Patch("this", points, np.full(n, h * h), frame, np.array([[0, 1]]), nodes, nodes)
    return patch, rectangle_flexibility(x, y, h, h, 5.8e10)


def blade_side(patch, local):
    """Four modes that move and tilt the patch, above the local compliance."""
    n = len(patch.area)
    ports = 3 * n
    x = patch.points[:, 1] / HALF_WIDTH
    y = patch.points[:, 2] / HALF_WIDTH
    shapes = np.zeros((ports + 2, 4))
    normal = slice(0, ports, 3)
    first = slice(1, ports, 3)
    second = slice(2, ports, 3)
    shapes[normal] = np.column_stack([np.full(n, 1.2), 2.5 * x, np.full(n, 4.0), 3.0 * y])
    shapes[first] = np.array([2.5, 0.5, 0.0, 3.0])
    shapes[second] = np.column_stack([np.full(n, 0.5), np.zeros(n), 2.0 * x, np.zeros(n)])
    shapes[ports:] = np.array([4.0, 1.0, 1.0, 0.0])
    residual = np.zeros((ports + 2, ports + 2))
    residual[:ports, :ports] = np.kron(local, np.diag([1.0, 1.2, 1.2]))
    residual[ports:, ports:] = 1e-9
    omega = 2 * np.pi * np.array([380.0, 900.0, 1500.0, 2600.0])
    names = {
        "contact": slice(0, ports),
        "load": slice(ports, ports + 1),
        "probe": slice(ports + 1, ports + 2),
    }
    return PortModel(omega, shapes, residual, names)


@pytest.fixture(scope="module")
def rigid_faces_model():
    patch, local = patch_on_half_space()
    side = blade_side(patch, local)
    n = len(patch.area)
    flexibility = side.residual[: 3 * n : 3, : 3 * n : 3]
    normal = side.shapes[: 3 * n : 3] / side.omega
    problem = ContactProblem(
        (patch,),
        flexibility + normal @ normal.T,
        *np.zeros((3, n)),
        np.zeros((n, 1)),
        np.zeros(1),
        0.0,
    )
    stiff = 1e22 * patch.area
    elements = Elements(stiff, stiff, np.full(n, 0.3), np.full(n, LOAD / n))
    maps = [PressureMap(patch, elements.n0, np.zeros(n), 0.0)]
    elements, series = split_stiffness(
        elements, maps, Contact(), numerical_stiffness(problem), stiffest_layer(problem)
    )
    return ReducedModel(
        (in_series(side, series),),
        elements,
        {1: np.array([FORCE])},
        Damping(ratio=0.002),
        series=series,
    )


def test_no_point_is_lost_and_none_needs_a_path(rigid_faces_model):
    """With a numerical stiffness of 20 times that of the softest common motion, no layer on rigid
    faces and no walks from neighbours, points here were found by paths in the excitation or lost.
    """
    band = (2 * np.pi * 380.0, 2 * np.pi * 720.0)
    options = Options(tolerance=1e-7)
    points = list(sweep(rigid_faces_model, band, 3, 64, paths=False, options=options))
    assert all(p.converged for p in points)
    assert {p.method for p in points} <= {"newton", "newton on the residual", "more samples"}
    assert max(p.states["lift"] for p in points) == len(rigid_faces_model.elements.kt)
