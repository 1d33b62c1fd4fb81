"""One wheel's sectors and nodal diameters shared by ranks: the motion is that of one rank."""

import sys
from pathlib import Path

import numpy as np
import pytest
from processes import run_on_ranks

# six sectors and four nodal diameters: of five ranks one has neither
PROGRAM = """
import sys
sys.path.insert(0, sys.argv[2])
from dataclasses import replace
import numpy as np
from mpi4py import MPI
from rings import RIGID, elements, forces, ring_wheel
from bladefem.wheel.model import Pattern
from bladefem.wheel.solve import solve_wheel

comm = MPI.COMM_WORLD
wheel = ring_wheel(elements(2, kn=1.5), RIGID, forces({1: 0.8, 2: 0.1}))
if comm.size > 1:
    wheel = replace(wheel, comm=comm)
rng = np.random.default_rng(0)
pattern = Pattern(
    0.2 * rng.normal(size=(6, 1, 1)) * np.eye(2), damper_mass=0.1 * rng.normal(size=6)
)
point = solve_wheel(wheel, 2.2, 3, 64, pattern=pattern)
assert point.converged, point.reason
assert (point.shares[..., 1] > 0).any()
every = comm.allgather(point.w.tobytes())
assert all(one == every[0] for one in every), "ranks disagree"
if comm.rank == comm.size - 1:
    names = ("w", "f", "probe", "shares", "dissipated", "products")
    np.savez(sys.argv[1], **{name: getattr(point, name) for name in names})
"""


def motion_on(ranks, folder):
    """What the last of some ranks knows."""
    file = folder / f"{ranks}.npz"
    here = str(Path(__file__).parent)
    done = run_on_ranks(
        ranks,
        [sys.executable, "-c", PROGRAM, str(file), here],
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return np.load(file)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What one rank finds."""
    return dict(motion_on(1, tmp_path_factory.mktemp("alone")))


@pytest.mark.parametrize("ranks", [2, 4, 5])
def test_motion_is_that_of_one_rank(alone, ranks, tmp_path):
    shared = motion_on(ranks, tmp_path)
    for name in alone:
        size = abs(alone[name]).max()
        np.testing.assert_allclose(
            shared[name], alone[name], rtol=0, atol=1e-11 * size, err_msg=name
        )
