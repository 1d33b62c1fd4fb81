"""Sensitivities against central differences of solved points."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.errors import InputError
from bladefem.hbm.api import solve
from bladefem.hbm.gradient import node_gradients
from bladefem.hbm.model import Damping
from bladefem.hbm.newton import Options
from bladefem.hbm.reference import reference_model
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.sweep import size
from bladefem.hbm.vary import vary

TIGHT = Options(tolerance=1e-13)
COUPLED = ("omega", "force", "load", "mu", "kt", "kn", "gap", "damping")


def elastic_damper(**changes):
    """Contacts in 3-D between a body and a floating elastic one."""
    damper = block(nodes=4, seed=5, dofs=14).side(1)
    damper = replace(damper, omega=np.maximum(1.5 * damper.omega - 0.9, 0.0), ports={"contact": slice(0, 12)})
    model = block(force=0.8)
    return replace(model, damper=(damper,), damper_damping=Damping(0.02, 0.01, mass=0.03, stiffness=0.02), **changes)


def difference(model, near, name, step):
    omega = near.omega
    def point(value):
        changed = model if name == "omega" else vary(model, name, value if name == "gap" else np.exp(value))
        return solve(changed, omega + (value if name == "omega" else 0.0), 5, 512, start=near, options=TIGHT)
    high, low = point(step), point(-step)
    return (high.probe - low.probe) / (2 * step), (size(high) - size(low)) / (2 * step)


@pytest.mark.parametrize(("model", "omega", "names"), [
    (single_mass(), 1.1, ("omega", "force", "load", "mu", "kt", "damping")),
    (replace(single_mass(), normal={1: np.array([0.2j])}), 1.1, ("omega", "force", "load", "mu", "kt", "damping")),
    (block(force=1.5), 0.9, COUPLED),
    (block(force=0.5, damper=True), 1.3, (*COUPLED, "mass")), (replace(block(force=1.5), coupled=False), 0.9, COUPLED),
    (elastic_damper(), 1.1, (*COUPLED, "mass")),
    (reference_model(load=1.4, points=3, phase=0.7, harmonics=5), 8300.0,
     ("omega", "force", "load", "mu", "kt", "mass", "damping"))])
def test_sensitivities_equal_differences(model, omega, names):
    solution = solve(model, omega, 5, 512, options=TIGHT)
    assert solution.converged and solution.states["slip"] + solution.states["lift"]
    for name, found in sensitivities(model, solution, names).items():
        step = 1e-6 * (omega if name == "omega" else 1.0)
        probe, height = difference(model, solution, name, step)
        # the springs that hold a rigid damper change with kt and kn, by 1e-3: the derivative keeps them
        exact = 2e-5 if model.damper is None or name not in ("kt", "kn") else 1e-3
        np.testing.assert_allclose(found.probe, probe, rtol=0, atol=exact * abs(probe).max(), err_msg=name)
        assert found.size[0] == pytest.approx(height, rel=10 * exact, abs=exact * abs(probe).max()), name


def test_unknown_parameter():
    model = single_mass()
    with pytest.raises(InputError, match="did you mean 'load'"):
        sensitivities(model, solve(model, 1.1), ["loads"])
    with pytest.raises(InputError, match="with a damper"):
        sensitivities(model, solve(model, 1.1), ["mass"])
    with pytest.raises(InputError, match="gap"):
        sensitivities(model, solve(model, 1.1), ["gap"])


@pytest.mark.parametrize(("model", "omega", "names"), [
    (block(force=1.5), 0.9, ("load", "mu", "kt", "kn", "gap")),
    (block(force=0.5, damper=True), 1.3, ("load", "mu", "kt", "kn", "gap")),
    (reference_model(load=1.4, points=3, phase=0.7, harmonics=5), 8300.0, ("load", "mu", "kt"))])
def test_gradients_of_the_nodes(model, omega, names):
    """Their sum is the direct derivative; the load of one node is checked by differences."""
    solution = solve(model, omega, 5, 512, options=TIGHT)
    found, direct = node_gradients(model, solution, names), sensitivities(model, solution, names)
    for name in names:
        assert found[name].sum() == pytest.approx(direct[name].size[0], rel=1e-7), name
    def height(factor):
        n0 = model.elements.n0.copy()
        n0[1] *= factor
        return size(solve(replace(model, elements=replace(model.elements, n0=n0)), omega, 5, 512, start=solution,
                          options=TIGHT))
    slope = (height(1 + 1e-5) - height(1 - 1e-5)) / 2e-5
    assert found["load"][1] == pytest.approx(slope, rel=1e-3, abs=1e-4 * abs(found["load"]).max())


def test_gradients_of_bodies_are_refused():
    model = single_mass()
    with pytest.raises(InputError, match="expected contact parameters"):
        node_gradients(model, solve(model, 1.1), ["mass"])
