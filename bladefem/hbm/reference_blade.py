"""The reference blade with its damper as a ready model: for demos, tests, benchmarks and a first
look.
"""

from __future__ import annotations

import numpy as np

from ..data import Elements, RigidBody
from ..reduction.assemble import pair_models
from ..reduction.beam import reference_blade
from .model import Damping, ReducedModel


def reference_model(
    kt: float = 1e6,
    mass: float = 0.06,
    load: float = 10.0,
    *,
    phase: float = 0.0,
    points: int = 1,
    modes: int | None = None,
    harmonics: int = 31,
) -> ReducedModel:
    """A tuned row of reference blades with a rigid tangential damper between each two, driven by 1
    N at the tips.

    Args:
        kt: tangential stiffness of one side, shared equally by its points [N/m].
        load: friction limit mu N of one side [N], shared in a parabola over the points.
        phase: interblade phase angle of the first harmonic [rad].
    """
    x = (2 * np.arange(points) + 1) / points - 1
    share = np.tile((1 - x**2) / np.sum(1 - x**2), 2)
    nodes = 2 * points
    elements = Elements(
        np.full(nodes, kt / points), np.zeros(nodes), np.ones(nodes), load * share, tangents=1
    )
    blade = reference_blade(points, modes=modes)
    return ReducedModel(
        pair_models(blade, slice(points, nodes), phase, harmonics),
        elements,
        {1: np.array([1.0])},
        Damping(ratio=0.002),
        RigidBody(np.array([[mass]]), np.ones((nodes, 1))),
    )
