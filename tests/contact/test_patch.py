"""Port vectors of patches: exact areas, uniform pressure, linear motion; the contact patch test;
interference.
"""

from dataclasses import replace

import numpy as np
import pytest
from blocks import compliances, facing_blocks, graded, rollers
from seated_wedge import ALPHA, SPEED, condensed
from wedge import wedge_mesh

from bladefem.contact.complementarity import solve_lcp
from bladefem.contact.patch import (
    initial_gap,
    make_patch,
    normal_ports,
    patch_means,
    port_matrix,
    rigid_ports,
)
from bladefem.contact.resultants import resultant
from bladefem.contact.seating import solve_seating
from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain, expand_to_mesh, restrict_load
from bladefem.fem.face_elements import (
    corner_count,
    face_quadrature,
    face_shape_functions,
    traction_shape,
)
from bladefem.fem.linalg import apply_block
from bladefem.fem.surface import outward_signs, surface_quadrature
from bladefem.scene.tables import Material

STEEL, TITANIUM = (2.1e11, 0.3), (1.1e11, 0.34)


@pytest.mark.parametrize(
    ("dimension", "nodes"), [(2, 2), (2, 3), (3, 3), (3, 6), (3, 4), (3, 8), (3, 9)]
)
def test_shape_functions(dimension, nodes):
    """Partition of unity, gradients against finite differences, areas of the traction functions."""
    k = corner_count(dimension, nodes)
    x, w = face_quadrature(k)
    N, dN = face_shape_functions(nodes, k, x)
    assert np.allclose(N.sum(axis=1), 1) and np.allclose(dN.sum(axis=1), 0)
    for a in range(x.shape[1]):
        step = np.eye(x.shape[1])[a] * 1e-6
        assert np.allclose(
            (
                face_shape_functions(nodes, k, x + step)[0]
                - face_shape_functions(nodes, k, x - step)[0]
            )
            / 2e-6,
            dN[:, :, a],
            atol=1e-8,
        )
    chi = traction_shape(k, x)
    assert np.allclose(chi.sum(axis=1), 1) and np.allclose(
        w @ chi, w @ face_shape_functions(k, k, x)[0]
    )


def test_frames_and_areas_of_a_wedge():
    mesh = wedge_mesh(ALPHA)
    theta = np.pi / 36
    for name, sign in (("this", 1), ("next", -1)):
        p = make_patch(mesh, name)
        assert p.area.sum() == pytest.approx(0.03 * 0.01 / np.cos(ALPHA), rel=1e-12)
        assert np.allclose(np.einsum("nij,nkj->nik", p.frame, p.frame), np.eye(3))
        angle = ALPHA + np.pi / 2 + theta
        expected = np.array([np.cos(angle), sign * np.sin(angle), 0])
        assert np.allclose(p.frame[:, 0], expected) and np.allclose(p.frame[:, 2], [0, 0, 1])
        assert (p.frame[:, 1, 1] > 0).all()  # t1 runs towards +y on both seats


@pytest.mark.parametrize("dimension", [2, 3])
def test_port_vectors_of_matched_faces(dimension):
    mesh = wedge_mesh(ALPHA, dimension=dimension)
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    blade, damper = (port_matrix(patches, mesh, side) for side in ("blade", "damper"))
    # A pressure of 1 Pa on the damper is the closed form, force p A n on each flank, seen from the
    # damper's sector.
    f = np.zeros(damper.shape[1])
    f[normal_ports(patches, mesh)] = np.concatenate([p.area for p in patches])
    total = (damper @ f).reshape(-1, dimension).sum(axis=0)
    n = [patches[0].frame[0, 0], mesh.pairs["next"].rotation @ patches[1].frame[0, 0]]
    assert np.allclose(
        total,
        sum(p.area.sum() * v for p, v in zip(patches, n, strict=True))[:dimension],
        rtol=1e-12,
    )
    # A motion that is the same field on both sides of "this" opens nothing there.
    field = (mesh.points @ np.random.default_rng(1).standard_normal((3, 3)))[:, :dimension].ravel()
    m = len(patches[0].area) * dimension
    assert np.allclose((blade.T @ field)[:m], (damper.T @ field)[:m], atol=1e-15)


def test_rigid_ports_are_the_ports_of_rigid_motions():
    mesh = wedge_mesh(ALPHA)
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    origin = np.array([0.2, 0.01, 0.003])
    B = rigid_ports(patches, mesh, origin)
    q = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    field = q[:3] + np.cross(q[3:], mesh.points - origin)
    assert np.allclose(B @ q, port_matrix(patches, mesh, "damper").T @ field.ravel(), atol=1e-13)


