"""Systems that several tests share."""

from dataclasses import replace

import numpy as np

from bladefem.data import Elements
from bladefem.reduction.beam import reference_blade
from bladefem.time.system import System, blade_ring


def seat(kt, load, nodes=5):
    """Both seats of one blade: stiffness and load of each seat, the load on a parabola over the
    nodes.
    """
    x = (np.arange(nodes) + 0.5) / nodes
    share = x * (1 - x) / np.sum(x * (1 - x))
    return Elements(
        np.full(2 * nodes, kt / nodes),
        np.zeros(2 * nodes),
        np.ones(2 * nodes),
        np.r_[share, share] * load,
        1,
    )


def blade(modes=5, nodes=5):
    """The reference blade without the flexibility of the modes left out, so that all methods see
    one model.
    """
    body = reference_blade(nodes, modes=modes)
    return replace(body, residual=0 * body.residual)


def blades(kt, load, mass, *, modes=5, nodes=5, count=1, waves=0):
    """A ring of reference blades; kt [N/m] and friction limit [N] of each seat, mass of a damper
    [kg].
    """
    return blade_ring(blade(modes, nodes), 0.002, seat(kt, load, nodes), mass, 1 + 0j, count, waves)


def rocking(load=10.0, force=2.0):
    """One mass on an inclined contact whose normal load follows the motion and can open."""
    zero, angle, kn = np.zeros((1, 3)), 1.2, 8e5
    R = np.array([[np.sin(angle)]])
    W, normal = np.array([[np.cos(angle)]]), np.array([[load, 0, 0]])
    return System(
        np.array([(200 * np.pi) ** 2]),
        np.array([[2 * np.pi]]),
        W,
        np.array([1e5]),
        np.array([0.3]),
        np.array([[0, force, 0.0]]),
        zero,
        normal,
        kn * R,
        np.ones((1, 1)),
        R,
    )


def friction_oscillator(omega, ratio, kt, limit, force):
    """One unit mass on a spring, with one friction element to the ground: the smallest system of
    its kind.

    omega: of the mass on its spring [rad/s]; ratio: of its damping; kt: contact stiffness [N/m];
    limit: of the friction force [N]; force: complex amplitude of the excitation [N].
    """
    return System(
        np.array([omega**2]),
        np.array([[2 * ratio * omega]]),
        np.ones((1, 1)),
        np.array([kt]),
        np.ones(1),
        np.array([[0.0, force.real, -force.imag]]),
        np.zeros((1, 3)),
        np.array([[limit, 0, 0]]),
        np.zeros((1, 1)),
        np.ones((1, 1)),
    )
