"""2-D elements: exact orbits, order, periodic state, derivatives, and the limits in which they are
1-D.
"""

from __future__ import annotations

import numpy as np
import pytest
from friction_cases import (
    coefficients,
    motion,
    numeric_jacobian,
    radial_return,
    random_case,
    single,
)

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.closed_form import circular_orbit_work
from bladefem.friction.coulomb_2d import force_at_middle, march_edge
from bladefem.friction.fourier import to_complex
from bladefem.friction.kernel_1d_exact import evaluate_exact
from bladefem.friction.states import SEPARATED, STICK
from bladefem.friction.trigonometric_tables import trigonometric_tables


def ellipse(a: float, b: float, H: int = 3) -> np.ndarray:
    """w = (0, a cos tau, b sin tau)."""
    w = np.zeros((1, 3, 2 * H + 1))
    w[0, 1, 1], w[0, 2, 2] = a, b
    return w


@pytest.mark.parametrize("samples", [16, 64, 512])
@pytest.mark.parametrize("ratio", [1.05, 1.5, 10.0, 1e3, 1e5])
def test_circular_orbit_is_exact_at_any_number_of_samples(ratio, samples):
    """Work of the closed form to rounding (1e-6 asked), up to rigid Coulomb friction.

    It holds as long as the lag acos(F / kA) is above half a step, so that the slip never pauses on
    an edge.
    """
    forces = evaluate(single(kt=2.0, mu=0.5, n0=4.0, tangents=2), ellipse(ratio, ratio), samples)
    assert forces.dissipated[0] == pytest.approx(circular_orbit_work(ratio, 2.0, 2.0), rel=1e-10)
    assert forces.shares[0, 1] == pytest.approx(1)


@pytest.mark.parametrize("ratio", [1.3, 10.0, 300.0])
def test_second_order_on_an_ellipse_from_soft_to_stiff(ratio):
    """Against 65536 samples; plain radial return has order 1 and 4e-3 where this has 1e-5 (ratio
    10, 1024 samples).
    """
    element, w = single(tangents=2), ellipse(ratio, 0.4 * ratio)
    best = evaluate(element, w, 65536).f
    errors = [np.linalg.norm(evaluate(element, w, S).f - best) for S in (256, 1024, 4096)]
    assert np.log2(errors[0] / errors[2]) / 4 == pytest.approx(2, abs=0.35)
    tau = 2 * np.pi * np.arange(1024) / 1024
    path = np.stack([motion(w[0, 1], tau), motion(w[0, 2], tau)])
    plain = coefficients(radial_return(1.0, 1.0, np.ones(1024), path), 3)
    assert np.linalg.norm(plain - best[0, 1:]) > 20 * errors[1]


@pytest.mark.parametrize("seed", range(2))
def test_against_radial_return_extrapolated(seed):
    """Plain radial return at 20 000 and 40 000 samples, extrapolated: independent of the half-angle
    map.
    """
    elements, w = random_case(seed, 6, 2, 2)
    ours = evaluate(elements, w, 4096).f
    for e in range(6):
        twins = []
        for S in (20000, 40000):
            tau = 2 * np.pi * np.arange(S) / S
            N = elements.n0[e] + elements.kn[e] * motion(w[e, 0], tau)
            path = np.stack([motion(w[e, 1], tau), motion(w[e, 2], tau)])
            twins.append(coefficients(radial_return(elements.kt[e], elements.mu[e], N, path, 2), 2))
        np.testing.assert_allclose(
            ours[e, 1:], 2 * twins[1] - twins[0], rtol=0, atol=2e-5 * max(1, np.abs(ours).max())
        )


