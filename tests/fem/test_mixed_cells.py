"""Cells of mixed shapes solved as what they are: closed forms that second-order cells hold exactly,
CalculiX's elements assembled beside, and the same numbers on any number of ranks.
"""

import json
from dataclasses import replace
from pathlib import Path

import decks
import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg
from mixed import row, serendipity_matrices, skew
from structured import box, turn

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import at_diameter, constrain, transformation
from bladefem.fem.held_part import part_above
from bladefem.fem.linear_preload import linear_tangent, thermal_force
from bladefem.fem.loads import body_mass, centrifugal
from bladefem.fem.mixed_cells import drawn_nodes
from bladefem.fem.modes import modes
from bladefem.fem.preload import preload
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.temperature import Temperatures
from bladefem.scene.tables import Material
from geometry.imported import read_mesh
from geometry.whole_cells import own_cells

GOLDEN = json.loads((Path(__file__).parent / "ccx_decks.json").read_text())
STEEL = Material()
SIZE = (0.5, 0.1, 0.1)


def dense(body, matrix):
    """A matrix on one rank in mesh numbering."""
    starts, columns, values = matrix.getValuesCSR()
    rows = body.scalar_rows
    return sp.csr_matrix((values, columns, starts), matrix.getSize())[rows][:, rows]


def cells_by_shape(mesh):
    return {own.word: own.cells for own in own_cells(mesh, ("blade",))}


def test_all_shapes_are_there():
    mesh = row()
    count = {word: len(cells) for word, cells in cells_by_shape(mesh).items()}
    assert count == {"hexahedron27": 2, "wedge18": 4, "pyramid14": 5, "tetra10": 2}
    body = assemble(mesh, "blade", STEEL)
    assert len(body.pieces) == 4 and (body.rows >= 0).all()


@pytest.mark.parametrize("word", ["wedge18", "pyramid14"])
def test_nodes_drawn_together_hold_quadratic_fields(word):
    """In each straight cell, at the places where its nodes lie."""
    body = assemble(row(map=skew), "blade", STEEL)
    cells = cells_by_shape(body.mesh)[word]
    x = body.mesh.points[cells] / 0.1
    T = drawn_nodes(word)
    at = np.einsum("nk,ckd->cnd", T, x)

    def field(p):
        a, b, c = np.moveaxis(p, -1, 0)
        return 1 + a - 2 * b + a * b - 3 * b * c + 0.5 * c * c - b * b + 2 * a * c + a * a

    np.testing.assert_allclose(np.einsum("nk,ck->cn", T, field(x)), field(at), atol=1e-10)


def test_energy_of_quadratic_displacements_is_exact():
    """A bar in pure bending has no shear and one stress: closed form on straight cells of any
    shape.
    """
    material = replace(STEEL, nu=0.0)
    body = assemble(row(), "blade", material)
    K = dense(body, body.K)
    x, y, _ = body.mesh.points.T
    u = np.stack([x * (y - 0.05), -(x**2) / 2, 0 * x], axis=1).ravel()
    inertia = 0.1 * 0.1**3 / 12
    assert u @ K @ u == pytest.approx(material.E * inertia * 0.5, rel=1e-10)
    # held at the ends by nodal forces there alone: all shapes balance across their faces
    force = (K @ u).reshape(-1, 3)
    inner = (x > 1e-9) & (x < 0.5 - 1e-9)
    assert abs(force[inner]).max() < 1e-9 * abs(force).max()


def test_even_strain_is_held_at_the_surface_alone():
    """The patch test, on skewed cells."""
    body = assemble(row(map=skew), "blade", STEEL)
    rng = np.random.default_rng(1)
    gradient = rng.normal(size=(3, 3))
    K = dense(body, body.K)
    force = (K @ (body.mesh.points @ gradient.T).ravel()).reshape(-1, 3)
    raw = row().points / SIZE
    inside = ((raw > 1e-9) & (raw < 1 - 1e-9)).all(axis=1)
    assert inside.sum() > 5
    assert abs(force[inside]).max() < 1e-10 * abs(force).max()
    strain = (gradient + gradient.T) / 2
    lam = STEEL.E * STEEL.nu / ((1 + STEEL.nu) * (1 - 2 * STEEL.nu))
    mu = STEEL.E / (2 * (1 + STEEL.nu))
    energy = lam * np.trace(strain) ** 2 + 2 * mu * (strain**2).sum()
    volume = 5e-3 * np.linalg.det(skew(np.eye(3)))
    moved = (body.mesh.points @ gradient.T).ravel()
    assert moved @ K @ moved == pytest.approx(energy * volume, rel=1e-10)


