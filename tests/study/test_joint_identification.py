"""A joint's friction from measured levels: known parameters come back, and what cannot be told is
said; the measured bolted beam is missed as the documentation says.
"""

from pathlib import Path

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.study.joint_identification import PARAMETERS, fit_joint, joint_curve

BEAM = Path(__file__).parents[2] / "benchmarks" / "bolted_beam.csv"
TRUE = np.array([80.0, 1.5e-3, 0.04, 4e-4, 0.8])


def test_known_parameters_come_back():
    """Levels from micro-slip to full slip."""
    a = np.geomspace(2e-5, 2e-3, 10)
    frequency, damping = joint_curve(TRUE, a)
    found = fit_joint(a, frequency, damping)
    np.testing.assert_allclose(found.values, TRUE, rtol=0.02)
    assert found.known.all() and "determine all" in found.sentence()
    assert ((found.intervals[:, 0] <= TRUE) & (TRUE <= found.intervals[:, 1])).all()


def test_micro_slip_alone_does_not_tell_the_full_slip():
    a = np.geomspace(1e-5, 6e-5, 6)
    frequency, damping = joint_curve(TRUE, a)
    found = fit_joint(a, frequency, damping)
    assert not found.known[PARAMETERS.index("full_slip")]
    assert "do not determine" in found.sentence() and "full_slip" in found.sentence()
    # what it can tell is right all the same: one level further
    further = joint_curve(TRUE, np.array([9e-5]))
    predicted = joint_curve(found.values, np.array([9e-5]))
    np.testing.assert_allclose(predicted[1], further[1], rtol=0.05)


def test_bolted_beam_is_predicted_as_far_as_it_goes():
    """Fitted to four levels of eight. Damping of the others is low by 8 to 22 % (15 % were wanted),
    and the frequency, which rises again in the test, by up to 0.9 % (0.2 % were wanted): friction
    alone softens a joint.
    """
    lines = [line for line in BEAM.read_text().splitlines() if not line.startswith("#")]
    data = np.genfromtxt(lines, delimiter=",", names=True)
    a = 1e-6 * data["displacement_um"]
    f = data["frequency_Hz"]
    z = data["damping_percent"] / 100
    found = fit_joint(a, f, z, np.arange(8) < 4)
    frequency, damping = joint_curve(found.values, a)
    np.testing.assert_allclose(damping[:4], z[:4], rtol=0.05)
    np.testing.assert_allclose(frequency[:4], f[:4], rtol=1e-3)
    miss = damping[4:] / z[4:] - 1
    assert miss.max() < -0.05 and miss.min() > -0.25
    assert -0.01 < (frequency[4:] / f[4:] - 1).min() < -0.002


def test_bad_levels_are_refused():
    with pytest.raises(InputError, match="2 used, expected at least 3"):
        fit_joint(np.ones(2), np.ones(2), np.ones(2))
    with pytest.raises(InputError, match="positive"):
        fit_joint(-np.ones(4), np.ones(4), np.ones(4))
