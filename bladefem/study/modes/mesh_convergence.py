"""Mesh refinement: frequencies on finer and finer meshes, and what they say about the finest.

Every element size of the finest mesh is scaled, so that the meshes are as similar as unstructured
ones can be. Modes are paired with those of the finest mesh by their shapes (MAC), so two that cross
while the mesh is refined keep their names. A mesh that comes from a file is halved instead, once or
twice as its size allows: that shows the error of its elements, not that of a boundary which is
faceted in the file. Error, order and limit are those of `frequency_error`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from geometry.mesh import Mesh
from geometry.whole_cells import own_cells

from ...data import ModeSet
from ...errors import InputError
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...scene.units import show
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress
from ..pipeline.bodies import Bodies, blade_dofs
from ..pipeline.normal_modes import find_modes
from ..pipeline.scene_mesh import build_mesh
from .comparison import mac_of
from .frequency_error import convergence_summary
from .mesh_transfer import nodal_volumes, transfer_fields

# of the scene's own element sizes
SIZE_RATIOS = (2.0, 1.7, 1.4, 1.2, 1.0)
# modes beyond those asked for, candidates for pairs
SPARE_MODES = 3
# a mesh of a file and its halves
MAX_HALVED_MESHES = 3
# elastic modes whose error is reported
MODES_STUDIED = 5
# beyond which halving once more takes too long
MAX_DOFS_HALVED_AGAIN = 60_000
# nodes that shapes are compared at
COMPARED_NODES = 4000


@dataclass(frozen=True)
class Convergence:
    """SI columns."""

    # size [m], cells, dofs, nodal_diameter, mode, frequency [Hz], estimated: its error [1] by
    # `fem.stiffness_error`, mac: one row a mesh and mode
    points: pd.DataFrame
    # nodal_diameter, mode, frequency, limit [Hz], order [1], error [1] of the finest mesh,
    # scatter [1] about the fit, reason: why the order is not believed, empty when it is; of a mesh
    # from a file also its own frequency, given [Hz], and the error of that, given_error [1]
    summary: pd.DataFrame


@dataclass(frozen=True)
class SolvedMesh:
    """A mesh and its modes."""

    mesh: Mesh
    # one a nodal diameter
    sets: Sequence[ModeSet]
    # (modes,) estimated errors of the frequencies [1], of each set
    errors: Sequence[np.ndarray]


def mesh_convergence(
    scene: Scene,
    sizes: Sequence[float],
    diameters: Sequence[int] | None = None,
    count: int = MODES_STUDIED,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> Convergence:
    """The same scene on several meshes; a mesh that is given and its halves.

    Args:
        sizes: empty for a given mesh; else target element sizes [m], at least three, from coarse
            to fine; where the scene leaves its size open and these are :data:`SIZE_RATIOS`, they
            are factors on its automatic sizes.
        diameters: nodal diameters of a wheel.
        count: modes of each.

    Raises:
        InputError: too few sizes, or not from coarse to fine; sizes for a mesh that is given, or
            one whose halves need more memory than there is.
    """
    if not kind_named(scene.kind).meshed_here(scene):
        if len(sizes):
            raise InputError(
                f"--converge {', '.join(show(size, 'm') for size in sizes)}: kind '{scene.kind}' "
                "has a mesh of its own, expected --converge without sizes, which halves its "
                "elements"
            )
        return _halved_mesh_convergence(scene, diameters, count, comm, progress)
    if len(sizes) < 3 or not all(a > b > 0 for a, b in pairwise(sizes)):
        raise InputError(
            f"--converge {', '.join(show(size, 'm') for size in sizes)}: expected at least three "
            "element sizes, from coarse to fine"
        )
    finest = None if tuple(sizes) == SIZE_RATIOS else sizes[-1]
    runs = []
    for size in progress(list(sizes), "meshes"):
        scale = scene.mesh.scale * size / sizes[-1]
        refined = replace(
            scene, mesh=replace(scene.mesh, size=finest or scene.mesh.size, scale=scale)
        )
        runs.append(solved_mesh(refined, build_mesh(refined, comm), diameters, count, comm))
    return of_meshes(runs, count)


def solved_mesh(
    scene: Scene,
    mesh: Mesh,
    diameters: Sequence[int] | None,
    count: int,
    comm: Communicator | None = None,
) -> SolvedMesh:
    """Modes of one mesh, some more than asked for, and their estimated errors."""
    from ...fem.stiffness_error import frequency_errors

    bodies = Bodies(scene, mesh, comm)
    sets = find_modes(bodies, diameters, count + SPARE_MODES)
    errors = [frequency_errors(bodies.still_blade, found, bodies.state) for found in sets]
    return SolvedMesh(mesh, sets, errors)


def _halved_mesh_convergence(
    scene: Scene,
    diameters: Sequence[int] | None,
    count: int,
    comm: Communicator | None,
    progress: Progress,
) -> Convergence:
    """A given mesh, its half, and the half of that where this is small enough."""
    from ...fem.refinement import refine_uniformly

    meshes = [build_mesh(scene, comm)]
    while len(meshes) < MAX_HALVED_MESHES and (
        len(meshes) == 1 or blade_dofs(meshes[-1]) <= MAX_DOFS_HALVED_AGAIN
    ):
        meshes.append(refine_uniformly(meshes[-1]))
    runs = [solved_mesh(scene, mesh, diameters, count, comm) for mesh in progress(meshes, "meshes")]
    found = of_meshes(runs, count)
    keys = [key for key in ("nodal_diameter", "mode") if key in found.points]
    given = found.points[found.points["dofs"] == found.points["dofs"].min()]
    summary = found.summary.merge(
        given[[*keys, "frequency", "estimated"]].rename(columns={"frequency": "given"}), on=keys
    )
    # down to the finest mesh, and from there
    below = abs(summary["given"] / summary["frequency"] - 1) + summary["error"]
    summary["given_error"] = np.fmax(below, summary["estimated"])
    # rigid modes are exact
    summary.loc[summary["frequency"] == 0, "given_error"] = 0.0
    summary = summary.drop(columns="estimated")
    return replace(found, summary=summary)


def of_meshes(runs: Sequence[SolvedMesh], count: int) -> Convergence:
    """The study from meshes and their modes, coarse to fine.

    Args:
        count: modes of each set; the sets should hold some more, as partners.
    """
    finest = runs[-1]
    points = pd.concat(
        [
            _mesh_rows(run.mesh, found, errors, finest.mesh, reference, count)
            for run in runs
            for found, errors, reference in zip(run.sets, run.errors, finest.sets, strict=True)
        ],
        ignore_index=True,
    )
    return Convergence(points, convergence_summary(points))


def paired_modes(
    mesh: Mesh,
    modes: ModeSet,
    finest: Mesh,
    reference: ModeSet,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """(count,) numbers in ``modes`` of the modes most like the first of ``reference``, and their
    MAC.
    """
    nodes = np.unique(finest.bodies["blade"])
    nodes = nodes[:: max(len(nodes) // COMPARED_NODES, 1)]
    blade = replace(mesh, bodies={"blade": mesh.bodies["blade"]})
    theirs = (
        modes.shapes[:, nodes]
        if mesh is finest
        else transfer_fields(blade, modes.shapes, finest.points[nodes])
    )
    match = mac_of(reference.shapes[:count, nodes], theirs, nodal_volumes(finest)[nodes])
    rows, columns = linear_sum_assignment(-match)
    return columns, match[rows, columns]


def _mesh_rows(
    mesh: Mesh,
    modes: ModeSet,
    errors: np.ndarray,
    finest: Mesh,
    reference: ModeSet,
    count: int,
) -> pd.DataFrame:
    """One mesh and nodal diameter."""
    numbers, match = paired_modes(mesh, modes, finest, reference, count)
    diameter = {} if modes.nodal_diameter is None else {"nodal_diameter": modes.nodal_diameter}
    return pd.DataFrame(
        {
            "size": element_size(mesh, "blade"),
            "cells": sum(len(own.cells) for own in own_cells(mesh, ("blade",))),
            "dofs": mesh.dimension * len(np.unique(mesh.bodies["blade"])),
            **diameter,
            "mode": np.arange(1, len(numbers) + 1),
            "frequency": modes.frequencies[numbers],
            "estimated": errors[numbers],
            "mac": match,
        }
    )


def default_sizes(scene: Scene) -> list[float]:
    """Element sizes [m] down to the scene's own; where that is open, :data:`SIZE_RATIOS`
    themselves; none for a mesh that is given.
    """
    if not kind_named(scene.kind).meshed_here(scene):
        return []
    return [ratio * (scene.mesh.size or 1.0) for ratio in SIZE_RATIOS]


def element_size(mesh: Mesh, body: str) -> float:
    """Side of a cube (square) as large as the mean cell [m]; of cells of mixed shapes, whose number
    a halved mesh does not tell, the mean piece: a halved mesh has half the size.
    """
    from ...fem.loads import body_volume

    d = mesh.dimension
    size = body_volume(mesh, body) / (mesh.depth if d == 2 else 1.0)
    return float((size / len(mesh.bodies[body])) ** (1 / d))
