"""How much too stiff a mesh makes a body, seen by its modes.

Where recovered stress and stress of the elements differ, elements are too large, and the energy of
that difference estimates the energy of the error (Zienkiewicz and Zhu 1987,
doi:10.1002/nme.1620240206). As a bilinear form in the modes it says more than the error of their
frequencies: subtracted from the diagonal stiffness of the reduced model, it gives one whose
deviation is the dual-weighted error of any linear quantity that the modes carry, since
Q(u) - Q(u_h) = a(u - u_h, z - z_h) with the dual solution z (Becker and Rannacher 2001,
doi:10.1017/S0962492901000010).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import scipy.sparse as sp

from geometry.topology import FAMILY
from geometry.whole_cells import OwnCells

from ..data import ModeSet
from ..scene.tables import Material
from .body import Body
from .cell_functions import order_of, quadrature, tabulate
from .elasticity import stiffness
from .stress import element_stress, extrapolation_matrix, solved_cells
from .temperature import Temperatures

# cells at a time
CELLS_PER_BLOCK = 2000
# energy of the error over that of the difference: plane bodies with re-entrant corners are 1.4 to
# 1.6, on all meshes of a row; the shipped sector is 0.55; a clamped bar of hexahedra, wedges or
# pyramids 1.2 to 2.3, of tetrahedra 2.3 to 2.7
SAFETY_FACTOR = 1.5


def stiffness_error(body: Body, shapes: np.ndarray) -> np.ndarray:
    """(m, m) Hermitian energies of the error, a(e_i, e_j), in the units of the modes' stiffness.

    For one mode of unit mass it is the estimated error of omega^2.

    Args:
        shapes: (m, n_points, dim or 3) displacements, real or complex.
    """
    m = len(shapes)
    u = np.moveaxis(np.asarray(shapes, dtype=complex)[:, :, : body.dim], 0, 2)
    # real and imaginary parts as fields of their own
    u = np.concatenate([u.real, u.imag], axis=2)
    total = np.zeros((m, m), complex)
    for name, material in body.material.items():
        own = [some for some in solved_cells(body) if some.name == name]
        for fields in _weighted_differences(body, u, own, material):
            d = fields[:m] + 1j * fields[m:]
            total += d.conj() @ d.T
    return SAFETY_FACTOR * total


def frequency_errors(body: Body, modes: ModeSet) -> np.ndarray:
    """(m,) estimated relative errors of the frequencies; NaN of rigid modes."""
    energies = stiffness_error(body, modes.shapes).diagonal().real
    squares = (2 * np.pi * modes.frequencies) ** 2
    return energies / np.where(squares > 0, 2 * squares, np.nan)


def _weighted_differences(
    body: Body,
    u: np.ndarray,
    own: list[OwnCells],
    material: Material,
) -> Iterator[np.ndarray]:
    """(fields, numbers) recovered less element stress, whose square sums are energies; a block of
    cells at a time.

    Args:
        own: the cells of one material.
    """
    blocks = [
        (some.word, cells)
        for some in own
        for cells in np.array_split(some.cells, len(some.cells) // CELLS_PER_BLOCK + 1)
    ]
    found = [element_stress(body, u, own[0].name, *block) for block in blocks]
    mean = _nodal_mean(len(body.mesh.points), blocks, found)
    compliance = _compliance_root(material, body.heat)
    for (word, cells), (volume, stress) in zip(blocks, found, strict=True):
        if FAMILY[word] in ("triangle", "tetra"):
            difference = mean[cells] - _at_nodes(extrapolation_matrix(word), stress)
            fields = np.tensordot(_mass_root(word), difference @ compliance, axes=([1], [1]))
            fields *= np.sqrt(volume.sum(axis=1))[:, None, None]
            yield np.moveaxis(fields, 2, 0).reshape(u.shape[2], -1)
            continue
        # the error of other cells is in what their stress has beyond its values at the Gauss points
        rule = quadrature(FAMILY[word], 2 * order_of(word))
        size, whole = element_stress(body, u, own[0].name, word, cells, rule)
        smooth = np.tensordot(tabulate(word, rule[0])[0], mean[cells], axes=([1], [1]))
        fields = (smooth.swapaxes(0, 1) - whole) @ compliance * np.sqrt(size)[..., None, None]
        yield np.moveaxis(fields, 2, 0).reshape(u.shape[2], -1)


def _nodal_mean(
    points: int,
    blocks: list[tuple[str, np.ndarray]],
    found: list[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """(points, fields, 6) stress at the nodes: the mean over the cells there, by volume [Pa]."""
    sums = np.zeros((points, *found[0][1].shape[2:]))
    weights = np.zeros(points)
    for (word, cells), (volume, stress) in zip(blocks, found, strict=True):
        own = cells.ravel()
        size = volume.sum(axis=1)
        gather = sp.csr_matrix(
            (np.repeat(size, cells.shape[1]), (own, np.arange(len(own)))),
            shape=(points, len(own)),
        )
        values = _at_nodes(extrapolation_matrix(word), stress).reshape(len(own), -1)
        sums += (gather @ values).reshape(sums.shape)
        weights += np.asarray(gather.sum(axis=1))[:, 0]
    return sums / np.maximum(weights, np.finfo(float).tiny)[:, None, None]


def _at_nodes(continuation: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """(nc, k, fields, 6) of (nc, q, fields, 6)."""
    return np.tensordot(continuation, stress, axes=([1], [1])).swapaxes(0, 1)


@cache
def _mass_root(word: str) -> np.ndarray:
    """(k, k) matrix whose square sums give the mean over a cell of the square of a field that its
    nodes span.
    """
    at, weight = quadrature(FAMILY[word], 2 * order_of(word))
    values, _ = tabulate(word, at)
    mass = (values * (weight / weight.sum())[:, None]).T @ values
    return np.linalg.cholesky(mass).T


def _compliance_root(material: Material, heat: Temperatures | None) -> np.ndarray:
    """(6, 6) symmetric root of the compliance [Pa^-1/2], in the order of `stress`; of the mean
    temperature, which is enough for an estimate.
    """
    mean = None if heat is None else np.asarray(heat.nodal.mean())
    order = [0, 1, 2, 5, 3, 4]
    compliance = np.linalg.inv(stiffness(material, mean))[np.ix_(order, order)]
    values, vectors = np.linalg.eigh(compliance)
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
