"""The damping ratio that a designer compares: of a linear blade that resonates as high."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from bladefem import balance as bf
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


def test_the_answer_gives_it_with_the_error_of_the_amplitude():
    """Amplitude divided by 20 at a frequency 5 % higher, 0.1 % without damper: 1.814 %, Q 27.6."""
    summary = pd.DataFrame(
        {
            "load": [0.0, 20.0, 40.0, 80.0, np.inf],
            "peak_frequency": [400.0, 410.0, 420.0, 430.0, 440.0],
            "peak_amplitude": [2e-3, 3e-4, 1e-4, 3e-4, 2e-3],
            "error": 0.03,
        }
    )
    free = (400.0, 2e-3)
    summary["equivalent_damping"] = equivalent_damping(
        0.001, summary["peak_frequency"], summary["peak_amplitude"], free
    )
    assert summary["equivalent_damping"][0] == pytest.approx(0.001)
    row = next(h for h in headlines(response_answer(summary), summary, None) if "damping" in h.what)
    assert (row.what, row.value) == ("equivalent damping ratio there", "1.81 %")
    assert row.remark.startswith("Q = 27.6: ") and "0.1 % without damper" in row.remark
    assert row.uncertainty.startswith("± 3 %")
    without = summary.drop(columns="equivalent_damping")
    assert not any("damping" in what for what, _, _ in response_answer(without).numbers)
