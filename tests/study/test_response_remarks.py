"""Remarks on responses: one sentence a reason, with all the loads that it holds for."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from bladefem.study.pipeline.response_remarks import (
    beyond_tolerance,
    lower_studied_remarks,
    resonance_warnings,
    stiff_layer_sentence,
)
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
    said = stiff_layer_sentence([shifted, plain])
    assert said.endswith("lies at 101.2 Hz in place of 100 Hz under 80 N")
    reached = curve(160.0, 0.05)
    reached.layer_shift, reached.reaches_layer = 0.02, True
    reached.peak_amplitude, reached.peak_frequency = 600e-6, 102.0
    said = stiff_layer_sentence([shifted, reached])
    assert "600 um at 102 Hz in place of 656 um at 100 Hz under 160 N; the resonance" in said
    assert stiff_layer_sentence([plain]) == ""


def test_loads_with_one_reason_share_a_sentence():
    curves = [curve(9.0, np.inf), curve(18.0, 0.51), curve(36.0, 0.67), curve(73.0, 0.01)]
    unknown, above = resonance_warnings(curves, 0.05)
    assert unknown.startswith("under 9 N the error of the resonance amplitude is unknown")
    assert above == (
        "estimated error of the resonance amplitude above the wanted 5 %: 18 N 51 %, 36 N 67 %"
    )
    assert list(resonance_warnings(curves[3:], 0.05)) == []


def test_the_part_of_the_contact_mesh_is_told_where_it_is_the_larger():
    curves = [curve(18.0, 0.08, halved=0.07), curve(36.0, 0.09, halved=0.01)]
    (above,) = resonance_warnings(curves, 0.05)
    assert "; 7 % under 18 N are what half as many contact points change" in above


def test_the_part_of_the_layer_is_told_where_it_is_the_larger():
    curves = [curve(18.0, 0.08, layer_law=0.07), curve(36.0, 0.09, layer_law=0.01)]
    (above,) = resonance_warnings(curves, 0.05)
    assert "; 7 % under 18 N are what the tangent of a layer that stiffens leaves out" in above


def test_an_error_by_the_mesh_of_the_bodies_says_so():
    (above,) = resonance_warnings([curve(192.8, 0.071, body_mesh=0.049)], 0.05)
    assert above.endswith(
        "4.9 % under 192.8 N are the estimated error of the mesh of the bodies, which a finer one "
        "lowers (mesh.size, mesh.scale)"
    )


def test_an_error_from_a_march_says_so():
    band = KeptBand(369.8, 640e-6, 662e-6, 200, points=16)
    reported, above = resonance_warnings([curve(36.0, 0.08, error_march=band)], 0.05)
    assert "error of the resonance amplitude, 656 um; it is estimated from a march" in reported
    assert "with 16 contact points a seat, which keeps between 640 and 662 um" in reported
    assert above.endswith("above the wanted 5 %: 36 N 8 %")


def test_a_resonance_next_to_an_unsolved_point_is_told():
    curves = [curve(18.0, 0.01, mass=0.02, converged=False), curve(36.0, None)]
    (reported,) = resonance_warnings(curves, 0.05)
    assert reported.startswith("under 18 N of 20 g the highest point that was solved lies next to")


def test_points_beyond_their_tolerance_are_counted_for_each_load():
    """The resonance itself has its own sentence."""
    curves = [
        curve(9.0, 0.0, estimated=(0.2, 0.2, np.inf)),
        curve(18.0, 0.0, estimated=(0.0, 0.2, 0.0)),
        curve(36.0, 0.0, estimated=(0.2, 0.0, 0.0)),
    ]
    reported = beyond_tolerance(curves)
    assert "9 N (2 of 3 points), 36 N (1 of 3 points); columns" in reported
    assert beyond_tolerance(curves[1:2]) == ""


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
