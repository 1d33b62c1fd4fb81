"""What the table of a mesh says, against numbers at hand."""

from pathlib import Path

import numpy as np
import pytest

from bladefem.scene.toml import load_scene
from geometry.builders import build_here
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


@pytest.mark.parametrize("name", ["plane", "zmass", "punch", "wedge"])
def test_the_size_wanted_has_the_scale_in_it(name):
    """A sector with mesh.scale = 3 and edges of 8.2 mm was said to want 3 mm."""
    file = Path(__file__).parents[2] / "scenes" / f"{name}.toml"
    found = [build_here(load_scene(file, [f"mesh.scale={scale}"])).report for scale in (3, 4)]
    assert found[1]["size"] == pytest.approx(4 / 3 * found[0]["size"])
