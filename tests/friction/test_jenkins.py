"""1-D elements, sampled and exact: closed forms, twins, orders, derivatives, and the corner
cases.
"""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import jenkins_coefficients
from friction_cases import decay, event_driven, numeric_jacobian, plain_jenkins, random_case, single

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.closed_form import jenkins
from bladefem.friction.kernel_1d_exact import evaluate_exact
from bladefem.friction.states import GROSS_SLIP, PARTIAL_SLIP, SEPARATED, STICK


def cosine(amplitude: float, H: int = 5, mean: float = 0.0, d: int = 2) -> np.ndarray:
    w = np.zeros((1, d, 2 * H + 1))
    w[0, 1, :2] = mean, amplitude
    return w


@pytest.mark.parametrize("amplitude", [0.3, 0.999, 1.0, 1.001, 1.3, 2.0, 10.0, 1e4])
def test_exact_element_meets_the_closed_forms(amplitude):
    """All harmonics, k_eq, c_eq and energy at 1e-12, from full stick to A/x_cr = 1e4.

    The force is the difference of kt w and kt times the slider: rounding leaves 1e-16 of kt A,
    hence the scale.
    """
    forces = evaluate_exact(single(kt=2.0, mu=0.5, n0=4.0), cosine(amplitude))
    expected, energy = jenkins_coefficients(amplitude, 2.0, 2.0, 5), jenkins(amplitude, 2.0, 2.0)
    np.testing.assert_allclose(
        forces.f[0, 1], expected, rtol=0, atol=1e-12 * max(2.0, 2e-3 * amplitude)
    )
    scale = 1e-12 * 2.0
    assert forces.f[0, 1, 1] / amplitude == pytest.approx(energy.stiffness, abs=scale)
    assert -forces.f[0, 1, 2] / amplitude == pytest.approx(energy.damping, abs=scale)
    assert forces.dissipated[0] == pytest.approx(energy.energy, abs=1e-12 * 4 * 2 * amplitude)


@pytest.mark.parametrize("seed", range(3))
def test_exact_element_against_an_independent_event_driven_one(seed):
    """Varying load, lift-off, gaps; other brackets, roots and quadrature. Agreement at 1e-9 of the
    force.
    """
    elements, w = random_case(seed, 30, 3, 1)
    ours = evaluate_exact(elements, w).f
    for e in range(30):
        other = event_driven(elements.kt[e], elements.kn[e], elements.mu[e], elements.n0[e], w[e])
        np.testing.assert_allclose(ours[e], other, rtol=0, atol=1e-9 * max(1, np.abs(other).max()))


def test_sampled_element_against_its_plain_twin():
    elements, w = random_case(3, 40, 3, 1)
    ours = evaluate(elements, w, 64).f
    twin = [
        plain_jenkins(elements.kt[e], elements.kn[e], elements.mu[e], elements.n0[e], w[e], 64)
        for e in range(40)
    ]
    np.testing.assert_allclose(ours, twin, rtol=0, atol=1e-13)


def test_sampled_element_is_second_order_with_lift_off_among_the_cases():
    """Error of 200 random elements against the exact one: 2.5e-4 at 128 samples, falls by 16 for
    every factor 4.
    """
    elements, w = random_case(4, 200, 3, 1)
    exact = evaluate_exact(elements, w)
    assert (exact.shares[:, 2] > 0).sum() > 20
    errors = [np.linalg.norm(evaluate(elements, w, S).f - exact.f) for S in (128, 512, 2048, 8192)]
    orders = np.log2(np.divide(errors[:-1], errors[1:])) / 2
    assert orders.min() > 1.8
    assert orders.mean() == pytest.approx(2, abs=0.15)


def test_200_random_motions_are_periodic_after_one_period():
    """The kernel, which marches two periods, gives the ninth period of the twin."""
    elements, w = random_case(5, 200, 2, 1)
    ninth = [
        plain_jenkins(elements.kt[e], elements.kn[e], elements.mu[e], elements.n0[e], w[e], 32, 9)
        for e in range(200)
    ]
    np.testing.assert_allclose(evaluate(elements, w, 32).f, ninth, rtol=0, atol=1e-13)


@pytest.mark.parametrize("kn", [0.0, 1.0])
@pytest.mark.parametrize("exact", [False, True])
def test_jacobian_against_finite_differences(exact, kn):
    """Worst of 150 elements at 1e-6; elements within one step of a change of state would show its
    kink.
    """
    elements, w = random_case(6, 150, 3, 1, kn)
    force = (
        (lambda x: evaluate_exact(elements, x)) if exact else (lambda x: evaluate(elements, x, 64))
    )
    numeric = numeric_jacobian(lambda x: force(x).f, w, 1e-6)
    np.testing.assert_allclose(force(w).dfdw, numeric, rtol=0, atol=1e-6)


def test_jacobian_with_a_prescribed_load_series():
    elements, w = random_case(7, 60, 2, 1)
    load = np.random.default_rng(7).normal(size=(60, 40)) + 1.5
    force = lambda x: evaluate(elements, x, 40, load=load)
    np.testing.assert_allclose(
        force(w).dfdw, numeric_jacobian(lambda x: force(x).f, w, 1e-6), rtol=0, atol=1e-6
    )


