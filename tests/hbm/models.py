"""Small models that several tests share."""

from dataclasses import replace

import numpy as np

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.reduction.matrices import port_model_from_matrices


def single_mass(kt=1.0, limit=0.5, zeta=0.01, force=1.0):
    """Mass 1, spring 1, dry friction of stiffness kt and limit mu N against the ground."""
    ports = {name: np.array([0]) for name in ("contact", "load", "probe")}
    body = port_model_from_matrices(np.eye(1), np.eye(1), ports)
    elements = Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    return ReducedModel((body,), elements, {1: np.array([force])}, Damping(ratio=zeta))


def block(nodes=4, *, kn=2.0, n0=1.0, mu=0.4, seed=0, damper=False, dofs=30, force=1.0):
    """A random elastic body with 3-D contacts against the ground or a rigid damper of six
    freedoms.
    """
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(dofs, dofs)) / np.sqrt(dofs)
    K = half @ half.T + 0.5 * np.eye(dofs)
    ports = {
        "contact": np.arange(3 * nodes),
        "load": np.array([dofs - 1]),
        "probe": np.array([dofs - 1, dofs - 2]),
    }
    body = port_model_from_matrices(np.eye(dofs), K, ports)
    elements = Elements(
        rng.uniform(0.5, 1.5, nodes),
        kn * rng.uniform(0.5, 1.5, nodes),
        np.full(nodes, mu),
        n0 * rng.uniform(0.5, 1.5, nodes),
    )
    other = (
        RigidBody(np.diag(rng.uniform(2.0, 4.0, 6)), rng.normal(size=(3 * nodes, 6)))
        if damper
        else None
    )
    return ReducedModel((body,), elements, {1: np.array([force])}, Damping(ratio=0.01), other)


def wedge_between_masses(force=10.0, at=0, damping=20.0, excited=True):
    """A wedge of 0.1 kg between two unequal masses of 10 kg, pressed outwards (along x) by 240 N.

    The flanks stand at +-40 deg to x, so that without friction each carries 240 / (2 sin 40 deg) N.
    The masses move along y, on springs of 9e5 and 3e5 N/m to the ground and coupled by 1e5 N/m; the
    wedge is held by springs of its own. Free modes at 31.2 and 50.7 Hz.
    """
    a = np.radians(40.0)
    # rows: normal out of the mass into the wedge, tangent; columns: x, y. Masses at y < 0, y > 0.
    first = np.array([[-np.sin(a), np.cos(a)], [np.cos(a), np.sin(a)]])
    second = np.array([[-np.sin(a), -np.cos(a)], [np.cos(a), -np.sin(a)]])
    flanks = np.zeros((4, 2))
    flanks[:2, 0] = first[:, 1]
    flanks[2:, 1] = second[:, 1]
    ports = {"contact": flanks, "load": np.array([at]), "probe": np.array([at])}
    K = np.array([[1e6, -1e5], [-1e5, 4e5]])
    masses = port_model_from_matrices(10.0 * np.eye(2), K, ports, C=damping * np.eye(2))
    ports = {"contact": np.vstack([first, second])}
    wedge = port_model_from_matrices(0.1 * np.eye(2), 1e6 * np.eye(2), ports, C=damping * np.eye(2))
    n0 = np.full(2, 240.0 / (2 * np.sin(a)))
    elements = Elements(np.full(2, 3e5), np.full(2, 3e5), np.full(2, 0.3), n0, tangents=1)
    loads = {1: np.array([force])} if excited else {}
    return ReducedModel((masses,), elements, loads, damper=(wedge,))


# two masses and one contact whose lift-off bends the resonance to lower frequencies
FOLDING = {
    "M": np.diag([0.4331616, 2.3952948]),
    "K": np.array([[933998.0, -256323.86], [-256323.86, 256323.86]]),
    "C": np.array([[9.510, -2.194], [-2.194, 10.581]]),
    "contact": np.array([[-0.77105, -0.63678], [-0.24764, -0.96885]]),
    "force": np.array([-9.354 - 2.544j, -10.289 + 9.410j]),
    # kt, kn [N/m], mu, n0 [N]
    "element": (92819.6, 133550.0, 0.75, 38.374),
}


def folding_pair():
    """The two masses of FOLDING."""
    ports = {"contact": FOLDING["contact"], "load": np.eye(2), "probe": np.eye(2)}
    body = port_model_from_matrices(FOLDING["M"], FOLDING["K"], ports, C=FOLDING["C"])
    element = Elements(*(np.array([x]) for x in FOLDING["element"]), tangents=1)
    return ReducedModel((body,), element, {1: FOLDING["force"]})


def rebounding(stiffness, gap, loss):
    """A unit mass on a unit spring that meets a one-sided elastic stop; the second degree of
    freedom carries the friction element, which has none.
    """
    ports = {"contact": [0, 1], "load": [0], "probe": [0]}
    K = np.diag([1.0, 50.0])
    body = port_model_from_matrices(np.eye(2), K, ports, C=loss * np.diag([1.0, 7.0]))
    parts = (1e-3, stiffness, 0.0, -gap * stiffness)
    element = Elements(*(np.array([x]) for x in parts), tangents=1)
    return ReducedModel((body,), element, {1: np.array([1.0])})


def bouncing():
    """Three masses with one contact of two tangents that lifts off."""
    K = np.array([[2.0, -0.3, 0.1], [-0.3, 1.5, 0.2], [0.1, 0.2, 1.2]])
    ports = {"contact": [0, 1, 2], "load": [0, 1], "probe": [0]}
    body = port_model_from_matrices(np.eye(3), K, ports, C=0.02 * K)
    contact = Elements(*(np.array([x]) for x in (1.0, 2.0, 0.4, 0.15)), tangents=2)
    return ReducedModel((body,), contact, {1: np.array([0.1, 0.08j])})


def bouncing_wave():
    """Four blades a quarter of a period apart; their third mode carries the wave's phase."""
    alone = bouncing()
    body = alone.sides[0]
    turned = [np.exp(0.5j * np.pi * h) for h in range(9)]
    sides = tuple(
        replace(body, shapes=body.shapes * np.where(np.arange(3) == 2, t, 1.0)) for t in turned
    )
    return replace(alone, sides=sides)
