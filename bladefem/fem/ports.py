"""A linear body seen from its ports: free modes and residual flexibility (Rubin), or Craig-Bampton.

Both come from the one factorisation that also gives the modes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from ..data import PortModel
from ..errors import InputError, suggestion
from .all_diameters import Eigenpairs, KeptPairs, eigenpairs, found_again
from .compat import MPI
from .constraint import Constrained, Transformation, restrict_load
from .cyclic_schur import Rim, face_solve, inner_solve
from .eigensolver import Eigensolver
from .flexibility import Flexibility, compliance, flexible
from .gyroscopic import Spin, constrained_coupling
from .lanczos import DIRECTION_TOLERANCE, WantedPairs
from .linalg import apply_block, hermitian_part, inner_products
from .mode_count import lost_modes
from .modes import SLEPC, canonical, elastic_pairs, proven_pairs
from .open_sector import Opened
from .separators import reduce_load, separator_solve

# work and items to items with their results
Deal: TypeAlias = Callable[[Callable[[int], Any], Sequence[int]], Iterable[tuple[int, Any]]]
# ports in one sweep
PORTS_PER_SOLVE = 64
REDUCTION_KINDS = ("rubin", "craig-bampton")
# largest Coriolis coupling of two modes of mass 1, which is at most 2, that is rounding
NO_COUPLING = 1e-12


@dataclass(frozen=True)
class PortReduction:
    """The reduced model that is wanted of a body or sector."""

    # (n_points*dim, p) port vectors in mesh numbering, real: displacements P^T u, forces P f
    P: sp.spmatrix
    # slices of the p ports
    names: dict[str, slice]
    # modes kept, rigid ones included; of "craig-bampton" the fixed-interface modes
    count: int
    # (n_points*dim,) [N], its displacement at the ports is the static offset; of nodal diameter 0
    static_load: np.ndarray | None = None
    # "rubin" or "craig-bampton"
    kind: str = "rubin"
    solver: Eigensolver = SLEPC
    # rotation whose Coriolis forces couple the modes kept, as damping without work; those of the
    # modes left out are left out
    spin: Spin | None = None


def port_model(
    con: Constrained,
    wanted: PortReduction,
    flex: Flexibility | None = None,
) -> PortModel:
    """Reduce a constrained body to its ports.

    Args:
        flex: factorisation to use again.

    Raises:
        InputError: the port vectors do not fit the mesh, or there is no such kind.
        NotSolvedError: from the factorisation or the modes.
    """
    if wanted.kind not in REDUCTION_KINDS:
        raise InputError(f"reduction is '{wanted.kind}'{suggestion(wanted.kind, REDUCTION_KINDS)}")
    F = _restrict_ports(con, wanted.P)
    flex = flex or flexible(con)
    load = wanted.static_load
    columns = (
        F if load is None else np.concatenate([F, restrict_load(con, load.reshape(-1, 1))], axis=1)
    )
    X = compliance(flex, columns)
    offset = (
        None if load is None else inner_products(con.body.comm, F, X[:, F.shape[1] :])[:, 0].real
    )
    X = X[:, : F.shape[1]]
    reduce = _rubin_modes if wanted.kind == "rubin" else _craig_bampton
    omega, V, residual = reduce(flex, F, X, wanted.count, wanted.solver)
    shapes = inner_products(con.body.comm, F, V)
    return PortModel(
        omega,
        shapes,
        residual,
        wanted.names,
        con.nodal_diameter,
        offset,
        damping=_coriolis_damping(con, V, wanted.spin),
    )


def port_models(
    t: Transformation,
    wanted: PortReduction,
    diameters: Sequence[int],
    kept: KeptPairs | None = None,
    seen: Callable[[Eigenpairs], None] | None = None,
    interior: tuple[np.ndarray, np.ndarray] | None = None,
) -> Iterator[tuple[int, PortModel]]:
    """``port_model`` in several nodal diameters, as they are solved, with all work shared that does
    not depend on them.

    The static flexibility of all diameters takes one sweep over the ports. In the end the inertia
    counts the modes; a diameter that lost one comes once more, whole.

    Args:
        kept: modes of the same body that are known; they are used up.
        seen: is shown the modes of each nodal diameter.
        interior: what ``interior_flexibility`` gives, where it is known.
    """
    count = wanted.count
    if interior is None and t.opened is not None and wanted.kind == "rubin":
        interior = interior_flexibility(t.opened, wanted.P, wanted.static_load)

    def reduced(pairs: Eigenpairs) -> tuple[int, PortModel]:
        if seen is not None:
            seen(pairs)
        return pairs.nodal_diameter, _reduced_pairs(wanted, pairs, interior)

    if kept is not None and kept.serves(diameters, count):
        for n in diameters:
            yield reduced(kept.pairs.pop(n))
        return
    lam = {}
    for p in eigenpairs(t, count, diameters, tolerance=DIRECTION_TOLERANCE, solver=wanted.solver):
        lam[p.nodal_diameter] = p.lam
        yield reduced(p)
    for n, truth in lost_modes(t, lam, count).items():
        yield reduced(found_again(t, n, count, truth, DIRECTION_TOLERANCE))


def deal_to_one(work: Callable[[int], Any], items: Sequence[int]) -> Iterator[tuple[int, Any]]:
    """Items with the results of work on them, one by one."""
    return ((item, work(item)) for item in items)


def _reduced_pairs(
    wanted: PortReduction,
    p: Eigenpairs,
    interior: tuple[np.ndarray, np.ndarray] | None,
) -> PortModel:
    """The port model of one nodal diameter from its modes.

    Args:
        interior: see ``interior_flexibility``; None where the body is reduced whole.
    """
    n = p.con.nodal_diameter
    load = wanted.static_load if n == 0 else None
    P = wanted.P
    flex = p.flex or flexible(p.con)
    rim = flex.factor.parts
    if interior is None or not isinstance(rim, Rim) or flex.R.shape[1]:
        return port_model(p.con, replace(wanted, static_load=load), flex)
    _check_ports(p.con, P)
    G, offset = _closed_flexibility(interior, rim)
    lam = p.lam[: wanted.count]
    vectors = canonical(p.con, lam, p.X[:, : wanted.count])
    # the ports stay sparse: dense they were the peak of memory
    shapes = (sp.csc_matrix(P).T @ p.con.T)[:, p.con.own] @ vectors
    comm = p.con.body.comm
    shapes = comm.allreduce(shapes) if comm.size > 1 else shapes
    ports = P.shape[1]
    return PortModel(
        np.sqrt(lam),
        shapes,
        _residual_flexibility(G[:ports, :ports], lam, shapes),
        wanted.names,
        n,
        None if load is None else offset,
        damping=_coriolis_damping(p.con, vectors, wanted.spin),
    )


def _coriolis_damping(con: Constrained, V: np.ndarray, spin: Spin | None) -> np.ndarray | None:
    """(m, m) skew-Hermitian speed times Phi^H G Phi [1/s] of modes given by their unknowns."""
    if spin is None or spin.speed == 0:
        return None
    g = constrained_coupling(con, V, spin.axis)
    return spin.speed * g if abs(g).max(initial=0.0) > NO_COUPLING else None


def _restrict_ports(con: Constrained, P: sp.spmatrix) -> np.ndarray:
    """(n_own, p) this rank's rows of the port vectors, dense."""
    _check_ports(con, P)
    return restrict_load(con, sp.csc_matrix(P)).astype(con.dtype)