def test_motion_on_a_line_is_the_1d_element():
    """A skewed line through the plane: the force of the 1-D element along it, none across; lift-off
    among the cases.
    """
    elements, flat = random_case(2, 60, 3, 1)
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi, 60)
    w = np.stack(
        [flat[:, 0], flat[:, 1] * np.cos(angle)[:, None], flat[:, 1] * np.sin(angle)[:, None]],
        axis=1,
    )
    solid = Elements(elements.kt, elements.kn, elements.mu, elements.n0, tangents=2)
    f, exact = evaluate(solid, w, 4096).f, evaluate_exact(elements, flat).f
    along = f[:, 1] * np.cos(angle)[:, None] + f[:, 2] * np.sin(angle)[:, None]
    across = f[:, 2] * np.cos(angle)[:, None] - f[:, 1] * np.sin(angle)[:, None]
    np.testing.assert_allclose(along, exact[:, 1], rtol=0, atol=1e-4)
    np.testing.assert_allclose(f[:, 0], exact[:, 0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(across, 0, rtol=0, atol=1e-12)


def test_the_frame_of_the_tangents_does_not_matter():
    elements, w = random_case(3, 80, 3, 2)
    c, s = np.cos(0.7), np.sin(0.7)
    Q = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    turned, f = (np.einsum("ab,nbk->nak", Q, x) for x in (w, evaluate(elements, w, 64).f))
    np.testing.assert_allclose(evaluate(elements, turned, 64).f, f, rtol=0, atol=1e-9)


def test_conjugate_motion_is_the_mirror_image():
    """A travelling wave the other way round: time reversed in the first tangent's mirror gives the
    mirrored force.
    """
    w = ellipse(3.0, 1.0)
    mirrored = w * np.array([1, 1, -1])[None, :, None]
    f, g = evaluate(single(tangents=2), w, 128).f, evaluate(single(tangents=2), mirrored, 128).f
    np.testing.assert_allclose(
        to_complex(g), to_complex(f) * np.array([1, 1, -1])[None, :, None], atol=1e-13
    )


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("kn", [0.0, 1.0])
def test_jacobian_against_finite_differences(kn, precision):
    """Implicit derivative of the periodic state, to 1e-6 of the largest of an element; 200
    elements, H = 3.

    Forces repeat to 6e-13, hence the step.
    """
    elements, w = random_case(4, 200, 3, 2, kn)
    forces = evaluate(elements, w, 64, precision=precision)
    numeric = numeric_jacobian(lambda x: evaluate(elements, x, 64).f, w, 1e-6)
    largest = np.maximum(np.abs(numeric).max(axis=(1, 2, 3, 4), keepdims=True), 1e-9)
    assert forces.converged
    np.testing.assert_allclose(forces.dfdw / largest, numeric / largest, rtol=0, atol=1e-6)


@pytest.mark.parametrize(("H", "samples", "kn"), [(3, 64, 1.0), (3, 64, 0.0), (5, 65, 1.0)])
def test_the_vector_kernel_is_the_plain_one(H, samples, kn):
    """Forces, derivatives and shares of 100 elements against the readable definition."""
    elements, w = random_case(H, 100, H, 2, kn)
    vector = evaluate(elements, w, samples)
    plain = evaluate(elements, w, samples, kernel="plain")
    assert vector.converged and plain.converged
    np.testing.assert_allclose(vector.f, plain.f, rtol=0, atol=1e-10)
    np.testing.assert_allclose(vector.dfdw, plain.dfdw, rtol=0, atol=1e-8)
    np.testing.assert_allclose(vector.shares, plain.shares, rtol=0, atol=1e-12)


def test_the_kernels_are_one_under_a_prescribed_load():
    elements, w = random_case(11, 40, 3, 2)
    load = elements.n0[:, None] + np.cos(2 * np.pi * np.arange(64) / 64 + np.arange(40)[:, None])
    vector = evaluate(elements, w, 64, load=load)
    plain = evaluate(elements, w, 64, load=load, kernel="plain")
    np.testing.assert_allclose(vector.f, plain.f, rtol=0, atol=1e-10)
    np.testing.assert_allclose(vector.dfdw, plain.dfdw, rtol=0, atol=1e-8)


def test_an_unknown_kernel_is_refused():
    with pytest.raises(InputError, match="expected one of vector, plain"):
        evaluate(single(tangents=2), ellipse(1.0, 1.0), 64, kernel="fast")


@pytest.mark.parametrize(("H", "samples"), [(1, 9), (2, 18), (5, 64), (7, 65), (9, 46)])
def test_jacobian_for_any_number_of_harmonics_and_samples(H, samples):
    """Sums over time are folded and tiled: odd, even and fourfold numbers of samples; tiles up to 8
    and beyond.

    To 1e-6 of the largest of an element: measured 2e-7.
    """
    elements, w = random_case(9, 40, H, 2)
    numeric = numeric_jacobian(lambda x: evaluate(elements, x, samples).f, w, 1e-6)
    largest = np.maximum(np.abs(numeric).max(axis=(1, 2, 3, 4), keepdims=True), 1e-9)
    np.testing.assert_allclose(
        evaluate(elements, w, samples).dfdw / largest, numeric / largest, rtol=0, atol=1e-6
    )


@pytest.mark.parametrize("H", [1, 3, 5, 9])
def test_a_derivative_summed_in_single_precision_is_that_in_double(H):
    """1000 elements; half are within 7e-8, 99 in a hundred within 7e-7. Forces are equal.

    The worst, up to 1e-4, slip while the load begins, where the angle depends on the motion as
    1/force, or are so close to the limit that their periodic state is nearly not unique.
    """
    elements, w = random_case(10, 1000, H, 2)
    double, single = (
        evaluate(elements, w, 96, precision=precision) for precision in ("double", "single")
    )
    np.testing.assert_allclose(single.f, double.f, rtol=0, atol=1e-14)
    off = np.abs(single.dfdw - double.dfdw).reshape(1000, -1).max(axis=1)
    assert np.quantile(off, 0.99) < 1e-6
    assert off.max() < 5e-4
    with pytest.raises(InputError, match="precision"):
        evaluate(elements, w, 96, precision="half")


def test_jacobian_with_a_prescribed_load_series():
    elements, w = random_case(5, 60, 2, 2)
    load = np.random.default_rng(5).normal(size=(60, 48)) + 1.5
    force = lambda x: evaluate(elements, x, 48, load=load)
    np.testing.assert_allclose(
        force(w).dfdw, numeric_jacobian(lambda x: force(x).f, w, 1e-7), rtol=0, atol=1e-6
    )


def test_full_stick_and_full_separation_are_linear():
    w = random_case(6, 2, 3, 2)[1] * 1e-3
    elements = Elements(
        *(np.array(x, dtype=float) for x in ([2, 2], [3, 3], [0.5, 0.5], [5, -5])), tangents=2
    )
    forces = evaluate(elements, w, 64)
    assert list(forces.state) == [STICK, SEPARATED]
    expected = np.array([3, 2, 2])[:, None] * w[0] + np.array([5, 0, 0])[:, None] * np.eye(7)[0]
    np.testing.assert_allclose(forces.f[0], expected, atol=1e-14)
    np.testing.assert_allclose(forces.f[1], 0, atol=0)
    eye = np.einsum("ab,kl->akbl", np.diag([3.0, 2, 2]), np.eye(7))
    np.testing.assert_allclose(forces.dfdw[0], eye, atol=1e-13)


def test_jacobian_of_a_shaken_down_element():
    """A mean displacement beyond the limit and a small vibration: slips once, then sticks; the
    memory is in dfdw.
    """
    w = random_case(7, 40, 2, 2)[1] * 0.05
    w[:, 1, 0] += 2.0
    elements = Elements(*(np.full(40, x) for x in (1.0, 0.3, 0.5, 2.0)), tangents=2)
    forces = evaluate(elements, w, 64)
    assert (forces.state == STICK).sum() > 5
    numeric = numeric_jacobian(lambda x: evaluate(elements, x, 64).f, w, 1e-7)
    np.testing.assert_allclose(forces.dfdw, numeric, rtol=0, atol=2e-5)


def plainly_marched(element: Elements, w: np.ndarray, samples: int) -> tuple[np.ndarray, int]:
    """(2, K) tangential harmonics of one element, period after period without leaps, and their
    number.
    """
    H, kt, mu = w.shape[1] // 2, element.kt[0], element.mu[0]
    knots = trigonometric_tables(H, samples).knots[np.arange(samples + 1) % samples] @ w.T
    N, path = element.n0[0] + element.kn[0] * knots[:, 0], kt * knots[:, 1:]
    (x, y), out, d = (
        path[0] * min(1, mu * N[0] / np.hypot(*path[0])),
        np.empty((2, samples)),
        np.diff(path, axis=0),
    )
    for period in range(1, 4000):
        before = x, y
        for i in range(samples):
            here = d[i, 0], d[i, 1], N[i], N[i + 1], mu
            _, ex, ey, mid, _ = march_edge(x, y, *here)
            out[0, i], out[1, i], _ = force_at_middle(x, y, *here, mid)
            x, y = ex, ey
        if np.hypot(x - before[0], y - before[1]) < 1e-13:
            break
    return coefficients(out, H), period


def test_elements_about_to_stick_are_periodic_too():
    """1000 elements whose motion reaches about the limit: two in a thousand shake down over
    hundreds of periods.

    Leaps arrive at the limit of plain marching, which is left at 1e-13 a period, 1e-11 away from
    it; at 1821 periods they take 117.
    """
    rng = np.random.default_rng(3)
    w = rng.normal(size=(1000, 3, 7)) / np.r_[1, np.repeat(np.arange(1, 4), 2)] ** 2
    w[:, 1:] *= 0.8
    w[:, 1:, 0] *= 0.1
    w[:, 0] *= 0.3
    elements = Elements(
        np.ones(1000), np.ones(1000), rng.uniform(0.8, 1.2, 1000), rng.uniform(0.7, 1.5, 1000), 2
    )
    forces = evaluate(elements, w, 128)
    assert forces.converged
    assert np.median(forces.cycles) <= 6
    np.testing.assert_allclose(evaluate(elements, w, 128, False).f, forces.f, rtol=0, atol=1e-10)
    slow, periods = np.argsort(forces.cycles)[-8:], []
    for e in slow:
        one = Elements(
            *(x[e : e + 1] for x in (elements.kt, elements.kn, elements.mu, elements.n0)),
            tangents=2,
        )
        f, period = plainly_marched(one, w[e], 128)
        periods.append(period)
        np.testing.assert_allclose(forces.f[e, 1:], f, rtol=0, atol=1e-10)
    assert max(periods) > 10 * forces.cycles.max()


def test_a_limit_on_the_cycles_is_reported():
    forces = evaluate(single(tangents=2), ellipse(1.2, 0.5), 128, cycles=1)
    assert not forces.converged
    assert "1 of 1 elements" in forces.reason


def test_dissipation_is_never_negative():
    elements, w = random_case(8, 300, 3, 2)
    assert evaluate(elements, w, 256).dissipated.min() > -1e-4


def test_forces_without_jacobian_are_the_same():
    """6000 random elements, among them slow shakedowns: the two paths find the same periodic state,
    to 1e-10.
    """
    for seed in range(6):
        for kn in (0.0, 1.0):
            elements, w = random_case(seed, 500, 3, 2, kn)
            load = np.random.default_rng(seed).normal(size=(500, 64)) + 1.0 if seed == 5 else None
            a, b = (evaluate(elements, w, 64, linear, load=load) for linear in (True, False))
            np.testing.assert_allclose(a.f, b.f, rtol=0, atol=1e-10)
            np.testing.assert_array_equal(a.state, b.state)
            assert np.isfinite(a.dfdw).all()
            assert b.dfdw is None
