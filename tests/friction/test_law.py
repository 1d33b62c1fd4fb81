"""Laws of one's own: their periodic forces against Coulomb's kernels, differences and a long
march.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from friction_cases import coefficients, motion, numeric_jacobian, random_case, single
from numba import njit

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.kernel_1d_exact import evaluate_exact
from bladefem.friction.law import FrictionLaw, NodeLaw
from bladefem.friction.law_table import LAWS, merged_laws, select_elements


class Clamp(FrictionLaw):
    """Coulomb's law of one tangent by its return map: the judge of the machinery around a law."""

    def step(self, state, increment, before, load, elements):
        limit = (elements.mu * load)[:, None]
        return np.clip(state + elements.kt[:, None] * increment, -limit, limit)

    def slipping(self, old, state, increment, elements):
        beyond = abs(old + elements.kt[:, None] * increment - state)[:, 0]
        return beyond > 1e-12 * elements.kt


class Dahl(FrictionLaw):
    """Dahl's law with the limit mu N, exact along a straight increment."""

    def step(self, state, increment, before, load, elements):
        limit = (elements.mu * load)[:, None]
        way = np.sign(increment)
        fade = np.exp(-elements.kt[:, None] * abs(increment) / limit)
        return way * limit + (state - way * limit) * fade


def dahl_of_a_node(state, increment, before, load, kt, mu, new):
    """The same for one node."""
    limit = mu * load
    way = np.sign(increment[0])
    new[0] = way * limit + (state[0] - way * limit) * np.exp(-kt * abs(increment[0]) / limit)


class Stretched(FrictionLaw):
    """Two numbers of state, and a force that sees motion and load."""

    variables = 2

    def step(self, state, increment, before, load, elements):
        both = np.concatenate([increment, 0.5 * increment], axis=1)
        return Dahl().step(state, both, before, load, elements)

    def force(self, state, motion, load, elements):
        return state.sum(axis=1, keepdims=True) + 0.1 * motion * load[:, None]


def with_load_above(elements: Elements, w: np.ndarray) -> Elements:
    """The same elements, closed all the time."""
    swing = abs(elements.kn[:, None] * w[:, 0, 1:]).sum(axis=1)
    return replace(elements, n0=0.2 + swing + abs(elements.kn * w[:, 0, 0]))


@pytest.mark.parametrize("closed", [True, False])
def test_the_return_map_as_a_law_is_the_kernel(closed):
    """Forces, states and derivatives of 60 elements with stick, slip and lift-off.

    Where elements close within a step the kernel counts the part of the step, the march all of it.
    """
    elements, w = random_case(1, 60, 3, 1)
    if closed:
        elements = with_load_above(elements, w)
    usual = evaluate(elements, w, 256)
    ours = evaluate(replace(elements, law=Clamp()), w, 256)
    assert ours.converged and usual.converged
    size = abs(usual.f).max()
    close = 2e-10 * size if closed else 2e-2 * size
    if closed:
        np.testing.assert_array_equal(ours.state, usual.state)
        slips = ours.shares[:, 1] > 0
        assert slips.any() and not slips.all()
    np.testing.assert_allclose(ours.f, usual.f, rtol=0, atol=close)


@pytest.mark.parametrize("law", [Dahl(), Stretched(), Clamp()])
@pytest.mark.parametrize("closed", [True, False])
def test_derivative_against_differences(law, closed):
    elements, w = random_case(5, 12, 2, 1)
    if closed:
        elements = with_load_above(elements, w)
    elements = replace(elements, law=law)
    forces = evaluate(elements, w, 64)
    numeric = numeric_jacobian(lambda x: evaluate(elements, x, 64, jacobian=False).f, w, 1e-6)
    largest = np.maximum(abs(numeric).max(axis=(1, 2, 3, 4), keepdims=True), 1e-9)
    assert forces.converged
    np.testing.assert_allclose(forces.dfdw / largest, numeric / largest, rtol=0, atol=2e-6)


