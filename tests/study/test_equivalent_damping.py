"""The damping ratio that a designer compares: of a linear blade with the same amplitude."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from bladefem import balance as bf
from bladefem.report.damping import damping_column, damping_error_words
from bladefem.report.headlines import headlines
from bladefem.report.statements import response_answer
from bladefem.study.pipeline.design_table import equivalent_damping

MASS, STIFFNESS, OWN = 1.0, 1e6, 1e-3


@pytest.mark.parametrize(("kt", "limit"), [(2e5, 0.5), (2e5, 2.0), (5e4, 1.0)])
def test_it_is_that_of_the_friction_element_in_closed_form(kt, limit):
    """One mass with one friction element under constant load: viscous damping of the element by
    Iwan's formula, worked out here at the amplitude of the solved resonance.
    """
    omega = np.sqrt(STIFFNESS / MASS)
    ports = {"contact": [0], "load": [0], "probe": [0]}
    viscous = 2 * OWN * MASS * omega
    body = bf.body_from_matrices(
        np.array([[MASS]]), np.array([[STIFFNESS]]), ports, C=np.array([[viscous]])
    )
    element = bf.Elements(kt=[kt], kn=[0.0], mu=[0.5], n0=[2 * limit], tangents=1)
    model = bf.ReducedModel((body,), element, {1: np.array([1.0])})
    curve = sorted(bf.sweep(model, (900.0, 1200.0), H=1, samples=2048), key=lambda p: p.omega)
    top = max(curve, key=bf.size)
    ratio = limit / (kt * bf.size(top))
    assert ratio < 0.9
    angle = np.arccos(1 - 2 * ratio)
    friction = kt * np.sin(angle) ** 2 / np.pi / top.omega
    expected = (viscous + friction) / (2 * MASS * top.omega)
    free = (omega / (2 * np.pi), 1.0 / (viscous * omega))
    found = equivalent_damping(OWN, [top.frequency], [bf.size(top)], free)
    # terms of the order of the damping ratio: the highest point is not that of phase resonance
    assert found[0] == pytest.approx(expected, rel=1e-3)
    assert found[0] > 2 * OWN


def summary_of(frequencies=(400.0, 410.0, 420.0, 430.0, 440.0), error=0.03):
    """A wedge that is best at 40 N, 0.1 % without damper."""
    summary = pd.DataFrame(
        {
            "load": [0.0, 20.0, 40.0, 80.0, np.inf],
            "peak_frequency": frequencies,
            "peak_amplitude": [2e-3, 3e-4, 1e-4, 3e-4, 2e-3],
            "error": error,
        }
    )
    band = [390.0, 450.0]
    points = pd.DataFrame(
        [
            {"load": load, "frequency": f, "amplitude": a if f == top else a / 2, "converged": True}
            for load, top, a in summary.iloc[:, :3].to_numpy()
            for f in sorted({*band, top - 0.5, top, top + 0.5} - {389.5, 450.5})
        ]
    )
    summary["equivalent_damping"] = damping_column(summary, points, OWN)
    return summary, points


def headline(summary, points):
    answer = response_answer(summary, points)
    found = headlines(answer, summary, points)
    return next((h for h in found if h.what == "equivalent damping ratio there"), None)


def test_the_answer_gives_it_with_what_makes_it_unsure():
    """Amplitude divided by 20 at a frequency 5 % higher: 1.814 %, Q 27.6. Its error is that of the
    amplitude, 3 %, twice that of the frequency, 0.5 of 420 Hz, and what the shape does in full
    stick, which has no friction and (400 / 440)^2 of the blade's own damping: 17.4 %.
    """
    summary, points = summary_of()
    assert summary["equivalent_damping"][0] == pytest.approx(OWN)
    row = headline(summary, points)
    assert row.value == "1.81 %"
    assert row.remark == (
        "Q = 27.6: a linear blade with this damping would have the same amplitude; 0.1 % without "
        "damper"
    )
    assert row.uncertainty == (
        "± 21 % (0.24 % by the frequency, 17 % by the mode's shape, as in full stick)"
    )
    without = summary.drop(columns="equivalent_damping")
    assert headline(without, points) is None
    unstuck = summary[np.isfinite(summary["load"])]
    assert headline(unstuck, points).uncertainty == (
        "± 3.2 % (0.24 % by the frequency, the mode's changed shape apart)"
    )
    assert headline(summary.assign(error=np.nan), points).uncertainty == "not estimated"


def test_the_end_of_the_band_is_no_resonance():
    """There the ratio is that of no resonance: of one load, or of the blade without damper, whose
    resonance all of them are compared with.
    """
    summary, points = summary_of((400.0, 410.0, 450.0, 430.0, 450.0))
    assert list(np.isnan(summary["equivalent_damping"])) == [False, False, True, False, True]
    assert headline(summary, points) is None
    summary, points = summary_of((390.0, 410.0, 420.0, 430.0, 440.0))
    assert np.isnan(summary["equivalent_damping"]).all()
    assert headline(summary, points) is None
    # what full stick, cut off, would say of the shape is not known
    summary, points = summary_of((400.0, 410.0, 420.0, 430.0, 450.0))
    assert headline(summary, points).uncertainty.endswith("the mode's changed shape apart)")


@pytest.mark.parametrize(
    ("own", "amplitude", "free"),
    [(0.0, 1e-4, 2e-3), (-1e-3, 1e-4, 2e-3), (1e-3, 0.0, 2e-3), (1e-3, 1e-4, np.inf)],
)
def test_without_damping_or_motion_there_is_none(own, amplitude, free):
    assert np.isnan(equivalent_damping(own, [420.0], [amplitude], (400.0, free))).all()
    summary, points = summary_of()
    summary.loc[0, ["peak_amplitude", "equivalent_damping"]] = free, own
    summary.loc[2, "peak_amplitude"] = amplitude
    assert headline(summary, points) is None


@pytest.mark.parametrize(
    ("error", "frequency", "words"),
    [
        (0.05, 0.01, "± 17 % (2 % by the frequency, 10 % by the mode's shape, as in full stick)"),
        (0.05, np.nan, "± 15 % (the frequency apart, 10 % by the mode's shape, as in full stick)"),
        (0.45, 0.01, "error not told, above 50 %"),
    ],
)
def test_the_parts_of_the_error_are_told(error, frequency, words):
    """Those that are not known are named; errors that are no small ones are not added."""
    summary = pd.DataFrame(
        {"load": [0.0, 70.0, np.inf], "equivalent_damping": [0.001, 0.02, 0.0011]}
    )
    best = pd.Series({"load": 70.0, "error": error})
    assert damping_error_words(summary, best, frequency) == words
