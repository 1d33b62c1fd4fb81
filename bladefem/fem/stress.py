"""Stresses of a displacement field (static, mode or forced response), in NumPy and mesh numbering.

Voigt order xx, yy, zz, xy, yz, zx, always six components: plane stress has zz = 0, plane strain
lambda tr(e). Amplitudes of harmonic motion are complex, s(t) = Re(s e^{j w t}).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp

from geometry.topology import FAMILY
from geometry.whole_cells import OwnCells, own_cells

from ..errors import InputError
from . import shape_functions as shape
from .body import Body
from .cell_functions import (
    order_of,
    product_rule,
    pyramid_rule,
    quadrature,
    reference_nodes,
    tabulate,
)
from .elasticity import lame_parameters, stress_of
from .temperature import point_temperatures, strain_tensor_at

# axes of the six components as stresses are written: shear xy, yz, zx; stiffness matrices have the
# order of elasticity.STIFFNESS_PAIRS
OUTPUT_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
# cells at a time
CELLS_PER_BLOCK = 20000
# of a period, for principal stresses of complex fields
PHASES_PER_PERIOD = 64
# square of a patch's radius: bounds the weight of Gauss points next to the node
MIN_SQUARED_DISTANCE = 0.01


@dataclass(frozen=True)
class GaussStress:
    """Stresses at the Gauss points of reduced integration, where they are best.

    A tetrahedron that is a piece of a cell of another shape has all points of that cell, and its
    share of their volume.
    """

    # (nc, q, 3) [m]
    points: np.ndarray
    # (nc, q) [m^3]
    volume: np.ndarray
    # (nc, q, 6) [Pa], real or complex
    stress: np.ndarray


@dataclass(frozen=True)
class _Strain:
    """How strain follows from the gradient of a displacement: see ``gauss_stress``."""

    large: bool
    heated: bool


# small strain of a motion about the static state
VIBRATION = _Strain(large=False, heated=False)


def gauss_stress(
    body: Body,
    u: np.ndarray,
    *,
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
    return _gauss_stress_of(body, _stress_of_shapes(body, u, _Strain(large, heated)))


def gauss_and_nodal_stress(
    body: Body,
    u: np.ndarray,
    *,
    large: bool = False,
    heated: bool = False,
) -> tuple[GaussStress, np.ndarray]:
    """``gauss_stress`` and ``nodal_stress`` of one field, in half the time of both."""
    found = _stress_of_shapes(body, u, _Strain(large, heated))
    return _gauss_stress_of(body, found), _nodal_stress_of(body, found)


def _stress_of_shapes(
    body: Body,
    u: np.ndarray,
    kind: _Strain,
) -> list[tuple[OwnCells, list[np.ndarray]]]:
    """Cells of each material and shape with places, volumes and stresses at their Gauss points."""
    _check_field(body, u, kind)
    return [(own, _all_cells(body, u, own, kind)) for own in solved_cells(body)]


def _gauss_stress_of(body: Body, by_shape: list[tuple[OwnCells, list[np.ndarray]]]) -> GaussStress:
    """Places, volumes and stresses by shape, put into the order of the body's cells."""
    width = max(len(best_points(some.word)[0]) for some, _ in by_shape)
    starts = dict(zip(body.material, np.cumsum([0, *_piece_counts(body)])[:-1], strict=True))
    columns: list[np.ndarray] = []
    for some, found in by_shape:
        rows = starts[some.name] + some.pieces
        for i, values in enumerate(_for_pieces(some, found, width)):
            if i == len(columns):
                shape_of = (sum(_piece_counts(body)), *values.shape[1:])
                columns.append(np.zeros(shape_of, values.dtype))
            columns[i][rows] = values
    return GaussStress(*columns)


def solved_cells(body: Body) -> list[OwnCells]:
    """The cells that the body's matrices are of, by material and shape."""
    return own_cells(body.mesh, tuple(body.material))


def _piece_counts(body: Body) -> list[int]:
    return [len(body.mesh.bodies[name]) for name in body.material]


def _check_field(body: Body, u: np.ndarray, kind: _Strain) -> None:
    mesh = body.mesh
    if np.shape(u)[0] != len(mesh.points) or np.shape(u)[1] < body.dim:
        raise InputError(
            f"displacement of shape {np.shape(u)}, expected ({len(mesh.points)}, {body.dim})"
        )
    if kind.large and np.iscomplexobj(u):
        raise InputError("displacement is complex, expected a real one for large displacements")
    if not np.isfinite(u).all():
        raise InputError("displacement has values that are not finite")