def _check_ports(con: Constrained, P: sp.spmatrix) -> None:
    if P.shape[0] != con.T.shape[0]:
        raise InputError(
            f"port vectors have {P.shape[0]} rows, expected {con.T.shape[0]} (nodes times "
            "components)"
        )


def interior_flexibility(
    opened: Opened,
    P: sp.spmatrix,
    load: np.ndarray | None = None,
    deal: Deal = deal_to_one,
) -> tuple[np.ndarray, np.ndarray]:
    """(p, p) flexibility of an open sector's interior at the ports [m/N], and (nb, p) the ports'
    loads as the rim feels them; a static load is the last column.

    Args:
        deal: shares some ports each over ranks that have the same open sector for themselves.
    """
    columns = [P] if load is None else [P, sp.csc_matrix(load.reshape(-1, 1))]
    F = sp.csc_matrix(opened.T.T @ sp.hstack(columns))
    inside = F[opened.core.inner]
    rim = F[opened.core.rim].toarray()

    def solved(first: int) -> tuple[np.ndarray, np.ndarray]:
        Y = inner_solve(opened.core, inside[:, first : first + PORTS_PER_SOLVE].toarray())
        return inside.T @ Y, opened.core.coupling @ Y

    G = np.empty((F.shape[1], F.shape[1]))
    for first, (own, felt) in deal(solved, range(0, F.shape[1], PORTS_PER_SOLVE)):
        part = slice(first, first + PORTS_PER_SOLVE)
        G[:, part] = own
        rim[:, part] -= felt
    separators = opened.core.separators
    if separators is None:
        return G, rim
    comm = separators.cut.comm
    load = np.zeros((len(separators.cut.separator), F.shape[1]))
    load[separators.cut.touched] = rim
    comm.Allreduce(MPI.IN_PLACE, G)
    comm.Allreduce(MPI.IN_PLACE, load)
    between = load[separators.cut.separator]
    G += between.T @ separator_solve(separators, between)
    return G, reduce_load(separators, load)


