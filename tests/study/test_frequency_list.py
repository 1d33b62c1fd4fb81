"""The automatic choice along a hundred frequencies, and points that stick with one harmonic."""

import numpy as np
import pytest

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.hbm.linear_resonances import free_resonances, stuck_resonances
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.study.adaptive.check_points import heights_of, peak_of, points_to_check
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.frequency_list import adapt_frequency_list
from bladefem.study.adaptive.settings import first_for


@pytest.fixture(scope="module")
def blade():
    """Two contact points; between free and stuck resonance all but a few of the frequencies
    stick.
    """
    return reference_model(1e6, 0.06, 8.0, phase=0.0, points=1, harmonics=63)


@pytest.fixture(scope="module")
def omegas(blade):
    ends = [sorted((free_resonances(blade)[i], stuck_resonances(blade)[i])) for i in (0, 1)]
    return {
        name: np.linspace(1.1 * low - 0.1 * high, 1.1 * high - 0.1 * low, 100)
        for name, (low, high) in zip(("first", "second"), ends, strict=True)
    }


@pytest.mark.parametrize("mode", ["first", "second"])
@pytest.mark.parametrize("accuracy", [0.02, 0.001])
def test_no_point_is_wrong(blade, omegas, mode, accuracy):
    """In phasors over the peak, measured 4e-3 and 4e-4.

    Round the second resonance slips that only begin were 3e-3 wrong at 0.1 %; round the first one a
    higher harmonic is in resonance half way down the slipping stretch, which 7 harmonics miss by
    1.2 %.
    """
    curve = adapt_frequency_list(
        family_of(blade, (1, 1)), omegas[mode], first_for(len(blade.side(1).omega)), accuracy
    )
    truth = list(response(blade, omegas[mode], 31, 2048))
    top = max(size(p) for p in truth)
    assert [p.omega for p in curve.points] == list(omegas[mode])
    assert all(p.converged for p in curve.points)
    assert (
        max(abs(p.probe[1, 0] - q.probe[1, 0]) for p, q in zip(curve.points, truth, strict=True))
        < accuracy * top
    )
    assert all(
        error <= accuracy * top / size(p)
        for p in curve.points
        if (error := curve.errors.get(p.omega))
    )


def test_the_first_slip_is_watched(blade, omegas):
    points = list(response(blade, omegas["second"], 7, 256))
    slips = [p.states["slip"] > 0 for p in points]
    onset = [
        p for p, before, now in zip(points[1:], slips, slips[1:], strict=False) if now > before
    ]
    looked_at = points_to_check(points, heights_of(points), np.zeros(len(points)), 0.001)
    assert onset and all(p in looked_at or p is peak_of(points) for p in onset)


def test_only_points_that_need_it_get_richer_settings(blade, omegas):
    """At 0.1 % slips that only begin take 15 harmonics here, the peak 7, and what sticks the
    excited one.
    """
    curve = adapt_frequency_list(
        family_of(blade, (1, 1)), omegas["second"], first_for(len(blade.side(1).omega)), 0.001
    )
    slipping = [p.harmonics for p in curve.points if p.states["slip"]]
    assert curve.settings.harmonics == min(slipping) < max(slipping)
    assert slipping.count(max(slipping)) < 10
    assert {p.harmonics for p in curve.points if not p.states["slip"]} <= {
        1,
        curve.settings.harmonics,
    }


def test_points_that_stick_take_the_excited_harmonic_alone(blade, omegas):
    frugal = Options(frugal=True)
    for omega in [*omegas["second"][::9], *omegas["first"][::20]]:
        lean, full = solve(blade, omega, 7, 256, options=frugal), solve(blade, omega, 7, 256)
        assert (lean.harmonics == 1) == (full.states["stick"] == 2)
        assert lean.probe[1, 0] == pytest.approx(full.probe[1, 0], rel=1e-9)


@pytest.mark.parametrize(
    ("omegas", "accuracy", "named"),
    [
        ([], 0.02, "omegas"),
        ([8300.0], -1.0, "accuracy -1"),
        ([8300.0], np.nan, "accuracy nan"),
        ([np.nan], 0.02, "omega nan"),
    ],
)
def test_bad_input_is_named(blade, omegas, accuracy, named):
    with pytest.raises(InputError, match=named):
        adapt_frequency_list(
            family_of(blade, (1, 1)), omegas, first_for(len(blade.side(1).omega)), accuracy
        )


def two_masses(n0, excitation):
    """The example of the README, its first mass rubbing on the ground."""
    K = np.array([[1.5e6, -0.5e6], [-0.5e6, 1.5e6]])
    ports = {"contact": [0], "load": [0, 1], "probe": [0, 1]}
    body = port_model_from_matrices(np.eye(2), K, ports, C=4e-6 * K)
    element = Elements(
        kt=np.array([1e6]), kn=np.zeros(1), mu=np.array([0.4]), n0=np.array([n0]), tangents=1
    )
    return ReducedModel((body,), element, excitation)


@pytest.mark.parametrize("n0", [3.0, 100.0])
@pytest.mark.parametrize(
    "excitation", [{1: np.array([1.0, 0.5j])}, {1: np.array([1.0, 0.0]), 3: np.array([0.5, 0.2j])}]
)
def test_points_that_stick_with_fewer_harmonics_are_compared_and_all_excited_ones_are_taken(
    n0, excitation
):
    """A stuck point is solved with the excited harmonics alone, of which there may be several."""
    model = two_masses(n0, excitation)
    omegas = np.linspace(800, 1600, 40)
    curve = adapt_frequency_list(family_of(model, (1,)), omegas, first_for(2), 0.01)
    truth = list(response(model, omegas, 31, 2048))
    top = max(size(p) for p in truth)
    for p, q in zip(curve.points, truth, strict=True):
        assert p.converged
        assert abs(size(p) - size(q)) < 0.01 * top
