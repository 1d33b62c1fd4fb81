"""What the verdicts of the page of claims are computed with."""

from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.damper.accelerate import Rules, iterate
from bladefem.damper.loops import FoundationMotion, steady
from bladefem.damper.paper import platform
from bladefem.damper.zmass import MassOnFoundation
from bladefem.data import Elements
from verification.paper.blades import paper_blade
from verification.paper.claim import verdict
from verification.paper.claims_blades import dips
from verification.paper.claims_response import slip_share


def test_verdict_words():
    assert [verdict(True), verdict(False, True), verdict(False)] == [
        "holds",
        "holds in part",
        "fails",
    ]


@pytest.mark.parametrize(
    ("values", "found"), [([3, 1, 2], True), ([1, 2, 3], False), ([3, 1, 2, 1.5], False)]
)
def test_a_dip_falls_and_rises_once(values, found):
    assert dips(values) is found


@pytest.mark.parametrize("ratio", [0.2, 0.7, 1.5])
def test_share_of_slip_in_closed_form(ratio):
    """Constant load, limit over k A = r: sticks for acos(1 - 2 r) of each half turn; one sample of
    1024 either way.
    """
    amplitude, one = 1e-5, np.ones(2)
    elements = Elements(
        1e6 * one, 0 * one, 0.5 * one, np.array([2 * ratio * 10.0, 0.0]), 1
    )  # the second not pressed
    motion = SimpleNamespace(harmonics=1, w=np.array([[[0.0, amplitude, 0.0]]] * 2))
    exact = max(0.0, 1 - np.arccos(max(1 - 2 * ratio, -1.0)) / np.pi)
    assert slip_share(motion, elements) == pytest.approx(exact, abs=4e-3)


def test_the_loop_tells_its_steps():
    """Falling below 2 % ends it; as many steps as evaluations of the damper."""
    found = iterate(platform(paper_blade(load=1.4), 2 * np.pi * 1315.5, 1), "amplitude", Rules())
    assert found.converged and len(found.steps) == found.iterations
    assert found.steps[-1] < 0.02 < min(found.steps[:-1])


def test_a_lag_of_a_whole_cycle_is_none():
    works = [
        steady(MassOnFoundation(), FoundationMotion(2, lag=lag), 500).motion.force
        for lag in (0.0, 0.5, 1.0)
    ]
    np.testing.assert_allclose(works[2], works[0], atol=1e-3 * abs(works[0]).max())
    assert abs(works[1] - works[0]).max() > 0.1 * abs(works[0]).max()
