"""A rigid flat punch on an elastic block from its scene: the paper's Fig. 5 and 6 by finite
elements.

Johnson, Contact Mechanics (1985), Sect. 3.8 and 2.8, the paper's Eq. 24 corrected: in terms of the
whole force P

    round:  p = P / (2 pi a sqrt(a^2 - r^2)),   u = P (1 - nu^2) / (2 a E)
    plane:  p = P / (pi sqrt(a^2 - x^2))

The plane force P acts on a unit of depth, in plane strain; there u grows with the logarithm of how
far the body reaches, by 2 P (1 - nu^2) / (pi E) each time that it reaches e times as far.

Eq. 25 is the stiffness of a ring: the force on it over u, so that the rings together carry 2 a E /
(1 - nu^2). Such springs give back the pressure and the approach of the load that they were made
for, and nothing else: tilted, they resist with half the moment of the half space, 2/3 a^3 E / (1 -
nu^2) a radian instead of 4/3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from geometry.mesh import Mesh

from ...contact.complementarity import solve_lcp
from ...contact.patch import make_patch, normal_ports, patch_means, port_matrix
from ...data import Patch
from ...errors import InputError, NotSolvedError
from ...scene.tables import Scene
from ...util.arrays import RealArray
from ...util.communicator import Communicator
from ..pipeline.scene_mesh import build_mesh

if TYPE_CHECKING:
    import scipy.sparse as sp

    from ...fem.body import Body


@dataclass(frozen=True)
class Indented:
    """The quarter (half, in the plane) under the punch, and what it took to solve it; the same on
    every rank.
    """

    mesh: Mesh
    patch: Patch
    # (n,) distance of the nodes from the axis [m]
    radius: RealArray
    # (n,) on the nodes of the meshed part [N]
    force: RealArray
    # of the punch [m]
    approach: float
    # force on the whole punch [N]
    total: float
    # (n, n) of the nodes of the meshed part, symmetric motion [m/N]
    flexibility: RealArray
    # (n, n) of the same under loads odd in x; None in the plane
    tilted: RealArray | None
    # (n,) mean of x over the length that each node represents [m]
    arm: RealArray
    # the proof of optimality, see PressureMap
    complementarity: float

    @property
    def pressure(self) -> np.ndarray:
        """(n,) [Pa]"""
        return self.force / self.patch.area

    @property
    def tilt_stiffness(self) -> float:
        """Moment a radian of the punch glued to the block [N m]."""
        if self.tilted is None:
            raise InputError("tilt_stiffness: a plane punch does not tilt, expected a solid one")
        return 4 * float(self.arm @ np.linalg.solve(self.tilted, self.arm))


def indent_punch(scene: Scene, comm: Communicator | None = None) -> Indented:
    """Press the punch of a scene of kind "punch" with its first load.

    Raises:
        InputError: another kind of scene. NotSolvedError: the contact iteration stopped.
    """
    from ...fem.body import assemble

    if scene.kind != "punch":
        raise InputError(f"kind = '{scene.kind}': expected 'punch'")
    total = 1000.0 if scene.study.loads is None else scene.study.loads[0]
    mesh = build_mesh(scene, comm)
    body = assemble(mesh, "blade", scene.material.blade, comm, plane="strain")
    patch = make_patch(mesh, "this")
    ports = port_matrix([patch], mesh)[:, normal_ports([patch], mesh)]
    solid = mesh.dimension == 3
    even = held_port_flexibility(body, ports)
    part = 4 if solid else 2
    found = solve_lcp(
        even, np.zeros(len(even)), -np.ones((len(even), 1)), np.array([-total / part])
    )
    if found.reason:
        raise NotSolvedError(f"the punch: {found.reason}")
    radius = np.linalg.norm(patch.points[:, : mesh.dimension - 1], axis=1)
    return Indented(
        mesh,
        patch,
        radius,
        found.force,
        float(found.rigid[0]),
        total,
        even,
        held_port_flexibility(_odd(body), ports) if solid else None,
        patch_means(patch, mesh).T @ mesh.points[:, 0],
        found.residual,
    )


def johnson_pressure(
    r: np.ndarray,
    a: float,
    force: float,
    plane: bool = False,
) -> np.ndarray:
    """Pressure [Pa] at r < a under a force [N], or [N/m] in the plane."""
    return force / (np.pi * np.sqrt(a**2 - r**2)) / (1.0 if plane else 2 * a)


def johnson_approach(
    a: float,
    force: float,
    E: float,
    nu: float,
) -> float:
    """Approach of a round punch and a half space [m]."""
    return force * (1 - nu**2) / (2 * a * E)


def ring_stiffness(
    edges: np.ndarray,
    a: float,
    E: float,
    nu: float,
) -> np.ndarray:
    """Normal stiffness [N/m] of the rings between radii (k + 1,) [m]: Eq. 25 integrated over
    each.
    """
    return -np.diff(2 * E / (1 - nu**2) * np.sqrt(np.maximum(a**2 - edges**2, 0.0)))


def spring_tilt(
    edges: np.ndarray,
    a: float,
    E: float,
    nu: float,
) -> float:
    """Moment a radian that those springs resist a tilt with [N m]: half of the ring's stiffness
    times r^2.
    """
    s = np.sqrt(np.maximum(a**2 - edges**2, 0.0))
    return float(np.diff(E / (1 - nu**2) * (s**3 / 3 - a**2 * s)).sum())


def held_port_flexibility(
    body: Body,
    ports: sp.spmatrix,
    held: str = "clamp",
) -> np.ndarray:
    """(n, n) displacements at the ports for unit forces there [m/N]; the body is held at a face.
    Collective.
    """
    from ...fem.constraint import constrain, restrict_load
    from ...fem.flexibility import compliance, flexible
    from ...fem.linalg import inner_products

    flex = flexible(constrain(body, held))
    columns = restrict_load(flex.con, ports)
    C = inner_products(body.comm, columns, compliance(flex, columns))
    return (C + C.T) / 2


def _odd(body: Body) -> Body:
    """The body for motions that turn over in the mirror x = 0."""
    faces = dict(body.mesh.faces)
    faces["antisymmetry_x"] = faces.pop("symmetry_x")
    return replace(body, mesh=replace(body.mesh, faces=faces))
