"""Blade, damper and friction elements joined for an engine order: the model that the balance
solves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np
import scipy.sparse as sp
from scipy.linalg import null_space

from geometry.mesh import Mesh, sector_of

from ...data import Elements, Patch, PortModel, RigidBody
from ...errors import InputError
from ...hbm.model import Damping, ReducedModel, in_series
from ...reduction.assemble import (
    change_each,
    pair_models,
    recombine_contact,
    standing_model,
    wheel_models,
)
from ...scene.tables import Scene
from .flow import flowing_sides, scene_flow
from .reduced_sector import Reduced

# of [damper] axial: a stop
AXIALLY_HELD = "held"
# the engine axis
AXIS = [0.0, 0.0, 1.0]
# of a translation: what rigid modes may miss of it
RIGID_SHARE = 1e-6


@dataclass(frozen=True)
class LoadCase:
    """One static load of the damper and the friction elements that it gives."""

    # mean normal force on each seat [N]
    load: float
    elements: Elements
    # (contact dofs of the mesh's nodes, contact dofs of the elements), see friction_elements
    selection: sp.spmatrix
    # of the damper [kg]; as meshed when None
    mass: float | None = None
    # (n, 1 + tangents) compliance of stiff layers that the elements leave to the bodies [m/N], see
    # contact.numerical_stiffness; None where they leave none
    series: np.ndarray | None = None
    # (n,) length over which the layer's stiffness grows by e [m], see contact.equivalent_layer;
    # None where it is linear
    decay: np.ndarray | None = None


def joint_model(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: list[Patch],
    case: LoadCase,
    harmonics: int,
    damper: str,
    sides: tuple[PortModel, ...] | None = None,
) -> ReducedModel:
    """The balance's model of one load case.

    A harmonic whose nodal diameter was not reduced borrows the nearest one that was: far above the
    modes that matter it moves quasi-statically, and the indicator of the harmonics sees what
    remains.

    Args:
        damper: "mass" (the paper's: tangential motion only, prescribed normal load), "rigid" or
            "elastic".
        sides: blade sides in pair coordinates, in place of those of the engine order's harmonics.
    """
    pick = case.selection.T.toarray()
    whole = pick.shape[0] == pick.shape[1]
    if sides is None:
        sides = _sides(scene, reduced, harmonics)
    elements = case.elements
    if not whole:
        sides = change_each(partial(recombine_contact, selection=pick), sides)
    if damper == "mass" or scene.contact.normal == "prescribed":
        elements = replace(elements, kn=np.zeros_like(elements.kn))
    series = case.series
    if series is not None:
        series = series * np.r_[float(elements.kn.any()), np.ones(elements.tangents)]
        sides = change_each(partial(in_series, compliance=series), sides)
    other: RigidBody | tuple[PortModel, ...]
    if damper == "elastic":
        free = _with_stop(scene, mesh, reduced, patches).damper
        other = (free if whole else recombine_contact(free, pick),)
    else:
        other = rigid_body(scene, mesh, reduced, patches, damper)
        if not whole:
            other = replace(other, B=pick @ other.B)
    return ReducedModel(
        sides,
        elements,
        {1: np.array([scene.excitation.force], dtype=complex)},
        Damping(ratio=scene.operation.damping),
        other,
        Damping(ratio=scene.operation.damping),
        coupled=scene.model.static == "coupled",
        series=series,
    )


def rigid_body(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: list[Patch],
    damper: str,
) -> RigidBody:
    """The damper without its deformation, on the ports of all contact nodes.

    Args:
        damper: as for `joint_model`; of an elastic one its rigid motions.
    """
    if damper == "mass":
        return mass_damper(mesh, patches, reduced.mass, scene.damper.axial == AXIALLY_HELD)
    return rigid_damper(_with_stop(scene, mesh, reduced, patches))


def _with_stop(scene: Scene, mesh: Mesh, reduced: Reduced, patches: list[Patch]) -> Reduced:
    """Held along the engine axis where the scene has a stop there."""
    if scene.damper.axial != AXIALLY_HELD:
        return reduced
    along = axial_motion(mesh, patches)
    return replace(reduced, damper=hold_translation(reduced.damper, along))


def rigid_damper(reduced: Reduced) -> RigidBody:
    """Six degrees of freedom (three in a plane, five with a stop), mass-normalised."""
    rigid = reduced.damper.omega == 0
    # a floating body moves alike in every sector: its shapes are real
    shapes = np.real(reduced.damper.shapes[reduced.damper.ports["contact"]][:, rigid])
    coupling = reduced.damper.damping
    gyroscopic = None if coupling is None else np.real(coupling[np.ix_(rigid, rigid)])
    return RigidBody(np.eye(int(rigid.sum())), shapes, gyroscopic=gyroscopic)


def mass_damper(
    mesh: Mesh,
    patches: list[Patch],
    mass: float,
    held: bool = False,
) -> RigidBody:
    """The paper's damper: a mass that moves circumferentially (and axially in 3-D, unless it is
    held), never up or down the slope.
    """
    dim = mesh.dimension
    count = sector_of(mesh).count
    angle = pi / count if count else 0.0
    moves = np.array([[-np.sin(angle), np.cos(angle), 0.0], AXIS])[: 1 if held else dim - 1]
    return RigidBody(mass * np.eye(len(moves)), _motion_at_contact(mesh, patches, moves))


def axial_motion(mesh: Mesh, patches: list[Patch]) -> np.ndarray:
    """(contact dofs,) a unit translation along the engine axis."""
    return _motion_at_contact(mesh, patches, np.array([AXIS]))[:, 0]


def _motion_at_contact(
    mesh: Mesh,
    patches: list[Patch],
    moves: np.ndarray,
) -> np.ndarray:
    """(contact dofs, k) translations (k, 3) in the frames of the contact."""
    dim = mesh.dimension
    rows = []
    for patch in patches:
        # into the axes in which the frame is given
        turned = moves @ mesh.pairs[patch.name].rotation
        rows.append((patch.frame[:, :dim] @ turned.T).reshape(-1, len(moves)))
    return np.concatenate(rows)


def hold_translation(damper: PortModel, along: np.ndarray) -> PortModel:
    """A free body whose centre of mass does not move along a translation.

    Rigid modes are mass-normalised, and elastic ones leave the centre of mass where it is: of the
    rigid modes those remain that are orthogonal to the translation. The body turns freely, its
    residual flexibility stays as it is.

    Args:
        along: (contact dofs,) the translation at the contact port.

    Raises:
        InputError: the translation is no rigid motion of the body.
    """
    rigid = damper.omega == 0
    at_contact = damper.shapes[damper.ports["contact"]][:, rigid].real
    share, _, _, _ = np.linalg.lstsq(at_contact, along, rcond=None)
    missed = np.linalg.norm(at_contact @ share - along)
    if missed > RIGID_SHARE * np.linalg.norm(along):
        raise InputError(
            'damper.axial = "held": the damper has no rigid motion along the engine axis, expected '
            "one that is not held elsewhere"
        )
    others = null_space(share[None])
    change = np.zeros((len(damper.omega), len(damper.omega) - 1))
    change[np.ix_(rigid, np.arange(others.shape[1]))] = others
    change[~rigid, others.shape[1] :] = np.eye(int((~rigid).sum()))
    damping: np.ndarray | None = damper.damping
    if damping is not None:
        whole = np.diag(damping) if damping.ndim == 1 else damping
        damping = change.T @ whole @ change
    return replace(
        damper,
        omega=np.concatenate([np.zeros(others.shape[1]), damper.omega[~rigid]]),
        shapes=damper.shapes @ change,
        damping=damping,
    )


def _sides(
    scene: Scene,
    reduced: Reduced,
    harmonics: int,
) -> tuple[PortModel, ...]:
    order = scene.excitation.engine_order
    if reduced.sectors:
        nearest = {
            n: reduced.sector[min(reduced.sector, key=lambda known: abs(known - n))]
            for n in range(reduced.sectors // 2 + 1)
        }
        # the wave repeats, and can be judged, only where the last diameter is its own mirror image
        if reduced.sectors % 2 == 0:
            nearest[reduced.sectors // 2] = standing_model(nearest[reduced.sectors // 2])
        sides = wheel_models(nearest, reduced.following, order, reduced.sectors, harmonics)
        return flowing_sides(scene_flow(scene, reduced.sectors), nearest, sides, order)
    return pair_models(reduced.sector[0], reduced.following, scene.excitation.phase, harmonics)
