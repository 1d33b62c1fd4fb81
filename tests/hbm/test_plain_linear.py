"""The compiled linear part, which serves all models, against its plain twins."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass
from plain_linear import plain_condense, plain_error, plain_jacobian, plain_works
from test_point_compiled import STATIC, elastic_damper, normal_direction

from bladefem.data import PortModel
from bladefem.errors import NotSolvedError
from bladefem.hbm.linear.condensation import condense, scale_loads, truncate_harmonics
from bladefem.hbm.model import Damping
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton_compiled import dense_jacobian
from bladefem.hbm.solver.residual import (
    Balance,
    as_amplitudes,
    evaluate_balance,
    start_in_stick,
)


def coupled_modes(**changes):
    """A block whose viscous damping couples its modes."""
    model = block(nodes=3, **changes)
    side = model.side(1)
    root = np.random.default_rng(5).standard_normal((len(side.omega), len(side.omega)))
    body = PortModel(
        side.omega, side.shapes, side.residual, side.ports, damping=0.02 * root @ root.T
    )
    return replace(model, sides=(body,), damping=Damping(0.003))


MODELS = {
    "single mass": (single_mass(), 1.1),
    "block": (block(), 0.9),
    "rigid damper": (block(damper=True), 0.9),
    "elastic damper": (elastic_damper(), 8300.0),
    "static load": (STATIC, 0.9),
    "mean not in the balance": (replace(normal_direction(), coupled=False), 0.9),
    "many contacts": (reference_model(load=1.4, phase=0.7, points=40, harmonics=5), 8300.0),
    "modes that damping couples": (coupled_modes(), 0.9),
}


@pytest.mark.parametrize("name", MODELS)
def test_condensation(name):
    model, omega = MODELS[name]
    found = condense(model, omega, 4)
    plain = plain_condense(model, omega, 4)
    for field in ("G", "A", "free", "stuck", "B", "g"):
        expected = getattr(plain, field)
        np.testing.assert_allclose(
            getattr(found, field), expected, rtol=0, atol=1e-10 * abs(expected).max(initial=1e-300)
        )


def test_a_mode_that_only_coupled_damping_holds_is_solved_at_its_own_frequency():
    model = replace(coupled_modes(), damping=Damping())
    omega = float(model.side(1).omega[1])
    found = condense(model, omega, 3)
    near = condense(model, omega * (1 + 1e-9), 3)
    for field in ("G", "A", "free", "stuck"):
        expected = getattr(near, field)
        np.testing.assert_allclose(
            getattr(found, field), expected, rtol=0, atol=1e-6 * abs(expected).max()
        )


@pytest.mark.parametrize("name", MODELS)
def test_residual_and_error(name):
    model, omega = MODELS[name]
    balance = Balance(model, condense(model, omega, 4), 64)
    start = start_in_stick(balance)
    w = start + 0.1 * abs(start).max() * np.random.default_rng(1).standard_normal(start.shape)
    state = evaluate_balance(balance, w)
    flat = (model.springs.size, w.shape[2])
    residual, error = plain_error(
        plain_condense(model, omega, 4),
        w.reshape(flat),
        state.forces.f.reshape(flat),
        model.preload,
    )
    expected = abs(residual).max()
    np.testing.assert_allclose(
        as_amplitudes(state.residual), residual, rtol=0, atol=1e-9 * expected
    )
    assert state.error == pytest.approx(error, rel=1e-8)


@pytest.mark.parametrize("name", MODELS)
def test_works_of_a_solved_point(name):
    model, omega = MODELS[name]
    point = solve(model, omega, 4, 64)
    assert point.converged and point.states["slip"] + point.states["lift"] > 0
    load = point.f.copy()
    load[:, :, 0] -= model.preload.reshape(load.shape[:2])
    plain = plain_works(model, omega, point.w, load, point.work.dissipated)
    for field in ("input", "damping", "friction"):
        assert getattr(point.work, field) == pytest.approx(getattr(plain, field), rel=1e-9), field
    assert point.work.imbalance < 1e-8


def test_the_dense_jacobian():
    random = np.random.default_rng(3)
    A = random.standard_normal((3, 6, 6)) + 1j * random.standard_normal((3, 6, 6))
    for nodes in (6, 3, 2):
        size = 5 * 6 // nodes
        change = random.standard_normal((nodes, size, size))
        np.testing.assert_allclose(
            dense_jacobian(A, change), np.eye(30) + plain_jacobian(A, change), atol=1e-12
        )


@pytest.mark.parametrize("name", ["block", "elastic damper", "many contacts"])
def test_fewer_harmonics_and_more_load(name):
    """Of the first harmonics of condensed bodies; of the bodies condensed under the load."""
    model, omega = MODELS[name]
    whole = condense(model, omega, 4)
    less = truncate_harmonics(whole, 2)
    alone = condense(model, omega, 2)
    for field in ("A", "G", "free", "stuck"):
        expected = getattr(alone, field)
        np.testing.assert_allclose(
            getattr(less, field), expected, rtol=0, atol=1e-12 * abs(expected).max()
        )
    assert less.condensed.scale == pytest.approx(alone.condensed.scale, rel=1e-12)
    more = scale_loads(whole, 3.0)
    loaded = condense(
        replace(model, excitation={h: 3.0 * np.asarray(f) for h, f in model.excitation.items()}),
        omega,
        4,
    )
    np.testing.assert_allclose(more.stuck, loaded.stuck, atol=1e-12 * abs(loaded.stuck).max())
    assert more.condensed.scale == pytest.approx(loaded.condensed.scale, rel=1e-12)


@pytest.mark.parametrize("coupled", [True, False])
def test_a_resonance_without_damping_is_said(coupled):
    model = replace(block(), damping=Damping(0.0), coupled=coupled)
    omega = float(model.side(1).omega[model.side(1).omega > 0][0])
    with pytest.raises(NotSolvedError, match="resonance without damping is hit exactly"):
        condense(model, omega, 2)
