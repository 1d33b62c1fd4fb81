"""A patch between rigid faces: no point of a sweep is lost where all contacts slip and lift off."""

import numpy as np
from small_patch import patch_model

from bladefem.hbm.response import response
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.sweep import sweep

# [N]
FORCE = 60.0
# stiffness per unit area that stands for rigid faces [N/m^3]
RIGID = 1e22
# [rad/s]
BAND = (2 * np.pi * 380.0, 2 * np.pi * 720.0)


def lost_points(split):
    """Of 24 points by Newton alone, no fallbacks."""
    model = patch_model(RIGID, FORCE, split)
    options = Options(tolerance=1e-7, fallbacks=False)
    points = response(model, np.linspace(*BAND, 24), 3, 64, options=options)
    return sum(not p.converged for p in points)


def test_newton_on_springs_for_rigid_faces_finds_nothing():
    """The fragile form, elements of 1e22 N/m^3: all 24 points are lost; split 5 of them."""
    assert lost_points(split=False) == 24
    assert lost_points(split=True) <= 8


def test_no_point_is_lost_and_none_needs_a_path():
    """Newton and walks from neighbours find every point, without paths in the excitation."""
    model = patch_model(RIGID, FORCE)
    options = Options(tolerance=1e-7)
    points = list(sweep(model, BAND, 3, 64, paths=False, options=options))
    assert all(p.converged for p in points)
    assert {p.method for p in points} <= {"newton", "newton on the residual", "more samples"}
    assert max(p.states["lift"] for p in points) == len(model.elements.kt)