def test_series_and_coefficients_of_the_load_agree():
    """N(t) = 2 + 1.5 cos 2 tau as samples, as coefficients, and as motion of the normal freedom."""
    w = cosine(2.0, H=3)
    load = np.zeros((1, 7))
    load[0, [0, 3]] = 2.0, 1.5
    S = 4096
    series = 2 + 1.5 * np.cos(4 * np.pi * np.arange(S) / S)[None]
    moved = w.copy()
    moved[0, 0, 3] = 1.5
    a = evaluate(single(mu=0.4), w, S, load=series).f
    b = evaluate(single(mu=0.4, kn=1.0, n0=2.0), moved, S).f
    c = evaluate_exact(single(mu=0.4), w, load=load).f
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-13)
    np.testing.assert_allclose(a, c, rtol=0, atol=2e-6)


def test_events_buy_accuracy_with_few_brackets():
    """12 (H+1) = 48 brackets and 400 give the same to rounding; 64 samples are 1e-3 off."""
    elements, w = random_case(8, 100, 3, 1)
    few, many = evaluate_exact(elements, w), evaluate_exact(elements, w, brackets=400)
    np.testing.assert_allclose(few.f, many.f, rtol=0, atol=1e-12)
    assert np.abs(evaluate(elements, w, 64).f - many.f).max() > 1e-3


@pytest.mark.parametrize("H", [5, 7, 11])
def test_events_at_rough_motions(H):
    """Motions whose harmonics do not fall: 3000 elements, 12 (H+1) brackets against 2003; measured
    3e-14, J 7e-14.

    A root of N carries the rounding of its time as well: an element that closes must not alternate
    between stick and slip at one instant. And a maximum that shares its bracket with a minimum
    counts. Without either, forces of 1 to 10 in 2000 elements were up to 0.5 off.
    """
    elements, w = random_case(9, 3000, H, 1)
    few, many = (evaluate_exact(elements, w / decay(H), brackets=b) for b in (None, 2003))
    assert few.converged and many.converged
    np.testing.assert_allclose(few.f, many.f, rtol=0, atol=1e-12)
    np.testing.assert_allclose(few.dfdw, many.dfdw, rtol=0, atol=1e-11)


def test_motion_that_is_not_finite_is_said():
    w = cosine(1.0)
    w[0, 1, 1] = np.nan
    for forces in (
        evaluate(single(), w, 64),
        evaluate_exact(single(), w),
        evaluate(single(tangents=2), np.concatenate([w, w[:, 1:]], axis=1), 64),
    ):
        assert not forces.converged and "not finite" in forces.reason
    with pytest.raises(InputError, match="load: contains values that are not finite"):
        evaluate(single(), cosine(1.0), 64, load=np.full((1, 64), np.nan))
    with pytest.raises(
        InputError, match="brackets: 1 intervals for 5 harmonics, expected at least 24"
    ):
        evaluate_exact(single(), cosine(1.0), brackets=1)


def test_states_and_shares():
    elements = Elements(
        *(np.array(x, dtype=float) for x in ([1] * 5, [1] * 5, [0.5] * 5, [9, 1.2, 0.5, -3, 0.5])),
        tangents=1,
    )
    w = np.repeat(cosine(1.0), 5, axis=0)
    w[4, 0, 1] = 1.0
    for forces in (evaluate(elements, w, 256), evaluate_exact(elements, w)):
        assert list(forces.state[:4]) == [STICK, PARTIAL_SLIP, GROSS_SLIP, SEPARATED]
        np.testing.assert_allclose(forces.shares.sum(1), 1, atol=1e-12)
        assert forces.shares[4, 2] == pytest.approx(
            1 / 3, abs=0.01
        )  # 0.5 + cos tau < 0 for a third of the period
        assert forces.converged


def test_initial_gap_closes_only_at_the_crest():
    """n0 = -0.5, kn = 1, w_n = cos tau: contact where cos tau > 0.5, mean force by hand."""
    w = np.zeros((1, 2, 7))
    w[0, 0, 1] = 1.0
    mean = (np.sqrt(3) / 2 - 0.5 * np.pi / 3) / np.pi
    assert evaluate_exact(single(kn=1.0, n0=-0.5), w).f[0, 0, 0] == pytest.approx(mean, abs=1e-15)
    assert evaluate(single(kn=1.0, n0=-0.5), w, 4096).f[0, 0, 0] == pytest.approx(mean, abs=1e-6)


@pytest.mark.parametrize("change", [{"mu": 0.0}, {"n0": 0.0}, {"kt": 0.0}])
def test_no_friction_without_coefficient_load_or_stiffness(change):
    for forces in (
        evaluate(single(**{"n0": 1.0, **change}), cosine(1.0, mean=0.3), 64),
        evaluate_exact(single(**{"n0": 1.0, **change}), cosine(1.0, mean=0.3)),
    ):
        np.testing.assert_allclose(forces.f[0, 1], 0, atol=1e-14)
        assert forces.dissipated[0] == pytest.approx(0, abs=1e-14)


def test_dissipation_is_never_negative():
    elements, w = random_case(9, 400, 4, 1)
    assert evaluate_exact(elements, w).dissipated.min() > -1e-13


def test_input_that_does_not_fit_is_refused():
    elements, w = random_case(0, 3, 2, 1)
    with pytest.raises(InputError, match="does not fit"):
        evaluate(elements, w[:2], 64)
    with pytest.raises(InputError, match="samples"):
        evaluate(elements, w, 8)
    with pytest.raises(InputError, match="load"):
        evaluate(elements, w, 64, load=np.ones((3, 32)))
    with pytest.raises(InputError, match="not negative"):
        evaluate(Elements(-elements.kt, elements.kn, elements.mu, elements.n0, 1), w, 64)
