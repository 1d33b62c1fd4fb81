"""The same numbers for any number of ranks. The reference is each rank's own solve on its own
communicator.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, sector
from test_ports import model

from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.fem.ports import PortReduction, port_model
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.temperature import Temperatures
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
    a, b = (port_model(c, PortReduction(P, names, 12)) for c in (con, alone))
    np.testing.assert_allclose(a.omega[a.omega > 0], b.omega[b.omega > 0], rtol=1e-10)
    np.testing.assert_allclose(a.residual, b.residual, atol=1e-10 * abs(b.residual).max())
    np.testing.assert_allclose(a.shapes, b.shapes, atol=1e-6 * abs(b.shapes).max())


@pytest.mark.parametrize(
    "cells",
    [
        pytest.param((1, 1, 1), id="fewer than ranks"),
        pytest.param((4, 2, 2), id="one of a part", marks=pytest.mark.two_ranks),
    ],
)
@pytest.mark.parametrize("even", [True, False])
def test_a_rank_without_cells_of_a_crystal(cells, even):
    """All cells, or the single one of a crystal whose constants vary with temperature, are on one
    rank.
    """
    rows = [f"{T} K: E={E} GPa; nu=0.3; G={G} GPa" for T, E, G in ((300, 200, 90), (900, 150, 70))]
    crystal = Material(G=9e10, angles=(0.3, 0.4, 0.5), expansion=1.2e-5, table=tuple(rows))
    mesh = box(cells, (0.1, 0.02, 0.03), "hexahedron27")
    first, *others = mesh.bodies["blade"]
    parts = {"blade": np.array(others), "insert": np.array([first])}
    mesh = replace(mesh, bodies={name: part for name, part in parts.items() if len(part)})
    materials = {"blade": Material(expansion=1.2e-5), "insert": crystal}
    x = mesh.points[:, 0]
    heat = Temperatures(np.full(len(x), 600.0) if even else 400 + 3000 * x, 300.0)
    together, alone = (
        modes(constrain(body_under_rotation(body, 500.0)), 3).frequencies
        for body in (
            assemble(mesh, tuple(mesh.bodies), materials, comm, heat=heat)
            for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
        )
    )
    np.testing.assert_allclose(together, alone, rtol=1e-9)
