"""Fully stuck and fully free are two linear responses; reduction by all modes is no reduction; work
balances.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.friction.fourier import to_complex
from bladefem.hbm.model import Damping
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import free_response, solve, stuck_response
from bladefem.reduction.beam import beam_matrices
from bladefem.reduction.matrices import port_model_from_matrices

MODELS = {
    "single mass": single_mass(),
    "block": block(),
    "block with rigid damper": block(damper=True),
    "reference blade": reference_model(points=3, phase=0.7, harmonics=3),
}
OMEGA = {"reference blade": 2 * np.pi * 1300}


@pytest.mark.parametrize("name", MODELS)
def test_huge_load_is_the_stuck_response(name):
    model, omega = MODELS[name], OMEGA.get(name, 0.9)
    heavy = replace(model, elements=replace(model.elements, n0=model.elements.n0 * 1e6))
    solution = solve(heavy, omega, 3, 64)
    exact = stuck_response(model, omega, 3)
    assert solution.converged and solution.states["stick"] == len(model.elements.kt)
    np.testing.assert_allclose(solution.probe, exact, rtol=0, atol=1e-10 * abs(exact).max())


@pytest.mark.parametrize("name", MODELS)
def test_no_load_is_the_free_response(name):
    model, omega = MODELS[name], OMEGA.get(name, 0.9)
    elements = model.elements
    gap = np.where(
        elements.kn > 0, -1e6, 0.0
    )  # open contacts need a gap that the motion does not close
    solution = solve(replace(model, elements=replace(elements, n0=gap)), omega, 3, 64)
    exact = free_response(model, omega, 3)
    assert solution.converged and solution.states["open"] == len(elements.kt)
    np.testing.assert_allclose(solution.probe[1:], exact[1:], rtol=0, atol=1e-10 * abs(exact).max())


def test_the_linear_limits_of_the_blade_are_those_of_its_matrices():
    """Stuck: blade with both platform sides on springs to a mass, the next blade turned by the
    phase, in full dofs.
    """
    kt, mass, phase, omega = 1e6, 0.06, 0.7, 2 * np.pi * 1300
    model = reference_model(kt, mass, 1.0, phase=phase)
    K, M = beam_matrices()
    M[10, 10] += 0.05
    Z = np.zeros((len(K) + 1, len(K) + 1), dtype=complex)
    lam, V = np.linalg.eigh(
        np.linalg.solve(np.linalg.cholesky(M), np.linalg.solve(np.linalg.cholesky(M), K).T)
    )
    modes = np.linalg.solve(np.linalg.cholesky(M).T, V)
    C = M @ modes @ np.diag(2 * 0.002 * np.sqrt(lam)) @ modes.T @ M
    Z[:-1, :-1] = K - omega**2 * M + 1j * omega * C
    force = np.zeros(len(Z))
    force[-3] = 1.0
    np.testing.assert_allclose(
        free_response(model, omega)[1], np.linalg.solve(Z[:-1, :-1], force[:-1])[-2], rtol=1e-8
    )
    Z[-1, -1] = -(omega**2) * mass
    for turn in (1.0, np.exp(1j * phase)):
        row = np.zeros(len(Z), dtype=complex)
        row[10], row[-1] = turn, -1.0
        Z += kt * np.outer(row.conj(), row)
    np.testing.assert_allclose(
        stuck_response(model, omega)[1], np.linalg.solve(Z, force)[-3], rtol=1e-8
    )


def test_all_modes_kept_equal_the_full_model():
    """The forces that were solved by modes balance the body's own dynamic stiffness, without any
    mode.
    """
    rng = np.random.default_rng(3)
    half = rng.normal(size=(20, 20)) / np.sqrt(20)
    K, M = half @ half.T + 0.5 * np.eye(20), np.diag(rng.uniform(0.5, 1.5, 20))
    C = 0.02 * K + 0.01 * M
    everything = {"contact": np.arange(6), "load": np.array([10]), "probe": np.arange(20)}
    model = replace(
        block(nodes=2), sides=(port_model_from_matrices(M, K, everything, C=C),), damping=Damping()
    )
    omega = 0.9
    s = solve(model, omega, 5, 128)
    assert s.converged and s.states["slip"] + s.states["lift"]
    contact = s.f.copy()
    contact[:, 0, 0] -= model.elements.n0
    for h, force in enumerate(to_complex(contact.reshape(6, -1)).T):
        Z = K - (h * omega) ** 2 * M + 1j * h * omega * C
        push = -np.concatenate([force, np.zeros(14)])
        push[10] += h == 1
        np.testing.assert_allclose(Z @ s.probe[h], push, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("model", "omegas"),
    [
        (single_mass(), np.linspace(0.5, 1.8, 14)),
        (block(force=2.0), np.linspace(0.5, 1.5, 11)),
        (block(damper=True, force=1.0), np.linspace(0.9, 1.5, 7)),
        (reference_model(points=5, load=1.4, harmonics=5), 2 * np.pi * np.linspace(1100, 1450, 15)),
    ],
)
def test_work_of_the_excitation_is_lost_in_damping_and_friction(model, omegas):
    solutions = [solve(model, omega, 5, 128) for omega in omegas]
    assert all(s.converged for s in solutions)
    assert max(s.work.imbalance for s in solutions) < 1e-8
    assert any(s.states["slip"] + s.states["lift"] for s in solutions)
    assert min(s.work.friction for s in solutions) > -1e-12 * max(s.work.input for s in solutions)


def test_a_solution_knows_its_residual_in_physical_units():
    s = solve(single_mass(), 1.2, 3, 64)
    assert s.residual < 1e-10 and s.residual_displacement < 1e-9 and s.residual_force < 1e-9
    assert s.method == "newton" and s.reason == "residual within tolerance"
