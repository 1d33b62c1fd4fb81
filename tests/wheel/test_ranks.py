"""Wheels dealt out over ranks: the statistics are those of one rank, whatever their number."""

import sys

import numpy as np
import pytest
from processes import run_on_ranks

# the smallest wheel, and fewer wheels than some numbers of ranks
PROGRAM = """
import sys
import numpy as np
from mpi4py import MPI
from bladefem.wheel.lumped import LumpedBlades, lumped_pattern, lumped_wheel
from bladefem.wheel.scatter import Scatter, drawn_patterns
from bladefem.wheel.statistics import band_search, scatter_statistics, wheel_respond

blades = LumpedBlades(count=6)
wheels = {limit: lumped_wheel(blades, 2, 1.0, 1e5, limit) for limit in (2.0, 6.0)}
drawn = drawn_patterns(
    wheels[2.0], Scatter(0.02, friction=0.1), 3, lambda d: lumped_pattern(blades, d)
)
grid = 2900.0 * np.linspace(0.9, 1.1, 21)
found = scatter_statistics(
    dict.fromkeys(wheels, drawn),
    band_search(
        wheels,
        lambda load, pattern: grid,
        lambda wheel, pattern: wheel_respond(wheel, pattern, 1, 32),
    ),
    MPI.COMM_WORLD,
)
if MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
    np.savez(sys.argv[1], **vars(found))
"""


def statistics_on(ranks, folder):
    """What the last of some ranks knows."""
    file = folder / f"{ranks}.npz"
    done = run_on_ranks(
        ranks,
        [sys.executable, "-c", PROGRAM, str(file)],
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return np.load(file)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What one rank finds."""
    return dict(statistics_on(1, tmp_path_factory.mktemp("alone")))


@pytest.mark.parametrize("ranks", [2, 4])
def test_statistics_are_those_of_one_rank(alone, ranks, tmp_path):
    shared = statistics_on(ranks, tmp_path)
    assert alone["peak"].shape == (2, 3) and (alone["peak"] > 0).all()
    assert not alone["unsolved"].any()
    for name in alone:
        np.testing.assert_array_equal(shared[name], alone[name], err_msg=name)
