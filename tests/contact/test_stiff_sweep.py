"""A patch between rigid faces: no point of a sweep is lost where all contacts slip and lift off."""

import numpy as np
from small_patch import patch_model

from bladefem.hbm.solver.newton import Options
from bladefem.hbm.sweep import sweep

# [N]
FORCE = 60.0
# stiffness per unit area that stands for rigid faces [N/m^3]
RIGID = 1e22


def test_no_point_is_lost_and_none_needs_a_path():
    """With a numerical stiffness of 20 times that of the softest common motion, no layer on rigid
    faces and no walks from neighbours, points here were found by paths in the excitation or lost.
    """
    model = patch_model(RIGID, FORCE)
    band = (2 * np.pi * 380.0, 2 * np.pi * 720.0)
    options = Options(tolerance=1e-7)
    points = list(sweep(model, band, 3, 64, paths=False, options=options))
    assert all(p.converged for p in points)
    assert {p.method for p in points} <= {"newton", "newton on the residual", "more samples"}
    assert max(p.states["lift"] for p in points) == len(model.elements.kt)
