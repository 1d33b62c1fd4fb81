"""Beside a resonance that lasts, against a plain explicit march written here: plane blades under 4 N,
eleven contact nodes a seat.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba import njit

from bladefem.damper.branch import state_of
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.stability import STABLE, UNSTABLE
from bladefem.hbm.time_model import time_system
from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.checked_curve import CheckedCurve
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import first_for
from bladefem.study.stability import error_in_time
from bladefem.study.stability.error_in_time import Marches
from bladefem.study.stability.flank_motions import flank_motions
from bladefem.study.stability.march_by_steps import band_by_steps
from bladefem.study.stability.march_from_motion import kept_band
from bladefem.study.stability.verdicts import in_one_body, stability_of
from verification.paper.plane_row import row_of_blades, whole_model

HARMONICS = 15
FREQUENCIES = (1077.0, 1069.4, 1061.8, 1054.3, 1046.7, 1039.1, 1031.5, 1023.9, 1016.4)
# at 1016.4 Hz a disturbance grows by 2.6 % a period
STEPS, PERIODS, COUNTED = 1000, 400, 150


# in loops: 0.3 times the time of expressions of small arrays
@njit(cache=True)
def march(stiffness, damping, W, R, kt, kn, mu, n0, force, probe, omega, q, v, z, steps, periods):
    """Symplectic Euler steps of modes and damper; the motion (periods, steps) of the probe."""
    n, d = W.shape
    dt = 2 * np.pi / omega / steps
    out = np.empty((periods, steps))
    a = np.empty(d)
    for period in range(periods):
        for step in range(steps):
            angle = 2 * np.pi * step / steps
            for i in range(d):
                a[i] = force[i, 0] + force[i, 1] * np.cos(angle) + force[i, 2] * np.sin(angle)
                a[i] -= stiffness[i] * q[i]
                for j in range(d):
                    a[i] -= damping[i, j] * v[j]
            for c in range(n):
                along = 0.0
                across = 0.0
                for i in range(d):
                    along += W[c, i] * q[i]
                    across += R[c, i] * q[i]
                normal = max(n0[c] + kn[c] * across, 0.0)
                friction = min(max(kt[c] * (along - z[c]), -mu[c] * normal), mu[c] * normal)
                z[c] = along - friction / kt[c]
                beyond = normal - max(n0[c], 0.0)
                for i in range(d):
                    a[i] -= W[c, i] * friction + R[c, i] * beyond
            read = 0.0
            for i in range(d):
                v[i] += dt * a[i]
                q[i] += dt * v[i]
                read += probe[i] * q[i]
            out[period, step] = read
    return out


@pytest.fixture(scope="module")
def model():
    scene = load_scene("scenes/plane.toml")
    row = row_of_blades(vary(scene, mesh__contact_size=scene.plane.seat_width / 10))
    return in_one_body(whole_model(scene, row, 4.0))


@pytest.fixture(scope="module")
def points(model):
    omegas = 2 * np.pi * np.array(FREQUENCIES)
    found = list(response(model, omegas, HARMONICS, 256))
    assert all(point.converged for point in found)
    return found[::-1]


@pytest.fixture(scope="module")
def truth(model, points):
    """Lowest and highest amplitude of the last periods, from the motion at the end of the band."""
    point = points[0]
    s = time_system(model, 1)
    start = state_of(point, s)
    normal = np.einsum("ij,ij->i", s.V, s.R) / np.einsum("ij,ij->i", s.R, s.R)
    moved = march(
        *(
            s.stiffness,
            s.damping,
            s.W.copy(),
            s.R.copy(),
            s.kt,
            normal,
            s.mu,
            s.normal[:, 0].copy(),
            s.force,
        ),
        *(s.probe[0].copy(), point.omega, 1.001 * start.q, start.v.copy(), start.z.copy()),
        *(STEPS, PERIODS),
    )
    lines = 2 / STEPS * np.fft.rfft(moved[-COUNTED:], axis=1)[:, 1 : HARMONICS + 1]
    heights = np.linalg.norm(lines, axis=1)
    return heights.min(), heights.max()


def settings_of(family):
    """Those of the points."""
    given = first_for(family.modes)
    return replace(given, harmonics=HARMONICS, samples=256, points=None, chosen=())


def test_the_blade_keeps_far_more_beside_the_resonance_than_at_it(model, points, truth):
    family = family_of(model)
    settings = settings_of(family)
    top = max(points, key=size)
    curve = CheckedCurve(settings, [points[0], top], {})
    marks = stability_of(model, curve.points)
    assert list(marks.verdict) == [UNSTABLE, STABLE]
    found = flank_motions(Marches(family), curve, marks, size(top))
    assert found.point is points[0] and found.reason == ""
    assert truth[1] > 1.6 * size(top)
    assert found.highest == pytest.approx(truth[1], rel=0.1)
    assert found.kept.lowest == pytest.approx(truth[0], rel=0.1)


def test_steps_keep_to_the_band_of_the_plain_march(model, points, truth):
    """Also where an exact march is possible, which takes far longer."""
    family = family_of(model)
    band = Marches(family).band(settings_of(family), points[0])
    assert band.reason == ""
    assert band.highest == pytest.approx(truth[1], rel=0.1)
    assert band.lowest == pytest.approx(truth[0], rel=0.1)


@pytest.fixture(scope="module")
def exact(model, points):
    """By the exact march."""
    return kept_band(model, points[0])


def test_the_exact_march_is_asked_where_steps_come_to_no_end(model, points, exact, monkeypatch):
    asked = []
    lost = replace(exact, reason="forces of a step were not found")
    monkeypatch.setattr(error_in_time, "band_by_steps", lambda *_: lost)
    monkeypatch.setattr(error_in_time, "exact_band", lambda *given: asked.append(given) or exact)
    family = family_of(model)
    assert Marches(family).band(settings_of(family), points[0]) is exact
    ((marched, point),) = asked
    assert point is points[0]
    for name in ("kt", "kn", "mu", "n0"):
        np.testing.assert_array_equal(
            getattr(marched.elements, name), getattr(model.elements, name)
        )


def test_the_exact_march_goes_on_until_the_band_is_that_of_the_plain_one(exact, truth):
    assert exact.reason == ""
    assert exact.highest == pytest.approx(truth[1], rel=0.1)
    assert exact.lowest == pytest.approx(truth[0], rel=0.1)


def test_steps_and_the_exact_march_keep_to_one_band_on_a_stiff_contact():
    """All contacts lift off, and no period is like another."""
    scene = load_scene("scenes/plane.toml", ["contact.kt=1e8 N/m"])
    row = row_of_blades(vary(scene, mesh__contact_size=scene.plane.seat_width / 4))
    stiff = in_one_body(whole_model(scene, row, 8.0))
    (point,) = response(stiff, 2 * np.pi * np.array([1100.0]), HARMONICS, 256)
    assert point.converged and point.states["lift"] == len(stiff.springs)
    exact, by_steps = kept_band(stiff, point), band_by_steps(stiff, point)
    assert exact.highest > 1.02 * exact.lowest
    assert by_steps.highest == pytest.approx(exact.highest, rel=3e-3)
    assert by_steps.lowest == pytest.approx(exact.lowest, rel=3e-3)
