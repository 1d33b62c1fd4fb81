"""Matrices of open sectors that share memory are the matrices that they stand for."""

import numpy as np
import pytest
import scipy.sparse as sp
from structured import sector

from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain, transformation
from bladefem.fem.distributed import local_rows, shared_rows
from bladefem.fem.linalg import apply_block, recombine
from bladefem.fem.modes import modes
from bladefem.fem.open_matrix import (
    Repeated,
    Selected,
    chosen_rows,
    diagonal,
    entries,
    entries_of_sum,
    picked,
    times,
)
from bladefem.scene.tables import Material

RNG = np.random.default_rng(3)
WHOLE = sp.random(15, 15, 0.4, "csr", random_state=1)
WHOLE = (WHOLE + WHOLE.T).tocsr()
CHOSEN = np.array([0, 1, 2, 6, 7, 8, 9, 10, 11])
NODAL = WHOLE[:3, :3]
KINDS = {
    "own": (WHOLE[CHOSEN][:, CHOSEN].tocsr(), WHOLE.toarray()[np.ix_(CHOSEN, CHOSEN)]),
    "selected": (Selected(WHOLE, CHOSEN, None), WHOLE.toarray()[np.ix_(CHOSEN, CHOSEN)]),
    "repeated": (Repeated(NODAL, 3), np.kron(NODAL.toarray(), np.eye(3))),
}


@pytest.fixture(scope="module")
def body():
    return assemble(sector(8, (4, 3, 2), "tetra10", bump=0.2), "blade", Material())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dtype", [float, complex])
def test_every_kind_is_its_dense_matrix(kind, dtype):
    A, dense = KINDS[kind]
    X = RNG.standard_normal((9, 4)).astype(dtype)
    if dtype is complex:
        X = X + 1j * RNG.standard_normal((9, 4))
    places = np.array([1, 5, 6])
    assert A.shape == dense.shape
    np.testing.assert_allclose(times(A, X), dense @ X, atol=1e-13)
    np.testing.assert_array_equal(entries(A).toarray(), dense)
    np.testing.assert_array_equal(chosen_rows(A, places).toarray(), dense[places])
    np.testing.assert_array_equal(diagonal(A), dense.diagonal())
    other, dense_other = KINDS["own"]
    np.testing.assert_allclose(entries_of_sum(A, -2.0, other).toarray(), dense - 2 * dense_other)


@pytest.mark.parametrize(
    "rows",
    [
        np.arange(40),
        np.r_[0:7, 8:40],
        np.array([3, 5, 30]),
        np.array([9, 2, 2]),
        np.arange(40)[::-1],
    ],
    ids=["all", "nearly all", "few", "in any order", "turned"],
)
@pytest.mark.parametrize(
    "columns", [np.arange(40), np.r_[0:7, 8:40], np.array([4, 6]), np.array([8, 1])]
)
def test_rows_and_columns_are_picked_as_scipy_does(rows, columns):
    A = sp.random(40, 40, 0.2, "csr", random_state=7)
    A.data[A.indptr[11] : A.indptr[12]] = 0
    A.eliminate_zeros()
    found = picked(A, rows, columns)
    assert found.nnz == A[rows][:, columns].nnz
    np.testing.assert_array_equal(found.toarray(), A.toarray()[np.ix_(rows, columns)])


def test_the_stiffness_of_an_open_sector_is_the_body_s_own_memory(body):
    opened = transformation(body, cyclic=True).opened
    assert isinstance(opened.K, Selected)
    assert isinstance(opened.M, Repeated)
    assert np.shares_memory(opened.K.whole.data, shared_rows(body.K).data)
    own = body.scalar_rows[opened.places]
    for A, whole in ((opened.K, body.K), (opened.M, body.M)):
        expected = local_rows(whole)[own][:, own]
        assert abs(entries(A) - expected).max() <= 1e-14 * abs(expected).max()


def test_modes_of_a_sector_need_the_mass_of_one_direction_alone():
    """It is made whole for whoever asks later, and an open sector after that is the same."""
    body = assemble(sector(8, (4, 3, 2), "tetra10", bump=0.2), "blade", Material())
    lean = transformation(body, cyclic=True).opened
    modes(constrain(body, "clamp", 2), 3)
    assert body.mass.whole is None
    X = RNG.standard_normal((body.K.size[0], 4)) + 1j
    products = [apply_block(body.mass, X), apply_block(body.mass, X.real)]
    assert body.mass.whole is None
    own = body.scalar_rows[lean.places]
    whole = local_rows(body.M)
    assert abs(entries(lean.M) - whole[own][:, own]).max() == 0
    for found, Y in zip(products, (X, X.real), strict=True):
        np.testing.assert_allclose(found, whole @ Y, rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(apply_block(body.mass, Y), whole @ Y, rtol=1e-12, atol=1e-18)
    assert body.mass.of_one_direction is None
    late = transformation(body, cyclic=True).opened
    np.testing.assert_array_equal(late.M.nodal.toarray(), lean.M.nodal.toarray())


def test_shared_rows_are_the_matrix_and_cannot_be_written_to(body):
    A = shared_rows(body.K)
    assert abs(A - local_rows(body.K)).max() == 0
    with pytest.raises(ValueError, match="read-only"):
        A.data[0] = 1.0


@pytest.mark.parametrize("dtype", [float, complex])
def test_a_block_is_recombined_in_its_own_memory(dtype):
    W = np.asfortranarray(RNG.standard_normal((9001, 5)).astype(dtype))
    C = RNG.standard_normal((5, 3)).astype(dtype)
    expected = W @ C
    out = recombine(W, C)
    np.testing.assert_allclose(out, expected, atol=1e-13)
    assert np.shares_memory(out, W)
    assert out.flags.f_contiguous


def test_a_shifted_stiffness_is_the_sum(body):
    """Mass is added in the place of the stiffness; where its pattern is another one, as a sum."""
    opened = transformation(body, cyclic=True).opened
    found = entries_of_sum(opened.K, -3e7, opened.M)
    expected = entries(opened.K) - 3e7 * entries(opened.M)
    assert found.nnz == entries(opened.K).nnz
    assert abs(found - expected).max() <= 1e-14 * abs(expected).max()
    assert abs(entries(opened.K) - opened.K.whole[opened.K.chosen][:, opened.K.chosen]).max() == 0
    few, _ = KINDS["selected"]
    several, dense = KINDS["repeated"]
    np.testing.assert_allclose(
        entries_of_sum(few, -2.0, several).toarray(), entries(few).toarray() - 2 * dense
    )
