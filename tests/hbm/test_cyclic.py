"""One sector with the phase between the blades against the whole ring; and blades that are not
alike.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from bladefem.data import Elements, RigidBody
from bladefem.errors import InputError
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.sector_modes import blades_of_wave
from bladefem.hbm.solve import solve
from bladefem.reduction.assemble import (
    join_bodies,
    recombine_contact,
    standing_model,
    wheel_models,
)
from bladefem.reduction.beam import reference_blade
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.scene.toml import load_scene, vary
from bladefem.study.pipeline.assemble_model import _sides

N, EO, H = 6, 2, 3  # harmonics 1, 2, 3 move in nodal diameters 2, 2 backwards, 0
OWN = np.array(
    [[6.0, 0.4, -2.0], [0.4, 8.0, -1.0], [-2.0, -1.0, 9.0]]
)  # blade along, blade across, disc
LINK = np.array(
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, -1.5]]
)  # of a sector with the next one
MASS = np.diag([1.0, 1.0, 2.0])
FACES = np.array(
    [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.7, -0.5, 0.1], [0.5, 0.7, 0.0]]
)  # this damper, that before
TURN = np.exp(2j * np.pi * EO / N * np.arange(N))
LOAD, PROBE = np.array([[0.3, 1.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
RIGID = RigidBody(np.diag([0.3, 0.4]), np.array([[0.9, 0.1], [-0.2, 0.8], [0.7, -0.3], [0.2, 0.9]]))


def sectors_by_diameter():
    sectors = {}
    for n in range(N // 2 + 1):
        K = OWN + np.exp(2j * np.pi * n / N) * LINK + np.exp(-2j * np.pi * n / N) * LINK.T
        ports = {"contact": FACES, "load": LOAD, "probe": PROBE}
        sectors[n] = port_model_from_matrices(
            MASS, K.real if 2 * n % N == 0 else K, ports, nodal_diameter=n
        )
    return sectors


def sector_models():
    return wheel_models(sectors_by_diameter(), slice(2, 4), EO, N, H)


def test_a_wave_repeats_whose_last_diameter_has_the_model_of_another_one():
    """Harmonics of the last diameter, that of antiphase, are their own mirror images."""
    sectors = sectors_by_diameter()
    near = sectors[N // 2 - 1]
    assert np.iscomplexobj(near.shapes)

    def model(sides):
        four = np.ones(4)
        element = Elements(kt=four, kn=0 * four, mu=0.3 * four, n0=four, tangents=1)
        return ReducedModel(sides, element, {1: np.ones(1)})

    with pytest.raises(InputError, match="does not repeat"):
        blades_of_wave(model(wheel_models({**sectors, N // 2: near}, slice(2, 4), 1, N, 7)))
    # few nodal diameters are reduced; the others have the model of the nearest one
    few = {n: sectors[n] for n in range(N // 2)}
    reduced = SimpleNamespace(sectors=N, sector=few, following=slice(2, 4))
    scene = vary(load_scene("scenes/wedge.toml"), "excitation.engine_order", 1)
    assert blades_of_wave(model(_sides(scene, reduced, 7))) == N


def test_a_standing_model_is_that_of_the_modes_whatever_their_phase():
    real = sectors_by_diameter()[N // 2]
    turn = np.exp(1j * np.arange(1.0, 1.0 + len(real.omega)))
    damping = 0.1 * np.ones((len(turn), len(turn))) + np.eye(len(turn))
    turned = replace(
        real,
        shapes=real.shapes * turn,
        damping=turn.conj()[:, None] * damping * turn,
    )
    found = standing_model(turned)
    given = replace(real, damping=damping)

    def receptance(body, omega=1.3):
        dynamic = np.diag(body.omega**2 - omega**2) + 1j * omega * body.damping
        return body.shapes @ np.linalg.solve(dynamic, body.shapes.conj().T) + body.residual

    assert not np.iscomplexobj(found.shapes)
    np.testing.assert_allclose(receptance(found), receptance(given), rtol=1e-12)
    assert standing_model(real) is real


def ring():
    """All sectors; contact rows of damper b: on blade b, then on blade b + 1."""
    following = np.roll(np.eye(N), 1, axis=1)  # picks the next sector
    K = np.kron(np.eye(N), OWN) + np.kron(following, LINK) + np.kron(following.T, LINK.T)
    contact = np.concatenate(
        [
            np.kron(np.eye(N)[[b]], FACES[:2]) if here else np.kron(following[[b]], FACES[2:])
            for b in range(N)
            for here in (True, False)
        ]
    )
    ports = {
        "contact": contact,
        "load": np.kron(np.eye(N), LOAD),
        "probe": np.kron(np.eye(N), PROBE),
    }
    return port_model_from_matrices(np.kron(np.eye(N), MASS), K, ports)


def elements(count, n0):
    return Elements(
        np.tile([2.0, 1.5], count)[:count],
        np.tile([1.8, 2.2], count)[:count],
        np.full(count, 0.4),
        np.full(count, n0),
        tangents=1,
    )


def tiled(e):
    return Elements(
        *(np.tile(getattr(e, name), N) for name in ("kt", "kn", "mu", "n0")), tangents=1
    )


@pytest.mark.parametrize(
    "damper", [RIGID, None], ids=["dampers between blades", "blades on each other"]
)
def test_a_sector_moves_as_the_whole_ring(damper):
    one, whole = sector_models(), ring()
    if damper is None:  # the contact is between the blades themselves
        pick = np.hstack([np.eye(2), -np.eye(2)])
        one, whole = (
            tuple(recombine_contact(body, pick) for body in one),
            recombine_contact(whole, np.kron(np.eye(N), pick)),
        )
    e, force = elements(1 if damper is None else 2, 0.5), {1: np.array([2.0]), 2: np.array([0.3j])}
    sector = ReducedModel(one, e, force, Damping(ratio=0.02), damper)
    everything = (
        None
        if damper is None
        else RigidBody(block_diag(*[damper.mass] * N), block_diag(*[damper.B] * N))
    )
    wheel = ReducedModel(
        (whole,),
        tiled(e),
        {h: amplitude * TURN**h for h, amplitude in force.items()},
        Damping(ratio=0.02),
        everything,
    )
    for omega in (1.6, 2.3):
        a, b = solve(sector, omega, H, 96), solve(wheel, omega, H, 96)
        assert a.converged and b.converged and a.states["slip"] + a.states["lift"] > 0
        size = abs(a.probe).max()
        for h in range(H + 1):
            np.testing.assert_allclose(
                b.probe[h], a.probe[h, 0] * TURN**h, rtol=0, atol=1e-8 * size
            )
        assert b.work.friction == pytest.approx(N * a.work.friction, rel=1e-8)
        assert a.work.imbalance < 1e-9


def test_two_unlike_blades_with_a_damper_between_them():
    """Joined bodies and a rigid damper against one body in which the damper is a mode of frequency
    zero.
    """
    light, heavy = (reference_blade(1, platform=mass) for mass in (0.05, 0.06))
    both = recombine_contact(
        join_bodies((light, heavy)), np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
    )
    e = Elements(np.full(2, 1e6), np.zeros(2), np.ones(2), np.array([1.4, 1.0]), tangents=1)
    force = {1: np.array([1.0, 0.5j])}
    joined = ReducedModel(
        (both,), e, force, Damping(ratio=0.002), RigidBody(np.array([[0.03]]), np.ones((2, 1)))
    )
    omega = np.concatenate([both.omega, [0.0]])
    order = np.argsort(omega)
    shapes = np.pad(both.shapes, ((0, 0), (0, 1)))
    shapes[:2, -1] = -(0.03**-0.5)
    damped = 0.004 * omega[order]
    side = replace(both, omega=omega[order], shapes=shapes[:, order], damping=damped)
    single = ReducedModel((side,), e, force)
    for f in (1150.0, 1230.0, 1300.0):
        a, b = (solve(model, 2 * np.pi * f, 5, 128) for model in (joined, single))
        assert a.converged and b.converged and a.states["slip"] == 2
        assert abs(a.probe[1, 0]) != pytest.approx(abs(a.probe[1, 1]), rel=0.05)
        np.testing.assert_allclose(b.probe[1:], a.probe[1:], rtol=0, atol=1e-7 * abs(a.probe).max())
