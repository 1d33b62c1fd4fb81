"""A softer layer in place of a stiff one where contacts lift off, and what that changes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_patch import blade_side, patch_model, patch_on_half_space, problem_of

from bladefem.contact.numerical_stiffness import numerical_stiffness
from bladefem.hbm import from_neighbours
from bladefem.hbm.from_neighbours import line_between
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import softened_layer
from bladefem.hbm.peak import Peak, find_peak
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve, solve_near
from bladefem.hbm.solver import fallback
from bladefem.hbm.solver.newton import Newton, Options
from bladefem.hbm.solver.residual import Balance, evaluate_balance, start_in_stick
from bladefem.study.adaptive import stiff_layer
from bladefem.study.adaptive.family import family_member, family_of
from bladefem.study.adaptive.resonance_choice import has_final_harmonics
from bladefem.study.adaptive.resonance_curve import resonance_curve
from bladefem.study.adaptive.settings import Settings
from bladefem.study.adaptive.stiff_layer import (
    climbed_to,
    settings_of_stiff_layer,
    softened_where_lifting,
    softer_model,
    stiff_layer_change,
    stiffened_model,
)

# [N]
FORCE = 30.0
# stiffness per unit area that stands for rigid faces [N/m^3]
RIGID = 1e22
# [rad/s] near the resonance
OMEGA = 2 * np.pi * 440.0
SETTINGS = Settings(4, 3, 64, "rigid")


@pytest.fixture(scope="module")
def stiff():
    return patch_model(RIGID, FORCE)


def numerical_areal():
    """Stiffness per unit area of the elements of a split layer [N/m^3]."""
    patch, local = patch_on_half_space()
    return numerical_stiffness(problem_of(patch, blade_side(patch, local)))


def height(model, omega=OMEGA):
    """Amplitude at the probe [m]."""
    point = solve(model, omega, 3, 64)
    assert point.converged
    return size(point)


def test_a_softened_layer_is_the_one_of_the_elements(stiff):
    """Against the model whose layer is given with that stiffness and not split."""
    areal = numerical_areal()
    whole = patch_model(areal, FORCE, split=False)
    softened = softened_layer(stiff)
    assert softened.series is None
    assert softened_layer(stiff) is softened
    assert height(softened) == pytest.approx(height(whole), rel=1e-8)


def test_the_way_begins_at_the_softer_layer_and_ends_at_the_layer(stiff):
    assert height(stiffened_model(stiff, 0.0)) == pytest.approx(
        height(softened_layer(stiff)), rel=1e-8
    )
    # where no contact opens the unknowns of the elements do not matter; few harmonics see the rest
    weak = patch_model(RIGID, 1.0)
    assert height(stiffened_model(weak, 1.0)) == pytest.approx(height(weak), rel=1e-6)
    assert abs(height(softened_layer(weak)) / height(weak) - 1) > 1e-3


def test_a_softer_model_has_the_layer_in_series(stiff):
    """Elements with their own compliance once more: a layer of half the stiffness."""
    areal = numerical_areal()
    half = patch_model(areal / 2, 1.0, split=False)
    softened = softened_layer(patch_model(RIGID, 1.0))
    assert height(softer_model(softened, 1.0)) == pytest.approx(height(half), rel=1e-6)


def test_settings_take_the_softer_layer_where_contacts_lift_off(stiff):
    family = family_of(stiff, [len(stiff.elements.kt)])
    lifting = solve(softened_layer(stiff), OMEGA, 3, 64)
    assert 2 * lifting.states["lift"] >= len(lifting.w)
    softened = softened_where_lifting(family, SETTINGS, lifting)
    assert softened.softened
    assert family_member(family, softened).model.series is None
    weak = patch_model(RIGID, 1.0)
    resting = solve(weak, OMEGA, 3, 64)
    assert softened_where_lifting(family, SETTINGS, resting) == SETTINGS
    soft = softened_layer(stiff)
    other = family_of(soft, [len(soft.elements.kt)])
    assert softened_where_lifting(other, SETTINGS, lifting) == SETTINGS


def test_the_change_is_that_of_the_resonances():
    """Of a layer a fifth stiffer, against the resonances of both, none of them split; with 64
    samples ripples have maxima of their own, 0.06 % beside.
    """
    areal = numerical_areal()
    layer = patch_model(1.2 * areal, FORCE)
    whole = patch_model(1.2 * areal, FORCE, split=False)
    family = family_of(layer, [len(layer.elements.kt)])
    settings = replace(SETTINGS, softened=True, points=16, samples=256)
    options = Options(tolerance=1e-6, fallbacks=False)
    softer = family_member(family, settings).model
    stiffer = family_member(family_of(whole, [len(whole.elements.kt)]), settings).model
    soft = find_peak(softer, OMEGA, 3, 256, tolerance=1e-3, options=options)
    true = find_peak(stiffer, soft.omega, 3, 256, near=soft, tolerance=1e-3, options=options)
    expected = true.height / soft.height - 1
    assert abs(expected) > 0.01
    found = stiff_layer_change(family, settings, soft.solution, 0.05)
    assert found.height == pytest.approx(expected, abs=found.error) and found.error == 0.01
    shift = true.omega / soft.omega - 1
    assert shift > 5e-4
    assert found.frequency == pytest.approx(shift, abs=0.1 * shift)


@pytest.mark.parametrize(
    ("fallbacks", "methods"),
    [(False, ["newton"]), (True, ["newton", "newton on the residual"])],
)
def test_newton_lowers_the_step_first_where_a_layer_is_split(stiff, fallbacks, methods):
    """Its residual is badly scaled; what only judges is sought from its start alone."""
    options = Options(iterations=1, fallbacks=fallbacks)

    def tried(model):
        balance = Balance(model, condense(model, OMEGA, 3), 64)
        start = np.zeros_like(start_in_stick(balance))
        attempts = fallback._newton_attempts(balance, start, options)
        return list(dict.fromkeys(attempt.method for attempt in attempts))

    assert tried(stiff) == methods
    assert tried(softened_layer(stiff))[0] == "newton on the residual"


def test_full_stick_is_no_start_where_a_neighbour_alone_is_asked_for(stiff, monkeypatch):
    """Between bouncing points of the shipped wedge under 80 N it leads nowhere, in 0.15 s a
    point.
    """
    soft = softened_layer(stiff)
    near = solve(soft, OMEGA, 3, 64)
    asked = []

    def failing(balance, w, options, merit, walks=True):
        asked.append(w)
        state = evaluate_balance(balance, w, "single")
        return Newton(state, 1, False, "made to fail")

    monkeypatch.setattr(fallback, "newton", failing)
    options = Options(fallbacks=False)
    for from_stick, starts in ((False, 1), (True, 2)):
        asked.clear()
        found = solve(
            soft, 1.001 * OMEGA, 3, 64, start=near, options=options, from_stick=from_stick
        )
        assert not found.converged and len(asked) == starts
        np.testing.assert_array_equal(asked[0], near.w)


@pytest.mark.parametrize(("lifting", "apart", "sticks"), [(1, 1.1, 0), (0, 1.1, 1), (1, 5.0, 1)])
def test_points_between_bouncing_neighbours_start_on_their_line(
    stiff, monkeypatch, lifting, apart, sticks
):
    """And not in full stick; neighbours far apart may lie on two branches."""
    point = solve(softened_layer(stiff), OMEGA, 3, 64)
    near = replace(point, states={**point.states, "lift": lifting * len(point.w)})
    beyond = replace(near, omega=1.1 * OMEGA, w=apart * near.w)
    asked = []

    def failing(model, omega, H, samples, start, options, from_stick=True):
        asked.append((start, from_stick))
        return replace(point, converged=False)

    monkeypatch.setattr(from_neighbours, "solve", failing)
    options = Options(fallbacks=False)
    between = 1.05 * OMEGA
    from_neighbours.solve_from(stiff, between, 3, 64, [near, beyond], options)
    assert {from_stick for _, from_stick in asked} == {bool(sticks)}
    expected = near.w if sticks else (1 + apart) / 2 * near.w
    np.testing.assert_allclose(asked[0][0].w, expected, rtol=1e-12)


def test_points_between_bouncing_neighbours_start_on_the_line_through_them(stiff):
    """The start is nearer to the solution than either; none where the damper walks at one alone."""
    soft = softened_layer(stiff)
    ends = [solve(soft, ratio * OMEGA, 3, 64) for ratio in (0.999, 1.001)]
    true = solve(soft, OMEGA, 3, 64)
    bouncing = [replace(p, states={**p.states, "lift": len(p.w)}) for p in ends]
    (start,) = line_between(bouncing, OMEGA, 3)
    off = [np.linalg.norm(p.w - true.w) for p in (start, *ends)]
    assert off[0] < 0.1 * min(off[1:])
    walking = replace(bouncing[1], walk=np.zeros((true.w[:, :, 0].size, 1)))
    assert line_between([bouncing[0], walking], OMEGA, 3) == []
    closed = [replace(p, states={**p.states, "lift": 0}) for p in ends]
    assert line_between(closed, OMEGA, 3) == []
    assert line_between(bouncing[:1], OMEGA, 3) == []


def test_a_neighbour_of_a_split_layer_lowers_the_step(stiff):
    near = solve(stiff, OMEGA, 3, 64)
    assert solve_near(stiff, OMEGA, 3, 64, near).method == "newton"
    soft = softened_layer(stiff)
    other = solve_near(soft, OMEGA, 3, 64, solve(soft, OMEGA, 3, 64))
    assert other.method == "newton on the residual"


def top_of(model, closed):
    """A motion of the softened layer during which so many contacts keep closed."""
    lifting = solve(softened_layer(model), OMEGA, 3, 64)
    return replace(lifting, states={**lifting.states, "lift": len(lifting.w) - closed})


@pytest.mark.parametrize(
    ("closed", "harmonics", "damper"),
    [(0, 15, "elastic"), (1, 7, "rigid")],
    ids=["bounces", "keeps closed"],
)
def test_a_bouncing_damper_gets_more_harmonics_and_an_elastic_damper(
    stiff, closed, harmonics, damper
):
    family = replace(family_of(stiff, [len(stiff.elements.kt)]), dampers=("rigid", "elastic"))
    settings = replace(SETTINGS, softened=True, chosen=("harmonics", "samples", "damper"))
    top = top_of(stiff, closed)
    found = settings_of_stiff_layer(family, settings, top)
    assert (found.harmonics, found.damper) == (harmonics, damper)
    assert found.samples >= 8 * (harmonics + 1)
    given = replace(settings, chosen=())
    assert settings_of_stiff_layer(family, given, top) == given
    own = replace(settings, softened=False)
    assert settings_of_stiff_layer(family, own, top) == own


def test_harmonics_are_added_one_after_the_other_and_with_softer_layers(stiff, monkeypatch):
    """Where the layer itself leads nowhere, one of half its stiffness is tried, and left again."""
    family = family_of(stiff, [len(stiff.elements.kt)])
    settings = replace(SETTINGS, softened=True, harmonics=1)
    wanted = replace(settings, harmonics=15, samples=128)
    top = top_of(stiff, 0)
    asked = []

    def found_with_softer_ones(model, step, near, accuracy):
        softer = model.series is not None and bool(np.any(model.series))
        asked.append((step.harmonics, softer))
        return SimpleNamespace(solution=near) if softer or asked.count((15, True)) else None

    monkeypatch.setattr(stiff_layer, "_peak_on_the_way", found_with_softer_ones)
    assert climbed_to(family, settings, top, wanted, 0.1) is top
    assert asked == [(3, False), (3, True), (7, True), (15, True), (15, False)]
    monkeypatch.setattr(stiff_layer, "_peak_on_the_way", lambda *_: None)
    assert climbed_to(family, settings, top, wanted, 0.1) is None


def test_a_way_that_is_not_solved_to_its_end_is_extrapolated(stiff, monkeypatch):
    """What changes up to 0.8 of the way goes on in proportion; less than half of it says nothing."""
    family = family_of(stiff, [len(stiff.elements.kt)])
    settings = replace(SETTINGS, softened=True, points=4)
    point = solve(family_member(family, settings).model, OMEGA, 3, 64)
    soft = Peak(point, size(point), 1)

    def ends_at(*ways, heights):
        """Shares of each way, and heights of its resonances over the first one; None: not found."""
        shares, found = iter(ways), iter(heights)

        def peak_next(*_):
            height = next(found)
            return None if height is None else replace(soft, height=height * soft.height)

        monkeypatch.setattr(
            stiff_layer,
            "_way_to_the_layer",
            lambda *_: [(share, soft.solution) for share in next(shares, ())],
        )
        monkeypatch.setattr(stiff_layer, "_peak_on_the_way", peak_next)
        monkeypatch.setattr(stiff_layer, "peak_from", lambda *_, **__: soft)
        return stiff_layer_change(family, settings, soft.solution, 0.05)

    partly = ends_at((0.4, 0.8), heights=[0.9])
    assert partly.error == pytest.approx(0.01 + 0.1 / 0.8)
    assert np.isnan(partly.height)
    assert np.isinf(ends_at((0.4,), heights=[0.9]).error)
    # no resonance next to the end of the way, one next to the point before
    assert ends_at((0.6, 1.0), heights=[None, 0.9]).error == pytest.approx(0.01 + 0.1 / 0.6)
    # the second way leads little farther, which counts all the same
    little = ends_at((0.45,), (0.55,), heights=[0.9, 0.9])
    assert little.error == pytest.approx(0.01 + 0.1 / 0.55)
    # what the height changed by on the way may change again
    back = ends_at((0.5,), (0.8,), heights=[0.9, 1.0])
    assert back.error == pytest.approx(0.01 + 0.1 / 0.8)
    assert ends_at((1.0,), heights=[0.9]).height == pytest.approx(-0.1)


def test_a_curve_takes_the_softer_layer_by_itself():
    """Under a load that lifts contacts off at most frequencies: under a lesser one the stiff layer
    takes ten times as long to get there.
    """
    stiff = patch_model(RIGID, 50.0)
    family = family_of(stiff, [len(stiff.elements.kt)])
    curve = resonance_curve(family, replace(SETTINGS, points=4), (440.0, 520.0), 1, 0.2)
    assert curve.settings.softened
    assert all(p.converged for p in curve.points)
    assert "a softer layer in place of the stiff one" in curve.settings.sentence()


def test_harmonics_of_a_softer_layer_are_not_refined_without_end():
    softened = replace(SETTINGS, softened=True, harmonics=15)
    assert has_final_harmonics(softened)
    assert not has_final_harmonics(replace(softened, harmonics=7))
    assert not has_final_harmonics(replace(softened, softened=False))