def test_mass_and_centrifugal_force():
    body = assemble(row(), "blade", STEEL)
    mass = STEEL.rho * 5e-3
    assert body_mass(body) == pytest.approx(mass, rel=1e-12)
    M = dense(body, body.M)
    x = np.zeros_like(body.mesh.points)
    x[:, 0] = body.mesh.points[:, 0]
    assert x.ravel() @ M @ x.ravel() == pytest.approx(mass * 0.5**2 / 3, rel=1e-12)
    force = centrifugal(body, 100.0).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(0), 1e4 * mass * np.array([0.25, 0.05, 0]), atol=1e-6)
    # the same force as the mass matrix gives: both are of the cells' own shape functions
    across = (body.mesh.points * [1, 1, 0]).ravel()
    np.testing.assert_allclose(force.ravel(), 1e4 * (M @ across), atol=1e-9 * abs(force).max())


def test_a_row_vibrates_like_hexahedra():
    """Finer hexahedra say what is right; tetrahedra in the same nodes are further from it."""
    mesh = row()
    right = modes(constrain(assemble(box((20, 4, 4), SIZE, "hexahedron27"), "blade", STEEL)), 4)
    own, split = (
        modes(constrain(assemble(m, "blade", STEEL)), 4).frequencies / right.frequencies - 1
        for m in (mesh, replace(mesh, whole={}))
    )
    assert (own > 0).all() and (own < split).all()
    # bending
    assert (own[:2] < 0.6 * split[:2]).all() and own[:2].max() < 0.015


def sector_mesh(tmp_path, *divisions):
    model = decks.model("c3d15_c3d20", *divisions)
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(model, {})))
    return model, read_mesh(tmp_path / "a.inp", sectors=decks.SECTORS)


def serendipity_frequencies(model, n, exact):
    """The lowest six [Hz] of a nodal diameter of the deck with its own elements."""
    K, M = serendipity_matrices(model, STEEL.E, STEEL.nu, STEEL.rho, exact)
    angle = 2 * np.pi / decks.SECTORS
    low, high = (model.node_sets[name] for name in ("cyclic_low", "cyclic_high"))
    turned = model.points[low] @ turn(angle).T
    partner = abs(turned[None] - model.points[high][:, None]).sum(2).argmin(axis=1)
    T = sp.lil_matrix(sp.identity(K.shape[0], dtype=complex))
    for h, p in zip(high, low[partner], strict=True):
        T[3 * h : 3 * h + 3, 3 * h : 3 * h + 3] = 0
        T[3 * h : 3 * h + 3, 3 * p : 3 * p + 3] = np.exp(1j * n * angle) * turn(angle)
    gone = np.zeros(len(model.points), bool)
    gone[model.node_sets["clamp"]] = gone[high] = True
    T = T.tocsc()[:, np.flatnonzero(np.repeat(~gone, 3))]
    A, B = ((T.conj().T @ part @ T).tocsc() for part in (K, M))
    found = scipy.sparse.linalg.eigsh(A, 6, M=B, sigma=0, return_eigenvectors=False)
    return np.sort(np.sqrt(found.real)) / (2 * np.pi)


@pytest.mark.parametrize("n", [0, 1])
def test_against_the_elements_of_calculix(n, tmp_path):
    """Those with CalculiX's integration are CalculiX; the cells here hold all that these hold, so
    with exact integration no frequency lies above (Rayleigh), and all lie near.
    """
    model, mesh = sector_mesh(tmp_path)
    theirs = serendipity_frequencies(model, n, exact=False)
    np.testing.assert_allclose(theirs, GOLDEN["c3d15_c3d20"][str(n)], rtol=1e-6)
    bound = serendipity_frequencies(model, n, exact=True)
    t = transformation(assemble(mesh, "blade", STEEL), "clamp", True)
    own = modes(at_diameter(t, n), 6).frequencies
    assert (own < bound * (1 + 1e-9)).all() and (own > bound * (1 - 2e-3)).all()


