"""Waves of a rotating ring against Bryan's closed form, and the coupling's symmetry."""

import numpy as np
import pytest
from structured import box, pair, sector, turn

from bladefem.data import PortModel
from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain
from bladefem.fem.gyroscopic import coupling, waves
from bladefem.fem.modes import modes
from bladefem.fem.rotation import body_under_rotation
from bladefem.hbm.linear.bodies import Damping, modal_flexibility, stack_bodies
from bladefem.hbm.linear_resonances import wave_frequencies
from bladefem.scene.tables import Material
from bladefem.study.pipeline.coriolis import coriolis_shift
from geometry.mesh import Mesh, Sector

RING = Material(E=2e11, nu=0.0, rho=8000.0)


def plane_ring(count, thickness=0.01, radius=1.0):
    """A sector of a thin ring in plane stress, free."""
    theta = 2 * np.pi / count

    def bend(x):
        r, a = x[:, 0], x[:, 1] * theta
        return np.stack([r * np.cos(a), r * np.sin(a), 0 * r], 1)

    mesh = box((1, 8), (thickness, 1.0), "quad9", origin=(radius - thickness / 2, 0.0), map=bend)
    faces = {"cyclic_low": mesh.faces["y0"], "cyclic_high": mesh.faces["y1"]}
    mesh = Mesh(mesh.points, "quad9", mesh.bodies, faces)
    cyclic = pair(mesh, "cyclic_low", "cyclic_high", turn(theta))
    return Mesh(
        mesh.points,
        "quad9",
        mesh.bodies,
        faces,
        pairs={"cyclic": cyclic},
        sector=Sector(count, turn(theta), np.zeros(3)),
    )


def first_elastic(body, n):
    """Modes of the free ring from the first bending mode on (rigid motions at n = 1 only)."""
    return modes(constrain(body, None, n), 4)


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("n", [2, 3, 4])
def test_waves_of_a_rotating_ring(n, linear):
    """w = -+2 n Omega / (n^2 + 1) + sqrt(w0^2 + Omega^2 n^2 (n^2 - 1)^2 / (n^2 + 1)^2), Bryan 1890,
    inextensible.

    w0 is the ring's own at rest, so that only the rotation is compared; wall over radius is 1 %,
    measured 9e-5 or less.
    """
    body = assemble(plane_ring(12), "blade", RING, MPI.COMM_SELF)
    at_rest = 2 * np.pi * first_elastic(body, n).frequencies[0]
    speed = at_rest / 2
    moving = body_under_rotation(body, speed, None, linear=linear)
    found = first_elastic(moving, n)
    split = waves(found, coupling(moving, found), speed)
    mean = np.sqrt(at_rest**2 + (speed * n * (n**2 - 1) / (n**2 + 1)) ** 2)
    shift = 2 * n * speed / (n**2 + 1)
    assert 2 * np.pi * split.forward[0] == pytest.approx(mean - shift, rel=2e-4)
    assert 2 * np.pi * split.backward[0] == pytest.approx(mean + shift, rel=2e-4)


def test_sense_of_counting_and_standing_modes():
    """A mirrored count of the sectors gives the same physical waves; nodal diameters 0 and N/2 do
    not split.
    """
    found = []
    for sense in (1, -1):
        body = assemble(sector(6, (3, 2, 1), sense=sense), "blade", Material(), MPI.COMM_SELF)
        for n in (0, 2, 3):
            shapes = modes(constrain(body, "clamp", n), 8)
            g = coupling(body, shapes)
            np.testing.assert_allclose(g, -g.conj().T, atol=1e-14)
            split = waves(shapes, g, 300.0, sense)
            if n == 2:
                found.append(np.concatenate([split.forward, split.backward]))
                assert abs(split.forward - split.backward).max() > 1.0
            else:
                np.testing.assert_allclose(split.forward, split.backward, rtol=1e-10)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)


def test_a_coupling_of_another_number_of_modes_is_refused():
    body = assemble(sector(6, (1, 1, 1)), "blade", Material(), MPI.COMM_SELF)
    shapes = modes(constrain(body, "clamp", 1), 3)
    with pytest.raises(InputError, match=r"shape \(2, 2\), expected \(3, 3\)"):
        waves(shapes, np.zeros((2, 2)), 1.0)


@pytest.mark.mpi
@pytest.mark.several_ranks
def test_coupling_does_not_depend_on_ranks():
    mesh = sector(6, (4, 2, 1), bump=0.2)
    g = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        body = assemble(mesh, "blade", Material(), comm)
        shapes = modes(constrain(body, "clamp", 1), 6)
        g.append(waves(shapes, coupling(body, shapes), 1000.0))
    np.testing.assert_allclose(g[0].forward, g[1].forward, rtol=1e-9)
    np.testing.assert_allclose(g[0].backward, g[1].backward, rtol=1e-9)


def test_shifts_of_a_mass_on_springs_in_a_rotating_frame():
    """Foucault's pendulum: with springs w0 and K = w0^2 - Omega^2 the waves turn with w0 + Omega and
    w0 - Omega; the reduced model with that damping answers a rotating force like them.
    """
    w0, speed = 2 * np.pi * 50.0, 60.0
    still = np.sqrt(w0**2 - speed**2)
    g = np.array([[0.0, -2.0], [2.0, 0.0]])
    found = wave_frequencies(np.full(2, still), speed * g)
    np.testing.assert_allclose(found, [w0 - speed, w0 + speed], rtol=1e-12)
    shift = coriolis_shift(np.full(2, still), speed * g, 2)
    np.testing.assert_allclose(shift, (w0 + speed) / still - 1, rtol=1e-12)
    ports = {"contact": slice(0, 1), "load": slice(1, 2)}
    none = np.zeros((2, 2))
    body = PortModel(np.full(2, still), np.eye(2), none, ports, damping=speed * g)
    stack = stack_bodies((body,), Damping(), np.array([0]))
    w = np.array([100.0, 300.0, 500.0])
    inverse = modal_flexibility(stack, w)
    for sense in (1, -1):
        force = np.array([1.0, -1j * sense])
        closed = 1 / (still**2 - w**2 - 2 * sense * speed * w)
        np.testing.assert_allclose(inverse @ force, closed[:, None] * force, rtol=1e-10)
