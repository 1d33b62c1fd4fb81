"""How a body is supported in addition to its clamp: springs per unit area on a face, such as the
elastic root in a disc, and single directions held.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..errors import InputError, suggestion
from . import shape_functions as shape
from .body import Body
from .compat import PETSc
from .loads import facets_by_shape

# directions along fixed axes
FIXED_DIRECTIONS = {"x": 0, "y": 1, "z": 2, "a": 2}
# directions at a node about the z axis
POLAR_DIRECTIONS = ("r", "t")
# of the mesh's size: nodes so near to the axis are on it
ON_AXIS = 1e-9
# component of a unit vector below which it lies along the other axis
ALONG_AXIS = 1e-9
# of the surface element times two shape functions, on curved faces
QUADRATURE_DEGREE = 8


@dataclass(frozen=True)
class AreaSpring:
    """Springs to the ground on a face."""

    face: str
    # [N/m^3]
    normal: float
    tangential: float


def supported(
    body: Body,
    clamp: str = "clamp",
    springs: Sequence[AreaSpring] = (),
    directions: Sequence[tuple[str, str]] = (),
) -> Body:
    """The body on its supports; everything made of it knows of them.

    Args:
        clamp: face or node set that is held, "" for none: a free body, or one on springs.
        directions: face or node set, and the letters of the displacements that are zero on it.

    Raises:
        InputError: a face or node set that the mesh does not have.
    """
    held_directions(body, directions)
    matrix = None
    if springs:
        matrix = spring_matrix(body, springs)
        stiffness = body.K.duplicate(copy=True)
        stiffness.axpy(1.0, matrix, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        body = replace(body, K=stiffness)
    return replace(body, hold=clamp, spring=matrix, directions=tuple(directions))


def held_directions(body: Body, directions: Sequence[tuple[str, str]]) -> np.ndarray:
    """(n_points, dim) true where a displacement along a fixed axis is zero by a support in single
    directions; "a" is "z".
    """
    held = np.zeros((len(body.mesh.points), body.dim), bool)
    for nodes, letters in _nodes_and_letters(body, directions):
        axes = [FIXED_DIRECTIONS[letter] for letter in letters if letter in FIXED_DIRECTIONS]
        held[np.ix_(nodes, np.array(axes, int))] = True
    return held


def polar_elimination(
    body: Body,
    directions: Sequence[tuple[str, str]],
    held: np.ndarray,
    partner: np.ndarray,
) -> sp.csr_matrix | None:
    """(n_points*dim,)*2 displacements from those left when radial or tangential ones are zero.

    At a node n . u = 0, with n the radial or the tangential direction there: the displacement along
    the axis on which n is longest follows from the other one.

    Args:
        held: (n_points, dim) displacements along fixed axes that are zero already.
        partner: (n_points,) the node on the low cut face whose motion each node repeats, itself
            where it repeats none.

    Returns:
        None where nothing is held like that.

    Raises:
        InputError: a node on the axis, which has no such directions.
    """
    polar = np.zeros((len(body.mesh.points), 2), bool)
    for nodes, letters in _nodes_and_letters(body, directions):
        for i, letter in enumerate(POLAR_DIRECTIONS):
            polar[partner[nodes], i] |= letter in letters
    some = np.flatnonzero(polar.any(axis=1))
    if not len(some):
        return None
    place = body.mesh.points[some, :2]
    radius = np.linalg.norm(place, axis=1)
    if radius.min() <= ON_AXIS * np.ptp(body.mesh.points, axis=0).max():
        raise InputError(
            "support.directions: a node on the z axis has no radial and tangential direction, "
            "expected 'xy' there"
        )
    radial = place / radius[:, None]
    tangential = np.stack([-radial[:, 1], radial[:, 0]], axis=1)
    normal = np.where(polar[some, :1], radial, tangential)
    slave = abs(normal).argmax(axis=1)
    each = np.arange(len(some))
    ratio = -normal[each, 1 - slave] / normal[each, slave]
    # both directions are zero, or one is and a fixed axis across it: nothing is left in the plane
    fixed = held[some, :2].any(axis=1) & (abs(normal) > ALONG_AXIS).all(axis=1)
    nothing = polar[some].all(axis=1) | fixed
    d = body.dim
    keep = np.ones(len(body.mesh.points) * d)
    keep[d * some + slave] = 0.0
    keep[d * some[nothing] + 1 - slave[nothing]] = 0.0
    row = (d * some + slave)[~nothing]
    column = (d * some + 1 - slave)[~nothing]
    follow = sp.coo_matrix((ratio[~nothing], (row, column)), shape=(len(keep),) * 2)
    out = (sp.diags(keep) + follow).tocsr()
    out.eliminate_zeros()
    return out


def _nodes_and_letters(
    body: Body, directions: Sequence[tuple[str, str]]
) -> Iterator[tuple[np.ndarray, str]]:
    """Nodes of the body and the letters of what is zero there.

    Raises:
        InputError: no such face or node set, or no such direction in a plane mesh.
    """
    known = {**body.mesh.faces, **body.mesh.nodes}
    for name, letters in directions:
        if name not in known:
            raise InputError(
                "support.directions: the mesh has no face or node set "
                f"'{name}'{suggestion(name, known)}"
            )
        missing = [letter for letter in letters if letter not in "xy"] if body.dim == 2 else []
        if missing:
            raise InputError(
                f"support.directions = '{name}: {letters}': a plane mesh has no direction "
                f"'{missing[0]}', expected x or y"
            )
        nodes = np.unique(known[name])
        yield nodes[body.rows[nodes] >= 0], letters


def spring_matrix(body: Body, springs: Sequence[AreaSpring]) -> PETSc.Mat:
    """Stiffness of the springs [N/m], with the pattern of the body's own.

    Raises:
        InputError: a face that the mesh does not have.
    """
    n = body.rows.size * body.dim
    total = sp.csr_matrix((n, n))
    for spring in springs:
        total = total + _of_face(body, spring)
    out = body.K.duplicate(copy=False)
    out.zeroEntries()
    place = body.scalar_rows
    first, last = body.K.owner_range
    for row in np.flatnonzero(np.diff(total.indptr)):
        if first <= place[row] < last:
            part = slice(total.indptr[row], total.indptr[row + 1])
            columns = place[total.indices[part]].astype(PETSc.IntType)
            out.setValues([place[row]], columns, total.data[part])
    out.assemble()
    return out


def _of_face(body: Body, spring: AreaSpring) -> sp.csr_matrix:
    """Consistent matrix in mesh numbering: kn along the normal, kt across it."""
    mesh = body.mesh
    if spring.face not in mesh.faces:
        raise InputError(
            "support.springs: the mesh has no face "
            f"'{spring.face}'{suggestion(spring.face, mesh.faces)}"
        )
    facets = mesh.faces[spring.face]
    facets = facets[(body.rows[facets] >= 0).all(axis=1)]
    n = body.rows.size * body.dim
    total = sp.csr_matrix((n, n))
    for word, some in facets_by_shape(body, facets):
        total = total + _of_facets(body, spring, word, some)
    return total


def _of_facets(body: Body, spring: AreaSpring, word: str, facets: np.ndarray) -> sp.csr_matrix:
    """The part of facets (nf, k) of one shape."""
    mesh = body.mesh
    d = body.dim
    values, tangents, weights = shape.geometry(
        word, mesh.points[facets][:, :, :d], QUADRATURE_DEGREE
    )
    if d == 3:
        normal = np.cross(tangents[..., 0], tangents[..., 1])
    else:
        normal = np.stack([tangents[..., 1, 0], -tangents[..., 0, 0]], axis=-1)
    area = np.linalg.norm(normal, axis=-1)
    unit = normal / area[..., None]
    along = np.einsum("cqi,cqj->cqij", unit, unit)
    local = spring.normal * along + spring.tangential * (np.eye(d) - along)
    depth = mesh.depth if d == 2 else 1.0
    blocks = depth * np.einsum(
        "qk,ql,q,cq,cqij->ckilj", values, values, weights, area, local, optimize=True
    )
    number = (d * facets[:, :, None] + np.arange(d)).reshape(len(facets), -1)
    size = number.shape[1]
    n = body.rows.size * d
    rows = np.repeat(number, size, axis=1).ravel()
    columns = np.tile(number, (1, size)).ravel()
    return sp.coo_matrix((blocks.ravel(), (rows, columns)), shape=(n, n)).tocsr()
