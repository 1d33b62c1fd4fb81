"""The Z-shaped mass from its scene: contact pressure by finite elements, then its motion on the
vibrating foundation.

The pressure is solved once: the contact is a receding one, its pressure keeps its shape and follows
the load in proportion (the paper's Eq. 27). The friction limits of the contact points come from it;
their stiffnesses share ``contact.kt`` by area. On a rigid foundation the pressure is that of the
top, everywhere: an elastic one presses back harder at the edges.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from geometry.mesh import Mesh
from geometry.zmass import z_section

from ...contact.interface_elements import pair_ratio, stiffnesses_at
from ...contact.patch import make_patch
from ...contact.seating import contact_problem, solve_seating
from ...damper.loops import FoundationMotion, Steady, steady
from ...damper.zmass import Footprint, MassOnFoundation, longest_step
from ...data import PressureMap
from ...errors import InputError
from ...io.stage_cache import cached_stage
from ...scene.tables import Scene
from ...scene.units import show
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress
from ..pipeline.scene_mesh import build_mesh
from ..pipeline.stage_inputs import stage_key

# largest of a frequency ratio
MAX_DENOMINATOR = 1000
# time steps within the longest stable one, at least: 16 in a period of the stuck mass
STEPS_PER_LIMIT = 5.0
# time steps of a common period of foundation and load: 200 megabytes, and minutes for 200 periods
MAX_STEPS = 2_000_000


@dataclass(frozen=True)
class Pressed:
    """The mass on its foundation and the pressure between them under the mean load."""

    mesh: Mesh
    seat: PressureMap


def press_mass(
    scene: Scene,
    folder: str | Path | None = None,
    comm: Communicator | None = None,
) -> Pressed:
    """Mesh and contact pressure of a scene of kind "z mass", on all ranks of a communicator.

    Raises:
        InputError: another kind of scene. NotSolvedError: the load tips the mass over.
    """
    if scene.kind != "z mass":
        raise InputError(f"kind = '{scene.kind}': expected 'z mass'")
    return cached_stage(
        folder, "pressure", stage_key("mass pressure", scene), lambda: _press(scene, comm), comm
    )[0]


def mass_on_foundation(scene: Scene, seat: PressureMap) -> MassOnFoundation:
    """The solid's own mass and moment of inertia, its contact points (``contact.points``) and their
    shares.
    """
    area, polar = z_section(scene.z_mass)
    line = scene.material.damper.rho * scene.z_mass.thickness
    label = cluster_nodes(seat.patch.points[:, :2], seat.patch.area, scene.contact.points)
    size = np.bincount(label, seat.patch.area)
    share = np.bincount(label, seat.force) / seat.force.sum()
    ratio = pair_ratio(scene.material.blade, scene.material.damper)
    force = np.bincount(label, seat.force)
    kt = float(stiffnesses_at(scene.contact, ratio, size, force)[0].sum())
    points = [np.bincount(label, seat.patch.area * x) / size for x in seat.patch.points[:, :2].T]
    return MassOnFoundation(
        line * area,
        line * polar,
        scene.contact.mu,
        kt,
        Footprint(np.column_stack(points), share, size / size.sum()),
    )


def cluster_nodes(
    points: np.ndarray,
    area: np.ndarray,
    count: int | None,
) -> np.ndarray:
    """(n,) number of the contact point that each node belongs to: nearest centres, moved to their
    means (Lloyd).

    Unlike halving a rectangle it keeps the points of a Z on the Z. Starts from nodes as far apart
    as can be.
    """
    if count is None or count >= len(points):
        return np.arange(len(points))
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    for _ in range(count - 1):
        chosen.append(int(np.argmax(cKDTree(points[chosen]).query(points)[0])))
    centres = points[chosen]
    for _ in range(30):
        label = cKDTree(centres).query(points)[1]
        size = np.bincount(label, area, count)
        centres = np.column_stack([np.bincount(label, area * x, count) / size for x in points.T])
    return label


def foundation_drives(scene: Scene) -> list[FoundationMotion]:
    """One for each frequency ratio of the scene."""
    base = scene.foundation
    load = mean_load(scene)
    ratios = [Fraction(r).limit_denominator(MAX_DENOMINATOR) for r in base.ratios]
    return [
        FoundationMotion(
            r, base.frequency, base.amplitude, base.phase, load, base.pulsation, base.pull
        )
        for r in ratios
    ]


def steady_motions(
    scene: Scene,
    body: MassOnFoundation,
    steps: int = 2000,
    progress: Progress = without_progress,
) -> Iterator[tuple[FoundationMotion, Steady]]:
    """The steady motion for each frequency ratio of the scene, to 1e-6: an odd footprint keeps
    turning slowly.

    Args:
        steps: time steps in one cycle of the foundation; more where the stuck mass swings faster.
        progress: wraps the periods of each march.

    Raises:
        InputError: a contact too stiff to be followed through such a slow cycle.
    """
    drives = foundation_drives(scene)
    cycles = max(drive.ratio.denominator for drive in drives)
    steps = max(steps, ceil(STEPS_PER_LIMIT / (longest_step(body) * scene.foundation.frequency)))
    if steps * cycles > MAX_STEPS:
        raise InputError(
            f"foundation.frequency = {show(scene.foundation.frequency, 'Hz')}: {steps * cycles} "
            f"steps of time in {cycles} cycles with contacts of {show(body.kt, 'N/m')}, expected "
            f"at most {MAX_STEPS}: a higher frequency or a smaller contact.kt"
        )
    for drive in drives:
        yield drive, steady(body, drive, steps, tolerance=1e-6, progress=progress)


def mean_load(scene: Scene) -> float:
    """The mean normal load [N]: the one of study.loads, 50 N when left out."""
    return 50.0 if scene.study.loads is None else scene.study.loads[0]


def _press(scene: Scene, comm: Communicator | None) -> Pressed:
    from ...fem.body import assemble
    from ...fem.constraint import constrain
    from ...fem.flexibility import flexible
    from ...fem.loads import surface_load

    mesh = build_mesh(scene, comm)
    mass = assemble(mesh, "damper", scene.material.damper, comm)
    even = surface_load(mass, "top", pressure=1.0).reshape(-1, 3)
    reach = np.array([scene.z_mass.width, scene.z_mass.height]) / 2
    load = (even * (1 + mesh.points[:, :2] @ (scene.foundation.skew / reach))[:, None]).ravel()
    block = flexible(constrain(assemble(mesh, "blade", scene.material.blade, comm), "clamp"))
    patch = make_patch(mesh, "this")
    problem = contact_problem(mesh, [patch], block, flexible(constrain(mass, None)), pull=load)
    return Pressed(mesh, solve_seating(problem, 0.0, normal=mean_load(scene))[0])
