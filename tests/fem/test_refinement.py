"""Halved meshes: the same volume and faces, finer and nested, pairs and names kept."""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, face_areas, sector

from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.loads import body_volume
from bladefem.fem.modes import modes
from bladefem.fem.refinement import refine_uniformly
from bladefem.scene.tables import Material

SOLIDS = ["tetra", "tetra10", "hexahedron", "hexahedron27"]
PLANE = ["triangle", "triangle6", "quad", "quad9"]


@pytest.mark.parametrize("cell", SOLIDS + PLANE)
def test_the_same_body_with_smaller_cells(cell):
    """A curved sector: volume, areas and number of cells."""
    d = 2 if cell in PLANE else 3
    mesh = sector(9, (2, 2, 1)[:d], cell, bump=0.2 if d == 3 else 0.0)
    mesh = replace(
        mesh,
        nodes={"held": np.unique(mesh.faces["x0"])},
        parts={"first": np.array([0, 2])},
    )
    fine = refine_uniformly(mesh)
    assert len(fine.bodies["blade"]) == 2**d * len(mesh.bodies["blade"])
    assert body_volume(fine, "blade") == pytest.approx(body_volume(mesh, "blade"), rel=1e-10)
    bodies = [assemble(some, "blade", Material()) for some in (mesh, fine)]
    for face in mesh.faces:
        coarse_area, area = (face_areas(body, face).sum() for body in bodies)
        assert area == pytest.approx(coarse_area, rel=1e-9)
    np.testing.assert_array_equal(fine.nodes["held"], np.unique(fine.faces["x0"]))
    assert fine.pairs["cyclic"].nodes.shape[1] == len(np.unique(fine.faces["cyclic_low"]))
    assert list(fine.parts["first"][[0, -1]]) == [0, 3 * 2**d - 1]
    # nested spaces: frequencies fall
    ours, theirs = (modes(constrain(body, "clamp", 2), 4).frequencies for body in bodies[::-1])
    assert (ours < theirs).all()


@pytest.mark.parametrize("cell", ["hexahedron27", "triangle6", "quad9"])
def test_a_straight_box_is_the_one_with_twice_the_divisions(cell):
    """Triangles too; tetrahedra are cut along other diagonals."""
    d = 2 if cell in PLANE else 3
    size = (0.1, 0.05, 0.02)[:d]
    fine = refine_uniformly(box((3, 2, 1)[:d], size, cell))
    other = box((6, 4, 2)[:d], size, cell)
    assert len(fine.points) == len(other.points)
    ours, theirs = (
        modes(constrain(assemble(some, "blade", Material())), 3).frequencies
        for some in (fine, other)
    )
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
