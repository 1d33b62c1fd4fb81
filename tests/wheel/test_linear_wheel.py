"""The mistuned wheel without friction against dense matrices, and Whitehead's bound."""

import numpy as np
import pytest
from rings import BLADE, EO, LINK, LOAD, MASS, OWN, PROBE, N, elements, forces, ring_wheel
from scipy import linalg

from bladefem.errors import InputError
from bladefem.hbm.linear.bodies import port_receptance
from bladefem.hbm.model import Damping
from bladefem.wheel.linear_motion import free_wheel
from bladefem.wheel.lumped import LumpedBlades, lumped_matrices, lumped_pattern, lumped_wheel
from bladefem.wheel.model import Pattern, engine_order, frequency_pattern
from bladefem.wheel.one_body import one_body_model
from bladefem.wheel.solve import solve_wheel


def test_free_wheel_is_the_dense_ring():
    """Stiffness and mass deviations of three times the coupling between the blades."""
    rng = np.random.default_rng(0)
    dK = rng.normal(size=(N, 2, 2))
    dK = dK + dK.swapaxes(1, 2)
    dM = 0.2 * rng.normal(size=(N, 1, 1)) * np.eye(2)
    damping = Damping(mass=0.01)
    wheel = ring_wheel(elements(2, 0.0), None, forces({1: 1.0, 3: 0.5}), damping)
    following = np.roll(np.eye(N), 1, axis=1)
    K = np.kron(np.eye(N), OWN) + np.kron(following, LINK) + np.kron(following.T, LINK.T)
    M = np.kron(np.eye(N), MASS)
    C = 0.01 * M
    for b in range(N):
        part = slice(3 * b, 3 * b + 3)
        K[part, part] += BLADE.T @ dK[b] @ BLADE
        M[part, part] += BLADE.T @ dM[b] @ BLADE
    for omega in (0.7, 2.1, 2.9):
        found = free_wheel(wheel, omega, 3, Pattern(dK, dM))
        for h, force in ((1, 1.0), (3, 0.5)):
            w = h * omega
            F = np.kron(np.eye(N), LOAD.T) @ engine_order(N, h * EO, np.array([force]))[:, 0]
            expected = np.kron(np.eye(N), PROBE) @ np.linalg.solve(K - w**2 * M + 1j * w * C, F)
            np.testing.assert_allclose(found[:, h, 0], expected, atol=1e-12 * abs(expected).max())


def test_free_wheel_with_coriolis_forces_is_the_dense_ring():
    """A skew matrix of each blade with its disc; by nodal diameters, and as one real body."""
    G = np.array([[0.0, -0.5, 0.1], [0.5, 0.0, 0.3], [-0.1, -0.3, 0.0]])
    dK = np.random.default_rng(3).normal(size=(N, 2, 2))
    dK = dK + dK.swapaxes(1, 2)
    damping = Damping(mass=0.01)
    wheel = ring_wheel(elements(2, 0.0), None, forces({1: 1.0}), damping, G)
    pattern = Pattern(dK, np.zeros_like(dK))
    body = one_body_model(wheel, pattern).sides[0]
    following = np.roll(np.eye(N), 1, axis=1)
    K = np.kron(np.eye(N), OWN) + np.kron(following, LINK) + np.kron(following.T, LINK.T)
    M = np.kron(np.eye(N), MASS)
    C = 0.01 * M + np.kron(np.eye(N), G)
    for b in range(N):
        part = slice(3 * b, 3 * b + 3)
        K[part, part] += BLADE.T @ dK[b] @ BLADE
    F = np.kron(np.eye(N), LOAD.T)
    force = engine_order(N, EO, np.array([1.0]))[:, 0]
    for w in (0.7, 2.1, 2.9):
        dense = np.kron(np.eye(N), PROBE) @ np.linalg.solve(K - w**2 * M + 1j * w * C, F @ force)
        found = free_wheel(wheel, w, 1, pattern)[:, 1, 0]
        np.testing.assert_allclose(found, dense, atol=1e-12 * abs(dense).max())
        rows = [np.arange(len(body.residual))[body.ports[name]] for name in ("probe", "load")]
        seen = port_receptance(body, Damping(), w, *rows) @ force
        np.testing.assert_allclose(seen, dense, atol=1e-10 * abs(dense).max())


def test_frequency_deviations_move_blade_alone_frequencies():
    """A wheel of separate blades: each resonates where its own deviation puts it."""
    blades = LumpedBlades(count=6, rim=0.0, ground=1e12, shank=1e12, platform=1e-3, disc=1e-3)
    wheel = lumped_wheel(blades, 1, 1.0, 1e4, 1.0)
    deviation = np.array([0.02, -0.01, 0.0, 0.03, -0.04, 0.01])
    pattern = lumped_pattern(blades, (1 + deviation) ** 2 - 1)
    own = np.sqrt(blades.aerofoil / blades.tip)
    for blade, d in enumerate(deviation):
        grid = own * (1 + d) * (1 + np.linspace(-2e-3, 2e-3, 41))
        size = [abs(free_wheel(wheel, w, 1, pattern)[blade, 1, 0]) for w in grid]
        assert abs(grid[int(np.argmax(size))] / own - 1 - d) < 2e-4
    modal = frequency_pattern(np.array([own]), deviation)
    np.testing.assert_allclose(
        modal.stiffness[:, 0, 0], own**2 * ((1 + deviation) ** 2 - 1), rtol=1e-12
    )


@pytest.mark.parametrize("scatter", [0.002, 0.01, 0.05])
def test_whiteheads_bound_holds_without_friction(scatter):
    """(1 + sqrt N) / 2 times the tuned peak (Whitehead 1966): one family of modes, here blades that
    move little of the disc.
    """
    count = 12
    blades = LumpedBlades(count=count, damping=1e-3)
    wheel = lumped_wheel(blades, 3, 1.0, 1e4, 1.0)
    M, K, _ = lumped_matrices(blades)
    # a quarter turn from blade to blade: the coupling of the discs cancels
    own = np.sqrt(linalg.eigh(K, M)[0][0])
    grid = own * np.linspace(0.93, 1.07, 400)
    tuned = max(abs(free_wheel(wheel, w)[0, 1, 0]) for w in grid)
    rng = np.random.default_rng(7)
    largest = 0.0
    for _ in range(4):
        pattern = lumped_pattern(blades, scatter * rng.normal(size=count))
        peak = max(abs(free_wheel(wheel, w, 1, pattern)[:, 1, 0]).max() for w in grid)
        largest = max(largest, peak / tuned)
    assert 1.02 < largest <= (1 + np.sqrt(count)) / 2


def test_bad_patterns_are_refused():
    wheel = ring_wheel(elements(2, 0.0), None, forces({1: 1.0}))
    with pytest.raises(InputError, match=r"pattern.stiffness of shape \(5, 2, 2\): expected \(6"):
        solve_wheel(wheel, 1.0, pattern=Pattern(np.zeros((5, 2, 2))))
    with pytest.raises(InputError, match="deviation -1.2 of blade 2 leaves it no stiffness"):
        frequency_pattern(np.array([1.0]), np.array([0.0, 0.1, -1.2]))
    with pytest.raises(InputError, match="engine order 2.5: expected a whole number"):
        engine_order(N, 2.5, np.array([1.0]))
