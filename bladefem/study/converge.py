"""Mesh refinement: frequencies on finer and finer meshes, observed order, Richardson's estimate of the limit.

f(h) = f + C h^p through the three finest meshes (Roache, J. Fluids Eng. 116 (1994), doi:10.1115/1.2910291), with the
element sizes that the meshes really have. Modes are compared by their number, so two that cross while the mesh is
refined show up as an order that makes no sense.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from geometry.mesh import Mesh

from ..errors import InputError
from ..scene import Scene
from .loads import Progress, unwatched
from .stages import Bodies, build_mesh, find_modes

__all__ = ["RATIOS", "Convergence", "converge", "default_sizes", "element_size", "richardson"]

RATIOS = (1.7, 1.3, 1.0)    # of the scene's own element size
HIGHEST = 12.0              # order that is looked for


@dataclass(frozen=True)
class Convergence:
    """SI columns."""

    points: pd.DataFrame        # size [m], cells, dofs, nodal_diameter, mode, frequency [Hz]: one row a mesh and mode
    summary: pd.DataFrame       # nodal_diameter, mode, frequency, limit [Hz], order [1], error [1] of the finest mesh


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
    frames = []
    for size in progress(list(sizes), "meshes"):
        refined = replace(scene, mesh=replace(scene.mesh, size=size, contact_size=_scaled(scene, size, sizes)))
        mesh = build_mesh(refined, comm)
        sets = find_modes(Bodies(refined, mesh, comm), diameters, count)
        frames += [pd.DataFrame({"size": element_size(mesh, "blade"), "cells": len(mesh.bodies["blade"]),
                                 "dofs": mesh.dimension * len(np.unique(mesh.bodies["blade"])),
                                 **({} if s.nodal_diameter is None else {"nodal_diameter": s.nodal_diameter}),
                                 "mode": np.arange(1, len(s.frequencies) + 1), "frequency": s.frequencies})
                   for s in sets]
    points = pd.concat(frames, ignore_index=True)
    return Convergence(points, _summary(points))


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
        error = abs(f[-1] / limit - 1) if np.isfinite(order) else abs(f[-1] - f[-2]) / f[-1]
        rows.append({**{name: int(line[name].iloc[0]) for name in keys}, "frequency": f[-1],
                     "limit": limit, "order": order, "error": error})
    return pd.DataFrame(rows)
