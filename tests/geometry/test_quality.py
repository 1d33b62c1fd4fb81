"""What the table of a mesh says, against numbers at hand."""

import numpy as np
import pytest

from geometry.mesh import Mesh
from geometry.quality import quality_report, quality_rows

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]) / 1000


def test_the_mean_edge_counts_each_edge_once():
    """Two cells that share a face, 9 edges: 3 of 1 mm and 6 of sqrt(2) mm; the wish of 1 m stands
    beside it.
    """
    mesh = Mesh(CORNERS, "tetra", {"blade": np.array([[0, 1, 2, 3], [1, 2, 3, 4]])})
    found = quality_report(mesh, 0, 1.0)
    assert found["edge"] == pytest.approx((3 + 6 * 2**0.5) / 9 * 1e-3)
    rows = dict(quality_rows(Mesh(CORNERS, "tetra", mesh.bodies, report=found)))
    assert rows["element size, wanted [mm]"] == "1000" and rows["mean edge length [mm]"] == "1.276"