def uniform(dimension, upper, E, nu, interference=None):
    """Two blocks on rollers, 10 and 8 mm high, pressed together: pressures, and the approach of the
    far sides.
    """
    y = None if dimension == 2 else np.linspace(0, 0.01, 4)
    x, depth = np.linspace(0, 0.01, 4), np.linspace(0, 0.01, 3)
    mesh = facing_blocks(x, depth, y, upper)
    patch = make_patch(mesh, "this")
    C = sum(compliances(mesh, patch, E, nu, rollers))
    if interference is not None:
        return patch, solve_lcp(C, np.full(len(C), -interference))
    return patch, solve_lcp(C, np.zeros(len(C)), -np.ones((len(C), 1)), [-1e6 * patch.area.sum()])


UPPER = {
    2: (np.array([0, 0.0017, 0.0045, 0.0061, 0.01]), np.linspace(0, 0.008, 3)),
    3: (
        np.array([0, 0.0017, 0.0061, 0.01]),
        np.linspace(0, 0.008, 3),
        np.array([0, 0.0042, 0.0057, 0.01]),
    ),
}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("matching", [True, False])
def test_contact_patch_test(dimension, matching):
    """A uniform pressure passes a non-matching interface: 1e-8 (measured 1e-12)."""
    patch, s = uniform(
        dimension, None if matching else UPPER[dimension], (2.1e11, 1.1e11), (0.3, 0.34)
    )
    assert s.reason == "" and s.active.all()
    assert patch.area.sum() == pytest.approx(0.01 if dimension == 2 else 1e-4, rel=1e-12)
    assert np.abs(s.force / patch.area / 1e6 - 1).max() < 1e-8


@pytest.mark.parametrize("matching", [True, False])
def test_interference_of_two_materials(matching):
    """p = delta / (h1 / E1 + h2 / E2) between fixed far sides, free to bulge."""
    patch, s = uniform(
        3, None if matching else UPPER[3], (STEEL[0], TITANIUM[0]), (STEEL[1], TITANIUM[1]), 1e-6
    )
    height = 0.01 if matching else 0.008
    exact = 1e-6 / (0.01 / STEEL[0] + height / TITANIUM[0])
    assert np.abs(s.force / patch.area / exact - 1).max() < 1e-8


def test_non_matching_wedge_is_balanced_too():
    """The next patch of a wedge, its damper side found through the rotation, without matched
    nodes.
    """
    mesh = wedge_mesh(ALPHA)
    pairs = {k: replace(p, nodes=np.zeros((2, 0), int)) for k, p in mesh.pairs.items()}
    loose = solve_seating(condensed(replace(mesh, pairs=pairs)), SPEED)
    for a, b in zip(loose, solve_seating(condensed(mesh), SPEED), strict=True):
        assert np.abs(a.force - b.force).max() < 1e-7 * b.force.max()
    this, following = (resultant(m) for m in loose)
    moment = this.moment + mesh.sector.rotation @ following.moment
    assert np.abs(moment).max() < 1e-9 * np.linalg.norm(this.moment)


def bent(dimension, matching, steep):
    """Blocks whose common face is a paraboloid, on which quadratic faces with midpoints in the
    middle lie exactly.
    """
    y = None if dimension == 2 else np.linspace(0, 0.01, 4)
    mesh = facing_blocks(
        np.linspace(0, 0.01, 4), np.linspace(0, 0.01, 3), y, None if matching else UPPER[dimension]
    )
    points = mesh.points.copy()
    points[:, dimension - 1] += steep * (
        points[:, 0] ** 2 - (0.4 * points[:, 1] ** 2 if dimension == 3 else 0.0)
    )
    return replace(mesh, points=points)


@pytest.mark.parametrize("matching", [True, False])
@pytest.mark.parametrize("dimension", [2, 3])
def test_patch_test_on_curved_faces(dimension, matching):
    """A state of uniform pressure: either body gets the consistent loads of its own curved faces,
    and a linear motion of both opens nothing and slides nothing: 1e-8 asked, measured 1e-15; slopes
    up to 31 degrees.
    """
    mesh = bent(dimension, matching, 30.0)
    patch = make_patch(mesh, "this")
    normal = normal_ports([patch], mesh)
    motion = (mesh.points @ np.random.default_rng(2).standard_normal((3, 3)))[:, :dimension].ravel()
    seen = []
    for side, name, sign in (("blade", "seat_right", 1), ("damper", "damper_left", -1)):
        P, faces = port_matrix([patch], mesh, side), mesh.faces[name]
        weighted, _ = surface_quadrature(mesh, faces)
        weighted = (
            weighted * (sign * outward_signs(mesh, faces, weighted.sum(axis=1)))[:, None, None]
        )
        corners = corner_count(dimension, faces.shape[1])
        N, _ = face_shape_functions(faces.shape[1], corners, face_quadrature(corners)[0])
        own = np.zeros((len(mesh.points), 3))
        np.add.at(own, faces, np.einsum("fqi,qm->fmi", weighted, N))
        loads = (P[:, normal] @ patch.area).reshape(-1, dimension)
        assert np.abs(loads - own[:, :dimension]).max() < 1e-12 * np.abs(own).max()
        seen.append(P.T @ motion)
    assert np.abs(seen[0] - seen[1]).max() < 1e-12 * np.abs(seen[0]).max()
    assert np.abs(initial_gap(patch, mesh)).max() < 1e-14


