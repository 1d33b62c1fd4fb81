"""Hertz, flat punch and Cattaneo-Mindlin in 3-D on gmsh's meshes; finer ones are in
benchmarks/contact_pairs.py.
"""

import numpy as np
import pytest
from pairs import indent, loops, press

from bladefem.scene.tables import Material

STEEL, ALUMINIUM = Material(), Material(E=7e10, nu=0.33, rho=2700.0)


@pytest.mark.parametrize("materials", [(STEEL, STEEL), (STEEL, ALUMINIUM)])
def test_hertz_sphere(materials):
    """h = a/6: measured peak 0.3 %, L2 1.8 %, radius 0.2 %; two materials enter by E* alone."""
    e = press(6, materials)
    assert e["peak"] < 0.01 and e["L2"] < 0.04 and e["radius"] < 0.03


def test_hertz_cylinder():
    """h = a/6, blocks of 60 half widths: measured peak 0.1 %, L2 1.2 %, half width 0.3 %."""
    e = press(6, (STEEL, ALUMINIUM), 2, contact_radius=5e-4, half_width=0.03)
    assert e["peak"] < 0.01 and e["L2"] < 0.04 and e["radius"] < 0.03


@pytest.mark.parametrize("dimension", [2, 3])
def test_rigid_flat_punch(dimension):
    """h = a/5: measured 0.8 % in the plane, 2.5 % in 3-D."""
    assert indent(5, STEEL, dimension) < 0.03


def test_partial_slip_of_a_sphere():
    """h = a/6, Q = 0.6 mu P between equal bodies: measured stick radius 0.1 %, energy of the loop
    0.7 %.
    """
    radius, energy = loops(press(6, (STEEL, STEEL)), STEEL, [0.6])[0]
    assert abs(radius) < 0.03 and abs(energy) < 0.03


def test_the_pressed_area_of_unequal_bodies_is_one():
    """Pressures of one map: what the blade feels is what the damper feels, resultants equal to
    rounding.
    """
    e = press(4, (STEEL, ALUMINIUM))
    assert e["force"].sum() == pytest.approx(e["total"], rel=1e-12)
    assert (np.asarray(e["force"]) >= 0).all()
