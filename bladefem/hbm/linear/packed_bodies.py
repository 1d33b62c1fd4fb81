"""The bodies of a model as one tuple of arrays, which numba takes: all that does not depend
on the frequency.

Both bodies are one: the damper's modes, rigid ones with frequency zero, follow the blades'
with the shapes that they give the relative displacement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from .. import policy
from ..model import ReducedModel
from ..solver.deflation import common_motions
from .bodies import Stack
from .common_basis import CommonBasis, common_basis
from .mean_motion import motions_without_stiffness, with_springs
from .woodbury import bodies_of, frequency_independent_parts


class Bodies(NamedTuple):
    """m contact degrees of freedom, M modes, p probes; S = H+1, or 1 where one serves all
    harmonics. Complex where not said.
    """

    # (S, M) frequencies [rad/s], real
    own: np.ndarray
    # (S, M) [1/s], real
    viscous: np.ndarray
    # (S, M) [1/s^2], real
    hysteretic: np.ndarray
    # (S, M, M) viscous damping that couples modes [1/s]; (0, M, M) where there is none
    coupled: np.ndarray
    # (S, m, M) shapes, the damper's reversed
    contact: np.ndarray
    # (S, m, m); (1, 0, 0) in the second form of `bladefem.hbm.linear.contact_flexibility`, where
    # `rest`, `basis` and `differences` have it
    residual: np.ndarray
    # (S, p, M) shapes
    probe: np.ndarray
    # (S, p, m) residual flexibility between probe and contact
    across: np.ndarray
    # (H+1, M) excitation of the modes
    push: np.ndarray
    # (H+1, m) displacement of the contact by the excitation in addition to the modes
    direct: np.ndarray
    # (H+1, p) the same of the probes
    straight: np.ndarray
    # (S, m, m), U (S, m, M), UH (S, M, m), N (S, M, M) of `woodbury.frequency_independent_parts`;
    # empty where there are too many modes for it; of the second form there is N alone
    A: np.ndarray
    U: np.ndarray
    UH: np.ndarray
    N: np.ndarray
    # (H+1, m) what the excitation moves in addition to the modes in full stick, empty as these
    stuck: np.ndarray
    # (H+1, M) what pushes the modes then
    sprung: np.ndarray
    # residual flexibility without springs (m, m) and basis V (m, q) of `common_basis`, real, and
    # their R (m, m) and U (m, q) of the second form, real; in the basis the differences (S, q, q)
    # and the shapes of the modes (S, q, M), without and with contact springs. Empty in the first
    # form
    rest: np.ndarray
    basis: np.ndarray
    R: np.ndarray
    shared: np.ndarray
    differences: np.ndarray
    coordinates: np.ndarray
    sprung_differences: np.ndarray
    sprung_coordinates: np.ndarray
    # (m, q) common motions of `bladefem.hbm.solver.deflation`, real
    motions: np.ndarray
    # (m, m) of the mean, real, and as its stuck (m,) and G (m, m) whatever the frequency
    mean_A: np.ndarray
    mean_stuck: np.ndarray
    mean_G: np.ndarray
    # (m, r) motions without stiffness and g (r,) their loads, see
    # `bladefem.hbm.linear.condensation`; real
    B: np.ndarray
    g: np.ndarray
    # (r0, r) the same in the blades' rigid modes, whose numbers are `still` (r0,)
    rigid: np.ndarray
    still: np.ndarray
    # size of what the preload presses the contact springs together [m]
    compression: float


def prepared_bodies(model: ReducedModel, H: int) -> Bodies:
    """Made once for a model and its harmonics 0..H."""
    return model.once(("small", H), lambda: _pack_bodies(model, H))


def _pack_bodies(model: ReducedModel, H: int) -> Bodies:
    dofs = model.springs.size
    springs = model.springs.ravel()
    bodies = bodies_of(model, H)
    blades = bodies[0]
    own, viscous, hysteretic = (
        _joined_modes(bodies, name) for name in ("omega", "viscous", "hysteretic")
    )
    contact = _joined_modes(
        [blades, *(_with_reversed_shapes(b) for b in bodies[1:])], "shapes", lambda b: b.contact
    )
    residual = reduce(np.add, [b.residual[:, b.contact, b.contact] for b in bodies])
    spare = ((0, 0), (0, 0), (0, contact.shape[2] - blades.shapes.shape[2]))
    push, direct, straight = _excitation(blades, model.loads(H), spare)
    mean = _mean_parts(model, blades, (own[0], contact[0], residual[0]), (push[0], direct[0]))
    basis = common_basis(residual, contact)
    if basis is not None:
        # not kept twice
        residual = np.zeros((1, 0, 0))
    by_modes = basis is None and policy.updates_by_modes(dofs, contact.shape[2])
    fixed = (
        frequency_independent_parts(residual, contact, springs)
        if by_modes
        else (np.zeros((0, 0, 0)),) * 4
    )
    excited = _excited_modes(fixed, springs, push, direct)
    joined, shared = _shared_parts(basis, springs)
    if basis is not None:
        fixed = (*fixed[:3], joined)
    parts = [
        contact,
        residual,
        np.pad(blades.shapes[:, blades.probe], spare),
        blades.residual[:, blades.probe, blades.contact],
        push,
        direct,
        straight,
        *fixed,
        *excited,
    ]
    return Bodies._make(
        [
            own,
            viscous,
            hysteretic,
            joined_blocks(bodies, [body.coupled for body in bodies]),
            *(np.ascontiguousarray(part, dtype=complex) for part in parts),
            *shared,
            common_motions(model, H),
            *mean,
            model.compression,
        ]
    )


def _mean_parts(
    model: ReducedModel,
    blades: Stack,
    body: tuple[np.ndarray, ...],
    pushed: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, ...]:
    """mean_A, mean_stuck, mean_G, B, g, rigid and still of `Bodies`, from frequencies, shapes and
    residual flexibility of harmonic 0 and what the excitation does there.
    """
    springs = model.springs.ravel()
    B, g, rigid = motions_without_stiffness(model)
    still = np.flatnonzero(blades.omega[0] == 0)
    mean = _mean_flexibility(body, pushed, (springs, B, g))
    # the mean displacements have no part in the balance
    if not model.coupled:
        mean = tuple(np.zeros_like(part) for part in mean)
    return *mean, np.ascontiguousarray(B), g, np.ascontiguousarray(rigid[: len(still)]), still


def _excitation(
    blades: Stack,
    loads: np.ndarray,
    spare: tuple[tuple[int, int], ...],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What loads (H+1, l) do: (H+1, M) forces on the modes, filled up for those of the damper, and
    the motion next to the modes of contact (H+1, m) and probes (H+1, p).
    """
    shapes = np.pad(blades.shapes[:, blades.load], spare)
    direct, straight = (
        (blades.residual[:, rows, blades.load] @ loads[:, :, None])[:, :, 0]
        for rows in (blades.contact, blades.probe)
    )
    return (loads[:, None] @ shapes.conj())[:, 0], direct, straight


