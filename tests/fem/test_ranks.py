"""The same numbers for any number of ranks. The reference is each rank's own solve on its own
communicator.
"""

import numpy as np
import pytest
from structured import box, sector
from test_ports import model

from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.fem.ports import port_model
from bladefem.scene.tables import Material

pytestmark = [pytest.mark.mpi, pytest.mark.several_ranks]


@pytest.mark.parametrize("n", [0, 1, 3])
@pytest.mark.parametrize("cell_type", ["tetra10", "hexahedron27", "tetra"])
def test_modes_do_not_depend_on_ranks(cell_type, n):
    mesh = sector(6, (4, 2, 1), cell_type, bump=0.2)
    together, alone = (
        modes(constrain(assemble(mesh, "blade", Material(), comm), "clamp", n), 10)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    np.testing.assert_allclose(together.frequencies, alone.frequencies, rtol=1e-10)
    np.testing.assert_allclose(together.shapes, alone.shapes, atol=1e-6 * abs(alone.shapes).max())


def test_multiple_frequencies_have_one_basis():
    """A square beam bends both ways at one frequency: any basis is right, the same one must come
    out.
    """
    mesh = box((4, 2, 2), (1.0, 0.1, 0.1), "hexahedron27")
    together, alone = (
        modes(constrain(assemble(mesh, "blade", Material(), comm)), 6)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    assert alone.frequencies[1] == pytest.approx(alone.frequencies[0], rel=1e-9)
    np.testing.assert_allclose(together.shapes, alone.shapes, atol=1e-6 * abs(alone.shapes).max())


@pytest.mark.parametrize("kind, n, clamp", [("sector", 1, "clamp"), ("box", None, None)])
def test_ports_do_not_depend_on_ranks(kind, n, clamp):
    con, P, names = model(kind, n, clamp)
    alone = constrain(assemble(con.body.mesh, "blade", Material(), MPI.COMM_SELF), clamp, n)
    a, b = (port_model(c, P, names, 12) for c in (con, alone))
    np.testing.assert_allclose(a.omega[a.omega > 0], b.omega[b.omega > 0], rtol=1e-10)
    np.testing.assert_allclose(a.residual, b.residual, atol=1e-10 * abs(b.residual).max())
    np.testing.assert_allclose(a.shapes, b.shapes, atol=1e-6 * abs(b.shapes).max())
