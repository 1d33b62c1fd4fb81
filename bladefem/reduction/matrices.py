"""Linear bodies from plain matrices: for users without a finite-element model here, and for
tests.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, linalg, sparse

from ..data import PortModel
from ..errors import InputError
from .exchange import read_ansys, read_dmig

# eigenvalues below this share of the largest one may be those of rigid modes: omega = 0
LOW_EIGENVALUE_SHARE = 1e-10
# energy of a rigid motion over the sum of its absolute terms: rounding leaves 1e-17, files of ten
# digits 1e-12 at most; the first mode of a beam of 400 elements has 1e-11
RIGID_ENERGY_SHARE = 1e-12
# the same below zero, which no elastic motion has: what entries of single precision may leave
NEGATIVE_ENERGY_SHARE = 6e-8
# stiffness of massless motions below this share of the largest entry is none
SLACK_STIFFNESS_SHARE = 1e-10
# eigenvalues of M below this share of the largest one belong to massless motions
MASSLESS_EIGENVALUE_SHARE = 1e-13
# negative damping below this share of the largest one is rounding
DAMPING_ROUNDING_SHARE = 1e-9
# difference of a Hermitian matrix from its transposed conjugate, relative, that is rounding
HERMITIAN_ROUNDING_SHARE = 1e-8
# action of the unsymmetric part on a motion, over its largest, that is rounding
CIRCULATION_ROUNDING_SHARE = 1e-9


def _with_rigid_zeros(
    K: np.ndarray, values: np.ndarray, vectors: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ascending eigenvalues (n,) [rad^2/s^2] of the stiffness K with those of rigid modes set to
    zero, and the modes (dofs, n).

    A small eigenvalue alone says little: a fine mesh of a slender body, or a light mass, stretches
    the spectrum by more than what rounding leaves of zero. A rigid motion is one whose energy is
    small against the terms that cancel in it.

    Raises:
        InputError: the stiffness is not positive semidefinite.
    """
    low = np.flatnonzero(values < LOW_EIGENVALUE_SHARE * values[-1])
    if not len(low):
        return values, vectors
    # told apart anew by the energies themselves, whose rounding is smaller
    some = vectors[:, low]
    energies, turn = linalg.eigh(some.conj().T @ K @ some)
    some = some @ turn
    terms = (abs(some) * (abs(K) @ abs(some))).sum(axis=0)
    if (energies < -NEGATIVE_ENERGY_SHARE * terms).any():
        raise InputError(
            f"K has the eigenvalue {energies[0]:.3g}: expected a positive semidefinite stiffness"
        )
    energies[energies < RIGID_ENERGY_SHARE * terms] = 0.0
    order = np.argsort(energies, kind="stable")
    values, vectors = values.copy(), vectors.copy()
    values[low], vectors[:, low] = energies[order], some[:, order]
    return values, vectors


def port_model_from_matrices(
    M: np.ndarray,
    K: np.ndarray,
    ports: Mapping[str, np.ndarray],
    *,
    count: int | None = None,
    C: np.ndarray | None = None,
    nodal_diameter: int | None = None,
    unsymmetric: bool = False,
) -> PortModel:
    """The body M, C, K seen from its ports, by normal modes and the residual flexibility of the
    modes left out.

    Args:
        M, K: (dofs, dofs) mass [kg] and stiffness [N/m], dense or sparse, real symmetric or
            Hermitian.
        ports: name ("contact", "load", "probe") to dof numbers (k,), or to a matrix (k, dofs) of
            displacement readings.
        count: modes kept; all when left out.
        C: (dofs, dofs) viscous damping and gyroscopic matrix [N s/m], which need not be symmetric;
            modes that it couples stay coupled.
        unsymmetric: K may be unsymmetric: its modes are those of the symmetric part, which the rest
            couples.

    Degrees of freedom without mass follow the others statically, and leave their flexibility as a
    residual one; the damping of that flexibility is left out.

    Raises:
        InputError: shapes do not fit, M or K is not Hermitian, M is not positive semidefinite, a
            motion has neither mass nor stiffness, or unsymmetric stiffness acts on a motion
            without one of them.
    """
    K, circulation = _split_stiffness(K) if unsymmetric else (K, None)
    M, K, C = _checked_matrices(M, K, C)
    P, slices = _port_selection(ports, M.shape[0])
    massless = np.zeros((len(P), len(P)))
    try:
        values, vectors = linalg.eigh(K, M)
    except linalg.LinAlgError:
        M, K, C, P, massless, circulation = _without_massless(M, K, C, P, circulation)
        values, vectors = linalg.eigh(K, M)
    values, vectors = _with_rigid_zeros(K, values, vectors)
    count = len(values) if count is None else count
    if not np.count_nonzero(values == 0) <= count <= len(values):
        raise InputError(
            f"count {count}: expected at least the rigid modes and at most {len(values)} modes"
        )
    shapes = P @ vectors
    rest = shapes[:, count:] / np.sqrt(values[count:])
    kept = vectors[:, :count]
    damping = None if C is None else _modal_damping(kept.conj().T @ C @ kept)
    return PortModel(
        np.sqrt(values[:count]),
        shapes[:, :count],
        massless + rest @ rest.conj().T,
        slices,
        nodal_diameter,
        damping=damping,
        circulatory=_modal_circulation(circulation, kept, values[:count]),
    )


