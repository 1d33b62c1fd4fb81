"""The same pressure for any number of ranks. The reference is each rank's own solve on its own
communicator.
"""

import numpy as np
import pytest
from mesh_seating import solve_mesh_seating
from seated_wedge import ALPHA, SPEED
from wedge import wedge_mesh

from bladefem.fem.compat import MPI
from bladefem.scene.tables import Materials

pytestmark = [pytest.mark.mpi, pytest.mark.several_ranks]


@pytest.mark.parametrize("dimension", [2, 3])
def test_pressure_does_not_depend_on_ranks(dimension):
    mesh = wedge_mesh(ALPHA, dimension=dimension)
    together, alone = (
        solve_mesh_seating(mesh, Materials(), SPEED, comm=comm)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    for a, b in zip(together, alone, strict=True):
        assert np.abs(a.force - b.force).max() < 1e-9 * b.force.max()
        everywhere = MPI.COMM_WORLD.allgather(a.force)
        assert all(np.array_equal(everywhere[0], f) for f in everywhere)
