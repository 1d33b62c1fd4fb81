"""How a body is supported in addition to its clamp: springs per unit area on a face, such as the
elastic root in a disc, and single directions held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..errors import InputError, suggestion
from . import shape_functions as shape
from .body import Body
from .compat import PETSc

# of the surface element times two shape functions, on curved faces
DEGREE = 8


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
    """(n_points, dim) true where a displacement is zero by a support in single directions."""
    held = np.zeros((len(body.mesh.points), body.dim), bool)
    known = {**body.mesh.faces, **body.mesh.nodes}
    for name, letters in directions:
        if name not in known:
            raise InputError(
                "support.directions: the mesh has no face or node set "
                f"'{name}'{suggestion(name, known)}"
            )
        nodes = np.unique(known[name])
        nodes = nodes[body.rows[nodes] >= 0]
        axes = np.array(["xyz".index(letter) for letter in letters])
        held[np.ix_(nodes, axes)] = True
    return held


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
    d = body.dim
    kind = shape.FACET_OF[mesh.cell_type]
    values, tangents, weights = shape.geometry(kind, mesh.points[facets][:, :, :d], DEGREE)
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
