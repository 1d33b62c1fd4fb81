"""The estimated error of frequencies by the mesh, against finer meshes and closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import factorial

import numpy as np
import pytest
from mixed import cut, row
from structured import box, sector, straightened
from twisted import twisted

from bladefem.errors import NotSolvedError
from bladefem.fem import stiffness_error as module
from bladefem.fem.body import assemble
from bladefem.fem.cell_functions import few_points, reference_nodes
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain, in_step
from bladefem.fem.cubic_functions import cubic_functions
from bladefem.fem.flexibility import flexible
from bladefem.fem.linear_preload import unit_speed_displacement
from bladefem.fem.modes import modes
from bladefem.fem.refinement import refine_uniformly
from bladefem.fem.rotation import state_tangent
from bladefem.fem.steady_state import SteadyState
from bladefem.fem.stiffness_error import frequency_errors, stiffness_error
from bladefem.scene.tables import Material

STEEL = Material(nu=0.3)
BAR = (0.5, 0.1, 0.1)
PLATE = (0.2, 0.1, 0.01)
WORDS = ("tetra10", "hexahedron27", "wedge18", "pyramid14", "tetra", "hexahedron")


def body_of(mesh):
    return assemble(mesh, "blade", STEEL, MPI.COMM_SELF)


def shape_of(word, divisions, size):
    """A box of cells of one shape."""
    if word in ("wedge18", "pyramid14"):
        return cut(box(divisions, size, "hexahedron27"), divisions, lambda i, j: word[0])
    return box(divisions, size, word)


def graded(divisions, size):
    """Hexahedra that are smaller at the clamp."""

    def towards_clamp(x):
        places = x.copy()
        places[:, 0] *= x[:, 0] / size[0]
        return places

    return straightened(box(divisions, size, "hexahedron27", map=towards_clamp))


@pytest.fixture(scope="module")
def exact():
    """Frequencies of fine meshes [Hz]: two bending pairs, torsion and extension of the bar in the
    order of their numbers; the plate.
    """
    bar = modes(constrain(body_of(graded((10, 4, 4), BAR))), 6).frequencies
    plate = modes(constrain(body_of(graded((12, 8, 2), PLATE))), 4).frequencies
    return {BAR: bar, PLATE: plate}


def shares(mesh, right):
    """Estimated over true errors of the frequencies."""
    body = body_of(mesh)
    found = modes(constrain(body), max(len(right), 6))
    count = len(right)
    return frequency_errors(body, found)[:count] / (found.frequencies[:count] / right - 1)


@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("divisions", [(5, 1, 1), (10, 2, 2)])
def test_clamped_bar(word, divisions, exact):
    """Bending, torsion and extension with one and two cells across. One across has no stress in
    torsion that would be recovered wrong.
    """
    count = 6 if word not in ("tetra", "hexahedron") else 2
    share = shares(shape_of(word, divisions, BAR), exact[BAR][:count])
    assert (share > 0.8).all() and (share < 2.3).all()


@pytest.mark.parametrize("word", WORDS[:4])
def test_clamped_plate(word, exact):
    """Cells five times as long as they are thick, and 2.5 times; the third mode bends in the plane
    of the plate.
    """
    for divisions, least in (((4, 2, 1), 0.5), ((8, 4, 1), 0.8)):
        share = shares(shape_of(word, divisions, PLATE), exact[PLATE])
        assert (share > least).all() and (share < 1.8).all()


def test_mixed_shapes(exact):
    for mesh in (row(), refine_uniformly(row())):
        share = shares(mesh, exact[BAR])
        assert (share > 0.8).all() and (share < 2.3).all()


def bracket(n, word):
    """A square without one quarter, whose corner is sharp; clamped at one side."""
    mesh = box((2 * n, 2 * n), (0.2, 0.2), word)
    centre = mesh.points[mesh.bodies["blade"]].mean(axis=1)
    cells = mesh.bodies["blade"][(centre[:, :2] < 0.1).any(axis=1)]
    used, local = np.unique(cells, return_inverse=True)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    faces = {"clamp": number[mesh.faces["x0"]]}
    return replace(
        mesh, points=mesh.points[used], bodies={"blade": local.reshape(cells.shape)}, faces=faces
    )


@pytest.mark.parametrize("word", ["triangle6", "quad9", "triangle", "quad"])
def test_sharp_corner(word):
    """The error is that of the corner, which cubics lower by no more than a third."""
    # the last three from meshes of 4 n, 8 n, 16 n cells by Richardson
    limits = [modes(constrain(body_of(bracket(n, "quad9"))), 1).frequencies[0] for n in (8, 16, 32)]
    first, second, third = limits
    right = third - (second - third) ** 2 / (first - 2 * second + third)
    for n in (2, 4):
        share = shares(bracket(n, word), np.array([right]))
        assert (share > 0.65).all() and (share < 1.3).all()


def test_refined_twisted_blade():
    """Curved, five times as long as thick: the frequencies of half the size say how much is true."""
    coarse = refine_uniformly(twisted())
    finest = modes(constrain(body_of(refine_uniformly(refine_uniformly(twisted())))), 3)
    share = shares(coarse, finest.frequencies)
    assert (share > 0.8).all() and (share < 2).all()


def test_estimate_of_a_rotating_blade():
    """Its shapes strain the body at rest by far more than the turned one: without the static state
    the estimate would be hundreds of times too large.
    """
    speed = 300.0
    found = []
    for mesh in (refine_uniformly(twisted()), refine_uniformly(refine_uniformly(twisted()))):
        body = body_of(mesh)
        swell = unit_speed_displacement(flexible(in_step(body)))
        state = SteadyState(speed**2 * swell, speed)
        turning = replace(body, K=state_tangent(body, state))
        found.append((body, state, modes(constrain(turning), 3)))
    (body, state, coarse), (*_, fine) = found
    true = coarse.frequencies / fine.frequencies - 1
    share = frequency_errors(body, coarse, state) / true
    assert (share > 0.8).all() and (share < 2).all()
    assert frequency_errors(body, coarse)[0] > 20 * true[0]


def test_energies_between_modes_tell_how_responses_change():
    """Heights of four resonances of a tapered, twisted blade, at its tip across the force, against
    a mesh twice as fine: +1.9, -3.1, +11 and -51 %. The energies between the modes, which turn
    their shapes, give the signs and sizes (+2.7, -2.0, +14 and -68 %); those of each mode alone do
    not (+3.3, +3.3, +11 and +15 %).
    """
    size, turn = (0.12, 0.02, 0.008), 0.8

    def bend(x):
        angle, width = turn * x[:, 0] / size[0], 1 - 0.35 * x[:, 0] / size[0]
        cos, sin = width * np.cos(angle), width * np.sin(angle)
        across, along = x[:, 1] * cos - x[:, 2] * sin, x[:, 1] * sin + x[:, 2] * cos
        return np.stack([x[:, 0], across, along], 1)

    def solved(divisions):
        origin = (0, -size[1] / 2, -size[2] / 2)
        body = body_of(box(divisions, size, "hexahedron27", origin=origin, map=bend))
        found = modes(constrain(body, "x0"), 8)
        at = np.unique(body.mesh.faces["x1"])
        tip = at[(body.mesh.points[at] @ [0, 1, 1.1]).argmax()]
        seen = found.shapes[:, tip] @ np.array([[0, 1, 0.6], [0, 0.2, 1]]).T
        return body, found, (2 * np.pi * found.frequencies) ** 2, seen

    def heights(squares, seen):
        damping = 0.002
        near = np.sqrt(squares[:4, None]) * (1 + damping * np.linspace(-3, 3, 301))
        below = squares - near[..., None] ** 2 + 2j * damping * np.sqrt(squares) * near[..., None]
        return abs((seen.prod(axis=1) / below).sum(axis=2)).max(axis=1)

    body, found, squares, seen = solved((4, 1, 1))
    energies = stiffness_error(body, found.shapes, squares)
    softer, vectors = np.linalg.eigh(np.diag(squares) - energies)
    before = heights(squares, seen)
    reported = heights(softer, vectors.T @ seen) / before - 1
    alone = heights(squares - energies.diagonal(), seen) / before - 1
    _, _, fine, fine_seen = solved((8, 2, 2))
    true = heights(fine, fine_seen) / before - 1
    assert ((reported / true > 0.5) & (reported / true < 2)).all()
    assert (alone / true)[[1, 3]].max() < 0


def test_forms_of_complex_waves():
    """Hermitian, not below zero, and turned with the modes."""
    body = body_of(sector(9, (3, 2, 1)))
    found = modes(constrain(body, nodal_diameter=2), 3)
    squares = (2 * np.pi * found.frequencies) ** 2
    energies = stiffness_error(body, found.shapes, squares)
    np.testing.assert_allclose(energies, energies.conj().T, rtol=1e-12)
    assert np.linalg.eigvalsh(energies)[0] > 0
    phase = np.exp(1j * np.array([0.3, 1.2, -2.0]))
    turned = stiffness_error(body, found.shapes * phase[:, None, None], squares)
    expected = phase.conj()[:, None] * energies * phase
    np.testing.assert_allclose(turned, expected, atol=2e-2 * abs(energies).max())


@pytest.mark.parametrize(
    ("word", "count"),
    [
        ("triangle", 7),
        ("triangle6", 4),
        ("quad", 12),
        ("quad9", 7),
        ("tetra", 16),
        ("tetra10", 10),
        ("hexahedron", 56),
        ("hexahedron27", 37),
        ("wedge", 34),
        ("wedge18", 22),
        ("pyramid", 25),
        ("pyramid14", 16),
    ],
)
def test_functions_of_third_order(word, count):
    """Zero at the nodes, independent, and with the cell's own all cubics of a simplex."""
    family = word.rstrip("0123456789")
    at, weight = few_points(family)
    values, slopes = cubic_functions(word, at)
    gram = np.einsum("qid,qjd,q->ij", slopes, slopes, weight)
    scale = np.sqrt(np.diag(gram))
    assert values.shape[1] == count
    assert np.linalg.eigvalsh(gram / scale / scale[:, None])[0] > 1e-6
    nodes = reference_nodes(word)
    assert abs(cubic_functions(word, nodes)[0]).max() < 1e-14


def test_the_fourteen_points_of_a_tetrahedron():
    """All monomials to degree 5, in closed form."""
    at, weight = few_points("tetra")
    for powers in product(range(6), repeat=3):
        if sum(powers) > 5:
            continue
        exact = np.prod([factorial(p) for p in powers]) / factorial(sum(powers) + 3)
        found = weight @ np.prod(at**powers, axis=1)
        assert found == pytest.approx(exact, rel=1e-13)


def test_an_energy_that_is_not_found_is_not_told(monkeypatch):
    """What conjugate gradients have found before their end is too small."""
    monkeypatch.setattr(module, "MAX_STEPS", 1)
    body = body_of(box((2, 1, 1), BAR, "hexahedron27"))
    with pytest.raises(NotSolvedError, match="1 conjugate gradients still add more than 1 % each"):
        frequency_errors(body, modes(constrain(body), 2))
