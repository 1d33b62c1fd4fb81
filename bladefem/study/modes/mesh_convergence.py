"""Mesh refinement: frequencies on finer and finer meshes, observed order, Richardson's estimate of
the limit.

Every element size of the finest mesh is scaled, so that the meshes are as similar as unstructured
ones can be. With three of them f(h) = f + C h^p goes through all (Roache, J. Fluids Eng. 116
(1994), doi:10.1115/1.2910291); with more it is fitted by least squares, and what is left is the
scatter of the meshes (Eca and Hoekstra, J. Comput. Phys. 262 (2014),
doi:10.1016/j.jcp.2014.01.006). h is the size that the elements really have. Modes are paired with
those of the finest mesh by their shapes (MAC), so two that cross while the mesh is refined keep
their names. A mesh that comes from a file is halved instead, once or twice as its size allows:
that shows the error of its elements, not that of a boundary which is faceted in the file. Where the
values do not fall into line, or the order is none that the elements can
have, ``reason`` says so and the error is three times the last change (Roache's safety factor for
two meshes), of more than three meshes the largest between the last three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.optimize import brentq, linear_sum_assignment, minimize_scalar

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
from .mesh_transfer import nodal_volumes, transfer_fields

# of the scene's own element sizes
SIZE_RATIOS = (2.0, 1.7, 1.4, 1.2, 1.0)
# order that is looked for
MAX_ORDER = 12.0
# orders that frequencies can have: from sharp re-entrant edges to 4 for P2, and some luck
PLAUSIBLE_ORDERS = (1.0, 6.0)
# error over change where no order is believed
UNTRUSTED_FACTOR = 3.0
# scatter over trend from which there is no trend
MAX_SCATTER = 0.5
# MAC of the same mode on two meshes
MIN_MAC = 0.8
# modes beyond those asked for, candidates for pairs
SPARE_MODES = 3
# a mesh of a file and its halves
MAX_HALVED_MESHES = 3
# beyond which halving once more takes too long
MAX_DOFS_HALVED_AGAIN = 60_000
# nodes that shapes are compared at
COMPARED_NODES = 4000


@dataclass(frozen=True)
class Convergence:
    """SI columns."""

    # size [m], cells, dofs, nodal_diameter, mode, frequency [Hz], mac: one row a mesh
    # and mode
    points: pd.DataFrame
    # nodal_diameter, mode, frequency, limit [Hz], order [1], error [1] of the finest mesh,
    # scatter [1] about the fit, reason: why the order is not believed, empty when it is; of a mesh
    # from a file also its own frequency, given [Hz], and the error of that, given_error [1]
    summary: pd.DataFrame


def mesh_convergence(
    scene: Scene,
    sizes: Sequence[float],
    diameters: Sequence[int] | None = None,
    count: int = 5,
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
        mesh = build_mesh(refined, comm)
        runs.append((mesh, find_modes(Bodies(refined, mesh, comm), diameters, count + SPARE_MODES)))
    return of_meshes(runs, count)


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
    runs = [
        (mesh, find_modes(Bodies(scene, mesh, comm), diameters, count + SPARE_MODES))
        for mesh in progress(meshes, "meshes")
    ]
    found = of_meshes(runs, count)
    keys = [key for key in ("nodal_diameter", "mode") if key in found.points]
    given = found.points[found.points["dofs"] == found.points["dofs"].min()]
    summary = found.summary.merge(
        given[[*keys, "frequency"]].rename(columns={"frequency": "given"}), on=keys
    )
    # where no limit is known, from the finest mesh
    own = abs(summary["given"] / summary["limit"].fillna(summary["frequency"]) - 1)
    summary["given_error"] = np.where(
        summary["reason"] == "", own + summary["scatter"], UNTRUSTED_FACTOR * own
    )
    return replace(found, summary=summary)


def of_meshes(runs: Sequence[tuple[Mesh, Sequence[ModeSet]]], count: int) -> Convergence:
    """The study from meshes and their modes, coarse to fine.

    Args:
        count: modes of each set; the sets should hold some more, as partners.
    """
    finest = runs[-1]
    points = pd.concat(
        [
            _mesh_rows(mesh, found, finest[0], reference, count)
            for mesh, sets in runs
            for found, reference in zip(sets, finest[1], strict=True)
        ],
        ignore_index=True,
    )
    return Convergence(points, _convergence_summary(points))


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


def richardson(h: np.ndarray, f: np.ndarray) -> tuple[float, float]:
    """Limit and order from three meshes, coarse to fine.

    Returns:
        the limit, and the order; where the values do not fall into line the finest value and NaN.
    """
    first = f[0] - f[1]
    second = f[1] - f[2]
    if first * second <= 0:
        return float(f[2]), np.nan
    wanted = first / second

    def miss(p: float) -> float:
        return (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - wanted

    if miss(0.05) * miss(MAX_ORDER) >= 0:
        return float(f[2]), np.nan
    p = brentq(miss, 0.05, MAX_ORDER)
    return float(f[2] - second * h[2] ** p / (h[1] ** p - h[2] ** p)), float(p)


def fitted_order(h: np.ndarray, f: np.ndarray) -> tuple[float, float, float]:
    """Limit, order and scatter (standard deviation) of f + C h^p by least squares.

    Returns:
        the finest value and NaN where the values have no trend, or three of them do not fall into
        line.
    """
    if len(f) < 3:
        return float(f[-1]), np.nan, 0.0
    if len(f) == 3:
        return *richardson(h, f), 0.0

    def fit(p: float) -> tuple[np.ndarray, float]:
        A = np.stack([np.ones(len(h)), h**p], axis=1)
        x = np.linalg.lstsq(A, f, rcond=None)[0]
        return x, float(np.sum((A @ x - f) ** 2))

    coarse = np.linspace(0.25, MAX_ORDER, 48)
    start = coarse[np.argmin([fit(p)[1] for p in coarse])]
    p = minimize_scalar(
        lambda p: fit(p)[1], bounds=(max(start - 0.5, 0.05), start + 0.5), method="bounded"
    ).x
    (limit, slope), left = fit(p)
    scatter = float(np.sqrt(left / (len(f) - 3)))
    if scatter > MAX_SCATTER * abs(slope) * (h.max() ** p - h.min() ** p):
        return float(f[-1]), np.nan, scatter
    return float(limit), float(p), scatter


def _convergence_summary(points: pd.DataFrame) -> pd.DataFrame:
    keys = [key for key in ("nodal_diameter", "mode") if key in points]
    rows = []
    for _, line in points.groupby(keys):
        line = line.sort_values("size", ascending=False)
        f = line["frequency"].to_numpy()
        limit, order, scatter = fitted_order(line["size"].to_numpy() / line["size"].iloc[-1], f)
        reason = _order_doubt(order, line["mac"].min(), len(f))
        change = np.ptp(f[-2:] if len(f) == 3 else f[-3:])
        error = (
            UNTRUSTED_FACTOR * change / f[-1]
            if reason
            else abs(f[-1] / limit - 1) + scatter / f[-1]
        )
        rows.append(
            {
                **{name: int(line[name].iloc[0]) for name in keys},
                "frequency": f[-1],
                "limit": np.nan if reason else limit,
                "order": order,
                "error": error,
                "scatter": scatter / f[-1],
                "reason": reason,
            }
        )
    return pd.DataFrame(rows)


def _order_doubt(order: float, mac: float, meshes: int) -> str:
    """Why an order is not believed."""
    if mac < MIN_MAC:
        return f"the shapes of two meshes differ, MAC {mac:.2f}"
    if meshes < 3:
        return "two meshes show no order"
    if np.isnan(order):
        return "the frequencies do not fall into line"
    if not PLAUSIBLE_ORDERS[0] <= order <= PLAUSIBLE_ORDERS[1]:
        low, high = PLAUSIBLE_ORDERS
        return f"order {order:.1f} is not plausible for such elements, expected {low:g} to {high:g}"
    return ""
