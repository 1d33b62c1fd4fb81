"""Clamps, ties and cyclic symmetry by an explicit transformation of the unknowns.

u = T(n) q with T(n) = T0 + e^{j n theta} T1: free nodes keep their displacements, nodes of the high
cut face repeat those of the low one, turned and shifted in phase by n theta. Then

    K(n) = T(n)^H K T(n) = K0 + cos(n theta) Kc + j sin(n theta) Ks

with three real sparse matrices that serve every nodal diameter n. A plane face named "symmetry_x",
"symmetry_y" or "symmetry_z" slides in its plane: the displacement along that axis is zero there. On
a plane "antisymmetry_x", ... the two others are zero: the deformed body turns over in the mirror.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Pair, sector_of

from ..errors import InputError, suggestion
from .body import Body
from .compat import PETSc
from .cut_faces import repeated_motion, tie_cut_faces
from .cyclic_schur import FaceMap
from .distributed import local_rows, to_petsc
from .linalg import Doubled, Folded, Matrix, combined
from .open_sector import Opened, boundary_map, columns_of_part, open_sector, with_stiffness
from .supports import held_directions, polar_elimination


@dataclass(frozen=True)
class Transformation:
    """The parts that all nodal diameters share: the two of T, and the projected matrices."""

    body: Body
    # T0 (n_points*dim, n_free) in mesh numbering, the same on every rank
    low: sp.csr_matrix
    # T1, None without cyclic symmetry
    high: sp.csr_matrix | None
    # (ranks+1,) first unknown of each rank
    start: np.ndarray
    # (K0,), or (K0, Kc, Ks); empty when opened
    K: tuple[PETSc.Mat, ...]
    M: tuple[PETSc.Mat, ...]
    # wheels
    opened: Opened | None
    # 0 without cyclic symmetry
    sectors: int

    @cached_property
    def faces(self) -> FaceMap:
        """How unknowns of an open sector depend on those of nodal diameters, but for the phase."""
        assert self.opened is not None
        return boundary_map(self.opened, self.low, high_part(self))


@dataclass(frozen=True)
class Constrained:
    """A body with its constraints in one nodal diameter."""

    body: Body
    # (n_points*dim, n_free) real or complex, the same on every rank
    T: sp.csr_matrix
    # unknowns of this rank
    own: slice
    # (n_free, n_free) [N/m]
    K: Matrix
    # makes M, which static states do without
    mass: Callable[[], Matrix]
    nodal_diameter: int | None

    @cached_property
    def M(self) -> Matrix:
        """(n_free, n_free) [kg]."""
        return self.mass()

    @property
    def dtype(self) -> type:
        """complex between nodal diameters 0 and N/2."""
        return complex if np.iscomplexobj(self.T) else float


def constrain(
    body: Body,
    clamp: str | None = "clamp",
    nodal_diameter: int | None = None,
    ties: np.ndarray | None = None,
) -> Constrained:
    """A body with its constraints and symmetry planes, for one nodal diameter (None: no cyclic
    symmetry).

    Args:
        clamp: face or node set held fast; None for a floating body.
        ties: (k, 3) node numbers, the first constrained to the mean of the two others.

    Raises:
        InputError: no such face, cut faces that do not match, a symmetry plane that is not plane, a
            nodal diameter that the wheel does not have.
    """
    return at_diameter(
        transformation(body, clamp, nodal_diameter is not None, ties), nodal_diameter
    )


def transformation(
    body: Body,
    clamp: str | None = "clamp",
    cyclic: bool = False,
    ties: np.ndarray | None = None,
    one_core: bool | None = None,
) -> Transformation:
    """The part of ``constrain`` that serves all nodal diameters.

    Args:
        one_core: eliminate the interior once (the default) instead of factorising the doubled
            pencil of each nodal diameter.
    """
    pair = _cyclic_pair(body) if cyclic else None
    clamped = _with_partners(clamped_nodes(body, clamp), pair)
    low, high, start = _number_unknowns(body, *_constraint_parts(body, clamped, pair, ties))
    if high is None:
        T0 = to_petsc(body, low, start)
        return Transformation(
            body, low, None, start, (body.K.ptap(T0),), (body.M.ptap(T0),), None, 0
        )
    sectors = sector_of(body.mesh).count
    if one_core is not False:
        T, _, first = _number_unknowns(body, *_constraint_parts(body, clamped, None, ties))
        own = slice(int(start[body.comm.rank]), int(start[body.comm.rank + 1]))
        opened = open_sector(body, T, first, (abs(low) + abs(high)).tocsr(), own)
        if opened is not None:
            return Transformation(body, low, high, start, (), (), opened, sectors)
    T0 = to_petsc(body, low, start)
    T1 = to_petsc(body, high, start)
    return Transformation(
        body,
        low,
        high,
        start,
        _three_matrices(body.K, T0, T1),
        _three_matrices(body.M, T0, T1),
        None,
        sectors,
    )


def transformation_about(t: Transformation, body: Body) -> Transformation:
    """The transformation of a body that has the nodes and constraints of ``t.body`` and another
    stiffness, as :func:`rotation.body_about` makes it: what does not depend on this serves both
    (collective).

    Raises:
        ValueError: ``t`` is not that of an open sector.
    """
    if t.opened is None:
        raise ValueError("the transformation is not that of an open sector")
    return replace(t, body=body, opened=with_stiffness(t.opened, body))


def high_part(t: Transformation) -> sp.csr_matrix:
    """T1, the part of a wheel's transformation that the next sector's motion adds.

    Raises:
        InputError: the body has no cyclic faces.
    """
    if t.high is None:
        raise InputError(f"body '{t.body.name}' has no cyclic faces, expected a sector of a wheel")
    return t.high


def at_diameter(t: Transformation, nodal_diameter: int | None) -> Constrained:
    """The constrained body in one nodal diameter, 0 <= n <= N/2."""
    rank = t.body.comm.rank
    own = slice(int(t.start[rank]), int(t.start[rank + 1]))
    if nodal_diameter is None:
        if t.high is not None:
            raise InputError("nodal_diameter is None, expected a number: the body has cyclic faces")
        return Constrained(t.body, t.low, own, t.K[0], lambda: t.M[0], None)
    n = checked_diameter(nodal_diameter, t.sectors)
    angle = 2 * np.pi * n / t.sectors
    real = 2 * n % t.sectors == 0
    phase = np.exp(1j * angle) if not real else 1.0 if n == 0 else -1.0
    T = (t.low + phase * high_part(t)).tocsr()
    if t.opened is not None:
        C = columns_of_part(t.opened, T[t.opened.places])
        shared = t.opened.shared
        faces = replace(t.faces, phase=phase)
        stiffness = Folded(t.opened.K, C, t.opened.elimination, shared, faces)
        mass = Folded(t.opened.M, C, None, shared, faces)
        return Constrained(t.body, T, own, stiffness, lambda: mass, n)
    if real:
        K, M = (combined(A[0], phase, A[1]) for A in (t.K, t.M))
    else:
        K, M = (
            _doubled_matrix(combined(A[0], np.cos(angle), A[1]), A[2], np.sin(angle))
            for A in (t.K, t.M)
        )
    return Constrained(t.body, T, own, K, lambda: M, n)


def in_step(body: Body, clamp: str | None = "clamp") -> Constrained:
    """All sectors move alike (nodal diameter 0), or no cyclic symmetry: for static states, nothing
    kept for others.

    Raises:
        InputError: see :func:`constrain`.
    """
    pair = _cyclic_pair(body) if "cyclic" in body.mesh.pairs else None
    low, high = _constraint_parts(
        body, _with_partners(clamped_nodes(body, clamp), pair), pair, None
    )
    T, _, start = _number_unknowns(body, low if high is None else (low + high).tocsr(), None)
    T0 = to_petsc(body, T, start)
    rank = body.comm.rank
    return Constrained(
        body,
        T,
        slice(int(start[rank]), int(start[rank + 1])),
        body.K.ptap(T0),
        lambda: body.M.ptap(T0),
        None if pair is None else 0,
    )


def clamped_nodes(body: Body, clamp: str | None) -> np.ndarray:
    """Node numbers of a face or node set that belong to the body."""
    clamp = body.hold if clamp == "clamp" else clamp
    if not clamp:
        return np.empty(0, int)
    known = {**body.mesh.faces, **body.mesh.nodes}
    if clamp not in known:
        raise InputError(f"the mesh has no face or node set '{clamp}'{suggestion(clamp, known)}")
    found = np.unique(known[clamp])
    found = found[body.rows[found] >= 0]
    if not len(found):
        raise InputError(
            f"'{clamp}' touches no node of body '{body.name}', expected nodes to hold it by"
        )
    return found


def restrict_load(con: Constrained, load: np.ndarray | sp.spmatrix) -> np.ndarray:
    """T^H load: this rank's rows (n_own, k) of loads or port vectors (n_points*dim, k) in mesh
    numbering.
    """
    product = con.T.conj().T @ load
    return (
        product.tocsr()[con.own].toarray() if sp.issparse(product) else np.asarray(product)[con.own]
    )


def unknowns(con: Constrained, x: np.ndarray) -> np.ndarray:
    """All unknowns (n_free, k) on every rank from this rank's rows (n_own, k)."""
    parts = con.body.comm.allgather(x)
    return np.concatenate(parts)


