"""Ties, several bodies, quadrature choices: what the transformation does besides cyclic
symmetry.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, sector

from bladefem.errors import InputError, NotSolvedError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import flexible
from bladefem.fem.linalg import factorise
from bladefem.fem.loads import body_mass
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material

STEEL = Material()


def middle_nodes(mesh, face):
    """(k, 3) middle node and its two corners of each edge of a face of tetra10."""
    triangles = mesh.faces[face]
    edges = np.concatenate(
        [triangles[:, [3, 0, 1]], triangles[:, [4, 1, 2]], triangles[:, [5, 2, 0]]]
    )
    return edges[np.unique(edges[:, 0], return_index=True)[1]]


@pytest.mark.mpi
@pytest.mark.parametrize("n", [None, 0, 1, 3])
def test_ties_hold_and_stiffen(n):
    """Also where tied nodes lie on the cut faces: rim to rim the tied face has edges on both."""
    mesh = box((3, 2, 2), (1.0, 0.2, 0.2)) if n is None else sector(6, (2, 2, 1), bump=0.2)
    ties = middle_nodes(mesh, "x1")
    body = assemble(mesh, "blade", STEEL)
    tied, free = (modes(constrain(body, "clamp", n, t), 6) for t in (ties, None))
    u = tied.shapes
    np.testing.assert_allclose(
        u[:, ties[:, 0]], (u[:, ties[:, 1]] + u[:, ties[:, 2]]) / 2, atol=1e-12 * abs(u).max()
    )
    assert (tied.frequencies > free.frequencies * (1 - 1e-9)).all()
    if n is not None:
        low, high = mesh.pairs["cyclic"].nodes
        turned = np.exp(2j * np.pi * n / 6) * u[:, low] @ mesh.sector.rotation.T
        np.testing.assert_allclose(u[:, high], turned, atol=1e-9 * abs(u).max())


def test_two_bodies_of_different_material():
    """A bar of two halves at nu = 0: tan(k1 l) tan(k2 l) = Z1 / Z2 for the first extension mode."""
    mesh = box((8, 1), (1.0, 0.05), "quad9")
    cells = mesh.bodies["blade"]
    left = mesh.points[cells[:, 8], 0] < 0.5
    mesh = replace(mesh, bodies={"root": cells[left], "tip": cells[~left]})
    soft, hard = Material(E=1e11, nu=0.0, rho=4000.0), Material(E=2e11, nu=0.0, rho=8000.0)
    body = assemble(mesh, ("root", "tip"), {"root": hard, "tip": soft})
    f = modes(constrain(body), 12).frequencies
    speed, ratio = 5000.0, 2.0  # same wave speed, impedances 4e7 and 2e7
    exact = np.arctan(np.sqrt(ratio)) * speed / 0.5 / (2 * np.pi)
    assert abs(f / exact - 1).min() < 1e-5
    assert body_mass(body) == pytest.approx(0.05 * 0.5 * 12000)


def test_missing_body_material_and_quadrature_are_refused():
    mesh = box((1, 1, 1), (1.0, 1.0, 1.0), "tetra")
    with pytest.raises(InputError, match="no body 'blad'; did you mean 'blade'"):
        assemble(mesh, "blad", STEEL)
    with pytest.raises(InputError, match="body 'blade' has no material"):
        assemble(mesh, "blade", {"disc": STEEL})
    with pytest.raises(InputError, match="quadrature is 'exakt'; did you mean 'exact'"):
        assemble(mesh, "blade", STEEL, quadrature="exakt")
    with pytest.raises(InputError, match="not supported"):
        assemble(replace(mesh, cell_type="pyramid"), "blade", STEEL)


def test_turned_over_elements_are_refused():
    """A middle node pulled across its element; dolfinx alone would say nothing."""
    mesh = box((2, 2, 2), (1.0, 1.0, 1.0))
    points = mesh.points.copy()
    cell = mesh.bodies["blade"][0]
    points[cell[4]] = points[cell[3]] * 1.6 - points[cell[0]] * 0.6
    with pytest.raises(InputError, match="of 48 elements are turned over"):
        assemble(replace(mesh, points=points), "blade", STEEL)


def test_not_a_number_is_refused():
    mesh = box((1, 1, 1), (1.0, 1.0, 1.0), "tetra")
    points = mesh.points.copy()
    points[3, 1] = np.nan
    with pytest.raises(InputError, match="not finite"):
        assemble(replace(mesh, points=points), "blade", STEEL)


def test_everything_clamped_is_refused():
    mesh = box((1, 1), (1.0, 1.0), "quad")
    mesh = replace(mesh, nodes={"all": np.arange(len(mesh.points))})
    with pytest.raises(InputError, match="no free node left"):
        constrain(assemble(mesh, "blade", STEEL), "all")


def test_an_indefinite_matrix_says_so():
    """Cholesky of -K: MUMPS itself would go on in silence."""
    con = constrain(assemble(box((2, 1, 1), (1.0, 1.0, 1.0)), "blade", STEEL))
    negative = con.K.duplicate(copy=True)
    negative.scale(-1.0)
    with pytest.raises(
        NotSolvedError, match=r"not positive definite, MUMPS met .* negative pivots"
    ):
        factorise(negative)


def test_a_floating_sector_without_props_says_so():
    con = constrain(assemble(sector(6, (2, 2, 1)), "blade", STEEL), None, 0)
    with pytest.raises(NotSolvedError, match="float"):
        factorise(con.K)
    assert flexible(con).R.shape[1] == 2


@pytest.mark.mpi
@pytest.mark.two_ranks
def test_symmetry_planes_leave_the_symmetric_modes():
    """Half and quarter of a bar, sliding in the cut planes, vibrate as the whole one does in its
    symmetric modes.
    """
    whole = box((4, 4, 4), (1.0, 0.3, 0.2), origin=(0.0, -0.15, -0.1), cell_type="hexahedron27")
    half = box((4, 4, 2), (1.0, 0.3, 0.1), cell_type="hexahedron27", origin=(0.0, -0.15, 0.0))
    quarter = box((4, 2, 2), (1.0, 0.15, 0.1), cell_type="hexahedron27")
    half = replace(half, faces={**half.faces, "symmetry_z": half.faces["z0"]})
    quarter = replace(
        quarter,
        faces={
            **quarter.faces,
            "symmetry_z": quarter.faces["z0"],
            "symmetry_y": quarter.faces["y0"],
        },
    )
    every, plane, both = (
        modes(constrain(assemble(m, "blade", STEEL)), k)
        for m, k in ((whole, 16), (half, 6), (quarter, 2))
    )
    assert (
        abs(every.frequencies - plane.frequencies[:, None]).min(1).max()
        < 1e-9 * every.frequencies[-1]
    )
    assert (
        abs(plane.frequencies - both.frequencies[:, None]).min(1).max()
        < 1e-9 * every.frequencies[-1]
    )
    assert abs(plane.shapes[:, np.unique(half.faces["z0"]), 2]).max() == 0
    assert (
        constrain(assemble(quarter, "blade", STEEL), None).T.shape[1]
        == both.shapes[0].size - 2 * 45
    )


def test_an_antisymmetry_plane_leaves_the_other_modes():
    whole = box((4, 4, 4), (1.0, 0.3, 0.2), origin=(0.0, -0.15, -0.1), cell_type="hexahedron27")
    half = box((4, 4, 2), (1.0, 0.3, 0.1), cell_type="hexahedron27", origin=(0.0, -0.15, 0.0))
    sides = [
        replace(half, faces={**half.faces, name: half.faces["z0"]})
        for name in ("symmetry_z", "antisymmetry_z")
    ]
    every, even, odd = (
        modes(constrain(assemble(m, "blade", STEEL)), 8).frequencies for m in (whole, *sides)
    )
    np.testing.assert_allclose(np.sort(np.r_[even, odd])[:8], every, rtol=1e-9)


def test_a_floating_half_keeps_the_rigid_motions_in_its_plane():
    mesh = box((2, 2, 2), (1.0, 1.0, 1.0))
    mesh = replace(mesh, faces={**mesh.faces, "symmetry_y": mesh.faces["y0"]})
    found = modes(constrain(assemble(mesh, "blade", STEEL), None), 5).frequencies
    assert (found[:3] == 0).all() and (found[3:] > 0).all()


def test_symmetry_planes_that_are_none_are_refused():
    mesh = box((2, 1, 1), (1.0, 1.0, 1.0))
    with pytest.raises(InputError, match=r"symmetry_y.*extends from 0 to 1 m"):
        constrain(
            assemble(
                replace(mesh, faces={**mesh.faces, "symmetry_y": mesh.faces["x0"]}), "blade", STEEL
            )
        )
    wheel = sector(6, (2, 2, 1))
    held = replace(
        wheel, faces={**wheel.faces, "symmetry_x": np.array([[wheel.points[:, 0].argmax()]])}
    )
    with pytest.raises(InputError, match="not across the axis"):
        constrain(assemble(held, "blade", STEEL), "clamp", 1)


@pytest.mark.parametrize("n", [0, 1])
def test_half_the_thickness_of_a_wheel(n):
    whole, half = (
        sector(6, (3, 2, 2), "hexahedron27", width=0.04),
        sector(6, (3, 2, 1), "hexahedron27", width=0.02),
    )
    half = replace(half, faces={**half.faces, "symmetry_z": half.faces["z0"]})
    every, plane = (
        modes(constrain(assemble(m, "blade", STEEL), "clamp", n), k).frequencies
        for m, k in ((whole, 12), (half, 3))
    )
    assert (abs(every / plane[:, None] - 1).min(1) < 1e-9).all()
