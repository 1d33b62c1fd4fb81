"""Sensitivities against central differences of solved points."""

import numpy as np
import pytest
from models import block, single_mass

from bladefem.errors import InputError
from bladefem.hbm.api import solve
from bladefem.hbm.newton import Options
from bladefem.hbm.reference import reference_model
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.sweep import size
from bladefem.hbm.vary import vary

TIGHT = Options(tolerance=1e-13)
COUPLED = ("omega", "force", "load", "mu", "kt", "kn", "gap")


def difference(model, near, name, step):
    omega = near.omega
    def point(value):
        changed = model if name == "omega" else vary(model, name, value if name == "gap" else np.exp(value))
        return solve(changed, omega + (value if name == "omega" else 0.0), 5, 512, start=near, options=TIGHT)
    high, low = point(step), point(-step)
    return (high.probe - low.probe) / (2 * step), (size(high) - size(low)) / (2 * step)


@pytest.mark.parametrize(("model", "omega", "names"), [
    (single_mass(), 1.1, ("omega", "force", "load", "mu", "kt")), (block(force=1.5), 0.9, COUPLED),
    (block(force=0.5, damper=True), 1.3, (*COUPLED, "mass")),
    (reference_model(load=1.4, points=3, phase=0.7, harmonics=5), 8300.0,
     ("omega", "force", "load", "mu", "kt", "mass"))])
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
    with pytest.raises(InputError, match="gap"):
        sensitivities(model, solve(model, 1.1), ["gap"])
