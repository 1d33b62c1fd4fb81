"""A point in one compiled call against the plain way, for every kind of body; prescribed and static
loads.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass
from plain import waves

from bladefem.data import PortModel
from bladefem.errors import InputError
from bladefem.friction.fourier import to_complex
from bladefem.hbm import response as response_module
from bladefem.hbm import solve as api
from bladefem.hbm.model import Damping
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.response import response
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.dense_lu import back_substitute, factorise_large, factorise_small


def elastic_damper():
    """The reference blade with a damper that has one rigid and one elastic mode, and structural
    damping.
    """
    model = reference_model(load=1.4, phase=0.7, harmonics=5)
    shapes = np.array([[4.0, 3.0], [4.0, -2.0]])
    damper = PortModel(
        np.array([0.0, 9000.0]), shapes, np.diag([1e-9, 2e-9]), {"contact": slice(0, 2)}
    )
    return replace(
        model,
        damper=(damper,),
        damper_damping=Damping(structural=0.01),
        damping=Damping(0.002, 0.001),
    )


def normal_direction(**changes):
    model = block(nodes=2, force=2.0)
    elements = replace(
        model.elements,
        kt=np.full(3, 0.7),
        kn=np.full(3, 1.2),
        mu=np.full(3, 0.4),
        n0=np.array([0.4, 0.8, 1.2]),
        tangents=1,
    )
    return replace(model, elements=elements, **changes)


SWELLING = replace(single_mass(), normal={1: np.array([0.3]), 2: np.array([0.1 - 0.2j])})
STATIC = normal_direction(excitation={0: np.array([0.3]), 1: np.array([1.0]), 2: np.array([0.4j])})
MODELS = {
    "single mass": (single_mass(), 1.1),
    "reference blade": (reference_model(load=1.4, phase=0.7), 8300.0),
    "elastic damper": (elastic_damper(), 8300.0),
    "normal direction": (normal_direction(), 0.9),
    "two harmonics and a static load": (STATIC, 0.9),
    "prescribed normal load": (SWELLING, 1.1),
}


@pytest.mark.parametrize("samples", [128, 0])
@pytest.mark.parametrize("name", MODELS)
def test_one_call_equals_the_plain_way(name, samples, monkeypatch):
    model, omega = MODELS[name]
    fast = solve(model, omega, 5, samples)
    monkeypatch.setattr(api, "solve_small", lambda *_: None)
    plain = solve(model, omega, 5, samples)
    assert fast.converged and plain.converged and fast.states == plain.states
    assert plain.states["slip"] + plain.states["lift"] > 0 and plain.work.imbalance < 1e-8
    for field in ("w", "f", "probe"):
        expected = getattr(plain, field)
        np.testing.assert_allclose(
            getattr(fast, field), expected, rtol=0, atol=1e-8 * abs(expected).max()
        )
    assert fast.drift == pytest.approx(plain.drift, rel=1e-6, abs=1e-12)
    for field in ("input", "damping", "friction", "dissipated"):
        assert getattr(fast.work, field) == pytest.approx(getattr(plain.work, field), rel=1e-7), (
            field
        )


def test_prescribed_normal_load_is_that_of_the_march():
    """The balanced force is that of a Coulomb slider marched under the given N(t), and obeys its
    limit.
    """
    solution = solve(SWELLING, 1.1, 5, 4096)
    samples = 4096
    w = solution.w[0, 0] @ waves(5, samples).T
    N = np.maximum(SWELLING.normal_load(5)[0] @ waves(5, samples).T, 0.0)
    assert N.min() < 0.15 and N.max() > 0.8
    f, series = w[0], np.zeros(samples)
    for _ in range(2):
        for s in range(samples):
            f = np.clip(f + w[s] - w[s - 1], -N[s], N[s])
            series[s] = f
    marched = np.fft.rfft(series)[:6] / samples * np.array([1, 2, 2, 2, 2, 2])
    np.testing.assert_allclose(
        to_complex(solution.f[0, 0]), marched, rtol=0, atol=2e-3 * abs(marched).max()
    )


def test_3d_contacts_take_a_prescribed_normal_load():
    """A normal load that swings in step with all nodes: the sampled 2-D law and the works agree."""
    model = replace(block(), normal={1: np.full(4, 0.4 + 0.2j)})
    solution = solve(model, 0.9, 5, 256)
    assert solution.converged and solution.work.imbalance < 1e-8
    assert (
        abs(solution.probe - solve(block(), 0.9, 5, 256).probe).max()
        > 1e-2 * abs(solution.probe).max()
    )


@pytest.mark.parametrize(
    "model",
    [normal_direction(), replace(block(), excitation={1: np.array([1.0])}), block(damper=True)],
    ids=["1-D", "3-D", "damper"],
)
def test_uncoupled_the_mean_stays_where_the_preload_left_it(model):
    """Against the same bodies immovable in harmonic 0 alone; coupled, the lift-off pushes the mean
    outwards.
    """
    side = model.side(1)
    fixed = replace(
        side, omega=np.ones_like(side.omega), shapes=0 * side.shapes, residual=0 * side.residual
    )
    uncoupled = solve(replace(model, coupled=False), 0.9, 5, 128)
    immovable = solve(
        replace(model, sides=(fixed, *[side] * 5), coupled=model.damper is None), 0.9, 5, 128
    )
    coupled = solve(model, 0.9, 5, 128)
    assert uncoupled.converged and immovable.converged and coupled.converged
    assert abs(uncoupled.w[:, :, 0]).max() < 1e-15 * abs(uncoupled.w).max()
    assert abs(coupled.w[:, :, 0]).max() > 1e-3 * abs(coupled.w).max()
    np.testing.assert_allclose(
        immovable.probe[1:], uncoupled.probe[1:], rtol=0, atol=1e-8 * abs(coupled.probe).max()
    )
    assert abs(coupled.probe[1:] - uncoupled.probe[1:]).max() > 1e-3 * abs(coupled.probe).max()
    assert uncoupled.work.imbalance < 1e-8
    with pytest.raises(InputError, match="static load in"):
        replace(model, coupled=False, excitation={0: np.array([1.0])})


def test_prescribed_normal_load_is_checked():
    with pytest.raises(InputError, match="normal of harmonic 0"):
        replace(single_mass(), normal={0: np.array([0.3])})
    with pytest.raises(InputError, match="normal of harmonic 1"):
        replace(single_mass(), normal={1: np.array([0.3, 0.2])})
    with pytest.raises(InputError, match="at least 2"):
        solve(SWELLING, 1.1, 1, 64)


@pytest.mark.parametrize("size", [31, 64, 97, 200])
def test_blocks_of_columns_give_the_same_factors(size):
    """Same pivots and factors as the plain elimination, which is slower by two to three from 200
    unknowns on.
    """
    M = np.random.default_rng(size).normal(size=(size, size))
    plain, blocks, other = M.copy(), M.copy(), M.copy()
    one, two = np.empty(size, np.int64), np.empty(size, np.int64)
    assert factorise_small(plain, one) and factorise_large(blocks, two)
    assert np.array_equal(one, two)
    np.testing.assert_allclose(blocks, plain, atol=1e-10)
    x = M @ np.arange(size)
    back_substitute(blocks, two, x)
    np.testing.assert_allclose(x, np.arange(size), atol=1e-8)
    other[:, 0] = 0.0
    assert not factorise_large(other, two)


@pytest.mark.parametrize("size", [*range(1, 10), 33, 66])
def test_lu_factors_solve_as_numpy_does(size):
    """Also where rows are left over that are not read with three others, and with every column
    exchanged.
    """
    rng = np.random.default_rng(size)
    M = rng.normal(size=(size, size)) + np.roll(10.0 * np.eye(size), 1, axis=0)
    x = rng.normal(size=size)
    for factorise in (factorise_small, factorise_large):
        factors, pivots, y = M.copy(), np.empty(size, np.int64), x.copy()
        assert factorise(factors, pivots)
        back_substitute(factors, pivots, y)
        np.testing.assert_allclose(y, np.linalg.solve(M, x), rtol=0, atol=1e-13)


@pytest.mark.parametrize("points", [1, 16])
def test_a_sweep_at_once_is_the_sweep_point_by_point(points, monkeypatch):
    """Blocks of a sweep in one call, with modes that add the springs and without; from slip into
    stick and back.
    """
    model = reference_model(3e6, 0.12, 8.0, phase=0.5, points=points, harmonics=3, modes=10)
    omegas = 2 * np.pi * np.linspace(780, 1300, 40)
    fast = list(response(model, omegas, 3, 64))
    monkeypatch.setattr(response_module, "solve_along", lambda *_: [])
    monkeypatch.setattr(api, "solve_small", lambda *_: None)
    plain = list(response(replace(model), omegas, 3, 64))
    assert {p.states["stick"] == 2 * points for p in fast} == {True, False}
    for one, other in zip(fast, plain, strict=True):
        assert one.converged and one.states == other.states and one.iterations == other.iterations
        np.testing.assert_allclose(one.w, other.w, rtol=0, atol=1e-8 * abs(other.w).max())
        np.testing.assert_allclose(
            one.probe, other.probe, rtol=0, atol=1e-8 * abs(other.probe).max()
        )


def test_a_sweep_without_compiled_points_checks_each_frequency_in_its_turn(monkeypatch):
    """Not up to 16 of them before every point; a bad one is refused all the same."""
    checked = []
    monkeypatch.setattr(
        response_module, "check_point", lambda *arguments: checked.append(arguments)
    )
    found = response(block(damper=True), [1.1, 1.125, -1.0], 3, 64)
    assert next(found).converged and next(found).converged and not checked
    with pytest.raises(InputError, match=r"omega -1\.0: expected a positive"):
        next(found)
    list(response(single_mass(), [0.9, 1.0], 3, 64))
    assert len(checked) == 2
