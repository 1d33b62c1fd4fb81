"""Warnings on responses: one a reason, with all the loads that it holds for, what to do about it
and details.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from bladefem.study.pipeline.accuracy_warnings import (
    beside_unsolved,
    errors_above,
    errors_in_time,
    inexact_flanks,
    single_motions,
    softer_layers,
    unconverged_points,
    unknown_errors,
)
from bladefem.study.pipeline.best_load_remarks import lower_studied_remarks
from bladefem.study.pipeline.load_remarks import LoadRemark, Reason, load_warnings
from bladefem.study.stability.kept_band import KeptBand


def curve(
    load,
    error,
    mass=None,
    halved=np.nan,
    estimated=(0.0, 0.0, 0.0),
    converged=True,
    layer_law=np.nan,
    body_mesh=np.nan,
    error_march=None,
):
    """Three points, the resonance in the middle."""
    return SimpleNamespace(
        load=load,
        mass=mass,
        error=error,
        halved=halved,
        layer_law=layer_law,
        body_mesh=body_mesh,
        error_march=error_march,
        resonance_by_march=None,
        peak=SimpleNamespace(frequency=100.0),
        peak_amplitude=656e-6,
        curve_amplitude=656e-6,
        reaches_layer=False,
        frequency=np.array([99.0, 100.0, 101.0]),
        peak_frequency=100.0,
        converged=np.array([converged, True, True]),
        estimated=np.array(estimated),
        tolerated=np.array([0.1, 0.05, 0.1]),
    )


def test_a_softer_layer_says_where_the_stiff_one_resonates():
    """Loads whose resonance is that of the layer itself are left out."""
    shifted, plain = curve(80.0, 0.17), curve(320.0, 0.03)
    shifted.layer_shift = 0.012
    plain.layer_shift = np.nan
    (said,) = load_warnings(softer_layers([shifted, plain]))
    assert said.startswith("under 80 N contacts lift off") and "details" in said.advice
    assert said.detail.endswith("lies at 101.2 Hz in place of 100 Hz")
    reached = curve(160.0, 0.05)
    reached.layer_shift, reached.reaches_layer = 0.02, True
    reached.peak_amplitude, reached.peak_frequency = 600e-6, 102.0
    _, said = load_warnings(softer_layers([shifted, reached]))
    assert said.endswith("the resonance given is that of the stiff one, followed from there")
    assert said.detail == "160 N: 600 um at 102 Hz in place of 656 um at 100 Hz"
    assert not list(softer_layers([plain]))


def test_loads_with_one_reason_share_a_sentence():
    curves = [curve(9.0, np.inf), curve(18.0, 0.51), curve(36.0, 0.67), curve(73.0, 0.01)]
    (unknown,) = load_warnings(unknown_errors(curves))
    assert unknown.startswith("under 9 N the error of the resonance amplitude is unknown")
    (above,) = load_warnings(errors_above(curves, 0.05))
    assert above == (
        "the estimated error of the resonance amplitude exceeds the wanted 5 % under 18 N (51 %) "
        "and 36 N (67 %)"
    )
    assert not list(errors_above(curves[3:], 0.05))


def test_the_part_of_the_contact_mesh_is_told_where_it_is_the_larger():
    curves = [curve(18.0, 0.08, halved=0.07), curve(36.0, 0.09, halved=0.01)]
    above, plain = load_warnings(errors_above(curves, 0.05))
    assert above.endswith("under 18 N (8 %)") and "mesh.seat_elements" in above.advice
    assert above.detail == "18 N: 7 % of 8 % are what half as many contact points change"
    assert plain.endswith("under 36 N (9 %)") and not plain.detail


def test_the_part_of_the_layer_is_told_where_it_is_the_larger():
    curves = [curve(18.0, 0.08, layer_law=0.07, halved=0.05)]
    (above,) = load_warnings(errors_above(curves, 0.05))
    assert "18 N: 7 % of 8 % are what the tangent of a layer that stiffens leaves" in above.detail
    assert "contact.kn_area" in above.advice


def test_an_error_by_the_mesh_of_the_bodies_says_so():
    (above,) = load_warnings(errors_above([curve(192.8, 0.071, body_mesh=0.049)], 0.05))
    assert above.detail.endswith("4.9 % of 7.1 % are the estimated error of the mesh of the bodies")
    assert "(mesh.size, mesh.scale)" in above.advice


def test_an_error_from_a_march_says_so():
    band = KeptBand(369.8, 640e-6, 662e-6, 200, points=16)
    (reported,) = load_warnings(errors_in_time([curve(36.0, 0.08, error_march=band)]))
    assert "error of the resonance amplitude is that of an integration in time" in reported
    assert "36 N: 656 um; marched from there with 16 contact points a seat" in reported.detail
    assert reported.detail.endswith("it keeps between 640 and 662 um")
    assert not list(errors_in_time([curve(36.0, 0.08)]))


def test_a_resonance_next_to_an_unsolved_point_is_told():
    curves = [curve(18.0, 0.01, mass=0.02, converged=False), curve(36.0, None)]
    (reported,) = load_warnings(beside_unsolved(curves))
    assert reported.startswith("under 18 N of 20 g the resonance may be higher than the one given")
    (lost,) = load_warnings(unconverged_points(curves))
    assert lost.endswith("under 18 N of 20 g (1 of 3)")


def test_points_beyond_their_tolerance_are_counted_for_each_load():
    """The resonance itself has its own sentence."""
    curves = [
        curve(9.0, 0.0, estimated=(0.2, 0.2, np.inf)),
        curve(18.0, 0.0, estimated=(0.0, 0.2, 0.0)),
        curve(36.0, 0.0, estimated=(0.2, 0.0, 0.0)),
    ]
    (reported,) = load_warnings(inexact_flanks(curves))
    assert reported.endswith("under 9 N (2 of 3 points) and 36 N (1 of 3 points)")
    assert not list(inexact_flanks(curves[1:2]))


def test_many_loads_are_counted_and_named_in_the_details():
    """The sentence stays short, and no load is lost."""
    many = [curve(float(load), 0.1 * load) for load in range(1, 8)]
    (above,) = load_warnings(errors_above(many, 0.05))
    assert above.endswith("exceeds the wanted 5 % under 7 loads")
    assert above.detail.startswith("1 N: 10 %; 2 N: 20 %;") and above.detail.endswith("7 N: 70 %")
    for one in many:
        one.folds_not_followed = True
    (single,) = load_warnings(single_motions(many))
    assert single.startswith("under 7 loads") and single.detail.endswith(
        "1 N; 2 N; 3 N; 4 N; 5 N; 6 N; 7 N"
    )


def test_each_reason_is_one_warning_with_its_advice():
    lifted, lost = (Reason(f"{what} under {{loads}}", f"mend {what}") for what in ("a", "b"))
    remarks = [
        LoadRemark(lifted, "1 N", "x"),
        None,
        LoadRemark(lost, "1 N"),
        LoadRemark(lifted, "2 N", "y"),
    ]
    first, second = load_warnings(remarks)
    assert (first, first.advice, first.detail) == (
        "a under 1 N and 2 N",
        "mend a",
        "1 N: x; 2 N: y",
    )
    assert (second, second.level, second.detail) == ("b under 1 N", "warning", "")


def test_a_best_load_above_a_load_studied_is_told():
    """The highest motion counts, stable or not; another damper's curves do not."""
    scene = SimpleNamespace(accuracy=0.05)
    best = SimpleNamespace(reason="", mass=0.02, load=50.0, amplitude=198e-6, kept=None)
    studied = [
        SimpleNamespace(
            mass=mass,
            load=load,
            amplitude=1e-6 * np.array(sizes),
            converged=np.array([True, True]),
            peak_amplitude=1e-6 * given,
        )
        for mass, load, sizes, given in (
            (0.02, 80.0, (150, 180), 175),
            (0.02, 40.0, (570, 608), 608),
            (0.02, 50.0, (190, 198), 198),
            (0.01, 9.0, (1, 2), 2),
        )
    ]
    (said,) = lower_studied_remarks(scene, [best], studied)
    assert "198 um under 50 N is more than the 180 um under 80 N studied" in said
    assert said.level == "warning"
    assert not list(lower_studied_remarks(scene, [best], studied[1:]))
    studied[1].peak_amplitude = 150e-6
    (said,) = lower_studied_remarks(scene, [best], studied[1:])
    assert "150 um under 40 N studied: the search compares balances" in said
    best = SimpleNamespace(reason="no peak", mass=0.02, load=np.nan, amplitude=np.nan)
    assert not list(lower_studied_remarks(scene, [best], studied))