@pytest.mark.parametrize("dimension", [2, 3])
def test_uniform_pressure_balances_curved_elements(dimension):
    """Both bodies shrunk alike: at the nodes of faces that do not match, stress and contact forces
    balance, 1e-8.
    """
    mesh, shrink = bent(dimension, False, 30.0), 1e-5
    patch = make_patch(mesh, "this")
    for side, face, sign in (("blade", "seat_right", -1), ("damper", "damper_left", 1)):
        con = constrain(assemble(mesh, side, Material(E=2e11, nu=0.3)), None)
        pressure = shrink * 2e11 / ((1 - 2 * 0.3) if dimension == 3 else (1 - 0.3))
        u = np.ascontiguousarray(-shrink * mesh.points[:, :dimension]).reshape(-1, 1)
        inner = expand_to_mesh(con, apply_block(con.K, restrict_load(con, u)))[:, :, 0]
        P = port_matrix([patch], mesh, side)[:, normal_ports([patch], mesh)]
        outer = (sign * pressure * (P @ patch.area)).reshape(-1, dimension)
        across = mesh.points[:, : dimension - 1]
        middle = ((across > 1e-9) & (across < 0.01 - 1e-9)).all(axis=1)
        nodes = np.intersect1d(np.unique(mesh.faces[face]), np.flatnonzero(middle))
        assert len(nodes) > 3
        assert np.abs(inner - outer)[nodes].max() < 1e-8 * np.abs(outer).max()


def test_faces_seen_from_the_side_are_bad_input():
    """A master that bends by more than 75 degrees has no one direction to be seen from."""
    flat = bent(2, False, 0.0)
    points = flat.points.copy()
    points[:, 1] += 2000 * (points[:, 0] - 0.005) ** 2
    with pytest.raises(InputError, match="75 degrees"):
        make_patch(replace(flat, points=points), "this")


def test_slave_smaller_than_master():
    """Only the overlap carries: its area is the slave's, forces on both sides have one resultant
    and one moment.
    """
    x = np.linspace(0, 0.01, 6)
    mesh = facing_blocks(
        x,
        np.linspace(0, 0.01, 3),
        x,
        (np.linspace(0, 0.0057, 4), np.linspace(0, 0.004, 2), np.linspace(0, 0.0083, 5)),
    )
    patch = make_patch(mesh, "this")
    assert patch.area.sum() == pytest.approx(0.0057 * 0.0083, rel=1e-12) and (patch.area > 0).all()
    f = np.random.default_rng(0).random(len(patch.area))
    for power in (np.ones(len(mesh.points)), mesh.points[:, 0], mesh.points[:, 1]):
        a, b = (power @ (patch_means(patch, mesh, side) @ f) for side in ("blade", "damper"))
        assert a == pytest.approx(b, rel=1e-9)


def test_faces_that_do_not_overlap_are_bad_input():
    mesh = facing_blocks(
        graded(1e-3, 3e-3, 5e-3),
        np.linspace(0, 0.01, 3),
        None,
        (np.linspace(0.05, 0.06, 3), np.linspace(0, 0.01, 3)),
    )
    with pytest.raises(InputError, match="do not overlap"):
        make_patch(mesh, "this")


def test_receding_contact_is_linear_in_the_load():
    """Without a clearance the contact area depends on the shape of the load only: forces grow with
    speed squared.
    """
    problem = condensed(wedge_mesh(ALPHA))
    one, two = solve_seating(problem, SPEED), solve_seating(problem, 2 * SPEED)
    for a, b in zip(one, two, strict=True):
        assert (a.force == 0).any()  # it does recede
        assert np.array_equal(a.force > 0, b.force > 0)
        assert np.abs(4 * a.force - b.force).max() < 1e-8 * b.force.max()
