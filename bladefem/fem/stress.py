"""Stresses of a displacement field (static, mode or forced response), in NumPy and mesh numbering.

Voigt order xx, yy, zz, xy, yz, zx, always six components: plane stress has zz = 0, plane strain
lambda tr(e). Amplitudes of harmonic motion are complex, s(t) = Re(s e^{j w t}).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import InputError
from . import shape_functions as shape
from .body import Body
from .elasticity import lame_parameters, stress_of
from .temperature import point_temperatures, strain_tensor_at

VOIGT_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
# cells at a time
CELLS_PER_BLOCK = 20000
# of a period, for principal stresses of complex fields
PHASES_PER_PERIOD = 64
# square of a patch's radius: bounds the weight of Gauss points next to the node
MIN_SQUARED_DISTANCE = 0.01


@dataclass(frozen=True)
class GaussStress:
    """Stresses at the Gauss points of reduced integration, where they are best."""

    # (nc, q, 3) [m]
    points: np.ndarray
    # (nc, q) [m^3]
    volume: np.ndarray
    # (nc, q, 6) [Pa], real or complex
    stress: np.ndarray


def gauss_stress(
    body: Body,
    u: np.ndarray,
    large: bool = False,
    heated: bool = False,
) -> GaussStress:
    """Stresses in the cells, ordered as ``cells_of(body)``.

    Args:
        u: (n_points, 2 or 3) displacement [m], real or complex; mode shapes give stress per modal
            amplitude.
        large: Cauchy stress of a Saint Venant-Kirchhoff body after large displacements (nonlinear
            preload).
        heated: the displacement is that of the static state, which contains the thermal strain;
            vibrations do not.

    Raises:
        InputError: the field does not fit the mesh, or a complex one with large displacements.
    """
    mesh = body.mesh
    if np.shape(u)[0] != len(mesh.points) or np.shape(u)[1] < body.dim:
        raise InputError(
            f"displacement of shape {np.shape(u)}, expected ({len(mesh.points)}, {body.dim})"
        )
    if large and np.iscomplexobj(u):
        raise InputError("displacement is complex, expected a real one for large displacements")
    if not np.isfinite(u).all():
        raise InputError("displacement has values that are not finite")
    parts = [
        _of_cells(body, np.asarray(u)[:, : body.dim], name, block, large, heated)
        for name in body.material
        for block in np.array_split(
            mesh.bodies[name], len(mesh.bodies[name]) // CELLS_PER_BLOCK + 1
        )
    ]
    return GaussStress(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def nodal_stress(
    body: Body,
    u: np.ndarray,
    large: bool = False,
    heated: bool = False,
) -> np.ndarray:
    """(n_points, 6) stresses at the nodes [Pa]: each cell's Gauss points continued to its nodes,
    then the mean over the cells of one material, weighted by volume; 0 outside the body.

    A node between two materials takes the mean of the material with the larger von Mises stress
    there.
    """
    found = gauss_stress(body, u, large, heated)
    out = np.zeros((len(body.mesh.points), 6), found.stress.dtype)
    largest = np.full(len(out), -1.0)
    start = 0
    for name in body.material:
        cells = body.mesh.bodies[name]
        part = slice(start, start + len(cells))
        start += len(cells)
        at_nodes = np.einsum(
            "kq,cqs->cks", extrapolation_matrix(body.mesh.cell_type), found.stress[part]
        )
        mean = _average_at_nodes(cells, at_nodes, found.volume[part].sum(1), len(out))
        size = np.where(np.bincount(cells.ravel(), minlength=len(out)) > 0, von_mises(mean), -1.0)
        better = size > largest
        out[better], largest[better] = mean[better], size[better]
    return out


def stress_jumps(
    body: Body,
    u: np.ndarray,
    recovered: np.ndarray,
) -> np.ndarray:
    """(n_points,) largest von Mises stress of the differences between the cells at a node and the
    recovered stress there [Pa].
    """
    found = gauss_stress(body, u)
    matrix = extrapolation_matrix(body.mesh.cell_type)
    jumps = np.zeros(len(body.mesh.points))
    cells = np.vstack([body.mesh.bodies[name] for name in body.material])
    for some in np.array_split(np.arange(len(cells)), len(cells) // CELLS_PER_BLOCK + 1):
        at_nodes = np.einsum("kq,cqs->cks", matrix, found.stress[some])
        np.maximum.at(jumps, cells[some], von_mises(at_nodes - recovered[cells[some]]))
    return jumps


def patch_stress(
    body: Body,
    u: np.ndarray,
    node: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Two values (6,) of the stress at a node, continued from the Gauss points near it.

    The first is a linear fit to the cells at the node. The second is a quadratic fit to these and
    to all that touch them, in which a residual counts with the inverse square of its distance:
    round a notch the stress falls within an element or two, and far points would flatten it.
    """
    mesh = body.mesh
    places = []
    stresses = []
    at_node = []
    for name in body.material:
        cells = mesh.bodies[name]
        near = cells[(cells == node).any(axis=1)]
        if not len(near):
            continue
        some = cells[np.isin(cells, near).any(axis=1)]
        at, _, stress = _of_cells(body, np.asarray(u)[:, : body.dim], name, some, False)
        places.append(at.reshape(-1, 3)[:, : body.dim])
        stresses.append(stress.reshape(-1, 6))
        at_node.append(np.repeat((some == node).any(axis=1), at.shape[1]))
    x = np.concatenate(places) - mesh.points[node, : body.dim]
    x = x / np.abs(x).max()
    values = np.concatenate(stresses)
    own = np.concatenate(at_node)
    linear = np.column_stack([np.ones(len(x)), x])
    squares = [x[:, i] * x[:, j] for i in range(body.dim) for j in range(i, body.dim)]
    quadratic = np.column_stack([linear, *squares])
    weight = 1 / (MIN_SQUARED_DISTANCE + (x**2).sum(axis=1))[:, None]
    first = np.linalg.lstsq(linear[own], values[own], rcond=None)[0][0]
    second = np.linalg.lstsq(quadratic * weight, values * weight, rcond=None)[0][0]
    return first, second


