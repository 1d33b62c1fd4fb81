"""All nodal diameters of a wheel: a few solved from scratch, the others from the space that these span.

The vectors of a few nodal diameters, real and imaginary parts apart, nearly span those of all others. Projected onto
them the three matrices of K(n) are small; what comes out starts a block Lanczos iteration, which stops only at the same
tolerance as a solve from scratch. The inertia of K(n) - s M(n), one more factorisation for all n, proves the count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from ..data import ModeSet
from ..errors import InputError, NotSolvedError
from . import core
from .body import Body
from .constraint import Constrained, Transformation, at_diameter, transformation
from .flexibility import Flexibility, flexible
from .linalg import Folded, apply, combined, dot, inertia, mix
from .modes import TOLERANCE, mode_set, pairs

__all__ = ["Eigenpairs", "all_diameters", "eigenpairs"]

GUARD = 2       # modes beyond those asked for


@dataclass(frozen=True)
class Eigenpairs:
    """Modes of one nodal diameter as this rank's unknowns, with the factorisation that they came from."""

    flex: Flexibility
    lam: np.ndarray                 # (m,) [rad^2/s^2], ascending
    X: np.ndarray                   # (n_own, m) M-orthonormal

    @property
    def con(self) -> Constrained:
        """The pencil."""
        return self.flex.con


def all_diameters(body: Body | Transformation, count: int, diameters: Sequence[int] | None = None,
                  direct: bool = False, prove: bool = True, clamp: str | None = "clamp") -> list[ModeSet]:
    """The lowest modes in each nodal diameter.

    Args:
        body: a body with cut faces (held at ``clamp``), or its transformation.
        diameters: 0 to N/2 when left out.
        direct: solve every nodal diameter from scratch.
        prove: count the eigenvalues below the highest common gap by inertia.

    Raises:
        InputError: a nodal diameter that the wheel does not have, count not positive.
        NotSolvedError: from a factorisation, no convergence, or a mode that is lost even in a solve from scratch.
    """
    if count < 1:
        raise InputError(f"count is {count}, expected at least 1 mode")
    t = transformation(body, clamp, True) if isinstance(body, Body) else body
    wanted = list(range(t.sectors // 2 + 1)) if diameters is None else list(diameters)
    found = {p.con.nodal_diameter: p for p in eigenpairs(t, count, wanted, direct)}
    if prove:
        found = _proved(t, found)
    return [mode_set(found[n].con, found[n].lam[:count], found[n].X[:, :count]) for n in wanted]


def eigenpairs(t: Transformation, count: int, diameters: Sequence[int], direct: bool = False) -> Iterator[Eigenpairs]:
    """``count`` and a few more pairs in each nodal diameter, in the order in which they are solved."""
    order = sorted(set(diameters))
    cons = {n: at_diameter(t, n) for n in order}
    size = next(iter(cons.values())).T.shape[1] if order else 0
    more = min(count + GUARD, size)
    seeds = order if direct or len(order) <= 3 else [order[i] for i in sorted({
        0, 1, len(order) // 4, len(order) // 2, len(order) - 1})]
    solved = []
    for n in seeds:
        solved.append(_pairs(flexible(cons[n]), more, None))
        yield solved[-1]
    rest = [n for n in order if n not in seeds]
    if rest:
        W = _span([p.X for p in solved], t)
        K, M = _projected(t, W)
        for n in rest:
            guess = _small(K, M, 2 * np.pi * n / t.sectors, more)
            start = mix(W, guess.real) + 1j * mix(W, guess.imag) if np.iscomplexobj(guess) else mix(W, guess)
            yield _pairs(flexible(cons[n]), more, start)


def _pairs(flex: Flexibility, count: int, start: np.ndarray | None) -> Eigenpairs:
    return Eigenpairs(flex, *pairs(flex, count, TOLERANCE, start))


def _span(blocks: list[np.ndarray], t: Transformation) -> np.ndarray:
    """(n_own, m) orthonormal real basis of all parts of the vectors."""
    comm = t.body.comm
    parts = [part for X in blocks for part in ((X.real, X.imag) if np.iscomplexobj(X) else (X,))]
    W = np.asfortranarray(np.concatenate(parts, axis=1))
    W /= np.sqrt(dot(comm, W, W).diagonal())
    size, Z = np.linalg.eigh(dot(comm, W, W))
    good = size > 1e-10 * size[-1]
    return mix(W, Z[:, good] / np.sqrt(size[good]))


def _projected(t: Transformation, W: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """(m, m) projections of K0, Kc, Ks and of M0, Mc, Ms."""
    if t.opened is None:
        return tuple([dot(t.body.comm, W, apply(A, W)) for A in three] for three in (t.K, t.M))
    low, high = (A[t.opened.places] @ W for A in (t.low, t.high))
    faces = np.flatnonzero(np.diff(t.high[t.opened.places].indptr))
    out = []
    for A in (t.opened.K, t.opened.M):
        A_high, A_low = A[:, faces] @ high[faces], A @ low
        LH = low.T @ A_high
        out.append([low.T @ A_low + high[faces].T @ A_high[faces], LH + LH.T, LH - LH.T])
    return tuple(out)


def _small(K: list[np.ndarray], M: list[np.ndarray], angle: float, count: int) -> np.ndarray:
    """(m, count) lowest eigenvectors of the projected pencil."""
    real = abs(np.sin(angle)) < 1e-12
    pencil = [A[0] + np.cos(angle) * A[1] + (0 if real else 1j * np.sin(angle) * A[2]) for A in (K, M)]
    return eigh(*[(A + A.conj().T) / 2 for A in pencil])[1][:, :count]


def _proved(t: Transformation, found: dict[int, Eigenpairs]) -> dict[int, Eigenpairs]:
    """Compare counts with inertia at one shift; a diameter that lost a mode is solved from scratch."""
    shift = _gap([p.lam for p in found.values()])
    shared = _shifted(t, shift)
    for n, p in found.items():
        exact = _count_below(p.con, shift, shared)
        if exact != np.count_nonzero(p.lam < shift):
            found[n] = p = _pairs(p.flex, max(len(p.lam), exact + GUARD), None)
        if exact != np.count_nonzero(p.lam < shift):
            raise NotSolvedError(f"nodal diameter {n}: {np.count_nonzero(p.lam < shift)} modes were found below "
                                 f"{np.sqrt(shift) / (2 * np.pi):.6g} Hz, the inertia counts {exact}")
    return found


def _shifted(t: Transformation, shift: float) -> Folded | None:
    """K - shift M of the open sector with its interior eliminated, for all nodal diameters."""
    if t.opened is None:
        return None
    A = (t.opened.K - shift * t.opened.M).tocsr()
    return Folded(A, t.low[t.opened.places], core.eliminate(A, t.opened.core.rim, definite=False))


def _count_below(con: Constrained, shift: float, shared: Folded | None) -> int:
    return inertia(combined(con.K, -shift, con.M) if shared is None else replace(shared, C=con.K.C))


def _gap(lists: list[np.ndarray]) -> float:
    """A shift in the widest relative gap of all eigenvalues, in the upper half of what every diameter covers."""
    top = min(lam[-1] for lam in lists)
    below = np.unique(np.concatenate([lam[lam <= top] for lam in lists]))
    below = below[below > 0]
    if len(below) < 2:
        return float(top) * (1 - 1e-6)
    upper = below[len(below) // 2 - 1:]
    i = int(np.argmax(np.diff(upper) / upper[1:]))
    return float(upper[i] + upper[i + 1]) / 2