def test_thermal_force_is_that_of_free_expansion():
    """Evenly hot cells that may expand are free of stress, an unevenly hot bar bends as it should."""
    mesh = row(map=skew)
    warm = replace(STEEL, expansion=1e-5)
    body = assemble(mesh, "blade", warm, heat=Temperatures(np.full(len(mesh.points), 400.0), 300.0))
    force = dense(body, body.K) @ (1e-3 * mesh.points).ravel()
    np.testing.assert_allclose(thermal_force(body), force, atol=1e-10 * abs(force).max())
    mesh = row()
    x, y, z = mesh.points.T
    body = assemble(mesh, "blade", warm, heat=Temperatures(300.0 + 1e3 * y, 300.0))
    bent = 1e-2 * np.stack([x * y, (y**2 - x**2 - z**2) / 2, y * z], axis=1)
    force = dense(body, body.K) @ bent.ravel()
    np.testing.assert_allclose(thermal_force(body), force, atol=1e-10 * abs(force).max())


def test_rotation_of_mixed_cells():
    """Without speed the tangent is the stiffness; with it, both preloads agree with hexahedra."""
    mixed, cubes = (
        replace(mesh, points=mesh.points + [0.3, -0.05, -0.05])
        for mesh in (row(), box((5, 1, 1), SIZE, "hexahedron27"))
    )
    body = assemble(mixed, "blade", STEEL)
    at_rest = linear_tangent(body, np.zeros_like(mixed.points), 0.0)
    a, b = dense(body, at_rest), dense(body, body.K)
    assert abs(a - b).max() < 1e-12 * abs(b).max()
    state = preload(body, 900.0, "clamp")
    assert state.residual < 1e-9
    other = assemble(cubes, "blade", STEEL)
    for linear in (False, True):
        found, expected = (
            modes(constrain(body_under_rotation(some, 900.0, linear=linear)), 3).frequencies
            for some in (body, other)
        )
        np.testing.assert_allclose(found, expected, rtol=0.02)
    end, corner = (
        u[mesh.nodes["end"] if mesh is mixed else np.unique(mesh.faces["x1"]), 0].mean()
        for mesh, u in ((mixed, state.displacement), (cubes, preload(other, 900.0).displacement))
    )
    assert end == pytest.approx(corner, rel=1e-3)


def test_parts_keep_whole_cells():
    mesh = row()
    part, held = part_above(mesh, 0.15)
    assert len(part.whole["blade"]) == len(part.bodies["blade"]) < len(mesh.bodies["blade"])
    # the wedges that reach across it are there with all their pieces
    count = {word: len(cells) for word, cells in cells_by_shape(part).items()}
    assert count["wedge18"] == 4 and len(held)


def test_a_wedge_that_is_turned_over():
    """Its middle of an edge beyond the far corner; the tetrahedra alone would not tell which."""
    mesh = row()
    points = mesh.points.copy()
    node = np.flatnonzero(abs(points - [0.15, 0.1, 0.0]).max(axis=1) < 1e-9)
    assert len(node) == 1
    points[node] = [0.15, 0.1, 0.3]
    with pytest.raises(InputError, match="elements are turned over"):
        assemble(replace(mesh, points=points), "blade", STEEL)


@pytest.mark.mpi
@pytest.mark.several_ranks
@pytest.mark.parametrize("n", [pytest.param(0, marks=pytest.mark.two_ranks), 2])
def test_mixed_cells_do_not_depend_on_ranks(n, tmp_path):
    _, mesh = sector_mesh(tmp_path, (4, 3, 2))
    assert len(cells_by_shape(mesh)) > 1
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        body = body_under_rotation(assemble(mesh, "blade", STEEL, comm), 300.0)
        found.append(modes(constrain(body, "clamp", n), 6))
    together, alone = found
    np.testing.assert_allclose(together.frequencies, alone.frequencies, rtol=1e-9)
    np.testing.assert_allclose(together.shapes, alone.shapes, atol=1e-6 * abs(alone.shapes).max())