def signed_von_mises(stress: np.ndarray) -> np.ndarray:
    """(...) von Mises stress of real (..., 6), negative where the mean of the principal stresses is
    (compression) [Pa].
    """
    return np.where(stress[..., :3].sum(axis=-1) < 0, -1.0, 1.0) * von_mises(stress)


def von_mises(stress: np.ndarray) -> np.ndarray:
    """(...) von Mises stress of (..., 6) [Pa]; of complex amplitudes the largest in a period, in
    closed form.

    The square is a quadratic form Q of s(t): Q = (Q(s, s*) + Re(Q(s, s) e^{2 j w t})) / 2.
    """
    if not np.iscomplexobj(stress):
        return np.sqrt(np.maximum(_mises_form(stress, stress), 0.0))
    mean = _mises_form(stress, stress.conj()).real
    swing = np.abs(_mises_form(stress, stress))
    return np.sqrt(np.maximum(mean + swing, 0.0) / 2)


def principal_stresses(stress: np.ndarray) -> np.ndarray:
    """(..., 3) principal stresses, descending [Pa]; of complex amplitudes the largest of each in a
    period.
    """
    if not np.iscomplexobj(stress):
        return np.linalg.eigvalsh(_stress_tensor(stress))[..., ::-1]
    best = np.full((*stress.shape[:-1], 3), -np.inf)
    # half a period later the sign is the other
    for turn in np.exp(2j * np.pi * np.arange(PHASES_PER_PERIOD // 2) / PHASES_PER_PERIOD):
        now = _cubic_roots((stress * turn).real)
        best = np.maximum(best, np.maximum(now, -now[..., ::-1]))
    return best


def _cubic_roots(s: np.ndarray) -> np.ndarray:
    """(..., 3) principal stresses of real (..., 6), descending, by the cosine formula (Smith 1961,
    doi:10.1145/355578.366316); double ones to eight digits, many times faster than an eigenvalue
    solver.
    """
    mean = s[..., :3].mean(-1)
    a, b, c = (s[..., i] - mean for i in range(3))
    xy = s[..., 3]
    yz = s[..., 4]
    zx = s[..., 5]
    radius = np.sqrt((a * a + b * b + c * c + 2 * (xy * xy + yz * yz + zx * zx)) / 6)
    det = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx)
    angle = np.arccos(np.clip(det / np.maximum(2 * radius**3, 1e-300), -1, 1)) / 3
    first = 2 * radius * np.cos(angle)
    last = 2 * radius * np.cos(angle + 2 * np.pi / 3)
    return mean[..., None] + np.stack([first, -first - last, last], axis=-1)


def _mises_form(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The bilinear form whose square root is the von Mises stress."""
    mean_a = a[..., :3].mean(-1, keepdims=True)
    mean_b = b[..., :3].mean(-1, keepdims=True)
    normal = ((a[..., :3] - mean_a) * (b[..., :3] - mean_b)).sum(-1)
    return 1.5 * normal + 3 * (a[..., 3:] * b[..., 3:]).sum(-1)


def _stress_tensor(stress: np.ndarray) -> np.ndarray:
    out = np.empty((*stress.shape[:-1], 3, 3), stress.dtype)
    for i, (a, b) in enumerate(VOIGT_PAIRS):
        out[..., a, b] = out[..., b, a] = stress[..., i]
    return out


def _of_cells(
    body: Body,
    u: np.ndarray,
    name: str,
    cells: np.ndarray,
    large: bool,
    heated: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, volumes and stresses at the Gauss points of some cells of one material."""
    mesh = body.mesh
    d = body.dim
    at, w = _best_points(mesh.cell_type)
    values, gradients = shape.tabulate(mesh.cell_type, at)
    tangents = np.einsum("ckg,qkd->cqgd", mesh.points[cells][:, :, :d], gradients)
    volume = np.abs(np.linalg.det(tangents)) * w * (mesh.depth if d == 2 else 1.0)
    slope = np.einsum(
        "cki,qkd,cqdj->cqij", u[cells], gradients, np.linalg.inv(tangents), optimize=True
    )
    strain = (slope + slope.swapaxes(2, 3)) / 2
    if large:
        strain = strain + slope.swapaxes(2, 3) @ slope / 2
    temperature = point_temperatures(body.heat, cells, values)
    if heated and body.heat is not None and temperature is not None:
        thermal = strain_tensor_at(body.material[name], body.heat, temperature, d)
        # Green's strain of free expansion, as in the nonlinear preload
        strain = strain - (thermal + thermal @ thermal / 2 if large else thermal)
    stress = stress_of(body.material[name], strain, body.plane, temperature)
    across = None
    if d == 2 and body.plane == "strain":
        lam = lame_parameters(body.material[name], d, body.plane)[..., 0]
        across = lam * np.trace(strain, axis1=2, axis2=3)
    if large:
        F = np.eye(d) + slope
        J = np.linalg.det(F)
        stress = F @ stress @ F.swapaxes(2, 3) / J[..., None, None]
        across = None if across is None else across / J
    return (
        np.einsum("qk,ckg->cqg", values, mesh.points[cells]),
        volume,
        _stress_vector(stress, across),
    )


def element_stress(
    body: Body,
    u: np.ndarray,
    name: str,
    cells: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Stresses of several real displacement fields at once, in some cells of one material.

    Args:
        u: (n_points, dim, m) displacements [m].
        cells: (nc, k) of the body's material ``name``.

    Returns:
        volumes (nc,) [m^3], and stresses (nc, q, m, 6) at the points of `gauss_stress` [Pa].
    """
    d = body.dim
    at, weight = _best_points(body.mesh.cell_type)
    values, gradients = shape.tabulate(body.mesh.cell_type, at)
    tangents = np.einsum("ckg,qkd->cqgd", body.mesh.points[cells][:, :, :d], gradients)
    depth = body.mesh.depth if d == 2 else 1.0
    volume = (np.abs(np.linalg.det(tangents)) * weight * depth).sum(axis=1)
    # (nc, q, k, d) gradients of the shape functions in space
    spatial = gradients @ np.linalg.inv(tangents)
    slope = np.einsum("ckim,cqkj->cqmij", u[cells], spatial, optimize=True)
    strain = (slope + slope.swapaxes(3, 4)) / 2
    temperature = point_temperatures(body.heat, cells, values)
    hot = None if temperature is None else temperature[..., None]
    stress = stress_of(body.material[name], strain, body.plane, hot)
    across = None
    if d == 2 and body.plane == "strain":
        lam = lame_parameters(body.material[name], d, body.plane)[..., 0]
        across = lam * np.trace(strain, axis1=3, axis2=4)
    return volume, _stress_vector(stress, across)


def _stress_vector(stress: np.ndarray, across: np.ndarray | None) -> np.ndarray:
    d = stress.shape[-1]
    out = np.zeros((*stress.shape[:-2], 6), stress.dtype)
    for i, (a, b) in enumerate(VOIGT_PAIRS):
        if max(a, b) < d:
            out[..., i] = stress[..., a, b]
    if across is not None:
        out[..., 2] = across
    return out


@cache
def _best_points(cell_type: str) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points of degree 2 (p - 1): one for first-order simplices, four in a tetra10, eight in
    a hexahedron27.
    """
    kind, degree = shape.SHAPES[cell_type]
    if kind in ("tetra", "triangle") and degree == 2:
        return _four_points(len(shape.reference_nodes(kind)))
    return shape.quadrature(
        kind, 2 * (degree - 1) if kind in ("tetra", "triangle") else 2 * degree - 1
    )


def _four_points(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """The symmetric rule of degree 2 with a point for each corner of a simplex (Hammer and Stroud
    1956).
    """
    d = corners - 1
    near = (1 + d / np.sqrt(d + 2)) / (d + 1)
    away = (1 - near) / d
    weights = np.full((corners, corners), away)
    np.fill_diagonal(weights, near)
    return weights[:, 1:].copy(), np.full(corners, {2: 1 / 2, 3: 1 / 6}[d] / corners)


@cache
def extrapolation_matrix(cell_type: str) -> np.ndarray:
    """(k, q) from the points of `gauss_stress` to the nodes of a cell, by the polynomial that the
    points determine.
    """
    kind = shape.SHAPES[cell_type][0]
    at, _ = _best_points(cell_type)
    target = shape.reference_nodes(cell_type)
    if len(at) == 1:
        return np.ones((len(target), 1))
    lower, _ = shape.tabulate(kind, at)
    return shape.tabulate(kind, target)[0] @ np.linalg.pinv(lower)


def _average_at_nodes(
    cells: np.ndarray,
    values: np.ndarray,
    weight: np.ndarray,
    n: int,
) -> np.ndarray:
    """(n, s) weighted mean of what the cells (nc, k) say about their nodes (nc, k, s)."""
    total = np.bincount(cells.ravel(), np.repeat(weight, cells.shape[1]), n)
    out = np.zeros((n, values.shape[2]), values.dtype)
    np.add.at(out, cells, values * weight[:, None, None])
    return out / np.maximum(total, 1e-300)[:, None]
