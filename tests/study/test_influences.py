"""What the best load depends on: derivatives against the search repeated with changed parameters."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from bladefem.contact.interface_elements import scaled_contact, stiffnesses
from bladefem.hbm.reference_blade import reference_model
from bladefem.report.influences import influence_sentence
from bladefem.scene.tables import Contact, Scene, Seat
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.influences import (
    Parameter,
    best_load_rate,
    influences,
    parameters_of,
    seat_friction_range,
)
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.best_load_search import find_best_load

PLANE = Path(__file__).parents[2] / "scenes" / "plane.toml"
MODEL = reference_model(1e6, 0.06, 1.0, harmonics=1)
SETTINGS = Settings(len(MODEL.sides[0].omega), 1, 0, "mass")
# half of the range over which the derivatives are compared with repeated searches
SMALL = 1.04


def changed(name, factor):
    """The seats press with the load less what closes a gap, which grows with kt."""

    def case_at(load):
        stiff = factor if name == "kt" else 1.0
        mu = factor if name == "mu" else 1.0
        scaled = factor * load if name == "seat friction" else load
        elements = replace(
            MODEL.elements,
            kt=stiff * MODEL.elements.kt,
            mu=mu * MODEL.elements.mu,
            n0=np.full(2, scaled - 0.2 * stiff),
        )
        return LoadCase(load, elements, np.eye(2))

    return case_at


def family(case):
    return family_of(replace(MODEL, elements=case.elements))


@pytest.fixture(scope="module")
def scene():
    given = load_scene(PLANE, ["accuracy=0.2 %", "contact.mu=1", "excitation.force=0.05 N"])
    return replace(given, study=replace(given.study, band=(1150.0, 1450.0)))


@pytest.fixture(scope="module")
def found(scene):
    best = find_best_load(scene, changed("kt", 1.0), family, SETTINGS, None)
    names = ("kt", "mu", "damping", "seat friction")
    parameters = [Parameter(name, 1 / SMALL, SMALL, "a test") for name in names]
    return best, influences(scene, best, family, changed, parameters)


@pytest.mark.mpi
@pytest.mark.several_ranks
@pytest.mark.two_ranks
def test_ranks_share_the_parameters(scene, found):
    """In the order and with the numbers of one rank."""
    best, alone = found
    parameters = [one.parameter for one in reversed(alone)]
    shared = influences(scene, best, family, changed, parameters, MPI.COMM_WORLD)
    assert [one.parameter for one in shared] == [one.parameter for one in alone]
    for one, same in zip(shared, alone, strict=True):
        for name in ("load", "amplitude", "frequency", "predicted", "solved"):
            np.testing.assert_allclose(getattr(one, name), getattr(same, name), rtol=1e-9)


def test_derivatives_are_those_of_repeated_searches(found):
    best, all_found = found
    assert best.reason == ""
    solved = [one for one in all_found if np.isfinite(one.solved).all()]
    assert len(solved) == 2
    for one in solved:
        change = np.log(one.solved[1] / one.solved[0]) / (2 * np.log(SMALL))
        assert one.amplitude == pytest.approx(change[1], rel=0.02)
        # a frequency is found to the square root of the search's tolerance only
        assert one.frequency == pytest.approx(change[2], rel=0.1, abs=5e-3)
        assert one.load == pytest.approx(change[0], rel=0.1, abs=0.05)


def test_loads_at_the_ends_are_searched_and_not_kept(found):
    """mu N decides alone, so that the load at an end is known; with the tolerance of a scene of 5 %
    accuracy the search kept where it began, 2 % off.
    """
    best, _ = found
    scene = load_scene(PLANE, ["accuracy=5 %", "contact.mu=1", "excitation.force=0.05 N"])
    scene = replace(scene, study=replace(scene.study, band=(1150.0, 1450.0)))
    mu = Parameter("mu", 0.8, 1.25, "a test")
    moved = replace(best, load=1.01 * best.load)
    (one,) = influences(scene, moved, family, changed, [mu])
    assert "falls by less than 0.001 %" in influence_sentence([one])
    exact = (best.load - 0.2) / np.array([0.8, 1.25]) + 0.2
    assert one.solved[:, 0] == pytest.approx(exact, rel=3e-3)
    assert (one.solved[:, 0] != one.predicted[:, 0]).all()


def test_derivatives_of_sampled_friction_are_those_of_exact_friction(scene, found):
    """With few samples slopes ripple: changes are found with many, whatever was chosen."""
    best, exact = found
    sampled = replace(SETTINGS, samples=64, chosen=("samples", "harmonics", "points"))
    parameters = [one.parameter for one in exact]
    again = influences(scene, replace(best, settings=sampled), family, changed, parameters)
    loads = {one.parameter.name: one.load for one in again}
    for one in exact:
        assert loads[one.parameter.name] == pytest.approx(one.load, rel=0.1, abs=0.02)


def test_the_best_load_is_followed_where_the_height_is_convex():
    """ln height 2 (l - r p)^2 by ln load l and parameter p: the minimum moves by r. On the side of
    another motion its derivatives are not taken.
    """
    rate, step = -0.08, 0.14
    below, here, above = (np.array([4.0 * at, -4.0 * rate * at]) for at in (-step, 0.0, step))
    assert best_load_rate(below, here, above) == pytest.approx(rate)
    other = np.array([0.02, -0.38])
    assert best_load_rate(other, here, above) == pytest.approx(rate)
    assert best_load_rate(below, here, -other) == pytest.approx(rate)
    assert np.isnan(best_load_rate(other, here, -other))


def test_the_largest_influence_comes_first(found):
    spans = [one.span for one in found[1]]
    assert spans == sorted(spans, reverse=True)


def test_friction_acts_through_its_product_with_the_normal_force(found):
    """mu N decides alone: the best load less what closes the gap goes with 1 / mu."""
    best, all_found = found
    by_name = {one.parameter.name: one for one in all_found}
    assert by_name["mu"].amplitude == pytest.approx(0.0, abs=2e-3)
    assert by_name["mu"].load == pytest.approx(-(best.load - 0.2) / best.load, rel=0.02)
    assert by_name["seat friction"].load == pytest.approx(-1.0, rel=0.02)


def test_seat_friction_of_a_wedge():
    """F / (2 (sin a +- mu cos a)) over F / (2 sin a); a self-locking wedge has no range."""
    low, high = seat_friction_range(0.3, (np.radians(65), np.radians(65)))
    sine, cosine = np.sin(np.radians(65)), np.cos(np.radians(65))
    assert low == pytest.approx(sine / (sine + 0.3 * cosine))
    assert high == pytest.approx(sine / (sine - 0.3 * cosine))
    assert seat_friction_range(0.6, (np.radians(30), np.radians(30))) is None


def reactions(mu, angles, way):
    """Normal loads of both seats under a unit radial force, by the balance of forces: friction of
    the same way on both, along each flank, and none without it.
    """
    first, second = angles
    radial = [np.sin(a) + way * mu * np.cos(a) for a in (first, second)]
    across = [np.cos(first) - way * mu * np.sin(first), way * mu * np.sin(second) - np.cos(second)]
    return np.linalg.solve([radial, across], [1.0, 0.0])


@pytest.mark.parametrize("mu", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("degrees", [(65, 65), (70, 50), (75, 60), (70, 45)])
def test_seat_friction_of_an_asymmetric_wedge(mu, degrees):
    """No range where a seat would have to pull: its logarithm ended the run."""
    angles = np.radians(degrees)
    without = reactions(mu, angles, 0.0)
    ratios = np.array([reactions(mu, angles, way) / without for way in (1.0, -1.0)])
    found = seat_friction_range(mu, tuple(angles))
    if (ratios > 0).all():
        assert found == pytest.approx((ratios.min(), ratios.max()))
    else:
        assert found is None


@pytest.mark.parametrize(
    "contact",
    [
        Contact(kt_area=4e10),
        Contact(kn=3e7),
        Contact(kt=1e7, kn_area=2e11),
        Contact(kt_area=4e10, left=Seat(kn=3e7)),
        Contact(left=Seat(kn_area=3e11), right=Seat(kt=2e6)),
    ],
)
def test_one_stiffness_is_scaled_without_the_other(contact):
    from bladefem.contact.interface_elements import seat_contact

    area = np.array([1e-5, 3e-5])
    for name in ("this", "next"):
        plain = stiffnesses(seat_contact(contact, name), 0.8, area)
        for factors in ((2.0, 1.0), (1.0, 3.0)):
            other = scaled_contact(contact, 0.8, *factors)
            scaled = stiffnesses(seat_contact(other, name), 0.8, area)
            for before, after, factor in zip(plain, scaled, factors, strict=True):
                assert after == pytest.approx(factor * before)


def test_roughness_takes_the_place_of_a_stiffness_that_is_not_given():
    """Over the published range; stiffnesses that are given are varied themselves."""
    found = {p.name: p for p in parameters_of(Scene())}
    assert not {"kt", "kn"} & set(found)
    assert (found["roughness"].low, found["roughness"].high) == (0.2, 5.0)
    assert "Persson" in found["roughness"].range_from
    given = {p.name for p in parameters_of(Scene(contact=Contact(kn=1e7)))}
    assert {"kt", "kn"} <= given and "roughness" not in given


def test_seat_friction_is_that_of_the_seats():
    seats = Contact(mu=0.0, left=Seat(mu=0.2), right=Seat(mu=0.4))
    angles = (np.deg2rad(65), np.deg2rad(65))
    found, same = (
        {one.name: (one.low, one.high) for one in parameters_of(Scene(contact=contact), angles)}
        for contact in (seats, Contact(mu=0.3))
    )
    assert found["seat friction"] == pytest.approx(same["seat friction"])
    assert found["seat friction"][0] < 1 < found["seat friction"][1]
