"""The iteration itself: against a dense solver, with directions that wait, and down to the last
mode of a body.
"""

import numpy as np
import pytest
from scipy.linalg import eigh
from structured import sector

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import compliance, flexible
from bladefem.fem.lanczos import WantedPairs, lowest_eigenpairs
from bladefem.fem.linalg import apply_block
from bladefem.scene.tables import Material


def pencil(n):
    con = constrain(assemble(sector(7, (2, 2, 1), bump=0.2), "blade", Material()), "clamp", n)
    unit = np.eye(con.T.shape[1], dtype=con.dtype, order="F")
    return con, *eigh(apply_block(con.K, unit), apply_block(con.M, unit))


@pytest.mark.parametrize("n", [0, 2])
def test_what_is_known_already_is_not_solved_for(n):
    """Six of ten first guesses are right to 1e-9, four to 1e-2: from the second step on blocks are
    narrow.
    """
    con, lam, X = pencil(n)
    wrong = np.where(np.arange(10) % 5 < 3, 1e-9, 1e-2)
    start = np.asfortranarray(
        X[:, :10] + X[:, 10:60] @ np.random.default_rng(1).standard_normal((50, 10)) * wrong
    )
    flex, widths = flexible(con), []
    found, Y = lowest_eigenpairs(
        con,
        lambda B: widths.append(B.shape[1]) or compliance(flex, B),
        start,
        WantedPairs(10, 1e-6),
    )
    np.testing.assert_allclose(found, lam[:10], rtol=1e-11)
    np.testing.assert_allclose(
        abs(np.einsum("ij,ij->j", X[:, :10].conj(), apply_block(con.M, Y))), 1, atol=1e-10
    )
    assert widths[0] == 10 and max(widths[1:]) <= 4


def test_all_modes_of_a_small_body():
    """The space is exhausted on the way: what is left then is rounding and must not come in as a
    direction.
    """
    con, lam, _ = pencil(0)
    flex = flexible(con)
    start = np.random.default_rng(2).standard_normal((len(lam), 8))
    found, _ = lowest_eigenpairs(
        con, lambda B: compliance(flex, B), start, WantedPairs(len(lam), 1e-6)
    )
    np.testing.assert_allclose(found, lam, rtol=1e-9)
    with pytest.raises(
        InputError,
        match=f"{len(lam) + 1} elastic modes were asked of a body that has {len(lam)}",
    ):
        lowest_eigenpairs(
            con, lambda B: compliance(flex, B), start, WantedPairs(len(lam) + 1, 1e-6)
        )