def test_periodic_state_against_a_long_march():
    """Small motion forgets its start in hundreds of periods; Newton finds the end of that march."""
    element = single(kt=1.0, mu=1.0, n0=1.0)
    w = np.zeros((1, 2, 5))
    w[0, 1, :] = 0.3, 0.04, 0.0, 0.01, 0.02
    forces = evaluate(replace(element, law=Dahl()), w, 64)
    assert forces.converged and forces.cycles[0] < 20
    u = motion(w[0, 1], 2 * np.pi * np.arange(64) / 64)
    f = 0.0
    for _ in range(400):
        force = np.empty(64)
        for i in range(64):
            du = u[i] - u[i - 1]
            f = np.sign(du) + (f - np.sign(du)) * np.exp(-abs(du))
            force[i] = f
    np.testing.assert_allclose(forces.f[0, 1], coefficients(force, 2), rtol=0, atol=1e-9)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_function_of_one_node_is_the_same_law(compiled):
    elements, w = random_case(6, 8, 2, 1)
    elements = with_load_above(elements, w)
    function = njit(dahl_of_a_node) if compiled else dahl_of_a_node
    one = evaluate(replace(elements, law=NodeLaw(function)), w, 64)
    other = evaluate(replace(elements, law=Dahl()), w, 64)
    np.testing.assert_allclose(one.f, other.f, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.dfdw, other.dfdw, rtol=0, atol=1e-7)


def test_a_derivative_that_is_given_is_used():
    """It is exact where differences have their error."""

    def derivative(state, increment, before, load, kt, mu, out):
        limit = mu * load
        way = np.sign(increment[0])
        lag = state[0] - way * limit
        x = kt * abs(increment[0]) / limit
        out[0, 0] = np.exp(-x)
        out[0, 1] = -lag * np.exp(-x) * kt / limit * way
        out[0, 2] = 0.0
        out[0, 3] = mu * (way * (1 - np.exp(-x)) + lag * np.exp(-x) * x / limit)

    elements, w = random_case(6, 8, 2, 1)
    elements = with_load_above(elements, w)
    ours = evaluate(replace(elements, law=NodeLaw(dahl_of_a_node, derivative)), w, 64).dfdw
    plain = evaluate(replace(elements, law=NodeLaw(dahl_of_a_node)), w, 64).dfdw
    np.testing.assert_allclose(ours, plain, rtol=0, atol=1e-7 * abs(plain).max())
    assert abs(ours - plain).max() > 0


def test_every_node_keeps_its_own_law():
    elements, w = random_case(7, 9, 2, 1)
    elements = with_load_above(elements, w)
    dahl = Dahl()
    mixed = evaluate(replace(elements, law=(None, dahl, Stretched()) * 3), w, 64)
    coulomb = evaluate(elements, w, 64)
    dahls = evaluate(replace(elements, law=dahl), w, 64)
    np.testing.assert_array_equal(mixed.f[::3], coulomb.f[::3])
    np.testing.assert_allclose(mixed.f[1::3], dahls.f[1::3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(mixed.dfdw[1::3], dahls.dfdw[1::3], rtol=0, atol=1e-12)
    assert abs(mixed.f[2::3] - dahls.f[2::3]).max() > 1e-3


def test_elements_of_several_laws_that_are_not_periodic_are_counted_one_by_one():
    """Of two Coulomb elements the one that sticks is periodic at once."""
    elements = Elements(np.ones(3), np.zeros(3), np.array([1.0, 50.0, 1.0]), np.ones(3), tangents=2)
    elements = replace(elements, law=(None, None, "dahl"))
    w = np.zeros((3, 3, 3))
    w[:, 1, 1] = 1.2
    w[:, 2, 2] = 0.5
    alone = [
        evaluate(select_elements(elements, [i]), w[i : i + 1], 128, cycles=1).converged
        for i in range(3)
    ]
    assert alone == [False, True, False]
    assert evaluate(elements, w, 128, cycles=1).reason.startswith("2 of 3 elements")


def test_what_is_no_law_is_refused():
    elements, w = random_case(7, 3, 2, 1)
    with pytest.raises(InputError, match="expected an object made from FrictionLaw"):
        evaluate(replace(elements, law=Dahl), w, 64)
    with pytest.raises(InputError, match="did you mean 'dahl'"):
        evaluate(replace(elements, law="dahll"), w, 64)
    with pytest.raises(InputError, match="2 laws for 3 elements"):
        evaluate(replace(elements, law=(None, None)), w, 64)
    with pytest.raises(InputError, match="3 elements follow Dahl"):
        evaluate_exact(replace(elements, law=Dahl()), w)
    with pytest.raises(InputError, match="different laws in element 0"):
        merged_laws(replace(elements, law=(None, Dahl(), None)), np.array([0, 0, 1]))


def test_laws_of_the_table_are_known_by_name():
    elements, w = random_case(6, 6, 2, 1)
    elements = with_load_above(elements, w)
    named = evaluate(replace(elements, law=("dahl", "coulomb", "bouc-wen") * 2), w, 64)
    given = evaluate(replace(elements, law=(LAWS["dahl"], None, LAWS["bouc-wen"]) * 2), w, 64)
    np.testing.assert_array_equal(named.f, given.f)
    np.testing.assert_array_equal(named.f[1::3], evaluate(elements, w, 64).f[1::3])
