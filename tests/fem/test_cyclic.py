"""A sector in every nodal diameter against the full wheel made of its copies, and how wrong input
is refused.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import box, sector, turn, wheel

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain, transformation
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material
from bladefem.study.modes.effective_mass import effective_masses
from geometry.mesh import Pair

STEEL = Material()


def sector_frequencies(mesh, count, clamp="clamp"):
    """All frequencies of the wheel, each as often as the wheel has it."""
    body = assemble(mesh, "blade", STEEL)
    out = []
    for n in range(mesh.sector.count // 2 + 1):
        f = modes(constrain(body, clamp, n), count).frequencies
        out.append(np.repeat(f, 1 if 2 * n % mesh.sector.count == 0 else 2))
    return np.sort(np.concatenate(out))


@pytest.mark.parametrize("cell_type", ["tetra10", "tetra", "hexahedron27"])
@pytest.mark.parametrize("axis, sense", [(2, 1), (0, -1)])
@pytest.mark.parametrize("count", [6, 7])
def test_sector_equals_full_wheel(cell_type, axis, sense, count):
    """64 modes, even and odd sector counts, both senses of the cut faces: same mesh, same
    arithmetic up to rounding.
    """
    mesh = sector(count, (3, 2, 1), cell_type, axis=axis, sense=sense, bump=0.2)
    whole = modes(constrain(assemble(wheel(mesh)[0], "blade", STEEL)), 64, prove=True).frequencies
    parts = sector_frequencies(mesh, 20)[:64]
    np.testing.assert_allclose(parts, whole, rtol=1e-9)


def test_half_wheel_equals_the_whole_one():
    """Both nodal diameters are standing waves; effective masses are the whole wheel's. The rows of
    both translations were one, with the mean of both.
    """
    mesh = sector(2, (3, 4, 1), bump=0.2)
    body = assemble(mesh, "blade", STEEL)
    whole = assemble(wheel(mesh)[0], "blade", STEEL)
    expected = modes(constrain(whole), 24)
    np.testing.assert_allclose(sector_frequencies(mesh, 20)[:24], expected.frequencies, rtol=1e-9)
    found = effective_masses([modes(constrain(body, nodal_diameter=n), 20) for n in (0, 1)], body)
    straight = effective_masses([expected], whole)
    for direction in ("x", "y", "z", "rz"):
        few, rows = (t[t["direction"] == direction] for t in (found, straight))
        few = few[few["frequency"] < 1.0001 * expected.frequencies[-1]]
        largest = rows["share"].max()
        assert few["share"].sum() == pytest.approx(rows["share"].sum(), rel=1e-6)
        assert few["effective_mass"].sum() == pytest.approx(rows["effective_mass"].sum(), rel=1e-6)
        assert few["share"].max() == pytest.approx(largest, rel=1e-6)


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_floating_sector_has_exact_rigid_motions(n):
    """Two at n = 0 (along and about the axis), two at n = 1 (across, tilt), none beyond."""
    mesh = sector(6, bump=0.2)
    f = modes(constrain(assemble(mesh, "blade", STEEL), None, n), 4).frequencies
    assert (f == 0).sum() == (2 if n < 2 else 0)


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_shapes_repeat_across_the_cut(n):
    mesh = sector(6, bump=0.2)
    shapes = modes(constrain(assemble(mesh, "blade", STEEL), "clamp", n), 5).shapes
    low, high = mesh.pairs["cyclic"].nodes
    turned = np.exp(2j * np.pi * n / 6) * shapes[:, low] @ mesh.sector.rotation.T
    np.testing.assert_allclose(shapes[:, high], turned, atol=1e-12 * abs(shapes).max())


def test_count_is_proved_by_inertia():
    body = assemble(sector(6, (2, 2, 1), bump=0.2), "blade", STEEL)
    for n in range(4):
        assert modes(constrain(body, "clamp", n), 12, prove=True).residuals.max() < 1e-6


def test_unmatched_faces_name_the_worst_pair():
    mesh = sector(6)
    low, high = mesh.pairs["cyclic"].nodes
    points = mesh.points.copy()
    points[high[3]] += [0, 0, 1e-3]
    body = assemble(replace(mesh, points=points), "blade", STEEL)
    with pytest.raises(
        InputError, match=rf"nodes {low[3]} at .* and {high[3]} at .* 1.00e-03 m apart"
    ):
        transformation(body, "clamp", True)


def test_missing_partner_is_refused():
    mesh = sector(6)
    pair = mesh.pairs["cyclic"]
    short = Pair(pair.master, pair.slave, pair.nodes[:, 1:], pair.rotation, pair.shift)
    with pytest.raises(InputError, match="without a partner"):
        constrain(assemble(replace(mesh, pairs={"cyclic": short}), "blade", STEEL), "clamp", 1)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"clamp": "bore"}, "no face or node set 'bore'"),
        ({"nodal_diameter": 4}, "nodal_diameter is 4, expected a whole number from 0 to 3"),
        ({"nodal_diameter": 1.5}, "expected a whole number"),
    ],
)
def test_wrong_words_are_refused(change, message):
    body = assemble(sector(6), "blade", STEEL)
    with pytest.raises(InputError, match=message):
        constrain(body, **{"clamp": "clamp", "nodal_diameter": 1, **change})


def test_no_cyclic_faces():
    with pytest.raises(InputError, match="no pair 'cyclic'"):
        constrain(assemble(box((1, 1, 1), (1, 1, 1), "tetra"), "blade", STEEL), "clamp", 1)


def test_rotation_convention():
    """The pair's rotation takes the low face to the high face."""
    mesh = sector(6, axis=1, sense=-1)
    np.testing.assert_allclose(mesh.sector.rotation, turn(-np.pi / 3, 1))