def _split_stiffness(K: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Hermitian and skew-Hermitian part of K; None for a second one that is rounding."""
    K = _square_matrix(K, "K")
    skew = (K - K.conj().T) / 2
    if abs(skew).max() <= HERMITIAN_ROUNDING_SHARE * abs(K).max():
        return K, None
    return (K + K.conj().T) / 2, skew


def _modal_circulation(
    circulation: np.ndarray | None, kept: np.ndarray, values: np.ndarray
) -> np.ndarray | None:
    """(m, m) of the modes (dofs, m) with these eigenvalues (m,) [1/s^2].

    Raises:
        InputError: a rigid motion is pushed, or pushes.
    """
    if circulation is None:
        return None
    modal = kept.conj().T @ circulation @ kept
    rigid = values == 0
    acting = abs(modal[rigid]).max(initial=0.0)
    if acting > CIRCULATION_ROUNDING_SHARE * abs(modal).max():
        raise InputError(
            f"K: its unsymmetric part acts on a rigid motion by {acting:.3g} 1/s^2, expected none"
        )
    modal[rigid] = 0.0
    modal[:, rigid] = 0.0
    return modal


def _checked_matrices(
    M: np.ndarray,
    K: np.ndarray,
    C: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Dense matrices of one shape, M and K Hermitian."""
    M = _hermitian_matrix(M, "M")
    K = _hermitian_matrix(K, "K")
    if M.shape != K.shape:
        raise InputError(f"M {M.shape} and K {K.shape}: expected the same shape")
    if C is not None:
        C = _square_matrix(C, "C")
        if C.shape != M.shape:
            raise InputError(f"C {C.shape} and M {M.shape}: expected the same shape")
    return M, K, C


def read_matrices(path: str | Path) -> dict[str, np.ndarray]:
    """Named arrays of a reduced model exported by another code.

    Reads NumPy ``.npz``, Matlab ``.mat`` (version 7 and older), one Matrix Market ``.mtx`` file,
    whose matrix is named after the file, Nastran DMIG (``.bdf``, ``.dat``, ``.pch``, ``.dmig``),
    and Ansys ``.full`` where its library is installed. Sparse matrices come back dense; the last
    two add "dofs" (n, 2), point and component of each row.

    Raises:
        InputError: the file is missing, of another kind, or cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    readers = {
        ".npz": _read_npz,
        ".mat": _read_mat,
        ".mtx": _read_market,
        ".full": read_ansys,
        **dict.fromkeys((".bdf", ".dat", ".pch", ".dmig"), read_dmig),
    }
    if suffix not in readers:
        raise InputError(f"file {path.name}: expected one of {', '.join(readers)}")
    if not path.is_file():
        raise InputError(f"file {path}: not found")
    try:
        return readers[suffix](path)
    except InputError:
        raise
    except Exception as error:
        # of the many kinds that NumPy's and SciPy's readers raise
        raise InputError(f"file {path}: cannot be read as {suffix}, {error}") from error


def _read_npz(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _read_mat(path: Path) -> dict[str, np.ndarray]:
    return {
        name: _dense_array(value)
        for name, value in io.loadmat(path).items()
        if not name.startswith("__")
    }


def _read_market(path: Path) -> dict[str, np.ndarray]:
    return {path.stem: _dense_array(io.mmread(path))}


def _dense_array(matrix: Any) -> np.ndarray:
    return matrix.toarray() if sparse.issparse(matrix) else np.asarray(matrix)


def _without_massless(
    M: np.ndarray,
    K: np.ndarray,
    C: np.ndarray | None,
    P: np.ndarray,
    circulation: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray, np.ndarray, np.ndarray | None]:
    """M, K, C and port readings P (p, dofs) on the motions with mass, the others following
    statically, the flexibility (p, p) of the others, and the skew part of K on the first.
    """
    masses, motions = linalg.eigh(M)
    if masses[0] < -MASSLESS_EIGENVALUE_SHARE * masses[-1]:
        raise InputError(
            f"M has the eigenvalue {masses[0]:.3g}: expected a positive semidefinite mass matrix"
        )
    still = masses <= MASSLESS_EIGENVALUE_SHARE * masses[-1]
    if still.all():
        raise InputError("M is zero: expected a mass matrix with some mass")
    light = motions[:, still]
    heavy = motions[:, ~still]
    own = light.conj().T @ K @ light
    if linalg.eigvalsh(own)[0] <= SLACK_STIFFNESS_SHARE * abs(K).max():
        raise InputError(
            "M and K: a motion has neither mass nor stiffness, expected one of them in each"
        )
    if circulation is not None:
        acting = abs(circulation @ light).max()
        if acting > CIRCULATION_ROUNDING_SHARE * abs(circulation).max():
            raise InputError("K: its unsymmetric part acts on a motion without mass, expected none")
        circulation = heavy.conj().T @ circulation @ heavy
    follow = heavy - light @ linalg.solve(own, light.conj().T @ K @ heavy, assume_a="pos")
    read = P @ light
    return (
        heavy.conj().T @ M @ heavy,
        follow.conj().T @ K @ follow,
        None if C is None else follow.conj().T @ C @ follow,
        P @ follow,
        read @ linalg.solve(own, read.conj().T, assume_a="pos"),
        circulation,
    )


def _square_matrix(matrix: np.ndarray, name: str) -> np.ndarray:
    matrix = np.atleast_2d(_dense_array(matrix))
    # the algebra of single precision would lose the low modes
    matrix = matrix.astype(np.result_type(matrix, float))
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not np.isfinite(matrix).all():
        raise InputError(
            f"{name} of shape {matrix.shape}: expected a square matrix of finite numbers"
        )
    return matrix


def _hermitian_matrix(matrix: np.ndarray, name: str) -> np.ndarray:
    matrix = _square_matrix(matrix, name)
    error = abs(matrix - matrix.conj().T).max()
    if error > HERMITIAN_ROUNDING_SHARE * abs(matrix).max():
        option = ", or unsymmetric = True" if name == "K" else ""
        raise InputError(
            f"{name} differs from its transposed conjugate by {error:.3g}: expected a Hermitian "
            f"matrix{option}"
        )
    return (matrix + matrix.conj().T) / 2


def _modal_damping(matrix: np.ndarray) -> np.ndarray:
    """The diagonal (m,) where the damping does not couple the modes, else the matrix (m, m).

    Raises:
        InputError: a motion gains work by it, beyond rounding.
    """
    # the part that does work; what is left of a gyroscopic matrix does none
    lowest = linalg.eigvalsh((matrix + matrix.conj().T) / 2)[0]
    rounding = DAMPING_ROUNDING_SHARE * abs(matrix).max()
    if lowest < -rounding:
        raise InputError(f"C damps a motion by {lowest:.3g} 1/s: expected no negative damping")
    diagonal = np.maximum(np.diag(matrix).real, 0.0)
    return diagonal if abs(matrix - np.diag(diagonal)).max() <= rounding else matrix


def _port_selection(
    ports: Mapping[str, np.ndarray], dofs: int
) -> tuple[np.ndarray, dict[str, slice]]:
    if not isinstance(ports, Mapping) or not ports:
        raise InputError(
            f"ports of type {type(ports).__name__}: expected a dict of names to dof numbers, not "
            "empty"
        )
    rows = []
    slices = {}
    start = 0
    for name, value in ports.items():
        value = np.asarray(value)
        if value.ndim == 1:
            if value.size and not (
                np.all(value == value.astype(int)) and 0 <= value.min() and value.max() < dofs
            ):
                raise InputError(
                    f"ports['{name}']: expected whole dof numbers from 0 to {dofs - 1}"
                )
            value = np.eye(dofs)[value.astype(int)]
        if value.ndim != 2 or value.shape[1] != dofs or not np.isfinite(value).all():
            raise InputError(
                f"ports['{name}'] of shape {value.shape}: expected (k,) dofs or a (k, {dofs}) "
                "matrix"
            )
        rows.append(value)
        slices[name] = slice(start, start + len(value))
        start += len(value)
    return np.vstack(rows), slices
