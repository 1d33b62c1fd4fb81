"""Contacts whose motion goes on by a step in each period: against a plain march over many periods
written here, the two 2-D kernels against each other, the limit of no step, and the derivatives.
"""

from __future__ import annotations

import numpy as np
import pytest

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.law_table import BoucWen

NODES = 5
HARMONICS = 2


def walking_case(tangents, kn, seed=1):
    """Elements, motion (n, d, K) and steps (n, tangents) that slip, with kn > 0 also lift off."""
    rng = np.random.default_rng(seed)
    elements = Elements(
        kt=rng.uniform(0.5, 2.0, NODES),
        kn=kn * rng.uniform(0.5, 1.5, NODES),
        mu=np.full(NODES, 0.3),
        n0=rng.uniform(0.5, 1.5, NODES),
        tangents=tangents,
    )
    w = rng.normal(size=(NODES, 1 + tangents, 2 * HARMONICS + 1))
    return elements, w, 0.3 * rng.normal(size=(NODES, tangents))


def marched(elements, w, step, samples, periods=6):
    """(n, tangents, K) harmonics of the friction force in the last of some periods from rest."""
    angle = 2 * np.pi * np.arange(samples * periods) / samples
    waves = [np.ones_like(angle)]
    for h in range(1, HARMONICS + 1):
        waves += [np.cos(h * angle), np.sin(h * angle)]
    basis = np.array(waves)
    x = w @ basis
    x[:, 1:] += step[:, :, None] * np.arange(samples * periods) / samples
    load = np.maximum(elements.n0[:, None] + elements.kn[:, None] * x[:, 0], 0.0)
    force = np.zeros(step.shape)
    last = np.zeros((*step.shape, samples))
    for i in range(1, samples * periods):
        force = force + elements.kt[:, None] * (x[:, 1:, i] - x[:, 1:, i - 1])
        limit = elements.mu * load[:, i]
        length = np.maximum(np.linalg.norm(force, axis=1), 1e-300)
        force = force * np.minimum(limit / length, 1.0)[:, None]
        last[:, :, i % samples] = force
    weights = np.linalg.pinv(basis[:, :samples].T)
    return np.einsum("ks,nts->ntk", weights, last)


@pytest.mark.parametrize("kn", [0.0, 0.5, 1.5])
@pytest.mark.parametrize("tangents", [1, 2])
def test_forces_of_contacts_that_walk_are_those_of_the_march(tangents, kn):
    """Radial return lags by half a step: first order in the march's 6000 steps."""
    elements, w, step = walking_case(tangents, kn)
    found = evaluate(elements, w, 512, walk=step)
    expected = marched(elements, w, step, 6000)
    still = evaluate(elements, w, 512)
    assert found.converged
    assert abs(still.f[:, 1:] - expected).max() > 4e-3
    np.testing.assert_allclose(found.f[:, 1:], expected, atol=1e-3)


@pytest.mark.parametrize("kn", [0.0, 1.5])
def test_the_vector_kernel_walks_as_the_plain_one(kn):
    elements, w, step = walking_case(2, kn)
    found = evaluate(elements, w, 256, walk=step)
    plain = evaluate(elements, w, 256, walk=step, kernel="plain")
    for name in ("f", "dfdw", "shares", "dissipated"):
        np.testing.assert_allclose(getattr(found, name), getattr(plain, name), atol=1e-12)


@pytest.mark.parametrize("kn", [0.0, 0.5])
@pytest.mark.parametrize("tangents", [1, 2])
def test_derivatives_of_contacts_that_walk(tangents, kn):
    elements, w, step = walking_case(tangents, kn)
    found = evaluate(elements, w, 256, walk=step)
    change = 1e-6 * np.random.default_rng(2).normal(size=w.shape)
    ends = [evaluate(elements, w + sign * change, 256, walk=step).f for sign in (1.0, -1.0)]
    expected = np.einsum("nakbl,nbl->nak", found.dfdw, change)
    np.testing.assert_allclose((ends[0] - ends[1]) / 2, expected, atol=1e-7 * 1e-6 * 10)


@pytest.mark.parametrize("tangents", [1, 2])
def test_a_walk_of_nothing_is_no_walk(tangents):
    """Contacts that slip in each period forget where they are: the limit is that of rest."""
    elements, w, step = walking_case(tangents, 0.5)
    still = evaluate(elements, w, 256)
    assert (still.shares[:, 1] > 0).all()
    found = evaluate(elements, w, 256, walk=1e-13 * np.sign(step))
    np.testing.assert_allclose(found.f, still.f, atol=1e-11)
    shifted = w.copy()
    shifted[:, 1:, 0] += 3.0
    np.testing.assert_allclose(
        evaluate(elements, shifted, 256, walk=step).f,
        evaluate(elements, w, 256, walk=step).f,
        atol=1e-11,
    )


def test_other_laws_walk_where_they_forget_the_position():
    """Dahl's law follows increments alone; Bouc and Wen's keeps a spring, and cannot walk."""
    elements, w, step = walking_case(1, 0.0)
    law = {name: getattr(elements, name) for name in ("kt", "kn", "mu", "n0")}
    dahl = evaluate(Elements(**law, tangents=1, law="dahl"), w, 128, walk=step)
    still = evaluate(Elements(**law, tangents=1, law="dahl"), w, 128)
    assert dahl.converged
    # the mean friction force is against the walk
    change = (dahl.f - still.f)[:, 1, 0]
    assert (change * step[:, 0] > 0).all()
    with pytest.raises(InputError, match="does not depend on the position"):
        evaluate(Elements(**law, tangents=1, law=BoucWen()), w, 128, walk=step)


def test_a_walk_that_does_not_fit_is_refused():
    elements, w, _ = walking_case(2, 0.0)
    with pytest.raises(InputError, match=r"walk: expected \(5, 2\)"):
        evaluate(elements, w, 128, walk=np.zeros((5, 1)))


@pytest.mark.parametrize("tangents", [1, 2])
def test_an_element_that_rests_beside_one_that_walks_is_as_alone(tangents):
    """It sticks, or slips, and remembers its mean displacement: forces and derivative are those of
    a batch in which nothing walks.
    """
    rng = np.random.default_rng(3)
    w = 0.1 * rng.normal(size=(4, 1 + tangents, 7))
    ends = np.full(4, 0.3)
    # sticks throughout; sticks at a limit that its mean reaches; slips; walks
    mu = np.array([20.0, 0.5, 0.2, 0.2])
    w[1, 1:, 1:] *= 1e-3
    w[1, 1:, 0] = 3.0
    w[1, 0] = 0.0
    elements = Elements(np.ones(4), 0.1 * np.ones(4), mu, ends + 1.0, tangents=tangents)
    walk = np.zeros((4, tangents))
    walk[3, 0] = 0.4
    both = evaluate(elements, w, 128, walk=walk)
    alone = evaluate(elements, w, 128)
    np.testing.assert_allclose(both.f[:3], alone.f[:3], atol=1e-12)
    np.testing.assert_allclose(both.jacobian[:3], alone.jacobian[:3], atol=1e-9)
    assert abs(both.jacobian[0, 1, 0, 1, 0]) > 0.5
    assert abs(both.f[3] - alone.f[3]).max() > 1e-3
