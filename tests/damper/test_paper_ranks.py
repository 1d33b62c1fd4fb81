"""The paper's finite elements on any number of ranks: the same as each rank by itself (the punch:
test_paper_demos).
"""

import numpy as np
import pytest

from bladefem.fem.compat import MPI
from bladefem.scene.toml import load_scene
from bladefem.study.kinds.zmass import press_mass
from verification.paper.plane_row import paper_model, row_of_blades

pytestmark = [pytest.mark.mpi, pytest.mark.two_ranks, pytest.mark.several_ranks]
RANKS = (MPI.COMM_WORLD, MPI.COMM_SELF)


def test_pressure_of_the_mass():
    together, alone = (
        press_mass(load_scene("scenes/zmass.toml", ["mesh.size=9 mm"]), comm=comm).seat
        for comm in RANKS
    )
    np.testing.assert_allclose(together.force, alone.force, rtol=1e-9)


def test_row_of_blades():
    scene = load_scene("scenes/plane.toml", ["mesh.size=5 mm"])
    together, alone = (paper_model(scene, row_of_blades(scene, comm=comm), 10.0) for comm in RANKS)
    np.testing.assert_allclose(together.side(1).omega, alone.side(1).omega, rtol=1e-9)
    np.testing.assert_allclose(together.elements.n0, alone.elements.n0, atol=1e-9)
