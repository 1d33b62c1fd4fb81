"""Blade and damper condensed onto the ports of their contact patches: flexibility, displacements by
the rotation, and the damper's rigid motions with its load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh, spin_axis

from ..data import Patch
from ..errors import InputError, NotSolvedError
from ..fem.body import Body
from ..fem.constraint import restrict_load
from ..fem.flexibility import Flexibility, compliance
from ..fem.linalg import inner_products
from ..fem.loads import centrifugal
from ..util.arrays import RealArray
from .complementarity import held_directions
from .patch import rigid_ports

# number of the translation along the engine axis among the rigid motions of a body in space
AXIAL_TRANSLATION = 2
# accepted part of the load along directions that frictionless seats can't hold
UNHELD_LOAD_SHARE = 0.01


@dataclass(frozen=True)
class CondensedBodies:
    """All that a new load state needs: dense matrices over m ports of the patches' n nodes, one
    patch after the other.

    "For unit rotation" means for a speed of 1 rad/s; multiply by the speed squared. What opens a
    gap moves the damper away from the blade.
    """

    patches: tuple[Patch, ...]
    # (m, m) blade and damper, elastic [m/N]
    flexibility: RealArray
    # (n,) gap before anything moves [m]
    clearance: RealArray
    # (m,) opened by the blade's displacement by the rotation, for unit rotation [m s^2]
    blade_swell: RealArray
    # (m,) opened by the damper's deformation under its load, for unit rotation [m s^2]
    damper_swell: RealArray
    # (m, d) opened by unit rigid motions of the damper [1]; rotations times a length
    rigid: RealArray
    # (d,) centrifugal load on the damper along these motions, for unit rotation [N s^2]
    load: RealArray
    # of the damper as meshed [kg]
    mass: float

    def by_patch(self, values: np.ndarray) -> list[np.ndarray]:
        """Values (n, ...) of all nodes, cut into those of each patch."""
        return np.split(values, np.cumsum([len(p.area) for p in self.patches])[:-1])


AnyBodies = TypeVar("AnyBodies", bound=CondensedBodies)


def condense_blade(
    blade: Flexibility,
    P: sp.spmatrix,
    mesh: Mesh,
    swell: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Flexibility (n, n) of the blade at its ports, and their displacement (n,) for unit rotation.

    Args:
        swell: (n_points, dim) displacement of the blade for unit rotation [m s^2] instead of the
            linear one.
    """
    C, moved = condense_body(blade, P, centrifugal(blade.con.body, 1.0, spin_axis(mesh)))
    return C, moved if swell is None else P.T @ swell.ravel()


def condense_body(
    flex: Flexibility,
    P: sp.spmatrix,
    load: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Flexibility (n, n) at the ports, and their displacement (n,) under a load in mesh
    numbering.
    """
    columns = restrict_load(flex.con, sp.hstack([P, sp.csc_matrix(load[:, None])], format="csc"))
    G = inner_products(flex.con.body.comm, columns[:, :-1], compliance(flex, columns)).real
    return (G[:, :-1] + G[:, :-1].T) / 2, G[:, -1]


def rigid_and_load(
    mesh: Mesh,
    patches: Sequence[Patch],
    body: Body,
    pull: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Rigid motions at all damper ports (ports, d) and the load that goes with them (d,), rotations
    times a length.
    """
    inside = np.unique(np.concatenate([mesh.bodies[name].ravel() for name in body.material]))
    origin = mesh.points[inside].mean(axis=0)
    length = np.linalg.norm(mesh.points[inside] - origin, axis=1).max()
    d = mesh.dimension
    scale = np.r_[np.ones(d), np.full(1 if d == 2 else 3, 1 / length)]
    force = pull.reshape(-1, d)
    arm = mesh.points - origin
    full = np.zeros((len(force), 3))
    full[:, :d] = force
    moment = np.cross(arm, full).sum(axis=0)
    load = np.r_[force.sum(axis=0), moment[2:] if d == 2 else moment]
    return rigid_ports(patches, mesh, origin) * scale, load * scale


def held_motions(rigid: np.ndarray, load: np.ndarray) -> np.ndarray:
    """(d, r) motions of the damper that frictionless seats hold, orthonormal.

    Args:
        rigid: (n, d) gap opened by unit rigid motions.
        load: (d,) on the damper along these.

    Raises:
        NotSolvedError: too much of the load is along the other motions.
    """
    _, _, held = held_directions(rigid)
    sideways = np.linalg.norm(load - held @ (held.T @ load)) / np.linalg.norm(load)
    if sideways > UNHELD_LOAD_SHARE:
        raise NotSolvedError(
            f"{sideways:.1%} of the damper's load is along a direction in which frictionless seats "
            f"can't hold it, expected below {UNHELD_LOAD_SHARE:.0%}"
        )
    return held


def hold_axially(problem: AnyBodies) -> AnyBodies:
    """A contact problem whose damper has a stop along the engine axis, which takes the load along
    it and lets the damper turn.

    Raises:
        InputError: the bodies are plane.
    """
    if len(problem.load) < 6:
        raise InputError(
            'damper.axial = "held": a plane damper does not move along the engine axis, expected '
            '"free"'
        )
    others = np.arange(len(problem.load)) != AXIAL_TRANSLATION
    return replace(problem, rigid=problem.rigid[:, others], load=problem.load[others])
