"""The compiled loop against the plain one, and both against the friction march of the textbook."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass
from plain import plain_forces

from bladefem.data import PortModel
from bladefem.hbm import policy
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import Damping
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import newton_as_given
from bladefem.hbm.solver.residual import Balance, contact_forces, start_in_stick


def coupled_1d():
    """Three contacts with a normal direction and one tangent, some of which lift off."""
    model = block(nodes=2, force=2.0)
    elements = replace(
        model.elements,
        kt=np.full(3, 0.7),
        kn=np.full(3, 1.2),
        mu=np.full(3, 0.4),
        n0=np.array([0.4, 0.8, 1.2]),
        tangents=1,
    )
    return replace(model, elements=elements)


MODELS = [
    (single_mass(), 1.1),
    (coupled_1d(), 0.9),
    (reference_model(load=1.4, phase=0.7, harmonics=5), 8300.0),
]


@pytest.mark.parametrize("samples", [128, 0])
@pytest.mark.parametrize(("model", "omega"), MODELS)
def test_compiled_and_plain_newton_take_the_same_steps(model, omega, samples, monkeypatch):
    balance = Balance(model, condense(model, omega, 5), samples)
    fast = newton_as_given(balance, start_in_stick(balance))
    monkeypatch.setattr(policy, "COMPILED_NEWTON_UNKNOWNS", 0)
    slow = newton_as_given(balance, start_in_stick(balance))
    assert fast.converged and slow.converged and fast.iterations == slow.iterations > 0
    # both end with a residual within 1e-10; nothing but stuck instants holds the mean of a contact
    # that slips, in which rounding leaves 1.6e-9 on some processors
    np.testing.assert_allclose(
        fast.state.w, slow.state.w, rtol=0, atol=1e-8 * abs(slow.state.w).max()
    )
    np.testing.assert_allclose(
        fast.state.forces.f, slow.state.forces.f, rtol=0, atol=1e-8 * abs(slow.state.p).max()
    )


@pytest.mark.parametrize(("model", "omega"), [*MODELS, (block(), 0.9)])
def test_forces_equal_the_plain_march(model, omega):
    """Where elements close within a step the kernel counts the part after closing, the march all of
    it: first order.
    """
    solution = solve(model, omega, 3, 512)
    full = solution.w
    if model.directions == model.elements.tangents:
        full = np.concatenate([np.zeros_like(full), full], axis=1)
    plain = plain_forces(model.elements, full, 512).f[:, -model.directions :]
    found = contact_forces(model, solution.w, 512).f
    tolerance = 1e-3 if np.any(model.elements.kn > 0) else 2e-4
    np.testing.assert_allclose(found, plain, rtol=0, atol=tolerance * abs(plain).max())


def test_located_transitions_are_the_limit_of_many_samples():
    model = single_mass()
    exact = solve(model, 1.1, 7, 0)
    errors = [
        abs(solve(model, 1.1, 7, samples).probe - exact.probe).max() for samples in (128, 512, 2048)
    ]
    assert exact.converged and errors[2] < 1e-6 * abs(exact.probe).max()
    assert errors[1] < errors[0] / 8 and errors[2] < errors[1] / 8  # second order


def test_damping_that_couples_modes_equals_the_same_damping_uncoupled():
    model = block(nodes=3)
    side = model.side(1)
    viscous = 0.02 * side.omega
    as_vector = PortModel(side.omega, side.shapes, side.residual, side.ports, damping=viscous)
    as_matrix = PortModel(
        side.omega, side.shapes, side.residual, side.ports, damping=np.diag(viscous)
    )
    one, two, three = (
        solve(replace(model, sides=(body,), damping=damping), 0.9, 3, 128)
        for body, damping in ((side, Damping(0.01)), (as_vector, Damping()), (as_matrix, Damping()))
    )
    assert one.converged and two.converged and three.converged
    for other in (two, three):
        np.testing.assert_allclose(
            other.probe, one.probe, rtol=0, atol=1e-10 * abs(one.probe).max()
        )
        assert other.work.imbalance < 1e-9