def expand_to_mesh(con: Constrained, x: np.ndarray) -> np.ndarray:
    """Displacements (n_points, dim, k) in mesh numbering on every rank from this rank's unknowns
    (n_own, k).
    """
    return (con.T @ unknowns(con, x)).reshape(len(con.body.mesh.points), con.body.dim, -1)


def checked_diameter(n: int, sectors: int) -> int:
    """The nodal diameter as a whole number.

    Raises:
        InputError: the wheel does not have it.
    """
    if sectors < 1:
        raise InputError("nodal_diameter is set, expected None: the mesh has no cyclic faces")
    if n != int(n) or not 0 <= n <= sectors // 2:
        raise InputError(f"nodal_diameter is {n}, expected a whole number from 0 to {sectors // 2}")
    return int(n)


def _cyclic_pair(body: Body) -> Pair:
    """The cut faces of this body, checked where their nodes match; without nodes where they are to
    be tied by a mortar.
    """
    mesh = body.mesh
    if "cyclic" not in mesh.pairs:
        raise InputError(f"the mesh has no pair 'cyclic'{suggestion('cyclic', mesh.pairs)}")
    if mesh.sector is None or mesh.sector.count < 2:
        raise InputError(
            "the mesh has no number of sectors, expected at least 2 for cyclic symmetry"
        )
    pair = mesh.pairs["cyclic"]
    if not pair.nodes.size:
        return pair
    low, high = pair.nodes[:, body.rows[pair.nodes[0]] >= 0]
    for side, nodes in ((pair.master, low), (pair.slave, high)):
        face = np.unique(mesh.faces.get(side, nodes))
        missing = np.setdiff1d(face[body.rows[face] >= 0], nodes)
        if len(missing):
            raise InputError(
                f"face '{side}' has {len(missing)} nodes without a partner, the first at "
                f"{mesh.points[missing[0]].round(6)} m; mesh the cut faces periodically"
            )
    _check_match(mesh.points, low, high, pair)
    return Pair(pair.master, pair.slave, np.stack([low, high]), pair.rotation, pair.shift)


