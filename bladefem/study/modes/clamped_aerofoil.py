"""The aerofoil alone, held at its root: what the modes of a wheel are called after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...data import ModeSet
from ..pipeline.bodies import Bodies, is_wheel
from ..pipeline.normal_modes import MODES_SHOWN
from .comparison import blade_root


def clamped_blade(bodies: Bodies) -> ModeSet | None:
    """Modes of the aerofoil clamped at its root, at rest.

    Returns:
        None where the modes are those of a clamped blade already, or the mesh names no aerofoil.
    """
    from ...fem.constraint import constrain
    from ...fem.modes import modes

    mesh = bodies.mesh
    if not is_wheel(mesh) or not {"pressure_side", "suction_side"} & set(mesh.faces):
        return None
    root = np.flatnonzero(mesh.points[:, 0] <= blade_root(mesh) + 1e-9)
    held = replace(bodies.still_blade.mesh, nodes={**mesh.nodes, "aerofoil_root": root})
    return modes(constrain(replace(bodies.still_blade, mesh=held), "aerofoil_root"), MODES_SHOWN)
