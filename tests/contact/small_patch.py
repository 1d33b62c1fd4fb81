"""A square patch of a blade with four modes, pressed on fixed ground with an interface layer
between: the smallest model that has short waves of pressure.
"""

import numpy as np
from half_space import rectangle_flexibility, square_grid

from bladefem.contact.numerical_stiffness import (
    numerical_stiffness,
    split_stiffness,
    stiffest_layer,
)
from bladefem.contact.seating import ContactProblem
from bladefem.data import Elements, Patch, PortModel, PressureMap
from bladefem.hbm.model import Damping, ReducedModel, in_series
from bladefem.scene.tables import Contact

HALF_WIDTH = 3e-3
NODES_A_SIDE = 4
LOAD = 80.0
FRICTION = 0.3


def patch_on_half_space():
    """The patch, its area, and the local compliance (n, n) [m/N] of two steel bodies."""
    x, y, h = square_grid(NODES_A_SIDE, HALF_WIDTH)
    n = len(x)
    frame = np.tile(np.eye(3), (n, 1, 1))
    points = np.column_stack([np.zeros(n), x, y])
    nodes = np.arange(n)
    patch = Patch("this", points, np.full(n, h * h), frame, np.array([[0, 1]]), nodes)
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


def problem_of(patch, side):
    """What the seating knows of the bodies: their flexibility normal to the patch."""
    ports = side.ports["contact"].stop
    normal = side.shapes[:ports:3] / side.omega
    flexibility = side.residual[:ports:3, :ports:3] + normal @ normal.T
    n = len(patch.area)
    return ContactProblem(
        (patch,), flexibility, *np.zeros((3, n)), np.zeros((n, 1)), np.zeros(1), 0.0
    )


def layer_elements(patch, areal):
    """Elements of a layer of this stiffness per unit area [N/m^3] under the even load."""
    n = len(patch.area)
    stiffness = areal * patch.area
    return Elements(stiffness, stiffness, np.full(n, FRICTION), np.full(n, LOAD / n))


def patch_model(areal, force, split=True):
    """The model with its stiff layer split, or whole in the elements, excited by a force [N]."""
    patch, local = patch_on_half_space()
    side = blade_side(patch, local)
    problem = problem_of(patch, side)
    elements = layer_elements(patch, areal)
    maps = [PressureMap(patch, elements.n0, np.zeros(len(patch.area)), 0.0)]
    series = None
    if split:
        elements, series = split_stiffness(
            elements, maps, Contact(), numerical_stiffness(problem), stiffest_layer(problem)
        )
    if series is not None:
        side = in_series(side, series)
    excitation = {1: np.array([force])}
    return ReducedModel((side,), elements, excitation, Damping(ratio=0.002), series=series)