def _closed_flexibility(
    interior: tuple[np.ndarray, np.ndarray], rim: Rim
) -> tuple[np.ndarray, np.ndarray]:
    """The flexibility (p, p) with the cut faces joined, and its last column's real part."""
    g = rim.faces.C.conj().T @ interior[1]
    G = hermitian_part(interior[0] + g.conj().T @ face_solve(rim, g))
    return G, G[:-1, -1].real


def _rubin_modes(
    flex: Flexibility,
    F: np.ndarray,
    X: np.ndarray,
    count: int,
    solver: Eigensolver,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Circular frequencies, free modes by their unknowns, and what the modes left out give to the
    static flexibility (Rubin 1975, doi:10.2514/3.60497).
    """
    comm = flex.con.body.comm
    lam, found = proven_pairs(flex, count, solver=solver)
    V = canonical(flex.con, lam, found)
    shapes = inner_products(comm, F, V)
    return np.sqrt(lam), V, _residual_flexibility(inner_products(comm, F, X), lam, shapes)


def _residual_flexibility(
    G: np.ndarray,
    lam: np.ndarray,
    shapes: np.ndarray,
) -> np.ndarray:
    """Static flexibility less that of the elastic modes kept."""
    elastic = lam > 0
    return hermitian_part(G - shapes[:, elastic] / lam[elastic] @ shapes[:, elastic].conj().T)


def _craig_bampton(
    flex: Flexibility,
    F: np.ndarray,
    X: np.ndarray,
    count: int,
    solver: Eigensolver,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Constraint modes and fixed-interface modes (Craig and Bampton 1968, doi:10.2514/3.4741), then
    the eigenvectors of the small matrices, which are free modes in form: nothing is left for a
    residual.
    """
    comm = flex.con.body.comm
    fixed = _fixed_inverse(flex, F, X)
    _, inner = elastic_pairs(flex, WantedPairs(count), inverse=fixed, solver=solver)
    V = np.concatenate([flex.R, X, inner], axis=1)
    V = V / np.sqrt(np.abs(inner_products(comm, V, apply_block(flex.con.M, V)).diagonal()))
    mass = hermitian_part(inner_products(comm, V, apply_block(flex.con.M, V)))
    stiff = hermitian_part(inner_products(comm, V, apply_block(flex.con.K, V)))
    size, Q = np.linalg.eigh(mass)
    # ports that repeat each other
    keep = size > 1e-12 * size[-1]
    W = Q[:, keep] / np.sqrt(size[keep])
    lam, Z = eigh(hermitian_part(W.conj().T @ stiff @ W))
    lam[: flex.R.shape[1]] = 0.0
    return (
        np.sqrt(np.maximum(lam, 0)),
        V @ (W @ Z),
        np.zeros((F.shape[1],) * 2, F.dtype),
    )


def _fixed_inverse(
    flex: Flexibility,
    F: np.ndarray,
    X: np.ndarray,
) -> Callable[[np.ndarray], np.ndarray]:
    """K^-1 with the ports held: the reactions f make F^H u zero, and leave no rigid load on a
    floating body.

    u = K^+ (b - F f) + R c with [G, -F^H R; R^H F, 0] (f, c) = (F^H K^+ b, R^H b), G = F^H K^+ F.
    """
    comm = flex.con.body.comm
    R = flex.R
    G = hermitian_part(inner_products(comm, F, X))
    FR = inner_products(comm, F, R)
    saddle = np.linalg.pinv(
        np.block([[G, -FR], [FR.conj().T, np.zeros((R.shape[1],) * 2)]]), rcond=1e-11
    )

    def inverse(B: np.ndarray) -> np.ndarray:
        U = compliance(flex, B)
        both = saddle @ np.concatenate([inner_products(comm, F, U), inner_products(comm, R, B)])
        return U - X @ both[: F.shape[1]] + R @ both[F.shape[1] :]

    return inverse
