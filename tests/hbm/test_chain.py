"""The chain whose contacts lift off: folds, several solutions, and no point lost."""

import numpy as np
from hbm_models import chain

from bladefem.hbm.response import response
from bladefem.hbm.solve import solve


def test_the_whole_curve_without_tuning():
    found = list(response(chain().model, np.linspace(0.6, 1.6, 21), 3, 128))
    assert all(s.converged for s in found)
    assert max(s.states["lift"] for s in found) > 10
    assert max(s.work.imbalance for s in found) < 1e-8


def test_a_point_behind_a_fold_is_reached_by_path_following():
    """At 1.5 rad/s Newton and the homotopies fail: the path in the load turns back on its way."""
    solution = solve(chain().model, 1.5, 7, 256)
    assert solution.converged and solution.residual < 1e-10 and solution.work.imbalance < 1e-8
    assert solution.method == "path in the excitation"