def _check_match(
    points: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    pair: Pair,
) -> None:
    """Partners must coincide under the motion, to a tolerance that scales with the distance between
    nodes.
    """
    error = np.linalg.norm(points[low] @ pair.rotation.T + pair.shift - points[high], axis=1)
    tolerance = 1e-6 * np.ptp(points[low], axis=0).max() / max(np.sqrt(len(low)), 1)
    worst = int(error.argmax())
    if error[worst] > tolerance:
        raise InputError(
            f"faces '{pair.master}' and '{pair.slave}' do not match: nodes {low[worst]} at "
            f"{points[low[worst]].round(6)} m and {high[worst]} at {points[high[worst]].round(6)} "
            f"m are {error[worst]:.2e} m apart after the rotation, expected at most "
            f"{tolerance:.1e} m"
        )
    if np.intersect1d(low, high).size:
        raise InputError("the cut faces share nodes (a solid hub on the axis), expected a bore")


def _constraint_parts(
    body: Body,
    clamped: np.ndarray,
    pair: Pair | None,
    ties: np.ndarray | None,
) -> tuple[sp.csr_matrix, sp.csr_matrix | None]:
    """T0 and T1 on all nodes' displacements; columns of dependent nodes stay empty."""
    n = len(body.mesh.points)
    d = body.dim
    free = body.rows >= 0
    free[clamped] = False
    _, slaves = _cut_nodes(body, pair)
    held = _plane_supports(body, pair)
    keep = np.repeat(free, d) & ~held
    keep[d * slaves[:, None] + np.arange(d)] = False
    low = sp.diags(keep.astype(float)).tocsr()
    high = None
    if pair is not None:
        block = _repeated_nodes(body, pair, free)
        moving = sp.diags((~held).astype(float))
        high = (moving @ sp.kron(block, pair.rotation[:d, :d])).tocsr()
        if not pair.nodes.size:
            # what is held on the low face moves no node of the high one
            high = (high @ sp.diags(keep.astype(float))).tocsr()
        high.eliminate_zeros()
    partner = np.arange(n)
    if pair is not None:
        partner[pair.nodes[1]] = pair.nodes[0]
    polar = polar_elimination(body, body.directions, held.reshape(n, d), partner)
    if polar is not None:
        low, high = (A if A is None else (A @ polar).tocsr() for A in (low, high))
    if ties is not None and len(ties):
        tie = _tied_identity(n, d, np.asarray(ties))
        low, high = (A if A is None else (tie @ A @ tie).tocsr() for A in (low, high))
    return low, high


