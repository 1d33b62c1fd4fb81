"""The motion of harmonics that were left out: against the solution that has them, and where one
meets a mode.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.fourier import to_complex
from bladefem.hbm.model import Damping
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.hbm.truncation_indicator import _higher_force_harmonics, truncation_indicator


@pytest.mark.parametrize("model", [single_mass(), block(nodes=2, force=3.0)], ids=["1-D", "3-D"])
def test_forces_of_the_next_harmonics(model):
    """Those of the sampled kernel at the same motion, to what 4 instants a harmonic leave; measured
    3 % and 4 %.
    """
    point = solve(model, 0.9, 3, 128)
    n, d, _ = point.w.shape
    w = np.zeros((n, 1 + model.elements.tangents, 31))
    w[:, -d:, :7] = point.w
    expected = to_complex(evaluate(model.elements, w, 2048, jacobian=False).f[:, -d:])[
        :, :, 4:
    ].reshape(n * d, -1)
    found = _higher_force_harmonics(model, point.w[None], 15)[:, 0].T
    assert abs(expected).max() > 1e-2 * abs(to_complex(point.f))[:, :, 1].max()
    assert np.linalg.norm(found - expected) < 0.08 * np.linalg.norm(expected)


def test_an_internal_resonance_stands_out():
    """Harmonic 9 meets a mode of the slipping blade near 1897 Hz: 7 harmonics are 0.6 % off there,
    nowhere near.
    """
    model = reference_model(2e7, 0.06, 1.0, phase=np.pi, points=8, harmonics=15)
    points = [solve(model, 2 * np.pi * f, 7, 256) for f in np.linspace(1837, 1957, 13)]
    moved = truncation_indicator(model, points, 15)
    assert (
        points[moved.argmax()].frequency == pytest.approx(1897, abs=1)
        and moved.max() > 3 * np.sort(moved)[-4]
    )
    richer = [
        abs(solve(model, p.omega, 15, 256, start=p).probe[1, 0] / p.probe[1, 0] - 1) for p in points
    ]
    assert np.argmax(richer) == moved.argmax() and max(richer) == pytest.approx(
        moved.max(), rel=1.0
    )


def test_points_of_other_harmonics_are_refused():
    model = single_mass()
    with pytest.raises(InputError, match="harmonics"):
        truncation_indicator(model, [solve(model, 0.9, 3, 128), solve(model, 0.9, 5, 128)], 7)


def test_a_resonance_without_damping_is_no_failure():
    model = replace(block(nodes=2, force=2.0), damping=Damping())
    points = [
        solve(model, float(omega) / 5, 3, 128) for omega in model.side(1).omega
    ]  # harmonic 5 hits it exactly
    moved = truncation_indicator(
        model, [p for p in points if p.converged and p.states["stick"] < 3], 7
    )
    assert len(moved) and np.isfinite(moved).all()