def joined_blocks(bodies: Sequence[Stack], blocks: Sequence[np.ndarray | None]) -> np.ndarray:
    """(S, M, M) what couples the modes of each body, (1 or S, m, m) or None for one whose modes
    nothing couples, the modes of the bodies one after the other; (0, M, M) where all are None.
    """
    count = sum(body.omega.shape[1] for body in bodies)
    most = max((len(block) for block in blocks if block is not None), default=0)
    joined = np.zeros((most, count, count), dtype=complex)
    start = 0
    for body, block in zip(bodies, blocks, strict=True):
        own = slice(start, start := start + body.omega.shape[1])
        if block is not None:
            joined[:, own, own] = block
    return joined


def _mean_flexibility(
    body: tuple[np.ndarray, ...],
    pushed: tuple[np.ndarray, np.ndarray],
    held: tuple,
) -> tuple[np.ndarray, ...]:
    """A (m, m), stuck (m,) and G (m, m) of the mean, as in `bladefem.hbm.linear.condensation`."""
    (own, shapes, residual) = body
    (push, direct) = pushed
    D = np.divide(1.0, own**2, out=np.zeros_like(own), where=own > 0)
    G = (residual + (shapes * D) @ shapes.conj().T).real
    free = (direct + shapes @ (D * push)).real
    A, stuck = with_springs(G, free, *held)
    return np.ascontiguousarray(A), stuck.astype(complex), np.ascontiguousarray(G)


def _shared_parts(
    basis: CommonBasis | None, springs: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """N (S, M, M), and `rest` to `sprung_coordinates` of the `Bodies`."""
    if basis is None:
        none = np.zeros((0, 0))
        parts = np.zeros((0, 0, 0), dtype=complex)
        return parts, (none, none, none, none, parts, parts, parts, parts)
    V = basis.vectors
    R, U, _, _ = frequency_independent_parts(basis.residual[None], V[None], springs)
    shared = np.ascontiguousarray(U[0].real)
    by_springs = V.T @ (springs[:, None] * shared)
    E, P = basis.differences, basis.shapes
    # the same update once more, for what each harmonic adds
    sprung = np.linalg.solve(np.eye(V.shape[1]) + E @ by_springs, np.concatenate([E, P], axis=2))
    sprung_E, sprung_P = np.split(sprung, [V.shape[1]], axis=2)
    joined = P.conj().swapaxes(1, 2) @ (by_springs @ sprung_P)
    return joined, (
        basis.residual,
        V,
        R[0],
        shared,
        E,
        P,
        np.ascontiguousarray(sprung_E),
        np.ascontiguousarray(sprung_P),
    )


def _excited_modes(
    fixed: tuple[np.ndarray, ...],
    springs: np.ndarray,
    push: np.ndarray,
    direct: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """(H+1, m) what the excitation moves in addition to the modes in full stick, (H+1, M) what
    pushes the modes then.
    """
    A, _, UH, _ = fixed
    if not len(A):
        return np.zeros((0, 0)), np.zeros((0, 0))
    sprung = springs * direct
    return direct - _each_harmonic(A, sprung), push - _each_harmonic(UH, sprung)


def _each_harmonic(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(H+1, a) products of matrices (S, a, m) and complex vectors (H+1, m); no matrix is copied."""
    at = np.minimum(np.arange(len(vectors)), len(matrices) - 1)
    if np.iscomplexobj(matrices):
        return np.array([matrices[s] @ vector for s, vector in zip(at, vectors, strict=True)])
    return np.array(
        [
            matrices[s] @ vector.real + 1j * (matrices[s] @ vector.imag)
            for s, vector in zip(at, vectors, strict=True)
        ]
    )


def _with_reversed_shapes(body: Stack) -> Stack:
    return Stack(
        body.omega,
        body.viscous,
        body.hysteretic,
        None,
        -body.shapes,
        body.residual,
        body.contact,
        body.load,
        body.probe,
    )


def _joined_modes(
    bodies: Sequence[Stack],
    name: str,
    rows: Callable[[Stack], slice] = lambda _: slice(None),
) -> np.ndarray:
    """Modes of several bodies side by side, on the harmonics of the one that has most."""
    most = max(len(body.omega) for body in bodies)
    parts = [
        getattr(body, name) if name != "shapes" else body.shapes[:, rows(body)] for body in bodies
    ]
    return np.concatenate(
        [np.broadcast_to(part, (most, *part.shape[1:])) for part in parts], axis=-1
    )
