"""MAC, mode names and effective masses of a beam-like blade with closed-form modes; transfer
between meshes.
"""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.data import ModeSet
from bladefem.scene.toml import load_scene
from bladefem.study.modes.comparison import (
    blade_root,
    family_table,
    mac,
    mac_of,
    pure_shapes,
)
from bladefem.study.modes.mesh_transfer import (
    MID_SIDE_EDGES,
    nodal_volumes,
    simplices,
    transfer_fields,
)
from bladefem.study.modes.survey import clamped_blade
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import find_modes
from bladefem.study.pipeline.scene_mesh import build_mesh
from geometry.mesh import Mesh


def prism(shape, span=0.12, twist=0.0, chord=0.04, thickness=0.004):
    """A twisted rectangular blade above x = 0.2: hexahedra, nodes of a regular grid."""
    axes = [
        np.linspace(a, b, n + 1)
        for (a, b), n in zip(((0, 1), (-0.5, 0.5), (-0.5, 0.5)), shape, strict=True)
    ]
    unit = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    angle = twist * unit[:, 0]
    y, z = thickness * unit[:, 1], chord * unit[:, 2]
    points = np.stack(
        [
            0.2 + span * unit[:, 0],
            y * np.cos(angle) - z * np.sin(angle),
            y * np.sin(angle) + z * np.cos(angle),
        ],
        1,
    )
    number = np.arange(len(points)).reshape([n + 1 for n in shape])
    corner = [
        number[a : a + shape[0], b : b + shape[1], c : c + shape[2]].ravel()
        for a, b, c in (
            (0, 0, 0),
            (1, 0, 0),
            (1, 1, 0),
            (0, 1, 0),
            (0, 0, 1),
            (1, 0, 1),
            (1, 1, 1),
            (0, 1, 1),
        )
    ]
    return Mesh(points, "hexahedron", {"blade": np.stack(corner, 1)})


def second_order(mesh):
    """The same block in P2 tetrahedra, straight sides."""
    cells = simplices(mesh, mesh.bodies["blade"]).reshape(-1, 4)
    pairs = np.sort(cells[:, list(MID_SIDE_EDGES["tetra10"])].reshape(-1, 2), axis=1)
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    points = np.concatenate([mesh.points, mesh.points[unique].mean(axis=1)])
    return Mesh(
        points, "tetra10", {"blade": np.hstack([cells, len(mesh.points) + inverse.reshape(-1, 6)])}
    )


def test_mac_of_a_phase_and_of_orthogonal_shapes():
    rng = np.random.default_rng(1)
    shapes = rng.normal(size=(3, 50, 3)) + 1j * rng.normal(size=(3, 50, 3))
    turned = (
        shapes
        * np.exp(1j * rng.uniform(0, 6, 3))[:, None, None]
        * np.array([1, -3, 0.1])[:, None, None]
    )
    a, b = (ModeSet(np.ones(3), s, 2, np.zeros(3)) for s in (shapes, turned))
    match = mac(a, b)
    assert np.allclose(np.diag(match), 1.0)
    assert np.all(match - np.eye(3) < 0.2)
    apart = np.zeros((2, 10, 3))
    apart[0, :, 0] = apart[1, :, 1] = 1.0
    assert np.allclose(mac_of(apart, apart, np.ones(10)), np.eye(2))


@pytest.mark.parametrize("twist", [0.0, 0.6])
def test_pure_motions_are_named(twist):
    """Cantilever shapes in the turning axes of a twisted blade carry their own name with MAC above
    0.97.
    """
    mesh = prism((24, 2, 8), twist=twist)
    shapes = pure_shapes(mesh, np.arange(len(mesh.points)), 0.2)
    s = (mesh.points[:, 0] - 0.2) / 0.12
    thin = np.stack([0 * s, np.cos(twist * s), np.sin(twist * s)], 1)
    first_flap = (s**2 * (6 - 4 * s + s**2))[:, None] * thin  # static shape under a uniform load
    modes = ModeSet(
        np.arange(1.0, 5),
        np.stack(
            [first_flap, shapes["second flap"], shapes["first edge"], shapes["first torsion"]]
        ),
        None,
        np.zeros(4),
    )
    table = family_table(modes, mesh)
    assert table["family"].tolist() == ["first flap", "second flap", "first edge", "first torsion"]
    assert table["mac"].min() > 0.97


def test_clamped_blade_as_reference_and_disc_modes():
    mesh = prism((24, 2, 8))
    pure = pure_shapes(mesh, np.arange(len(mesh.points)), 0.2)
    shapes = np.stack([pure["first flap"], pure["first torsion"]])
    clamped = ModeSet(np.array([100.0, 500.0]), shapes, None, np.zeros(2))
    low = np.zeros((len(mesh.points), 3))
    low[mesh.points[:, 0] < 0.23, 2] = 1.0
    mixed = 0.9 * pure["first flap"] + 0.1 * pure["second flap"]
    modes = ModeSet(np.array([90.0, 300.0]), np.stack([mixed, low]), 3, np.zeros(2))
    table = family_table(modes, mesh, clamped, root=0.25)
    assert table["family"].tolist() == ["first flap", "foot"]
    assert table["aerofoil_share"].iloc[1] == 0.0