def _cut_nodes(body: Body, pair: Pair | None) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the low and of the high cut face; partners where they match."""
    if pair is None:
        return np.empty(0, int), np.empty(0, int)
    if pair.nodes.size:
        return pair.nodes[0], pair.nodes[1]
    faces = body.mesh.faces
    return np.unique(faces[pair.master]), np.unique(faces[pair.slave])


def _repeated_nodes(body: Body, pair: Pair, free: np.ndarray) -> sp.csr_matrix:
    """(n_points, n_points) free nodes of the high cut face from those of the low one."""
    n = len(body.mesh.points)
    if not pair.nodes.size:
        return repeated_motion(tie_cut_faces(body.mesh), n, free)
    low, high = pair.nodes[:, free[pair.nodes[1]]]
    return sp.coo_matrix((np.ones(len(low)), (high, low)), shape=(n, n)).tocsr()


def _plane_supports(body: Body, pair: Pair | None) -> np.ndarray:
    """(n_points*dim,) true where a plane of symmetry or antisymmetry holds a displacement."""
    held = np.zeros((len(body.mesh.points), body.dim), bool)
    for axis, letter in enumerate("xyz"[: body.dim]):
        across = np.arange(body.dim) == axis
        for name, directions in (
            (f"symmetry_{letter}", across),
            (f"antisymmetry_{letter}", ~across),
        ):
            held[np.ix_(_plane_nodes(body, name, axis, pair), directions)] = True
    return (held | _direction_supports(body, pair)).ravel()


def _direction_supports(body: Body, pair: Pair | None) -> np.ndarray:
    """(n_points, dim) true where the supports hold a displacement.

    Raises:
        InputError: a direction that turns from sector to sector, held on a cut face.
    """
    held = held_directions(body, body.directions)
    if pair is None or not held.any():
        return held
    both = np.concatenate(_cut_nodes(body, pair))
    turning = np.abs(np.diag(pair.rotation)[: body.dim] - 1) > 1e-12
    if held[np.ix_(both, turning)].any():
        raise InputError(
            "support.directions: x and y turn from sector to sector, expected faces away from the "
            "cut faces, or z"
        )
    either = held[pair.nodes[0]] | held[pair.nodes[1]]
    held[pair.nodes[0]] = either
    held[pair.nodes[1]] = either
    return held


def _plane_nodes(
    body: Body,
    name: str,
    axis: int,
    pair: Pair | None,
) -> np.ndarray:
    """The body's nodes on a plane across an axis, checked."""
    points = body.mesh.points
    nodes = np.unique(body.mesh.faces.get(name, np.empty(0, int)))
    nodes = nodes[body.rows[nodes] >= 0]
    if not len(nodes):
        return nodes
    if np.ptp(points[nodes, axis]) > 1e-6 * np.ptp(points, axis=0).max():
        raise InputError(
            f"face '{name}' extends from {points[nodes, axis].min():.6g} to "
            f"{points[nodes, axis].max():.6g} m along {name[-1]}, expected a plane across that axis"
        )
    if pair is not None and abs(pair.rotation[axis, axis] - 1) > 1e-12:
        raise InputError(
            f"face '{name}' is not across the axis of the wheel, expected cyclic faces or a "
            "symmetry plane, not both"
        )
    return nodes


