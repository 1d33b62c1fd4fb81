"""The estimate of memory and its refusal."""

import pytest

from bladefem.errors import InputError
from bladefem.fem.compat import MPI
from bladefem.fem.memory import available_memory, check_memory, modal_solve_memory


@pytest.mark.parametrize(
    "dofs, ranks, measured",
    [
        (12530, 1, 0.22e9),
        (45550, 1, 0.56e9),
        (151000, 1, 2.05e9),
        (395100, 1, 6.66e9),
        (28482, 2, 0.91e9),
        (50514, 2, 1.51e9),
    ],
)
def test_model_follows_the_measured_peaks(dofs, ranks, measured):
    """Wedge sector; two ranks: the doubled pencil's peak on one rank, and a second interpreter."""
    assert modal_solve_memory(dofs, ranks) == pytest.approx(measured, rel=0.07)


def test_too_large_is_refused_with_advice():
    with pytest.raises(
        InputError, match=r"1000000 degrees of freedom .* 2.0 GB are free; expected"
    ):
        check_memory(1_000_000, MPI.COMM_WORLD, free=2e9)


def test_small_fits():
    assert 0 < check_memory(1000, MPI.COMM_SELF) < available_memory()
