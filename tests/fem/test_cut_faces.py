"""Cut faces whose nodes do not match: rigid motions, the matching mesh, refinement."""

from dataclasses import replace

import numpy as np
import pytest
from structured import sector

from bladefem.errors import InputError
from bladefem.fem.all_diameters import all_diameters
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain
from bladefem.fem.cut_faces import repeated_motion, tie_cut_faces
from bladefem.fem.flexibility import rigid_basis
from bladefem.fem.modes import modes
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.supports import supported
from bladefem.scene.tables import Material
from geometry.mesh import Pair

CELLS = ["tetra10", "hexahedron27", "hexahedron", "tetra"]


def unpaired(mesh):
    """The same mesh without partners on its cut faces."""
    old = mesh.pairs["cyclic"]
    pair = Pair(old.master, old.slave, np.zeros((2, 0), int), old.rotation, old.shift)
    return replace(mesh, pairs={"cyclic": pair})


def frequencies(mesh, n, count=6, clamp="clamp"):
    return modes(constrain(assemble(mesh, "blade", Material()), clamp, n), count).frequencies


@pytest.mark.parametrize("cell", CELLS)
def test_linear_fields_are_repeated(cell):
    mesh = sector(9, (3, 2, 2), cell, slide=0.2, straight=True)
    tie = tie_cut_faces(mesh)
    rotation = mesh.pairs["cyclic"].rotation
    np.testing.assert_allclose(tie.share.sum(axis=1), 1, atol=1e-12)
    image = mesh.points[tie.low] @ rotation.T
    np.testing.assert_allclose(tie.share @ image, mesh.points[tie.high], atol=1e-12)
    # the two faces do differ
    distance = np.linalg.norm(image[:, None] - mesh.points[tie.high][None], axis=2).min(axis=0)
    assert distance.max() > 0.003


def test_a_high_node_follows_the_low_ones_near_it():
    """Small shares are left out; linear and quadratic fields do not notice."""
    mesh = sector(9, (24, 2, 8), "tetra10", slide=0.1, straight=True)
    tie = tie_cut_faces(mesh)
    short = repeated_motion(tie, len(mesh.points), np.ones(len(mesh.points), bool))
    assert short.nnz < 0.25 * tie.share.size
    fields = np.column_stack([mesh.points, mesh.points**2, mesh.points[:, 0] * mesh.points[:, 2]])
    found = (short @ fields)[tie.high]
    np.testing.assert_allclose(found, tie.share @ fields[tie.low], atol=1e-11)


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("n", [0, 2])
def test_matching_faces_tied_by_the_mortar(cell, n):
    """The same space, the same frequencies."""
    mesh = sector(9, (3, 2, 1), cell, bump=0.2)
    np.testing.assert_allclose(frequencies(unpaired(mesh), n), frequencies(mesh, n), rtol=1e-8)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_against_the_matching_mesh_and_refinement(n):
    """What the tie changes is below the error of the mesh, and falls with it."""
    errors = []
    for divisions in ((4, 2, 1), (8, 4, 2)):
        matching, tied = (
            frequencies(sector(9, divisions, "tetra10", slide=slide, straight=True), n)
            for slide in (0.0, 0.15)
        )
        errors.append((matching, abs(tied / matching - 1)))
    mesh_error = abs(errors[0][0] / errors[1][0] - 1)
    assert (errors[0][1] < np.maximum(mesh_error, 3e-3)).all()
    assert errors[1][1].max() < errors[0][1].max() / 2


@pytest.mark.parametrize("n, rigid", [(0, 2), (1, 2), (2, 0)])
def test_a_free_wheel_moves_rigidly(n, rigid):
    """Axial shift and turn in nodal diameter 0; a wave of shifts and one of tilts in 1."""
    mesh = sector(9, (3, 2, 1), slide=0.2, straight=True)
    body = supported(assemble(mesh, "blade", Material()), "")
    found = all_diameters(body, 6, [n])[0].frequencies
    assert np.count_nonzero(found == 0) == rigid
    assert rigid_basis(constrain(body, "clamp", n)).shape[1] == rigid


def test_rotation_and_all_diameters():
    """Preload in nodal diameter 0, one core for all diameters and a matrix for each agree."""
    mesh = sector(8, (3, 2, 1), slide=0.2, straight=True)
    body = body_under_rotation(assemble(mesh, "blade", Material()), 2000.0, linear=True)
    for found in all_diameters(body, 5):
        exact = modes(constrain(body, "clamp", found.nodal_diameter), 5).frequencies
        np.testing.assert_allclose(found.frequencies, exact, rtol=1e-8)


def test_a_direction_held_on_the_cut():
    """Axial displacement held on one side of the disc, which meets the cut faces."""
    found = []
    for slide in (0.0, 0.15):
        mesh = sector(9, (6, 3, 2), "tetra10", slide=slide, straight=True)
        body = supported(assemble(mesh, "blade", Material()), "clamp", directions=[("z0", "z")])
        found.append(modes(constrain(body, "clamp", 2), 5).frequencies)
    np.testing.assert_allclose(*found, rtol=2e-3)


def test_faces_that_are_not_alike_are_refused():
    mesh = sector(9, (3, 2, 1), slide=0.2, straight=True)
    high = mesh.faces["cyclic_high"]
    cut = replace(mesh, faces={**mesh.faces, "cyclic_high": high[: len(high) // 2]})
    with pytest.raises(InputError, match="of their area only"):
        constrain(assemble(cut, "blade", Material()), "clamp", 1)


@pytest.mark.mpi
def test_the_tie_does_not_depend_on_ranks():
    mesh = sector(9, (4, 2, 1), slide=0.2, straight=True)
    found = [
        modes(constrain(assemble(mesh, "blade", Material(), comm), "clamp", 2), 5).frequencies
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]
    np.testing.assert_allclose(*found, rtol=1e-10)
