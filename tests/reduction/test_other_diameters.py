"""A cyclic sector in nodal diameters that were not reduced, beside its own reduction in each."""

import numpy as np
import pytest
from scipy.linalg import eigh

from bladefem.data import SectorSpan
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.reduction.other_diameters import has_rigid_motion, spanned_models

SECTORS = 12
SIZE = 60
PORTS = {"contact": np.array([0, 7]), "load": np.array([3]), "probe": np.array([15])}
ROWS = np.array([0, 7, 3, 15])
COUNT = 5


@pytest.fixture
def sector():
    """Parts (3, SIZE, SIZE) of the stiffness of a sector, its ends joined by two springs."""
    chain = 40.0 * (2 * np.eye(SIZE) - np.eye(SIZE, k=1) - np.eye(SIZE, k=-1))
    chain += np.diag(np.linspace(0.02, 0.06, SIZE))
    K = np.zeros((3, SIZE, SIZE))
    K[0] = chain
    for first, last, k in ((0, SIZE - 1, 9.0), (4, SIZE - 3, 5.0)):
        K[0][[first, last], [first, last]] += k
        K[1][[first, last], [last, first]] -= k
        # the next sector's first node, times e^{ia}
        K[2][last, first] -= k
        K[2][first, last] += k
    return K


def stiffness(parts, n):
    angle = 2 * np.pi * n / SECTORS
    return parts[0] + np.cos(angle) * parts[1] + 1j * np.sin(angle) * parts[2]


def reduced(parts, n, count=COUNT):
    M = np.eye(SIZE)
    return port_model_from_matrices(M, stiffness(parts, n), PORTS, count=count)


def span_of(parts, diameters, count=COUNT):
    """Of the lowest modes in some diameters."""
    shapes = [eigh(stiffness(parts, n))[1][:, :count] for n in diameters]
    both = np.hstack([part for X in shapes for part in (X.real, X.imag)])
    W, size, _ = np.linalg.svd(both, full_matrices=False)
    W = W[:, size > 1e-9 * size[0]]
    return SectorSpan(
        np.array([W.T @ A @ W for A in parts]),
        np.array([np.eye(W.shape[1]), *np.zeros((2, W.shape[1], W.shape[1]))]),
        W[ROWS],
        np.zeros((len(ROWS), W.shape[1])),
    )


def static(body):
    return body.residual + (body.shapes / body.omega**2) @ body.shapes.conj().T


def test_a_whole_space_is_exact(sector):
    found = spanned_models(
        span_of(sector, (0, 3, 6), SIZE), {3: reduced(sector, 3)}, SECTORS, COUNT
    )
    for n in range(SECTORS // 2 + 1):
        own = reduced(sector, n)
        assert found[n].omega == pytest.approx(own.omega, rel=1e-9)
        assert static(found[n]) == pytest.approx(static(own), rel=1e-9)
        assert found[n].nodal_diameter in (n, None)


def test_diameters_left_out_lie_near(sector):
    """Modes to 0.1 %, and a flexibility much nearer than that of the diameter next to it."""
    known = {n: reduced(sector, n) for n in (0, 3, 6)}
    found = spanned_models(span_of(sector, known), known, SECTORS, COUNT)
    assert found[3] is known[3]
    for n in (1, 2, 4, 5):
        own = reduced(sector, n)
        near = known[min(known, key=lambda m: abs(m - n))]
        assert found[n].omega == pytest.approx(own.omega, rel=1e-3)
        missed = abs(static(found[n]) - static(own)).max()
        assert missed < 0.3 * abs(static(near) - static(own)).max()


def test_rigid_motions_are_seen(sector):
    assert not has_rigid_motion({0: reduced(sector, 0)})
    floating = sector.copy()
    floating[0] -= np.diag(np.linspace(0.02, 0.06, SIZE))
    # ends of the chain that hold it
    floating[0][[0, -1], [0, -1]] -= 40.0
    assert has_rigid_motion({0: reduced(floating, 0)})
