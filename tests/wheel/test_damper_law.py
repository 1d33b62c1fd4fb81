"""The cheap level of statistics: the law of one damper against its own balance, and wheels solved
with it against the balance of all blades.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from bladefem.data import Elements, RigidBody
from bladefem.errors import InputError
from bladefem.hbm.model import Damping
from bladefem.reduction.assemble import recombine_contact
from bladefem.study.mistuning.law_level import changed_law
from bladefem.wheel import damper_law as damper_law_module
from bladefem.wheel.damper_balance import solve_damper, stuck_displacements
from bladefem.wheel.damper_law import damper_law, law_harmonics, scaled_elements
from bladefem.wheel.family import family_of_modes
from bladefem.wheel.law_response import (
    LawWheels,
    ScatteredLaw,
    law_statistics,
    pattern_deviations,
)
from bladefem.wheel.lumped import LumpedBlades, lumped_matrices, lumped_pattern, lumped_wheel
from bladefem.wheel.scatter import Scatter, drawn_deviations, drawn_patterns
from bladefem.wheel.solve import solve_wheel
from bladefem.wheel.statistics import band_search, one_body_respond, scatter_statistics

BLADES = LumpedBlades()
M, K, _ = lumped_matrices(BLADES)
OWN = float(np.sqrt(linalg.eigh(K, M)[0][0]))
SIZES = 1e-6, 5e-3


@pytest.fixture(scope="module")
def made():
    wheel = lumped_wheel(BLADES, 9, 1.0, 1e5, 3.0)
    family = family_of_modes(wheel, OWN)
    return wheel, family, damper_law(wheel, family, SIZES, 64)


def amplitudes(count=200):
    rng = np.random.default_rng(0)
    size = 10 ** rng.uniform(-5, -3, (2, count))
    return size * np.exp(2j * np.pi * rng.uniform(size=(2, count)))


def test_law_is_the_balance_of_its_damper(made):
    wheel, family, law = made
    a, b = amplitudes()
    imposed = np.outer(a, family.before) + np.outer(b, family.after)
    start = stuck_displacements(wheel, family, imposed)
    balanced = solve_damper(wheel, wheel.elements, family, imposed, start, 64)
    assert balanced.residual.max() < 1e-6
    force = balanced.force[:, :, 0]
    expected = np.array([force @ family.before, force @ family.after])
    found, _ = law.forces(a, b)
    off = np.linalg.norm(found - expected, axis=0)
    assert np.median(off / np.linalg.norm(expected, axis=0)) < 2e-3
    # of the force of full slip, 4 / pi times the friction limit; the table is too coarse only where
    # large motions of both blades are nearly alike, and the damper turns its force within a step
    full = 4 / np.pi * 3.0 * np.linalg.norm(family.before)
    assert np.quantile(off, 0.95) < 0.03 * full
    assert off.max() < 0.2 * full


def test_law_does_not_see_a_shift_of_time(made):
    _, _, law = made
    a, b = amplitudes()
    turn = np.exp(0.7j)
    np.testing.assert_allclose(
        law.forces(a * turn, b * turn)[0], turn * law.forces(a, b)[0], rtol=1e-9
    )


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_blades_that_move_alike_leave_their_damper_at_rest(made, monkeypatch):
    """The damper of lumped blades feels their difference alone: exactly none of two alike, where
    rounding leaves none. Such a pair was not solved, and had the mean of its neighbours.
    """
    wheel, family, law = made
    exact = damper_law_module.pairs_of_motions(family)
    alike = np.linalg.norm(exact, axis=1) < 1e-12 * np.linalg.norm(exact, axis=1).max()
    assert np.count_nonzero(alike) == 1
    exact[alike] = 0.0
    monkeypatch.setattr(damper_law_module, "pairs_of_motions", lambda _: exact)
    found = damper_law(wheel, family, SIZES, 64)
    a = np.geomspace(*SIZES, 20) / np.sqrt(2) * np.exp(0.4j)
    size = np.linalg.norm([a, a], axis=0)
    stiff = 1e5 * np.linalg.norm(family.before) ** 2
    assert abs(found.forces(a, a)[0] / size).max() < 1e-9 * stiff
    one, other = amplitudes()
    np.testing.assert_allclose(found.forces(one, other)[0], law.forces(one, other)[0], rtol=1e-6)


def test_derivatives_are_those_of_the_splines(made):
    _, _, law = made
    a, b = amplitudes()
    _, derivative = law.forces(a, b)
    step = 1e-6 * abs(a)
    for i, (da, db) in enumerate([(1, 0), (1j, 0), (0, 1), (0, 1j)]):
        upper = law.forces(a + step * da, b + step * db)[0]
        lower = law.forces(a - step * da, b - step * db)[0]
        slope = ((upper - lower) / (2 * step)).T
        numeric = np.stack([slope.real, slope.imag], axis=2).reshape(-1, 4)
        np.testing.assert_allclose(derivative[:, :, i], numeric, atol=1e-5 * abs(derivative).max())


def by_law(made, patterns, factors, changed=None):
    _, family, law = made
    deviation, mass = pattern_deviations(patterns, family, BLADES.count)
    wheels = LawWheels(family, ScatteredLaw(law, changed or {}), deviation, factors, mass)
    return law_statistics(wheels, 3.0, (0.96 * OWN, 1.05 * OWN))


def by_balance(wheel, patterns):
    return scatter_statistics(
        {3.0: patterns},
        band_search(
            {3.0: wheel},
            lambda load, pattern: OWN * np.linspace(0.96, 1.05, 61),
            lambda w, p: one_body_respond(w, p, 1, 64),
        ),
    )


def test_wheels_are_those_of_the_balance(made):
    """At the load of the tuned optimum: amplification within 5 % of the balance of all modes, on
    the same blade but where two are as high.
    """
    wheel, _, _ = made
    drawn = drawn_patterns(wheel, Scatter(0.02), 6, lambda d: lumped_pattern(BLADES, d))
    found = by_law(made, drawn, {})
    whole = by_balance(wheel, drawn)
    assert not whole.unsolved.any()
    assert found.tuned[0] == pytest.approx(whole.tuned[0], rel=0.03)
    np.testing.assert_allclose(found.factor, whole.factor, rtol=0.05)
    assert np.mean(found.blade == whole.blade) > 0.6


def test_dampers_scatter(made):
    """Friction, stiffness and load of every damper."""
    wheel, family, _ = made
    scatter = Scatter(0.01, friction=0.08, stiffness=0.08, load=0.08, seed=2)
    drawn = drawn_patterns(wheel, scatter, 6, lambda d: lumped_pattern(BLADES, d))
    factors = drawn_deviations(BLADES.count, scatter, 6).factors(scatter)
    changed = {
        name: tuple(
            damper_law(wheel, family, SIZES, 64, scaled_elements(wheel, name, factor))
            for factor in (1.1, 0.9)
        )
        + (0.1,)
        for name in ("friction", "stiffness")
    }
    found = by_law(made, drawn, factors, changed)
    without = by_law(made, drawn, {})
    whole = by_balance(wheel, drawn)
    np.testing.assert_allclose(found.factor, whole.factor, rtol=0.05)
    # what the dampers' scatter does is seen, as far as it goes
    assert np.std(found.factor / whole.factor) < np.std(without.factor / whole.factor)


def test_heavier_dampers_by_the_change_of_the_law():
    """Dampers 7 % heavier under the same load: the table of those, to what first order leaves."""
    light = RigidBody(np.array([[0.05]]), np.ones((1, 1)))
    wheel = replace(lumped_wheel(BLADES, 9, 1.0, 1e5, 3.0), damper=light)
    family = family_of_modes(wheel, OWN)
    nominal = damper_law(wheel, family, SIZES, 64)
    changed = [changed_law(wheel, family, 0, SIZES, 64, "mass", factor) for factor in (1.15, 0.85)]
    law = ScatteredLaw(nominal, {"mass": (changed[0], changed[1], 0.15)})
    a, b = amplitudes()
    found, _ = law.forces(a, b, {"mass": np.full(len(a), 1.07)})
    heavier = replace(wheel, damper=RigidBody(np.array([[1.07 * 0.05]]), np.ones((1, 1))))
    exact, _ = damper_law(heavier, family_of_modes(heavier, OWN), SIZES, 64).forces(a, b)
    before, _ = nominal.forces(a, b)
    change = np.linalg.norm(exact - before, axis=0)
    assert change.max() > 1e-3
    assert np.median(np.linalg.norm(found - exact, axis=0) / change) < 0.15


def test_masses_deviate(made):
    """Heavier and lighter blades, by 1 % of a tip: amplification within 5 % of the balance."""
    wheel, _, _ = made
    drawn = drawn_patterns(wheel, Scatter(0.005), 6, lambda d: lumped_pattern(BLADES, d))
    rng = np.random.default_rng(5)
    q = drawn[0].stiffness.shape[1]
    size = 0.01 * BLADES.tip * rng.normal(size=(6, BLADES.count, 1, 1))
    heavier = [replace(p, mass=m * np.eye(q)) for p, m in zip(drawn, size, strict=True)]
    found = by_law(made, heavier, {})
    whole = by_balance(wheel, heavier)
    assert not whole.unsolved.any()
    np.testing.assert_allclose(found.factor, whole.factor, rtol=0.05)
    without = by_law(made, drawn, {})
    assert abs(without.factor / whole.factor - 1).max() > 0.08


def inclined_wheel():
    """Dampers between the platforms that a stretch also presses together or lets go."""
    wheel = lumped_wheel(BLADES, 9, 1.0, 1e5, 3.0)
    inclined = np.array([[-0.7], [0.7]])
    sectors = {d: recombine_contact(body, inclined) for d, body in wheel.sectors.items()}
    element = Elements(
        np.array([1e5]), np.array([1e5]), np.array([0.3]), np.array([2.0]), tangents=1
    )
    return replace(wheel, sectors=sectors, elements=element)


ONE_MOTION = RigidBody(np.array([[0.05]]), np.array([[0.5], [0.5]]))
# two motions that Coriolis forces couple
WHIRLING = RigidBody(
    0.05 * np.eye(2),
    np.array([[0.5, 0.1], [0.5, -0.3]]),
    gyroscopic=np.array([[0.0, -60.0], [60.0, 0.0]]),
)


@pytest.mark.parametrize("damping", [Damping(ratio=1e-3), Damping(ratio=1e-4, structural=2e-3)])
@pytest.mark.parametrize("damper", [None, ONE_MOTION, WHIRLING], ids=["none", "rigid", "whirling"])
def test_harmonics_are_those_of_the_tuned_wheel(damping, damper):
    """Contacts that lift off: from the balance of all sectors, what is left over in the damper's is
    the family's motion in the first harmonic and nothing in the others.
    """
    # the law holds mean displacements
    wheel = replace(inclined_wheel(), damping=damping, damper=damper, coupled=False)
    point = solve_wheel(wheel, OWN, 5, 128)
    assert point.converged
    assert point.shares[0, 0, 2] > 0.1
    family = family_of_modes(wheel, OWN, harmonics=5)
    w, f = ((q[0, 0, :, 1::2] - 1j * q[0, 0, :, 2::2])[None] for q in (point.w, point.f))
    imposed = w[0] + np.einsum("hij,jh->ih", family.flexibility, f[0])
    size = abs(imposed[:, 0]).max()
    np.testing.assert_allclose(imposed[:, 1:], 0, atol=1e-6 * size)
    turn = np.exp(2j * np.pi * 9 / BLADES.count)
    amplitude = imposed[:, 0] / (family.before + turn * family.after)
    np.testing.assert_allclose(amplitude, amplitude[0], rtol=1e-6)
    # and back again, from full stick
    start = stuck_displacements(wheel, family, imposed[None, :, 0])
    found = solve_damper(wheel, wheel.elements, family, imposed[None, :, 0], start, 128)
    assert found.solved.all()
    np.testing.assert_allclose(found.force, f, atol=1e-5 * abs(f).max())


def test_law_gives_up_harmonics_that_it_cannot_afford():
    assert law_harmonics(24, 3) == 3
    assert law_harmonics(120, 3) == 2
    assert law_harmonics(400, 3) == 1


def test_what_has_no_law_is_refused(made):
    one = lumped_wheel(BLADES, 9, 1.0, 1e5, 3.0)
    one.excitation[2] = one.excitation[1]
    with pytest.raises(InputError, match="expected one engine order"):
        family_of_modes(one, OWN)
