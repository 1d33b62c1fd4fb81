"""The static flexibility K^+ of a constrained body, also where the body can still move rigidly.

Rigid motions R (M-orthonormal) are found exactly from geometry. A floating body is propped by
springs at as many degrees of freedom as it has rigid motions: loads without a resultant leave such
a statically determinate support without force, so for them (K + C)^-1 is exact whatever the
stiffness of the springs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr

from ..errors import IndefiniteError, InputError
from ..scene.units import show
from .body import Body, rigid_modes
from .compat import PETSc
from .constraint import Constrained, expand_to_mesh, unknowns
from .linalg import (
    Factor,
    apply_block,
    dense_rows,
    factorise,
    inner_products,
    mean_diagonal,
    release,
    solve_together,
)
from .memory import give_back

# of the mean diagonal of K over that of M: squared frequency of a motion that springs do not hold
UNHELD_FREQUENCY_RATIO = 1e-12
# the same: squared frequency of a rigid motion that rounding leaves, some 1e-16, and that
# second-order terms of thermal strains leave
ROUNDED_FREQUENCY_RATIO = 1e-14
THERMAL_FREQUENCY_RATIO = 1e-10
# of the squared speed: the same by second-order terms of rotation, some 1e-7; what rotation drives
# or resists has a squared frequency of its order
TURNING_FREQUENCY_RATIO = 1e-3
# of the mean diagonal of K times a motion: a force on it that is rounding
RIGID_FORCE = 1e-10
# corrections of rigid motions, each of which leaves a hundredth of the error
RIGID_PASSES = 3


@dataclass(frozen=True)
class Flexibility:
    """K^+ of a constrained body as one factorisation."""

    con: Constrained
    # of K, or of K with props
    factor: Factor
    # (n_own, r) rigid motions, M-orthonormal
    R: np.ndarray
    # (n_own, r)
    MR: np.ndarray


def flexible(con: Constrained, prop: float = 1.0, settled: bool = True) -> Flexibility:
    """Factorise K for modes, reduction and contact alike.

    Args:
        prop: stiffness of the props over the mean diagonal of K; floating bodies only, without
            influence.
        settled: K is that of a state in balance; False on the way to one, where unbalanced forces
            act on rigid motions too.

    A rotation that a loaded body can follow turns its deformation too: there the motion without
    force is the rigid one and what that deformation adds, a static answer.

    Raises:
        InputError: a loaded body can move rigidly, and the load resists or drives that, or the
            body does not withstand its rotation (settled).
        NotSolvedError: from MUMPS.
    """
    R = rigid_basis(con)
    springs = _place_springs(con, R, prop) if R.shape[1] else None
    try:
        factor = factorise(con.K, springs=springs, on_disk=con.body.plan.on_disk)
    except IndefiniteError:
        if settled:
            _refuse_buckled(con.body)
        raise
    if not R.shape[1]:
        return Flexibility(con, factor, R, R)
    flex = Flexibility(con, factor, R, apply_block(con.M, R))
    if not settled:
        return flex
    for _ in range(RIGID_PASSES):
        force = apply_block(con.K, flex.R)
        limit = RIGID_FORCE * mean_diagonal(con.K)
        if _size(con, force) <= limit * _size(con, flex.R):
            break
        R = _orthonormal(con, flex.R - compliance(flex, force))
        flex = Flexibility(con, factor, R, apply_block(con.M, R))
    _check_settled(flex)
    return flex


def _refuse_buckled(body: Body) -> None:
    """Refuse a speed under which a body has no stiffness left in some direction: at rest it has,
    the preload was found with that.
    """
    if body.state is None or not body.state.speed > 0:
        return
    kind = "nonlinear" if body.state.large else "linear"
    other = "" if body.state.large else ', or operation.preload = "nonlinear"'
    raise InputError(
        f"operation.speed = {show(body.state.speed, 'rad/s')}: about the preload of this rotation "
        f'(operation.preload = "{kind}") the blade is not stable, it buckles, or spin softening '
        f"outweighs its stiffness; expected a lower speed, a stiffer blade or disc{other}"
    )


def discard(flex: Flexibility) -> None:
    """Give the memory of a factorisation and its matrix back, which nobody will use again
    (collective).
    """
    release(flex.con.K, flex.factor)
    # of several ranks it would wait for a garbage collection
    if isinstance(flex.con.K, PETSc.Mat):
        flex.con.K.destroy()
    give_back()


def _check_settled(flex: Flexibility) -> None:
    """Refuse a load that resists or drives a rigid motion."""
    con = flex.con
    body = con.body
    heated = body.heat is not None and body.heat.strains
    speed = 0.0 if body.state is None else body.state.speed
    if not (speed > 0 or heated):
        return
    ratio = THERMAL_FREQUENCY_RATIO if heated else ROUNDED_FREQUENCY_RATIO
    if body.spring is not None:
        # of soft springs that count as none
        ratio += UNHELD_FREQUENCY_RATIO
    limit = ratio * mean_diagonal(con.K) / mean_diagonal(con.M)
    limit += TURNING_FREQUENCY_RATIO * speed**2
    pull = inner_products(body.comm, flex.R, apply_block(con.K, flex.R))
    if abs(pull).max() > limit:
        raise InputError(
            "support: it leaves the body free to turn or slide while rotation or heat loads it "
            "there, so that it has no steady place, expected supports that hold it, or "
            "operation.stiffening = false"
        )


def _size(con: Constrained, X: np.ndarray) -> float:
    """Largest length of the columns (n_own, r) over all ranks."""
    return float(np.sqrt(abs(inner_products(con.body.comm, X, X)).max()))


def _orthonormal(con: Constrained, basis: np.ndarray) -> np.ndarray:
    """The motions (n_own, r) with mass 1 and none in common."""
    gram = inner_products(con.body.comm, basis, apply_block(con.M, basis))
    return np.asarray(basis @ np.linalg.inv(np.linalg.cholesky(gram)).conj().T)


def compliance(flex: Flexibility, B: np.ndarray) -> np.ndarray:
    """K^+ B (n_own, k): loads without their rigid part give displacements without theirs."""
    return compliances([(flex, B)])[0]


def compliances(loaded: list[tuple[Flexibility, np.ndarray]]) -> list[np.ndarray]:
    """``compliance`` of several bodies at once: nodal diameters of a wheel share work."""
    balanced = [(flex.factor, _balanced(flex, B)) for flex, B in loaded]
    return [
        _without_rigid_motion(flex, X)
        for (flex, _), X in zip(loaded, solve_together(balanced), strict=True)
    ]


def _balanced(flex: Flexibility, B: np.ndarray) -> np.ndarray:
    """Loads less their rigid part."""
    if not flex.R.shape[1]:
        return B
    return B - flex.MR @ inner_products(flex.con.body.comm, flex.R, B)


def _without_rigid_motion(flex: Flexibility, X: np.ndarray) -> np.ndarray:
    """Displacements less their rigid part."""
    if not flex.R.shape[1]:
        return X
    return X - flex.R @ inner_products(flex.con.body.comm, flex.MR, X)


def rigid_basis(con: Constrained) -> np.ndarray:
    """(n_own, r) M-orthonormal rigid motions that clamp and cyclic symmetry allow; r = 0 for a held
    body.

    A combination R c is allowed when it is T times its own values at the unknowns: c is in the null
    space of R - T R_unknowns. Of a wheel, translations and rotations are waves of nodal diameter 0
    and 1 only.
    """
    body = con.body
    if (con.nodal_diameter or 0) > 1:
        return np.zeros((con.own.stop - con.own.start, 0), con.dtype)
    R: np.ndarray = rigid_modes(body).reshape(con.T.shape[0], -1).astype(con.dtype)
    weight = np.asarray(abs(con.T).max(1).todense()).ravel() > 0
    inside = np.repeat(body.rows >= 0, body.dim)
    columns = unknown_places(con)
    q = R[columns]
    misfit = np.linalg.qr((R - con.T @ q)[inside | weight], mode="r")
    _, s, vh = np.linalg.svd(misfit)
    null = vh[s < 1e-8 * np.linalg.norm(R)].conj().T
    basis = (q @ null)[con.own]
    if not basis.shape[1]:
        return basis
    basis = _orthonormal(con, basis)
    return basis if body.spring is None else _unsprung_motions(con, body.spring, basis)


def _unsprung_motions(con: Constrained, spring: Any, basis: np.ndarray) -> np.ndarray:
    """The rigid motions (n_own, r) that springs on faces leave without force."""
    body = con.body
    moves = expand_to_mesh(con, basis).reshape(len(body.scalar_rows), -1)
    first, last = spring.owner_range
    outside = np.count_nonzero(body.scalar_rows < 0)
    mine = np.argsort(body.scalar_rows, kind="stable")[outside:][first:last]
    local = np.asfortranarray(moves[mine])
    stiffness = inner_products(body.comm, local, apply_block(spring, local))
    lam, Z = np.linalg.eigh((stiffness + stiffness.conj().T) / 2)
    return basis @ Z[:, lam < UNHELD_FREQUENCY_RATIO * mean_diagonal(con.K) / mean_diagonal(con.M)]


def unknown_places(con: Constrained) -> np.ndarray:
    """(n_free,) degree of freedom in mesh numbering whose value each unknown is."""
    T = con.T.tocoo()
    single = np.flatnonzero(np.diff(con.T.indptr) == 1)
    unit = np.isin(T.row, single) & (T.data == 1)
    columns = np.full(con.T.shape[1], -1)
    columns[T.col[unit]] = T.row[unit]
    return columns


def _place_springs(
    con: Constrained,
    R: np.ndarray,
    prop: float,
) -> np.ndarray:
    """(n_own,) springs at the degrees of freedom that hold the rigid motions best (pivoted QR)."""
    everywhere = unknowns(con, R)
    allowed = dense_rows(con.K, len(everywhere))
    places = allowed[qr(everywhere[allowed].conj().T, mode="r", pivoting=True)[1][: R.shape[1]]]
    springs = np.zeros(len(everywhere))
    springs[places] = prop * mean_diagonal(con.K)
    return springs[con.own]
