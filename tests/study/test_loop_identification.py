"""Contacts from hysteresis loops: drawn by closed form and by a rule of its own, noise, and what
loops cannot tell.
"""

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.study.loop_identification import MeasuredLoop, fit_loops, loop_force

TURNS = 2 * np.pi * np.arange(400) / 400


def corners(amplitude, kt, limit, count=400):
    """One period of a Jenkins element: the parallelogram by its corners, no marching."""
    x = amplitude * np.cos(2 * np.pi * np.arange(count) / count)
    slips = 2 * limit / kt
    down = np.maximum(limit - kt * (amplitude - x), -limit)
    up = np.minimum(-limit + kt * (amplitude + x), limit)
    if slips > 2 * amplitude:
        return x, kt * x
    return x, np.where(np.arange(count) < count // 2, down, up)


def two_loops(loads, mu=0.4, kt=3e7, noise=0.0, rng=None):
    loops = []
    for load in loads:
        x, f = corners(8e-6, kt, mu * load)
        if rng is not None:
            f = f + noise * abs(f).max() * rng.normal(size=len(f))
        loops.append(MeasuredLoop(x, f + 3.0, load))
    return loops


def test_friction_and_stiffness_come_back_from_corners():
    fit = fit_loops(two_loops((40.0, 80.0)))
    assert fit.names == ("mu", "kt")
    np.testing.assert_allclose(fit.values, [0.4, 3e7], rtol=2e-3)
    assert fit.knowledge.known.all() and "all parameters" in fit.sentence()


def test_intervals_hold_what_they_promise():
    """Of 60 noisy pairs of loops, both true values are inside in at least 90 % of the cases."""
    rng = np.random.default_rng(1)
    held = []
    for _ in range(60):
        fit = fit_loops(two_loops((40.0, 80.0), noise=0.02, rng=rng), error=0.02)
        (low, high), true = fit.knowledge.intervals.T, np.array([0.4, 3e7])
        held += list((low < true) & (true < high))
    assert np.mean(held) >= 0.9


def test_an_unknown_normal_load_leaves_the_product():
    loops = [MeasuredLoop(loop.displacement, loop.force) for loop in two_loops((50.0,))]
    fit = fit_loops(loops)
    values = dict(zip(fit.names, fit.values, strict=True))
    assert values["mu"] * values["load"] == pytest.approx(20.0, rel=2e-3)
    assert fit.knowledge.open == [("mu", "load")] and "mu and load apart" in fit.sentence()
    assert values["kt"] == pytest.approx(3e7, rel=2e-3)


def test_sticking_loops_do_not_tell_friction():
    x = 1e-6 * np.cos(TURNS)
    loops = [MeasuredLoop(x, 3e7 * x, load) for load in (400.0, 800.0)]
    fit = fit_loops(loops)
    assert fit.knowledge.open == [("mu",)] and list(fit.knowledge.known) == [False, True]
    # what the force reached under the lower normal load is a bound
    low, high = fit.knowledge.intervals[0]
    assert low == pytest.approx(30.0 / 400.0, rel=0.05) and high == np.inf


def rule(x, normal, mu, kt):
    """Friction by the states of Griffin and Menq: stick from the last stop, slip at the limit, a
    stop where the motion turns or the limit outruns it.
    """
    f, start, at, force = 0.0, 0.0, x[0], []
    for i in [*range(len(x)), *range(len(x)), *range(len(x))]:
        f = start + kt * (x[i] - at)
        if abs(f) >= mu * normal[i]:
            f = np.sign(f) * mu * normal[i]
            start, at = f, x[i]
        force.append(f)
    return np.array(force[-len(x) :])


def test_varying_normal_load_tells_all_four():
    """Loops whose faces approach each other in the rhythm of the motion; normal load not measured.
    The limit is mu N0 + mu kn z: of the four, kn, mu and N0 are known by two products.
    """
    approach = 2e-6 * np.cos(TURNS + 1.0)
    x = 8e-6 * np.cos(TURNS)
    f = rule(x, 60.0 + 1e7 * approach, 0.4, 3e7)
    fit = fit_loops([MeasuredLoop(x, f, None, approach)])
    values = dict(zip(fit.names, fit.values, strict=True))
    assert values["kt"] == pytest.approx(3e7, rel=0.01)
    assert values["mu"] * values["load"] == pytest.approx(24.0, rel=0.01)
    assert values["mu"] * values["kn"] == pytest.approx(4e6, rel=0.02)
    assert fit.knowledge.open == [("mu", "kn", "load")]
    # with the normal load of the rig all are known
    fit = fit_loops([MeasuredLoop(x, f, 60.0, approach)])
    values = dict(zip(fit.names, fit.values, strict=True))
    assert values == pytest.approx({"mu": 0.4, "kt": 3e7, "kn": 1e7}, rel=0.02)
    assert not fit.knowledge.open


def test_derivatives_are_those_of_differences():
    values = {"mu": 0.4, "kt": 3e7, "kn": 1e7, "load": 60.0}
    loop = MeasuredLoop(8e-6 * np.cos(TURNS), np.zeros(400), None, 2e-6 * np.cos(TURNS + 1.0))
    _, slope = loop_force(loop, values)
    for i, name in enumerate(values):
        up, down = (
            loop_force(loop, values | {name: values[name] * np.exp(step)})[0]
            for step in (1e-7, -1e-7)
        )
        np.testing.assert_allclose(slope[:, i], (up - down) / 2e-7, atol=1e-4)


def test_bad_loops_are_refused():
    with pytest.raises(InputError, match="none given"):
        fit_loops([])
    x = np.cos(TURNS)
    with pytest.raises(InputError, match="loop 1: force of shape"):
        fit_loops([MeasuredLoop(x, x[:9])])
    with pytest.raises(InputError, match="expected a motion of at least 8 samples"):
        fit_loops([MeasuredLoop(0 * x, x)])
    with pytest.raises(InputError, match="loop 1: normal load -1"):
        fit_loops([MeasuredLoop(x, x, -1.0)])