def _with_partners(clamped: np.ndarray, pair: Pair | None) -> np.ndarray:
    """A node held on one cut face is held on the other."""
    if pair is None:
        return clamped
    held = np.isin(pair.nodes[0], clamped) | np.isin(pair.nodes[1], clamped)
    return np.union1d(clamped, pair.nodes[:, held].ravel())


def _tied_identity(
    n: int,
    d: int,
    ties: np.ndarray,
) -> sp.csr_matrix:
    """Identity, but tied nodes are the mean of two others."""
    keep = np.ones(n)
    keep[ties[:, 0]] = 0
    half = sp.coo_matrix(
        (np.full(2 * len(ties), 0.5), (np.repeat(ties[:, 0], 2), ties[:, 1:].ravel())), shape=(n, n)
    )
    return sp.kron(sp.diags(keep) + half, sp.identity(d)).tocsr()


def _number_unknowns(
    body: Body,
    low: sp.csr_matrix,
    high: sp.csr_matrix | None,
) -> tuple[sp.csr_matrix, sp.csr_matrix | None, np.ndarray]:
    """Drop empty columns; number the others by their PETSc row, so that an unknown lives where its
    node lives.
    """
    used = abs(low).sum(0) if high is None else abs(low).sum(0) + abs(high).sum(0)
    columns = np.flatnonzero(np.asarray(used).ravel())
    rows = body.scalar_rows[columns]
    order = np.argsort(rows)
    columns = columns[order]
    rows = rows[order]
    start = np.searchsorted(
        rows, body.K.owner_ranges if body.comm.size > 1 else [0, body.K.size[0]]
    )
    if not len(columns):
        raise InputError(f"body '{body.name}' has no free node left, expected a smaller clamp")
    kept = low[:, columns].tocsr()
    moved = None if high is None else high[:, columns].tocsr()
    return kept, moved, np.asarray(start, int)


def _three_matrices(
    A: PETSc.Mat,
    T0: PETSc.Mat,
    T1: PETSc.Mat,
) -> tuple[PETSc.Mat, PETSc.Mat, PETSc.Mat]:
    """K0, Kc and Ks."""
    cross = T0.transposeMatMult(A.matMult(T1))
    turned = cross.duplicate(copy=True)
    turned.transpose()
    return (
        combined(A.ptap(T0), 1.0, A.ptap(T1)),
        combined(cross, 1.0, turned),
        combined(cross, -1.0, turned),
    )


def _doubled_matrix(
    A: PETSc.Mat,
    B: PETSc.Mat,
    factor: float,
) -> Doubled:
    """The real twin of A + j factor B, parts interleaved: kron(A, I) + kron(factor B, [0 -1; 1
    0]).
    """
    twin = sp.kron(local_rows(A), np.eye(2), "csr") + factor * sp.kron(
        local_rows(B), np.array([[0.0, -1.0], [1.0, 0.0]]), "csr"
    )
    twin.sum_duplicates()
    (n, N), _ = A.sizes
    out = PETSc.Mat().createAIJ(
        ((2 * n, 2 * N), (2 * n, 2 * N)),
        comm=A.comm,
        csr=(twin.indptr.astype(PETSc.IntType), twin.indices.astype(PETSc.IntType), twin.data),
    )
    out.assemble()
    return Doubled(out)
