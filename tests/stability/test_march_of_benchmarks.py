"""The slow march that judges random models, against the verdicts of the library."""

import pytest
from branch_models import random_case, state_of
from march_multipliers import PERIODIC, periodic_march

from bladefem import balance as bf
from bladefem.hbm.stability import UNSTABLE, stability_verdict


def test_an_open_contact_lands_between_two_steps():
    """A motion that strikes twice a period, whose disturbances grow by 1.072 with 63 harmonics, by
    1.0715 with 16 000 steps of the march and more. Where a contact began to stick at the last step
    before it landed they decayed, 0.823 with 1000 steps, and 1.37 or 0.83 with more.
    """
    case = random_case(356, lifts=True)
    point = bf.solve(case.model, 230.25767, 31, 2048)
    assert bf.size(point) == pytest.approx(2.0423e-5, rel=1e-3)
    verdict = stability_verdict(case.model, point)
    found = periodic_march(case, point.omega, state_of(case, point))
    assert found.change < PERIODIC
    assert verdict.verdict == UNSTABLE
    assert found.multiplier == pytest.approx(verdict.multiplier, rel=0.03)