def _all_cells(
    body: Body,
    u: np.ndarray,
    own: OwnCells,
    kind: _Strain,
) -> list[np.ndarray]:
    """Places, volumes and stresses at the Gauss points of all cells of a shape, some at a time."""
    blocks = np.array_split(own.cells, len(own.cells) // CELLS_PER_BLOCK + 1)
    u = np.asarray(u)[:, : body.dim]
    parts = [_of_cells(body, u, own.name, own.word, some, kind) for some in blocks]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _for_pieces(own: OwnCells, found: list[np.ndarray], width: int) -> list[np.ndarray]:
    """Places, volumes and stresses of pieces (np, width, ...) from those of their cells
    (nc, q, ...): points are repeated up to the width, and their volumes shared.
    """
    places, volume, stress = found
    again = np.arange(width) % volume.shape[1]
    share = np.bincount(own.owner)[own.owner][:, None] * np.bincount(again)[again]
    return [
        places[own.owner][:, again],
        volume[own.owner][:, again] / share,
        stress[own.owner][:, again],
    ]


def nodal_stress(
    body: Body,
    u: np.ndarray,
    *,
    large: bool = False,
    heated: bool = False,
) -> np.ndarray:
    """(n_points, 6) stresses at the nodes [Pa]: each cell's Gauss points continued to its nodes,
    then the mean over the cells of one material, weighted by volume; 0 outside the body.

    A node between two materials takes the mean of the material with the larger von Mises stress
    there.
    """
    return _nodal_stress_of(body, _stress_of_shapes(body, u, _Strain(large, heated)))


def _nodal_stress_of(body: Body, by_shape: list[tuple[OwnCells, list[np.ndarray]]]) -> np.ndarray:
    """``nodal_stress`` from what was found by shape."""
    n = len(body.mesh.points)
    out = np.zeros((n, 6), np.result_type(*(stress for _, (*_, stress) in by_shape)))
    largest = np.full(n, -1.0)
    for name in body.material:
        weight = np.zeros(n)
        total = np.zeros_like(out)
        for own, (_, volume, stress) in by_shape:
            if own.name != name:
                continue
            at_nodes = extrapolation_matrix(own.word) @ stress
            # row by row: the mean over cells is a product with a sparse matrix
            entry = np.arange(own.cells.size)
            size = np.repeat(volume.sum(axis=1), own.cells.shape[1])
            sums = sp.csr_matrix((size, (own.cells.ravel(), entry)), shape=(n, own.cells.size))
            weight += np.asarray(sums.sum(axis=1)).ravel()
            total += sums @ at_nodes.reshape(-1, 6)
        mean = total / np.maximum(weight, np.finfo(float).tiny)[:, None]
        size = np.where(weight > 0, von_mises(mean), -1.0)
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
    _check_field(body, u, VIBRATION)
    u = np.asarray(u)[:, : body.dim]
    jumps = np.zeros(len(body.mesh.points))
    for own in solved_cells(body):
        matrix = extrapolation_matrix(own.word)
        for cells in np.array_split(own.cells, len(own.cells) // CELLS_PER_BLOCK + 1):
            *_, stress = _of_cells(body, u, own.name, own.word, cells, VIBRATION)
            at_nodes = matrix @ stress
            np.maximum.at(jumps, cells, von_mises(at_nodes - recovered[cells]))
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
    own = solved_cells(body)
    near = {
        name: np.concatenate(
            [o.cells[(o.cells == node).any(axis=1)].ravel() for o in own if o.name == name]
        )
        for name in body.material
    }
    for o in own:
        some = o.cells[np.isin(o.cells, near[o.name]).any(axis=1)]
        if not len(some):
            continue
        at, _, stress = _of_cells(
            body, np.asarray(u)[:, : body.dim], o.name, o.word, some, VIBRATION
        )
        places.append(at.reshape(-1, 3)[:, : body.dim])
        stresses.append(stress.reshape(-1, 6))
        at_node.append(np.repeat((some == node).any(axis=1), at.shape[1]))
    x = np.concatenate(places) - mesh.points[node, : body.dim]
    x = x / np.abs(x).max()
    values = np.concatenate(stresses)
    here = np.concatenate(at_node)
    linear = np.column_stack([np.ones(len(x)), x])
    squares = [x[:, i] * x[:, j] for i in range(body.dim) for j in range(i, body.dim)]
    quadratic = np.column_stack([linear, *squares])
    weight = 1 / (MIN_SQUARED_DISTANCE + (x**2).sum(axis=1))[:, None]
    first = np.linalg.lstsq(linear[here], values[here], rcond=None)[0][0]
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


def mises_vector(stress: np.ndarray) -> np.ndarray:
    """(..., 6) linear in the stress (..., 6) [Pa]; of real ones its length is the von Mises
    stress.
    """
    normal = (stress[..., [0, 1, 2]] - stress[..., [1, 2, 0]]) / np.sqrt(2)
    return np.concatenate([normal, np.sqrt(3) * stress[..., 3:]], axis=-1)


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
    for i, (a, b) in enumerate(OUTPUT_PAIRS):
        out[..., a, b] = out[..., b, a] = stress[..., i]
    return out


def _of_cells(
    body: Body,
    u: np.ndarray,
    name: str,
    word: str,
    cells: np.ndarray,
    kind: _Strain,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, volumes and stresses at the Gauss points of some cells of one material."""
    mesh = body.mesh
    d = body.dim
    at, w = best_points(word)
    values, gradients = tabulate(word, at)
    corners = mesh.points[cells]
    # matrix products: einsum takes several times as long
    turned = gradients.swapaxes(1, 2)
    tangents = (turned @ corners[:, None, :, :d]).swapaxes(2, 3)
    volume = np.abs(np.linalg.det(tangents)) * w * (mesh.depth if d == 2 else 1.0)
    slope = (turned @ u[cells][:, None]).swapaxes(2, 3) @ np.linalg.inv(tangents)
    strain = (slope + slope.swapaxes(2, 3)) / 2
    if kind.large:
        strain = strain + slope.swapaxes(2, 3) @ slope / 2
    temperature = point_temperatures(body.heat, cells, values)
    if kind.heated and body.heat is not None and temperature is not None:
        thermal = strain_tensor_at(body.material[name], body.heat, temperature, d)
        # Green's strain of free expansion, as in the nonlinear preload
        strain = strain - (thermal + thermal @ thermal / 2 if kind.large else thermal)
    stress = stress_of(body.material[name], strain, body.plane, temperature)
    across = None
    if d == 2 and body.plane == "strain":
        lam = lame_parameters(body.material[name], d, body.plane)[..., 0]
        across = lam * np.trace(strain, axis1=2, axis2=3)
    if kind.large:
        F = np.eye(d) + slope
        J = np.linalg.det(F)
        stress = F @ stress @ F.swapaxes(2, 3) / J[..., None, None]
        across = None if across is None else across / J
    return (
        values @ corners,
        volume,
        _stress_vector(stress, across),
    )


def _stress_vector(stress: np.ndarray, across: np.ndarray | None) -> np.ndarray:
    d = stress.shape[-1]
    out = np.zeros((*stress.shape[:-2], 6), stress.dtype)
    for i, (a, b) in enumerate(OUTPUT_PAIRS):
        if max(a, b) < d:
            out[..., i] = stress[..., a, b]
    if across is not None:
        out[..., 2] = across
    return out


@cache
def best_points(word: str) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points of degree 2 (p - 1): one for cells of first order, four in a tetra10, eight in a
    hexahedron27 and a pyramid14, six in a wedge18.
    """
    kind, degree = FAMILY[word], order_of(word)
    if degree == 2 and kind in ("tetra", "triangle"):
        return _four_points(len(shape.reference_nodes(kind)))
    if kind == "wedge" and degree == 2:
        return product_rule(_four_points(3), shape.quadrature("line", 2))
    if kind == "pyramid":
        return pyramid_rule(degree)
    return quadrature(
        kind, 2 * (degree - 1) if kind in ("tetra", "triangle", "wedge") else 2 * degree - 1
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
def extrapolation_matrix(word: str) -> np.ndarray:
    """(k, q) from the points of `gauss_stress` to the nodes of a cell, by the polynomial that the
    points determine.
    """
    kind = FAMILY[word]
    at, _ = best_points(word)
    target = reference_nodes(word)
    if len(at) == 1:
        return np.ones((len(target), 1))
    lower, _ = tabulate(kind, at)
    return np.asarray(tabulate(kind, target)[0] @ np.linalg.pinv(lower))
