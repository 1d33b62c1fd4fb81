"""The laws of docs/extending.md: balance against time integration of their own, and every path."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.hbm.continuation import follow
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.node_gradients import node_gradients
from bladefem.hbm.parameters import vary
from bladefem.hbm.response import response
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import fallback
from bladefem.hbm.solver.fallback import solve_balance
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS, Options
from bladefem.hbm.solver.residual import Balance
from bladefem.hbm.sweep import sweep
from bladefem.hbm.truncation_indicator import truncation_indicator
from bladefem.reduction.matrices import port_model_from_matrices

PAGE = Path(__file__).parents[2] / "docs/extending.md"


@pytest.fixture(scope="module")
def page():
    """What the code of the page defines."""
    names = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL):
        exec(block, names)
    return names


def mass_on_law(law, n0=1.0, zeta=0.02, force=1.0):
    """Mass 1, spring 1, an element of stiffness 1 and limit 0.5 n0 to the ground."""
    ports = {name: np.array([0]) for name in ("contact", "load", "probe")}
    body = port_model_from_matrices(np.eye(1), np.eye(1), ports)
    elements = Elements(
        np.ones(1), np.zeros(1), np.full(1, 0.5), np.full(1, n0), tangents=1, law=law
    )
    return ReducedModel((body,), elements, {1: np.array([force])}, Damping(ratio=zeta))


def first_harmonic(slope, elastic, omega):
    """Amplitude of m x'' + 2 zeta x' + x + f = cos(omega t) by integration over many periods."""

    def rates(t, y):
        x, v, z = y
        f = elastic * x + (1 - elastic) * z
        return v, np.cos(omega * t) - 0.04 * v - x - f, slope(z, v) * v

    period = 2 * np.pi / omega
    periods, samples = 60, 256
    times = np.linspace((periods - 1) * period, periods * period, samples, endpoint=False)
    found = solve_ivp(
        rates,
        (0, periods * period),
        np.zeros(3),
        t_eval=times,
        rtol=1e-8,
        atol=1e-9,
        max_step=period / 60,
    )
    return abs(np.fft.rfft(found.y[0])[1]) * 2 / samples


@pytest.mark.parametrize("omega", [0.9, 1.25])
def test_dahl_against_time_integration(page, omega):
    point = solve(mass_on_law(page["Dahl"]()), omega, 15, 1024)
    direct = first_harmonic(lambda z, v: 1 - z * np.sign(v) / 0.5, 0.0, omega)
    assert point.converged and point.work.imbalance < 1e-8
    assert point.amplitude[1, 0] == pytest.approx(direct, rel=2e-4)


@pytest.mark.parametrize("omega", [0.9, 1.25])
def test_bouc_wen_against_time_integration(page, omega):
    point = solve(mass_on_law(page["BoucWen"]()), omega, 15, 1024)

    def slope(z, v):
        return 1 - abs(z / 0.5) ** 2 * (1 + np.sign(z * v)) / 2

    assert point.converged and point.work.imbalance < 1e-8
    assert point.amplitude[1, 0] == pytest.approx(first_harmonic(slope, 0.1, omega), rel=2e-4)


def test_the_page_solves_two_laws_in_one_model(page):
    point = page["point"]
    assert point.converged and point.route == "NumPy Newton, dense LU"
    swapped = replace(page["contacts"], law=(page["BoucWen"](), page["Dahl"]()))
    other = solve(replace(page["model"], elements=swapped), 0.8, 7, 256)
    assert abs(other.amplitude[1, 0] / point.amplitude[1, 0] - 1) > 1e-3


def test_every_path_uses_the_law(page):
    """Points, a list, a band and a path in the frequency lie on one curve, none on Coulomb's."""
    model = mass_on_law(page["Dahl"]())
    coulomb = mass_on_law(None)
    omegas = np.linspace(0.9, 1.5, 7)
    points = [solve(model, omega, 3, 64) for omega in omegas]
    heights = [size(point) for point in points]
    listed = [size(point) for point in response(model, omegas, 3, 64)]
    np.testing.assert_allclose(listed, heights, rtol=1e-8)
    frugal = Options(frugal=True)
    np.testing.assert_allclose(
        [size(p) for p in response(model, omegas, 3, 64, options=frugal)], heights, rtol=1e-8
    )
    followed = [at.solution for at in follow(model, "omega", points[0], (0.9, 1.5))]
    band = list(sweep(model, (0.9, 1.5), 3, 64))
    for curve in (followed, band):
        at = [size(solve(model, p.omega, 3, 64)) for p in curve[::5]]
        np.testing.assert_allclose([size(p) for p in curve[::5]], at, rtol=1e-8)
    usual = [size(solve(coulomb, omega, 3, 64)) for omega in omegas]
    assert (abs(np.array(usual) / heights - 1) > 1e-3).all()
    assert all(p.states["stick"] == 0 for p in points)


