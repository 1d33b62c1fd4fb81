"""Mesh refinement: frequencies on finer and finer meshes, observed order, Richardson's estimate of the limit.

f(h) = f + C h^p through the three finest meshes (Roache, J. Fluids Eng. 116 (1994), doi:10.1115/1.2910291), with the
element sizes that the meshes really have. Modes are paired with those of the finest mesh by their shapes (MAC), so two
that cross while the mesh is refined keep their names. Unstructured meshes are not similar to each other, so values need
not fall into line: where they do not, or the order is none that the elements can have, ``reason`` says so and the error
is three times the last change (Roache's safety factor for two meshes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq, linear_sum_assignment

from geometry.mesh import Mesh

from ..data import ModeSet
from ..errors import InputError
from ..scene import Scene
from .loads import Progress, unwatched
from .modal import mac_of
from .stages import Bodies, build_mesh, find_modes
from .transfer import nodal_volumes, transfer

__all__ = ["RATIOS", "Convergence", "converge", "default_sizes", "element_size", "richardson"]

RATIOS = (1.7, 1.3, 1.0)    # of the scene's own element size
HIGHEST = 12.0              # order that is looked for
BELIEVED = (1.0, 6.0)       # orders that frequencies can have: from sharp re-entrant edges to 4 for P2, and some luck
SAFETY = 3.0                # error over last change where no order is believed
ALIKE = 0.8                 # MAC of the same mode on two meshes
SPARE = 3                   # modes beyond those asked for, candidates for pairs
POINTS = 4000               # nodes that shapes are compared at


@dataclass(frozen=True)
class Convergence:
    """SI columns."""

    points: pd.DataFrame        # size [m], cells, dofs, nodal_diameter, mode, frequency [Hz], mac: one row a mesh
                                # and mode
    summary: pd.DataFrame       # nodal_diameter, mode, frequency, limit [Hz], order [1], error [1] of the finest mesh,
                                # reason: why the order is not believed, empty when it is


def converge(scene: Scene, sizes: Sequence[float], diameters: Sequence[int] | None = None, count: int = 5,
             comm: Any = None, progress: Progress = unwatched) -> Convergence:
    """The same scene on several meshes.

    Args:
        sizes: target element sizes [m], at least three, from coarse to fine.
        diameters: nodal diameters of a wheel.
        count: modes of each.

    Raises:
        InputError: too few sizes, or not from coarse to fine; a scene whose mesh is given.
    """
    if scene.kind == "imported":
        raise InputError("kind 'imported': its mesh is given, expected a scene that is meshed here")
    if len(sizes) < 3 or not all(a > b > 0 for a, b in pairwise(sizes)):
        raise InputError(f"converge = {list(sizes)} m: expected at least three element sizes, from coarse to fine")
    runs = []
    for size in progress(list(sizes), "meshes"):
        refined = replace(scene, mesh=replace(scene.mesh, size=size, contact_size=_scaled(scene, size, sizes)))
        mesh = build_mesh(refined, comm)
        runs.append((mesh, find_modes(Bodies(refined, mesh, comm), diameters, count + SPARE)))
    finest = runs[-1]
    points = pd.concat([_rows(mesh, found, finest[0], reference, count) for mesh, sets in runs
                        for found, reference in zip(sets, finest[1], strict=True)], ignore_index=True)
    return Convergence(points, _summary(points))


def paired(mesh: Mesh, modes: ModeSet, finest: Mesh, reference: ModeSet, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(count,) numbers in ``modes`` of the modes most like the first of ``reference``, and their MAC."""
    nodes = np.unique(finest.bodies["blade"])
    nodes = nodes[::max(len(nodes) // POINTS, 1)]
    blade = replace(mesh, bodies={"blade": mesh.bodies["blade"]})
    theirs = modes.shapes[:, nodes] if mesh is finest else transfer(blade, modes.shapes, finest.points[nodes])
    match = mac_of(reference.shapes[:count, nodes], theirs, nodal_volumes(finest)[nodes])
    rows, columns = linear_sum_assignment(-match)
    return columns, match[rows, columns]


def _rows(mesh: Mesh, modes: ModeSet, finest: Mesh, reference: ModeSet, count: int) -> pd.DataFrame:
    """One mesh and nodal diameter."""
    numbers, match = paired(mesh, modes, finest, reference, count)
    diameter = {} if modes.nodal_diameter is None else {"nodal_diameter": modes.nodal_diameter}
    return pd.DataFrame({"size": element_size(mesh, "blade"), "cells": len(mesh.bodies["blade"]),
                         "dofs": mesh.dimension * len(np.unique(mesh.bodies["blade"])), **diameter,
                         "mode": np.arange(1, len(numbers) + 1), "frequency": modes.frequencies[numbers], "mac": match})


def default_sizes(scene: Scene, mesh: Mesh) -> list[float]:
    """Three element sizes [m] down to the scene's own; where that is open, down to the mean one of its mesh."""
    own = scene.mesh.size or 1.5 * element_size(mesh, "blade")
    return [ratio * own for ratio in RATIOS]


def element_size(mesh: Mesh, body: str) -> float:
    """Side of a cube (square) as large as the mean cell [m]."""
    from ..fem.loads import volume
    d = mesh.dimension
    size = volume(mesh, body) / (mesh.depth if d == 2 else 1.0)
    return float((size / len(mesh.bodies[body])) ** (1 / d))


def richardson(h: np.ndarray, f: np.ndarray) -> tuple[float, float]:
    """Limit and order from three meshes, coarse to fine.

    Returns:
        the limit, and the order; where the values do not fall into line the finest value and NaN.
    """
    first, second = f[0] - f[1], f[1] - f[2]
    if first * second <= 0:
        return float(f[2]), np.nan
    wanted = first / second

    def miss(p: float) -> float:
        return (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - wanted

    if miss(0.05) * miss(HIGHEST) >= 0:
        return float(f[2]), np.nan
    p = brentq(miss, 0.05, HIGHEST)
    return float(f[2] - second * h[2] ** p / (h[1] ** p - h[2] ** p)), float(p)


def _scaled(scene: Scene, size: float, sizes: Sequence[float]) -> float | None:
    """A given size on the contact faces is refined alike."""
    given = scene.mesh.contact_size
    return None if given is None else given * size / sizes[-1]


def _summary(points: pd.DataFrame) -> pd.DataFrame:
    keys = [key for key in ("nodal_diameter", "mode") if key in points]
    rows = []
    for _, line in points.groupby(keys):
        line = line.sort_values("size", ascending=False)[-3:]
        f = line["frequency"].to_numpy()
        limit, order = richardson(line["size"].to_numpy() / line["size"].iloc[-1], f)
        reason = _doubt(order, line["mac"].min())
        error = SAFETY * abs(f[-1] - f[-2]) / f[-1] if reason else abs(f[-1] / limit - 1)
        rows.append({**{name: int(line[name].iloc[0]) for name in keys}, "frequency": f[-1],
                     "limit": f[-1] if reason else limit, "order": order, "error": error, "reason": reason})
    return pd.DataFrame(rows)


def _doubt(order: float, mac: float) -> str:
    """Why an order is not believed."""
    if mac < ALIKE:
        return f"the shapes of two meshes differ, MAC {mac:.2f}"
    if np.isnan(order):
        return "the frequencies do not fall into line"
    if not BELIEVED[0] <= order <= BELIEVED[1]:
        return f"order {order:.1f} is none that the elements can have"
    return ""
