"""The row of plane blades with flat dampers as the paper computes it (Sect. 5), from 2-D finite
elements.

Blade in plane stress, clamped at its root, by its modes; damper rigid and free along the row only;
the normal load of each contact point from the quasi-static contact solve, constant in time. The
residual flexibility of the modes left out is dropped, so that the balance, the paper's loop and
time integration solve the very same equations; ``whole`` keeps it, and the damper's other two
degrees of freedom with the normal load that follows them, to see what that leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bladefem.contact.interface_elements import friction_elements, pair_ratio
from bladefem.contact.seating import ContactProblem, solve_seating
from bladefem.data import RigidBody
from bladefem.errors import InputError
from bladefem.hbm.model import ReducedModel
from bladefem.io.stage_cache import cached_stage
from bladefem.reduction.assemble import recombine_contact
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary
from bladefem.study.pipeline.assemble_model import LoadCase, joint_model
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.damper_contact import condense_contact, contact_patches, on_layer
from bladefem.study.pipeline.reduced_sector import Reduced, reduce_sector
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.stage_inputs import stage_key


@dataclass(frozen=True)
class Row:
    """What the finite elements leave: the same on every rank."""

    # of rigid faces, as in the paper
    problem: ContactProblem
    reduced: Reduced
    mesh: Any


def row_of_blades(scene: Scene, modes: int = 8, folder: Any = None, comm: Any = None) -> Row:
    """Mesh, seated damper and modes of a scene of kind "plane blades".

    Args:
        modes: of the blade that are kept.

    Raises:
        InputError: another kind of scene.
    """
    if scene.kind != "plane blades":
        raise InputError(f"kind = '{scene.kind}': expected 'plane blades'")

    def compute() -> Row:
        mesh = build_mesh(scene, comm)
        bodies = Bodies(scene, mesh, comm)
        patches = contact_patches(mesh)
        return Row(
            condense_contact(bodies, patches), reduce_sector(bodies, patches, [0], modes), mesh
        )

    return cached_stage(folder, "row", stage_key("contact", scene, modes), compute, comm)[0]


def paper_model(
    scene: Scene,
    row: Row,
    load: float,
    mass: float | None = None,
    harmonics: int = 31,
    *,
    layer: bool = False,
) -> ReducedModel:
    """The paper's model: tangential degrees of freedom only, prescribed normal loads from rigid
    faces, a damper that moves along the row.

    Args:
        load: normal load of a seat [N].
        mass: of the damper [kg]; the scene's own when left out.
        layer: the faces are seated on the contact layer instead, as those of `whole_model`.
    """
    problem = on_layer(scene, row.problem) if layer else row.problem
    model = _joint(vary(scene, contact__normal="prescribed"), problem, row, load, "mass", harmonics)
    nodes = len(model.elements.kt)
    tangents = np.kron(np.eye(nodes), [[0.0, 1.0]])
    sides = tuple(
        replace(side, residual=0 * side.residual)
        for side in (recombine_contact(s, tangents) for s in model.sides)
    )
    mass = row.reduced.mass if mass is None else mass
    return replace(
        model, sides=sides, damper=RigidBody(mass * np.eye(1), tangents @ model.damper.B)
    )


def whole_model(
    scene: Scene, row: Row, load: float, damper: str = "rigid", harmonics: int = 31
) -> ReducedModel:
    """The same blades without the paper's simplifications: residual flexibility, and normal loads
    that follow, from faces seated on the layer whose springs they move on.

    Args:
        load: static normal load of a seat [N].
        damper: "mass" (residual flexibility only), "rigid" (three degrees of freedom, normal
            springs) or "elastic".
    """
    return _joint(scene, on_layer(scene, row.problem), row, load, damper, harmonics)


def _joint(
    scene: Scene, problem: ContactProblem, row: Row, load: float, damper: str, harmonics: int
) -> ReducedModel:
    maps = solve_seating(problem, 0.0, normal=load, bedded=scene.contact.bedded)
    ratio = pair_ratio(scene.material.blade, scene.material.damper)
    elements, selection = friction_elements(
        problem, maps, scene.contact, ratio, row.mesh.dimension - 1
    )
    case = LoadCase(load, elements, selection)
    return joint_model(
        scene, row.mesh, row.reduced, list(row.problem.patches), case, harmonics, damper
    )
