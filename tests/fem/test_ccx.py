"""CalculiX 2.20 on the same mesh: its frequencies stand in ccx_sector.json (``benchmarks/fem_ccx.py
--golden``).
"""

import json
from pathlib import Path

import numpy as np
import pytest
from structured import sector

from bladefem.fem.all_diameters import all_diameters
from bladefem.fem.body import assemble
from bladefem.scene.tables import Material

GOLDEN = json.loads((Path(__file__).parent / "ccx_sector.json").read_text())


@pytest.mark.parametrize("kind", ["straight", "curved"])
def test_same_frequencies_with_its_quadrature(kind):
    """All nodal diameters of a wheel with twelve sectors; ccx prints seven digits."""
    mesh = sector(12, (4, 3, 1), bump=0.2, straight=kind == "straight")
    for modes in all_diameters(assemble(mesh, "blade", Material(), quadrature="ccx"), 10):
        np.testing.assert_allclose(
            modes.frequencies, GOLDEN[kind][str(modes.nodal_diameter)], rtol=1e-6
        )
