"""A stiff layer split between element and body is the same layer: laws in series, and a response
that does not depend on the split.
"""

from dataclasses import replace

import numpy as np
import pytest
from seated_wedge import ALPHA, condensed
from wedge import wedge_mesh

from bladefem.contact.interface_elements import gives_stiffness, pair_ratio, with_interface_law
from bladefem.contact.numerical_stiffness import (
    numerical_stiffness,
    physical_stiffness,
    split_stiffness,
    stiffest_layer,
)
from bladefem.data import Elements, Patch, PressureMap
from bladefem.hbm.model import ReducedModel, in_series
from bladefem.hbm.parameters import vary
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solve import solve, stuck_response
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.scene.tables import Contact, Scene
from bladefem.scene.toml import vary as vary_scene
from bladefem.study.influences import parameters_of
from bladefem.study.pipeline.changed_cases import cases_of

STIFFNESS = 4e6
OMEGA = 120.0


def elements(kt=STIFFNESS, n0=(40.0, -2.0)):
    """Two 3-D contacts, the second open: its gap is 2 N over kn."""
    return Elements(np.full(2, kt), np.full(2, 1.2 * kt), np.full(2, 0.3), np.array(n0))


def maps(e):
    """Both on one patch of 2 mm^2."""
    frame = np.tile(np.eye(3), (2, 1, 1))
    patch = Patch("this", np.eye(2, 3), np.full(2, 1e-6), frame, np.array([[0, 1]]), [0, 1])
    return [PressureMap(patch, np.maximum(e.n0, 0.0), np.maximum(-e.n0 / e.kn, 0.0), 0.0)]


def split_model(model, areal):
    e, series = split_stiffness(model.elements, maps(model.elements), Contact(), areal)
    if series is None:
        return model
    sides = tuple(in_series(side, series) for side in model.sides)
    return replace(model, elements=e, sides=sides, series=series)


def chain(kt=STIFFNESS, n0=(40.0, 20.0), force=40.0):
    """Two masses with three directions each on springs, both pressed on fixed ground."""
    M = np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
    K = np.kron([[3e4, -1e4], [-1e4, 2e4]], np.eye(3)) + 2e3 * np.ones((6, 6))
    ports = {"contact": np.arange(6), "load": np.array([2]), "probe": np.array([2])}
    side = port_model_from_matrices(M, K, ports, C=2e-4 * K)
    return ReducedModel((side,), elements(kt, n0), {1: np.array([force])})


@pytest.mark.parametrize("areal", [1e10, 3e11, 1e12, 1e13])
def test_elements_in_series_have_the_stiffness_of_the_layer(areal):
    e = elements()
    soft, series = split_stiffness(e, maps(e), Contact(), areal)
    assert (soft.kt <= areal * 1e-6 * (1 + 1e-12)).all()
    whole = physical_stiffness(soft, series)
    np.testing.assert_allclose(whole.kt, e.kt, rtol=1e-9)
    np.testing.assert_allclose(whole.kn, e.kn, rtol=1e-9)
    np.testing.assert_allclose(whole.n0, e.n0, rtol=1e-9)
    np.testing.assert_allclose(soft.n0[1] / soft.kn[1], e.n0[1] / e.kn[1], rtol=1e-12)
    assert (series is None) == (areal > 5e12)


def test_rigid_faces_leave_no_compliance():
    e = elements(kt=1e16)
    soft, series = split_stiffness(e, maps(e), Contact(), 1e11)
    np.testing.assert_allclose(1.0 / soft.kt + series[:, 1], 0.0, atol=1e-15)
    np.testing.assert_allclose(1.0 / soft.kn + series[:, 0], 0.0, atol=1e-15)


@pytest.mark.parametrize("areal", [1e11, 4e11, 1e12])
def test_full_stick_does_not_depend_on_the_split(areal):
    model = chain(n0=(40.0, 30.0))
    soft = stuck_response(split_model(model, areal), OMEGA)
    assert soft == pytest.approx(stuck_response(model, OMEGA), rel=1e-9)


def test_the_response_depends_on_the_split_by_truncation_alone():
    """Both contacts slip: what tells the split apart falls as harmonics are added."""
    whole = solve(chain(), OMEGA, 63, 1024)
    assert whole.converged and whole.states["slip"] == 2
    apart = []
    for H in (3, 15, 63):
        soft = solve(split_model(chain(), 4e11), OMEGA, H, 16 * H + 64)
        assert soft.converged
        apart.append(abs(soft.probe[1, 0] / whole.probe[1, 0] - 1.0))
    assert apart[1] < 5e-3 and apart[2] < 5e-4


def test_the_response_between_rigid_faces_has_a_limit():
    """Two numerical stiffnesses give one response, and stiff layers tend to it."""
    model = chain(kt=1e16)
    one, other = (solve(split_model(model, k), OMEGA, 31, 560) for k in (2e11, 1e12))
    assert one.converged and other.converged and one.states["slip"] == 2
    assert abs(one.probe[1, 0] / other.probe[1, 0] - 1.0) < 5e-3
    stiff = solve(split_model(chain(kt=1e9), 1e12), OMEGA, 31, 560)
    assert abs(stiff.probe[1, 0] / other.probe[1, 0] - 1.0) < 1e-3


@pytest.mark.parametrize("name", ["kt", "kn"])
def test_the_derivative_by_the_stiffness_is_that_of_the_layer(name):
    """Against differences of the split model, and against the layer that is not split."""
    model = split_model(chain(), 1e12)
    point = solve(model, OMEGA, 31, 512)
    rate = sensitivities(model, point, [name])[name].size[0]
    step = 1e-3
    ends = [
        np.linalg.norm(solve(vary(model, name, f), OMEGA, 31, 512, start=point).probe[1:, 0])
        for f in (np.exp(step), np.exp(-step))
    ]
    height = ends[0]
    assert rate == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-2, abs=1e-5 * height)
    whole = solve(chain(), OMEGA, 31, 512)
    same = sensitivities(chain(), whole, [name])[name].size[0]
    assert rate == pytest.approx(same, rel=0.1, abs=1e-3 * height)


def test_every_search_solves_the_split_layer():
    """Loads that are studied and loads that the best one is searched among have the same
    elements.
    """
    for given, value in (("contact.stiffness", "rigid"), ("contact.kt_area", 1e15)):
        scene = vary_scene(Scene(), given, value, "contact.mu", 0.3)
        ratio = pair_ratio(scene.material.blade, scene.material.damper)
        problem = with_interface_law(condensed(wedge_mesh(ALPHA)), scene.contact, ratio)
        case = cases_of(scene, problem, 2)(120.0)
        assert case.series is not None and (case.series < 0).all()
        area = np.concatenate([patch.area for patch in problem.patches])
        np.testing.assert_allclose(case.elements.kt, numerical_stiffness(problem) * area)
        layer = physical_stiffness(case.elements, case.series)
        # a given layer is taken as it is, rigid faces as a stiff one
        stiffness = stiffest_layer(problem) if value == "rigid" else value
        np.testing.assert_allclose(layer.kt, stiffness * area, rtol=1e-6)


def test_rigid_faces_have_no_stiffness_to_vary():
    scene = vary_scene(Scene(), "contact.stiffness", "rigid")
    assert gives_stiffness(scene.contact)
    names = {parameter.name for parameter in parameters_of(scene)}
    assert "mu" in names and not names & {"kt", "kn"}
