"""The error of a resonance where richer models of it are not solved: poorer ones tell it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import single_mass

from bladefem.errors import NotSolvedError
from bladefem.hbm.reference_blade import reference_model
from bladefem.study.adaptive import peak_errors, resonance_choice
from bladefem.study.adaptive.family import Family, Member, family_of
from bladefem.study.adaptive.resonance_curve import resonance_curve
from bladefem.study.adaptive.settings import DIRECTIONS, first_for


def search_by(monkeypatch, found):
    """Peaks are those that a stand-in gives, for judging as for choosing; their judges leave out no
    motion.
    """
    for module in (peak_errors, resonance_choice):
        monkeypatch.setattr(module, "peak_from", found)
    monkeypatch.setattr(peak_errors, "_peak_at_once", lambda *given: None)
    monkeypatch.setattr(peak_errors, "truncation_indicator", lambda *given: np.zeros(1))


@dataclass(frozen=True)
class KnownPeak:
    """A peak whose height is known, without a solve."""

    height: float
    omega: float
    solution: SimpleNamespace
    # second derivative of 1/height^2; 0: unknown
    bend: float = 0.0

    @property
    def vertex(self):
        """It was closed in."""
        return self.omega


def peak_of_settings(settings):
    """Heights that tend to 1 with contact points and harmonics, at a frequency of 100 rad/s."""
    points = 8 if settings.points is None else settings.points
    height = 1.0 + 0.4 / points + 0.3 / settings.harmonics
    slips = {"stick": 0, "slip": 16, "lift": 0, "open": 0}
    return KnownPeak(height, 100.0, SimpleNamespace(states=slips))


@pytest.fixture
def judged(monkeypatch):
    """A family, settings, and the error of their peak with a limit on what can be solved."""
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    settings = replace(first_for(family.modes), harmonics=3, samples=128, points=4)

    def errors(most_harmonics, most_points):
        def known(family, old, point, new, accuracy, fallbacks=True):
            points = 8 if new.points is None else new.points
            if new.harmonics > most_harmonics or points > most_points:
                raise NotSolvedError("too rich")
            return peak_of_settings(new)

        search_by(monkeypatch, known)
        return peak_errors.peak_errors(family, settings, peak_of_settings(settings), 0.05)

    return errors


def test_an_unsolved_richer_model_leaves_the_error_to_a_poorer_one(judged):
    """Of contact points half as many, of harmonics fewer: they differ by more than the richer model
    does, and are no start for other work.
    """
    whole = judged(99, 99)
    poorer = judged(3, 4)
    for name in ("harmonics", "points"):
        assert 0 < whole.height[name] < poorer.height[name] < np.inf
        assert name in whole.better and name not in poorer.better


def test_where_nothing_is_solved_the_error_stays_unknown(judged):
    assert judged(0, 0).total == np.inf


@pytest.mark.parametrize("name", ["points", "harmonics"])
def test_the_poorest_model_has_no_poorer_one(name):
    family = family_of(reference_model(points=4, load=1.4))
    settings = replace(first_for(family.modes), **{name: 1})
    assert peak_errors.poorer_settings(family, settings, name) is None


def peak_with(lift, height=1.0):
    """A peak of 16 contacts of which some lift off."""
    states = {"stick": 0, "slip": 16 - lift, "lift": lift, "open": 0}
    solution = SimpleNamespace(states=states, w=np.zeros((16, 3, 7)))
    return KnownPeak(height, 100.0, solution)


@pytest.mark.parametrize(("lift", "least"), [(7, 1), (8, 3)])
def test_one_harmonic_is_not_enough_where_half_of_the_contacts_lift(lift, least, monkeypatch):
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    search_by(monkeypatch, lambda *a, **k: peak_with(lift))
    settings, _, errors = resonance_choice.choose_at_peak(
        family, first_for(family.modes), peak_with(lift), 0.05
    )
    assert settings.harmonics == least and errors.total == 0


def test_far_from_right_with_lift_off_the_less_wrong_model_is_kept(monkeypatch):
    """Harmonics are taken first; where they do not halve the error, the search ends unless more
    contact points may be chosen: then these are, and the error they had is gone.
    """
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    tried = []

    def found(family, old, point, new, accuracy, fallbacks=True):
        tried.append(new)
        return peak_with(4, 1.1 + 0.5 * (new.points != 4) - 0.1 / new.harmonics)

    search_by(monkeypatch, found)
    settings, peak, errors = resonance_choice.choose_at_peak(
        family, first_for(family.modes), peak_with(4, 1.0), 0.05, ("points",)
    )
    assert settings.points == 4 and settings.harmonics == 7
    assert 0.2 < errors.total == settings.error and peak.height == pytest.approx(1.1 - 0.1 / 7)
    settings, peak, errors = resonance_choice.choose_at_peak(
        family, first_for(family.modes), peak_with(4, 1.0), 0.05
    )
    assert settings.points > 4 and settings.harmonics == 7
    assert errors.total < 0.01 and peak.height == pytest.approx(1.6 - 0.1 / 7)


@pytest.mark.parametrize(("lift", "refined"), [(4, True), (8, False)])
def test_the_change_from_one_harmonic_to_three_says_little_of_the_next(lift, refined, monkeypatch):
    """Three harmonics show a larger error than one did: more are taken even so, unless most
    contacts lift off with these.
    """
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    heights = {1: 1.0, 2: 1.0, 3: 1.1}

    def found(family, old, point, new, accuracy, fallbacks=True):
        few = new.harmonics in heights
        return peak_with(4 if few else lift, heights.get(new.harmonics, 0.85))

    search_by(monkeypatch, found)
    settings, _, errors = resonance_choice.choose_at_peak(
        family, first_for(family.modes), peak_with(4, 1.0), 0.05, ("points",)
    )
    assert (settings.harmonics > 3) == refined
    assert errors.total == (0 if refined else pytest.approx(1.1 / 0.85 - 1))


def test_an_error_that_another_respect_brings_out_is_refined_as_well(monkeypatch):
    """All points leave nothing of their own error, and show that of the rigid damper, which is as
    large: that one is refined next, although both together have not halved.
    """
    model = reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31)
    one = family_of(model)

    def with_own_damper(settings):
        member = one.build(settings)
        return replace(member, model=replace(member.model))

    family = replace(one, build=with_own_damper, dampers=("rigid", "elastic"))
    settings = replace(first_for(family.modes, dampers=True), harmonics=3, samples=128)

    def found(family, old, point, new, accuracy, fallbacks=True):
        rigid = new.damper == "rigid"
        if new.points == 4:
            return peak_with(1, 1.0 if rigid else 1.02)
        return peak_with(1, 1.3 if rigid else 1.7)

    search_by(monkeypatch, found)
    chosen, peak, errors = resonance_choice.choose_at_peak(
        family, settings, peak_with(1, 1.0), 0.05
    )
    assert chosen.damper == "elastic" and peak.height == 1.7 and errors.total == 0


@pytest.mark.parametrize("damping", [0.5, 0.005])
def test_a_flat_top_does_not_determine_the_frequency(damping):
    """What a shift takes from the height counts where it is less than the weighted shift."""
    # of one mode with omega = height = 1, next to its peak: 1/height^2 = 1 + (shift / damping)^2
    peak = KnownPeak(1.0, 1.0, SimpleNamespace(), bend=2 / damping**2)
    fall = peak_errors.fall_beside(peak, 0.01)
    assert fall == pytest.approx(1 - 1 / np.hypot(1, 0.01 / damping))
    errors = peak_errors.PeakErrors({"points": 0.001}, {"points": 0.01}, fall={"points": fall})
    assert errors.needs["points"] == (0.05 if damping < 0.01 else max(fall, 0.001))


def test_what_is_too_large_with_all_points_is_judged_with_twice_as_many(monkeypatch):
    """The error is of first order in the points: twice the change."""
    family = family_of(reference_model(points=64, load=1.4, phase=0.7, modes=10, harmonics=31))
    settings = replace(first_for(family.modes), harmonics=3, points=8)
    richer = replace(settings, points=None)
    point = peak_with(4).solution
    unknowns = family.build(replace(settings, points=16)).model.springs.size * 7
    monkeypatch.setattr(peak_errors, "LIFTING_POINTS_JUDGE", unknowns)
    found = peak_errors.compared_settings(family, settings, richer, "points", point)
    assert found == (settings, replace(settings, points=16), 2.0)


def test_more_harmonics_start_from_the_peak_that_judged_them(monkeypatch):
    """It is nearer than the peak that was judged; other respects start from that one."""
    nothing_left_out(monkeypatch)
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    settings = replace(first_for(family.modes), harmonics=3, samples=128)
    peak = peak_with(16)
    judge = peak_with(16, 1.2)
    errors = peak_errors.PeakErrors({}, {}, better={"harmonics": judge})
    ahead = resonance_choice._solution_ahead
    richer = replace(settings, harmonics=15)
    base, point = ahead(family, settings, peak, errors, richer)
    assert base.harmonics == 7 and point is judge.solution
    more_points = replace(settings, points=8)
    assert ahead(family, settings, peak, errors, more_points) == (settings, peak.solution)
    unknown = peak_errors.PeakErrors({}, {})
    assert ahead(family, settings, peak, unknown, richer) == (settings, peak.solution)


def test_a_damper_that_comes_off_is_tried_with_several_points_and_harmonics():
    first = first_for(10)
    top = SimpleNamespace(w=np.zeros((8, 3, 3)))
    start = resonance_choice.settings_of_lift_off(first, top)
    assert start.harmonics == 3 and start.points == resonance_choice.LIFTING_POINTS
    given = replace(first, chosen=("harmonics", "samples"))
    start = resonance_choice.settings_of_lift_off(given, top)
    assert start.points == first.points and start.harmonics == 3
    # a small balance is tried with more at once: a second curve would take longer
    small = SimpleNamespace(w=np.zeros((2, 2, 3)))
    start = resonance_choice.settings_of_lift_off(given, small)
    assert (start.harmonics, start.samples) == (7, 256)
    few = replace(given, most=5)
    assert resonance_choice.settings_of_lift_off(few, small).harmonics == 5


def test_a_richer_model_of_the_same_equations_tells_no_error(monkeypatch):
    """Modes that a family does not know differed by what a search for a peak had left: 9 % on a
    bouncing mass.
    """
    model = reference_model(points=1, load=1.4, phase=0.7, modes=10, harmonics=31)
    family = Family(lambda _: Member(model, np.arange(2)), 10)
    asked = []

    def known(family, old, point, new, accuracy, fallbacks=True):
        asked.append(new)
        return peak_of_settings(replace(new, points=1))

    search_by(monkeypatch, known)
    settings = replace(first_for(10), points=1)
    errors = peak_errors.peak_errors(family, settings, peak_of_settings(settings), 0.05)
    assert errors.height["modes"] == 0 < errors.height["harmonics"]
    assert all(s.modes == settings.modes for s in asked)


def test_harmonics_that_lift_off_has_changed_are_judged_again(monkeypatch):
    """An error that could not be reported with one harmonic is none of the seven that most contacts in
    the air asked for (seed 57 of benchmarks/choice_random.py).
    """
    model = reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31)
    family = family_of(model)
    judged = []

    def reported(family, settings, peak, accuracy, known):
        judged.append((settings.harmonics, dict(known)))
        far = {"harmonics": np.inf, "samples": 1.0} if len(judged) == 1 else {"samples": 0.0}
        changes = dict.fromkeys(DIRECTIONS, 0.0) | far
        return peak_errors.PeakErrors(changes, changes)

    closed = {"stick": 8, "slip": 6, "lift": 2, "open": 0}
    lifted = {"stick": 0, "slip": 0, "lift": 16, "open": 0}
    shape = SimpleNamespace(w=np.zeros((16, 1, 3)), states=closed)
    top = KnownPeak(1.0, 100.0, shape)
    monkeypatch.setattr(resonance_choice, "peak_errors", reported)
    monkeypatch.setattr(
        resonance_choice,
        "peak_from",
        lambda *given, **options: replace(top, solution=SimpleNamespace(w=shape.w, states=lifted)),
    )
    settings = replace(first_for(family.modes), points=8)
    resonance_choice.choose_at_peak(family, settings, top, 0.02)
    assert judged[0] == (1, {})
    assert judged[1][0] == 7 and "harmonics" not in judged[1][1]


@pytest.mark.parametrize(("solved", "tried"), [(True, [False]), (False, [False, True])])
def test_harmonics_of_lift_off_are_sought_without_fallbacks_first(solved, tried, monkeypatch):
    """On the shipped wedge under 9 N they are found so in 5 s of CPU, and with fallbacks not in
    24; where they are not found so the fallbacks are the second way.
    """
    lifted = {"stick": 0, "slip": 0, "lift": 16, "open": 0}
    shape = SimpleNamespace(w=np.zeros((16, 1, 3)), states=lifted)
    top = KnownPeak(1.0, 100.0, shape)
    ways = []

    def peak_from(*given, fallbacks=True):
        ways.append(fallbacks)
        if not (solved or fallbacks):
            raise NotSolvedError("no maximum was closed in")
        return top

    monkeypatch.setattr(resonance_choice, "peak_from", peak_from)
    settings = replace(first_for(10), points=8)
    richer, found = resonance_choice._with_harmonics_of_lift_off(None, settings, top, 0.02)
    assert ways == tried
    assert richer.harmonics == 7 and found is top


def test_an_error_stays_known_where_the_richer_model_is_not_solved_any_more(judged):
    """As it was before, unless its own respect has been refined since."""
    settings = replace(first_for(10), harmonics=7, points=4)
    known = judged(99, 99)
    before = resonance_choice.Choice(replace(settings, harmonics=3), None, known)
    unknown = peak_errors.PeakErrors(
        {**known.height, "points": np.inf, "harmonics": np.inf},
        {**known.frequency, "points": np.inf, "harmonics": np.inf},
    )
    found = resonance_choice._with_errors_before(unknown, settings, before)
    assert found.height["points"] == known.height["points"] > 0
    assert found.frequency["points"] == known.frequency["points"]
    assert found.height["harmonics"] == np.inf


def test_a_curve_starts_with_the_harmonics_that_are_excited():
    model = replace(single_mass(), excitation={1: np.array([1.0]), 5: np.array([0.02])})
    family = Family(lambda _: Member(model, np.arange(1)), 1)
    start = replace(first_for(1), points=None, chosen=("harmonics", "samples"))
    found = resonance_curve(family, start, (0.9 / (2 * np.pi), 1.6 / (2 * np.pi)), 1, 0.05)
    assert found.settings.harmonics >= 5


def test_a_poor_model_has_the_errors_that_a_richer_one_still_shows(monkeypatch):
    """One harmonic sees little of what more contact points change: 36 N on the shipped wedge."""
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))

    def found(family, old, point, new, accuracy, fallbacks=True):
        more = 0.25 if new.harmonics == 1 else 0.55
        return peak_with(4, (1.0 + 0.15 * (new.harmonics > 1)) * (1 + more * (new.points != 4)))

    search_by(monkeypatch, found)
    start = replace(first_for(family.modes), points=4, harmonics=1)
    settings, peak, errors = resonance_choice.choose_at_peak(
        family, start, peak_with(4, 1.0), 0.05, ("points",)
    )
    assert settings.harmonics > 1 and peak.height == pytest.approx(1.15)
    assert settings.error == errors.total == pytest.approx(0.55 / 1.55)


def nothing_left_out(monkeypatch):
    """Harmonics that a point leaves out move nothing."""
    monkeypatch.setattr(peak_errors, "truncation_indicator", lambda *_: np.zeros(1))


@pytest.mark.parametrize(("harmonics", "more"), [(3, 7), (7, 15), (15, 23)])
def test_many_harmonics_are_judged_by_half_as_many_again_where_contacts_lift(
    monkeypatch, harmonics, more
):
    """Twice as many cost a minute a peak there."""
    nothing_left_out(monkeypatch)
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=63))
    settings = replace(first_for(family.modes), harmonics=harmonics, samples=128)
    point = SimpleNamespace(states={"lift": 4}, w=np.zeros((16, 3, 1)))
    judge = peak_errors.judge_settings(family, settings, "harmonics", point)
    assert judge.harmonics == more and judge.samples >= 8 * more


@pytest.mark.parametrize(
    ("largest", "beyond", "more"), [(1e9, 2e-2, 15), (1e9, 5e-3, 7), (9, 2e-2, 7)]
)
def test_a_judge_that_is_blind_to_most_leaves_its_place(monkeypatch, largest, beyond, more):
    """Of three harmonics, which seven add a motion of 0.01 to: fifteen judge them where they add
    more than that, and are no large balance.
    """
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=63))
    settings = replace(first_for(family.modes), harmonics=3, samples=128)
    point = SimpleNamespace(states={"lift": 4}, w=np.zeros((16, 3, 1)), converged=True)
    moved = {7: 1e-2, 15: np.hypot(1e-2, beyond)}
    monkeypatch.setattr(peak_errors, "truncation_indicator", lambda *given: [moved[given[2]]])
    monkeypatch.setattr(peak_errors, "SEEING_JUDGE", largest)
    judge = peak_errors.judge_settings(family, settings, "harmonics", point)
    assert judge.harmonics == more


@pytest.mark.parametrize(("most", "height"), [(31, 0.1), (7, 0.01)])
def test_few_contacts_that_lift_leave_the_judge_four_times_the_harmonics(monkeypatch, most, height):
    """An internal resonance of the ninth harmonic, which seven do not know of; where fifteen are
    not solved, seven judge.
    """
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    settings = replace(first_for(family.modes), harmonics=3, samples=128, points=4)
    states = {"stick": 0, "slip": 7, "lift": 1, "open": 0}
    point = SimpleNamespace(states=states, w=np.zeros((8, 3, 1)))

    def known(family, old, start, new, accuracy, fallbacks=True):
        if new.harmonics > most:
            raise NotSolvedError("too rich")
        lower = {3: 0.0, 7: 0.01}.get(new.harmonics, 0.1)
        return KnownPeak(1.0 - lower, 100.0, point)

    search_by(monkeypatch, known)
    peak = KnownPeak(1.0, 100.0, point)
    errors = peak_errors.peak_errors(family, settings, peak, 0.05)
    assert errors.height["harmonics"] == pytest.approx(1 / (1 - height) - 1)


def test_a_choice_for_a_fine_accuracy_begins_with_what_it_mostly_ends_at(monkeypatch):
    """Climbing there took three quarters of the time of small models; where contacts stick, and
    where settings hold already, nothing is taken.
    """
    model = reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31)
    family = family_of(model)
    begun = []

    def reported(family, settings, peak, accuracy, known):
        begun.append(settings)
        return peak_errors.PeakErrors(*[dict.fromkeys(DIRECTIONS, 0.0)] * 2)

    monkeypatch.setattr(resonance_choice, "peak_errors", reported)
    search_by(monkeypatch, lambda *given, **options: peak_with(1, 1.0))
    monkeypatch.setattr(resonance_choice, "sticks_safely", lambda model, point: False)
    first = first_for(family.modes)
    for settings, accuracy in (
        (first, 1e-3),
        (first, 0.02),
        (replace(first, error=1e-4), 1e-3),
        (replace(first, chosen=("samples",)), 1e-3),
    ):
        resonance_choice.choose_at_peak(family, settings, peak_with(1, 1.0), accuracy)
    assert [(s.harmonics, s.samples) for s in begun] == [(7, 256), (1, 64), (1, 64), (1, 256)]
    monkeypatch.setattr(resonance_choice, "sticks_safely", lambda model, point: True)
    resonance_choice.choose_at_peak(family, first, peak_with(1, 1.0), 1e-3)
    assert begun[-1].harmonics == 1


@pytest.mark.parametrize(
    ("omega", "height", "another"),
    [
        # the curve has fallen to a half there, and the maximum is far lower
        (103.0, 0.6, True),
        # it has moved as far, and is as high
        (103.0, 0.9, False),
        # it is as low, on the curve itself
        (100.1, 0.6, False),
    ],
)
def test_a_lower_maximum_far_away_is_another_one(omega, height, another):
    """The curve of one mode of 0.87 % damping: 1/height^2 rises by 3 within 3 % of the frequency."""
    slips = SimpleNamespace(states={"stick": 0, "slip": 16, "lift": 0, "open": 0})
    peak = KnownPeak(1.0, 100.0, slips, bend=2 * 3.0 / 3.0**2)
    assert peak_errors.fall_beside(peak, 0.03) == pytest.approx(0.5)
    found = KnownPeak(height, omega, slips)
    assert peak_errors._is_another_maximum(peak, found) is another
    # a peak whose bend is not known says nothing of its surroundings
    assert not peak_errors._is_another_maximum(replace(peak, bend=0.0), found)


@pytest.mark.parametrize("nearer", [True, False])
def test_a_judge_that_is_another_maximum_leaves_the_error_to_a_nearer_one(nearer, monkeypatch):
    """As one that is not solved; its own change is told where the others are there, too: from one
    harmonic on a resonance with lift-off moves that far (seed 5 of benchmarks/choice_random.py).
    """
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    settings = replace(first_for(family.modes), harmonics=3, samples=128, points=4)
    slips = SimpleNamespace(states={"stick": 0, "slip": 16, "lift": 0, "open": 0})
    peak = KnownPeak(1.0, 100.0, slips, bend=2 * 3.0 / 3.0**2)
    judged = []

    def peak_by(family, own, base, judge, accuracy):
        judged.append(judge.harmonics)
        if len(judged) == 1 or not nearer:
            return KnownPeak(0.6 if len(judged) == 1 else 0.5, 103.0, slips)
        return KnownPeak(0.98, 100.0, slips, peak.bend)

    monkeypatch.setattr(peak_errors, "_judging_peak", peak_by)
    monkeypatch.setattr(peak_errors, "peak_from", lambda *given, **named: peak)
    monkeypatch.setattr(peak_errors, "truncation_indicator", lambda *given: np.zeros(1))
    other = replace(settings, harmonics=15)
    change, found = peak_errors._change_by(family, settings, peak, "harmonics", other, 0.02)
    if nearer:
        assert len(judged) == 2 and found is None
        assert 0.02 < change.height < 0.2
    else:
        assert len(judged) >= 2 and found.height == 0.6
        assert change.height > abs(1 / 0.6 - 1) - 1e-9