def test_every_fallback_ends_on_the_law(page):
    """With plain Newton from both starts closed, each later link gives the same point or says
    why.
    """
    model = mass_on_law(page["Dahl"]())
    balance = Balance(model, condense(model, 1.25, 5), 64)
    usual = solve(model, 1.25, 5, 64)
    for name in ("_more_harmonics", "_from_high_load", "_along_excitation"):
        end = getattr(fallback, name)(balance, DEFAULT_OPTIONS)
        assert end.converged, (name, end.reason)
        np.testing.assert_allclose(end.state.w, usual.w, rtol=0, atol=1e-8)
    near = solve_balance(balance, None, DEFAULT_OPTIONS)[0].end
    shot = fallback._from_shooting(balance, near, DEFAULT_OPTIONS)
    assert not shot.converged and "written for Coulomb's law" in shot.reason


def test_derivatives_by_parameters(page):
    """Of the height, against solving anew; of each node, their sum."""
    model = page["model"]
    names = ["mu", "kt", "load", "force", "omega"]
    point = solve(model, 0.8, 5, 128)
    slopes = sensitivities(model, point, names)
    each = node_gradients(model, point, ["mu", "kt", "load"])
    for name in names:
        step = 1e-4
        ends = [
            size(solve(model, 0.8 + x, 5, 128))
            if name == "omega"
            else size(solve(vary(model, name, np.exp(x)), 0.8, 5, 128))
            for x in (step, -step)
        ]
        assert slopes[name].size[0] == pytest.approx((ends[0] - ends[1]) / 2 / step, rel=1e-5)
        if name in each:
            assert each[name].sum() == pytest.approx(slopes[name].size[0], rel=1e-6)


def test_the_indicator_of_left_out_harmonics(page):
    """Its forces are those of the law, to the higher harmonics that a richer balance has."""
    model = mass_on_law(page["Dahl"]())
    point = solve(model, 0.9, 3, 64)
    assert 0 < truncation_indicator(model, [point], 9)[0] < 0.1


def test_what_is_written_for_coulomb_refuses(page):
    with pytest.raises(InputError, match=r"samples = 0.*written for Coulomb's law"):
        solve(mass_on_law(page["Dahl"]()), 1.0, 3, 0)
    with pytest.raises(InputError, match="expected an object made from FrictionLaw"):
        mass_on_law(page["Dahl"])


def test_the_page_writes_the_laws_of_the_table(page):
    for name, law in (("dahl", page["Dahl"]()), ("bouc-wen", page["BoucWen"]())):
        ours = solve(mass_on_law(name), 0.9, 5, 128)
        np.testing.assert_allclose(solve(mass_on_law(law), 0.9, 5, 128).w, ours.w, atol=1e-12)


def test_the_step_as_merit_comes_after_the_residual_from_every_start():
    """Where the loop is not compiled; a point for which nothing else is tried is left without."""
    starts = [np.zeros(1), np.ones(1)]
    merits = fallback.NEWTON_MERITS[::-1]

    def order(starts, by_start, fallbacks):
        runs = fallback._runs_in_order(starts, merits, by_start, fallbacks)
        return [(int(w[0]), merit) for w, (_, merit) in runs]

    residual_first = [(0, "residual"), (1, "residual")]
    assert order(starts, False, True) == [*residual_first, (0, "step"), (1, "step")]
    assert order(starts, False, False) == residual_first
    assert order(starts[:1], False, False) == [(0, "residual"), (0, "step")]
    by_start = [(0, "residual"), (0, "step"), (1, "residual"), (1, "step")]
    assert order(starts, True, True) == order(starts, True, False) == by_start
