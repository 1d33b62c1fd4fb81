"""Natural frequencies of the linear limits."""

import numpy as np
import pytest

from bladefem.hbm import linear_resonances
from bladefem.hbm.linear_resonances import free_resonances, stuck_partners, stuck_resonances
from bladefem.hbm.reference_blade import reference_model
from bladefem.study.adaptive.band_sweep import default_band

HZ = 2 * np.pi


@pytest.mark.parametrize(
    ("kt", "mass", "number", "frequency"),
    [
        (1e6, 0.06, 2, 1385.7),
        (1e6, 0.03, 2, 1519.8),
        (3e6, 0.12, 2, 1633.9),
        (2e7, 0.06, 1, 1087.7),
    ],
)
def test_stuck_mode_of_a_blade_is_not_the_dampers_own(kt, mass, number, frequency):
    """On soft contacts the stuck mode next above the blade's first is the damper's, bouncing on its
    springs.

    1385.7 and 1087.7 Hz are the beam theory's. Overlaps of the modes: 0.81, 0.74, 0.80, 0.75.
    """
    model = reference_model(kt, mass, 8.0, points=4, harmonics=3)
    stuck, partner = stuck_resonances(model) / HZ, stuck_partners(model)[1] / HZ
    assert partner == stuck[number] == pytest.approx(frequency, rel=1e-4)
    free = free_resonances(model)[1] / HZ
    low, high = default_band(model, 2)
    assert low < min(free, partner) < max(free, partner) < high
    assert high - low < 1.5 * abs(free - partner)


def test_stuck_modes_are_computed_once_a_model(monkeypatch):
    """Sweeps, their bands and peaks ask for them again and again."""
    calls = []
    compute = linear_resonances._stuck_modes

    def counted(model, h):
        calls.append(h)
        return compute(model, h)

    monkeypatch.setattr(linear_resonances, "_stuck_modes", counted)
    model = reference_model(points=2)
    first = linear_resonances.stuck_resonances(model)
    linear_resonances.stuck_resonances(model)[:] = 0.0
    linear_resonances.stuck_partners(model)
    assert calls == [1]
    assert np.array_equal(linear_resonances.stuck_resonances(model), first)