def test_modes_that_the_clamp_mixes_are_named_after_the_closer_reference():
    """A torsion that the clamped blade only has mixed with flap keeps its name, and so does the
    mixture.
    """
    mesh = prism((24, 2, 8))
    pure = pure_shapes(mesh, np.arange(len(mesh.points)), 0.2)
    flap, turn = (
        pure[name] / np.linalg.norm(pure[name]) for name in ("second flap", "first torsion")
    )
    clamped = ModeSet(
        np.array([500.0, 510.0]),
        np.stack([flap + 0.9 * turn, turn - 0.9 * flap]),
        None,
        np.zeros(2),
    )
    modes = ModeSet(np.array([490.0, 495.0]), np.stack([turn, flap + 0.8 * turn]), 3, np.zeros(2))
    table = family_table(modes, mesh, clamped, root=0.2)
    assert (
        table["family"].tolist() == ["first torsion", "second flap"] and table["mac"].min() > 0.99
    )


def test_second_best_modes_are_called_coupled_and_weak_ones_mixed():
    mesh = prism((24, 2, 8))
    pure = pure_shapes(mesh, np.arange(len(mesh.points)), 0.2)
    noise = np.random.default_rng(0).normal(size=mesh.points.shape)
    stack = np.stack([pure["first flap"], pure["first flap"] + 0.5 * pure["first edge"], noise])
    table = family_table(ModeSet(np.arange(1.0, 4), stack, None, np.zeros(3)), mesh)
    assert table["family"].tolist() == ["first flap", "first flap, coupled", "mixed"]


def test_transfer_is_exact_for_quadratics_on_second_order_cells():
    block = second_order(prism((6, 2, 3), twist=0.4))
    x, y, z = block.points.T
    field = np.stack([x * y, y**2 - z, 1 + x * z], 1)[None]
    rng = np.random.default_rng(0)
    cells = block.bodies["blade"][rng.integers(len(block.bodies["blade"]), size=200), :4]
    inside = np.einsum("kc,kci->ki", rng.dirichlet(np.ones(4), 200), block.points[cells])
    x, y, z = inside.T
    assert np.allclose(
        transfer_fields(block, field, inside)[0],
        np.stack([x * y, y**2 - z, 1 + x * z], 1),
        atol=1e-12,
    )


def test_mac_between_two_meshes():
    """The same smooth shapes sampled on two hexahedral meshes: diagonal above 0.999 with linear
    interpolation.
    """
    fine, coarse = prism((40, 2, 10), twist=0.3), prism((24, 2, 6), twist=0.3)
    sets = []
    for mesh in (fine, coarse):
        pure = pure_shapes(mesh, np.arange(len(mesh.points)), 0.2)
        shapes = np.stack([pure[name] for name in ("first flap", "second flap", "first torsion")])
        sets.append(ModeSet(np.ones(3), shapes, None, np.zeros(3)))
    match = mac(*sets, fine, coarse)
    assert np.all(np.diag(match) > 0.999)
    assert np.max(match - np.diag(np.diag(match))) < 0.05


def test_nodal_volumes_add_up():
    assert np.isclose(nodal_volumes(prism((12, 2, 4))).sum(), 0.12 * 0.04 * 0.004)


def test_wheel_modes_are_called_after_the_clamped_aerofoil():
    """The disc shifts and mixes the modes; beyond the lowest the clamped aerofoil is much closer
    than a beam is.
    """
    scene = load_scene("scenes/wedge.toml", ["mesh.size=24 mm", "mesh.scale=1.5"])
    whole = Bodies(scene, build_mesh(scene))
    held = clamped_blade(whole)
    modes = find_modes(whole, [6], 8)[0]
    pure, named = (family_table(modes, whole.mesh, clamped) for clamped in (None, held))
    assert named["family"][0] == "first flap" and named["mac"][0] > pure["mac"][0]
    assert not named["family"].str.contains("coupled, coupled").any()
    # a mesh from elsewhere that names the seats, and not the sides of the aerofoil
    sides = ("pressure_side", "suction_side")
    faces = {name: face for name, face in whole.mesh.faces.items() if name not in sides}
    unnamed = family_table(modes, replace(whole.mesh, faces=faces))
    assert list(unnamed["family"][:3]) == list(pure["family"][:3])
    assert unnamed["aerofoil_share"].max() < 0.999
    root = whole.mesh.points[:, 0] <= blade_root(whole.mesh)
    assert abs(held.shapes[:, root]).max() == 0 and held.frequencies[0] > modes.frequencies[0]
