"""Sensitivities against central differences of solved points."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.errors import InputError
from bladefem.hbm.model import Damping
from bladefem.hbm.node_gradients import node_gradients
from bladefem.hbm.parameters import vary
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options

TIGHT = Options(tolerance=1e-13)
COUPLED = ("omega", "force", "load", "mu", "kt", "kn", "gap", "damping")


def elastic_damper(**changes):
    """Contacts in 3-D between a body and a floating elastic one."""
    damper = block(nodes=4, seed=5, dofs=14).side(1)
    damper = replace(
        damper, omega=np.maximum(1.5 * damper.omega - 0.9, 0.0), ports={"contact": slice(0, 12)}
    )
    model = block(force=0.8)
    return replace(
        model,
        damper=(damper,),
        damper_damping=Damping(0.02, 0.01, mass=0.03, stiffness=0.02),
        **changes,
    )


def floating_body():
    """A body with rigid motions under a static and a moving load, held by its contacts with the
    ground alone.
    """
    model = block(nodes=4, force=1.0)
    side = replace(model.side(1), omega=np.where(np.arange(30) < 3, 0.0, model.side(1).omega))
    return replace(model, sides=(side,), excitation={0: np.array([0.2]), 1: np.array([1.0])})


def difference(model, near, name, step):
    omega = near.omega

    def point(value):
        changed = (
            model
            if name == "omega"
            else vary(model, name, value if name == "gap" else np.exp(value))
        )
        return solve(
            changed, omega + (value if name == "omega" else 0.0), 5, 512, start=near, options=TIGHT
        )

    high, low = point(step), point(-step)
    return (high.probe - low.probe) / (2 * step), (size(high) - size(low)) / (2 * step)


@pytest.mark.parametrize(
    ("model", "omega", "names"),
    [
        (single_mass(), 1.1, ("omega", "force", "load", "mu", "kt", "damping")),
        (
            replace(single_mass(), normal={1: np.array([0.2j])}),
            1.1,
            ("omega", "force", "load", "mu", "kt", "damping"),
        ),
        (block(force=1.5), 0.9, COUPLED),
        (block(force=0.5, damper=True), 1.3, (*COUPLED, "mass")),
        (replace(block(force=1.5), coupled=False), 0.9, COUPLED),
        (elastic_damper(), 1.1, (*COUPLED, "mass")),
        (floating_body(), 0.9, COUPLED),
        (
            reference_model(load=1.4, points=3, phase=0.7, harmonics=5),
            8300.0,
            ("omega", "force", "load", "mu", "kt", "mass", "damping"),
        ),
    ],
)
def test_sensitivities_equal_differences(model, omega, names):
    solution = solve(model, omega, 5, 512, options=TIGHT)
    assert solution.converged and solution.states["slip"] + solution.states["lift"]
    for name, found in sensitivities(model, solution, names).items():
        probe, height = difference(
            model, solution, name, 1e-6 * (omega if name == "omega" else 1.0)
        )
        # measured: 3e-8, the curvature over the step; a kink of the sampled friction within it
        # would show at once
        np.testing.assert_allclose(
            found.probe, probe, rtol=0, atol=3e-7 * abs(probe).max(), err_msg=name
        )
        assert found.size[0] == pytest.approx(height, rel=1e-6, abs=3e-7 * abs(probe).max()), name


def test_derivatives_take_the_bodies_that_the_point_was_solved_with(monkeypatch):
    """Modal flexibilities are those of the solved point: none is computed again."""
    model = elastic_damper()
    point = solve(model, 1.1, 3, 128)

    def refused(*arguments):
        raise AssertionError("flexibilities of the modes computed again")

    monkeypatch.setattr("bladefem.hbm.solution.modal_flexibility", refused)
    monkeypatch.setattr("bladefem.hbm.model.stack_bodies", refused)
    assert set(sensitivities(model, point, ["omega", "damping"])) == {"omega", "damping"}


def test_unknown_parameter():
    model = single_mass()
    with pytest.raises(InputError, match="did you mean 'load'"):
        sensitivities(model, solve(model, 1.1), ["loads"])
    with pytest.raises(InputError, match="with a damper"):
        sensitivities(model, solve(model, 1.1), ["mass"])
    with pytest.raises(InputError, match="gap"):
        sensitivities(model, solve(model, 1.1), ["gap"])


@pytest.mark.parametrize(
    ("model", "omega", "names"),
    [
        (block(force=1.5), 0.9, ("load", "mu", "kt", "kn", "gap")),
        (block(force=0.5, damper=True), 1.3, ("load", "mu", "kt", "kn", "gap")),
        (reference_model(load=1.4, points=3, phase=0.7, harmonics=5), 8300.0, ("load", "mu", "kt")),
    ],
)
def test_gradients_of_the_nodes(model, omega, names):
    """Their sum is the direct derivative; those of one node against differences."""
    solution = solve(model, omega, 5, 512, options=TIGHT)
    found, direct = node_gradients(model, solution, names), sensitivities(model, solution, names)

    def height(name, step):
        value = getattr(model.elements, "n0" if name in ("load", "gap") else name).copy()
        value[1] = (
            value[1] - step * model.elements.kn[1] if name == "gap" else value[1] * np.exp(step)
        )
        changed = replace(model.elements, **{"n0" if name in ("load", "gap") else name: value})
        return size(
            solve(replace(model, elements=changed), omega, 5, 512, start=solution, options=TIGHT)
        )

    for name in names:
        assert found[name].sum() == pytest.approx(direct[name].size[0], rel=1e-8), name
        slope = (height(name, 1e-6) - height(name, -1e-6)) / 2e-6
        assert found[name][1] == pytest.approx(slope, abs=1e-6 * abs(found[name]).max()), name


def test_gradients_of_bodies_are_refused():
    model = single_mass()
    with pytest.raises(InputError, match="expected contact parameters"):
        node_gradients(model, solve(model, 1.1), ["mass"])
