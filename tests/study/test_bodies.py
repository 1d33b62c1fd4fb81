"""The blade at rest and the blade under rotation share what rotation does not change."""

from __future__ import annotations

import numpy as np
import pytest

from bladefem.fem.constraint import at_diameter, in_step, transformation
from bladefem.fem.flexibility import flexible
from bladefem.fem.linear_preload import unit_speed_displacement
from bladefem.fem.modes import modes
from bladefem.scene.toml import load_scene
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.scene_mesh import build_mesh

COARSE = ["mesh.size=24 mm", "mesh.scale=1.5", "aerofoil.fillet=0 mm"]


@pytest.fixture(scope="module")
def mesh():
    return build_mesh(load_scene("scenes/wedge.toml", COARSE))


def test_at_rest_seats_and_modes_have_one_elimination(mesh):
    """Statics and dynamics of a blade that does not turn are of one matrix."""
    scene = load_scene("scenes/wedge.toml", [*COARSE, "operation.stiffening=false"])
    bodies = Bodies(scene, mesh)
    assert bodies.still.factor.parts.core is bodies.frame.opened.core


def test_the_preload_is_that_of_the_sectors_in_step(mesh):
    """The open sector gives the displacement that the sparse matrix of nodal diameter 0 gives."""
    bodies = Bodies(load_scene("scenes/wedge.toml", COARSE), mesh)
    plain = unit_speed_displacement(flexible(in_step(bodies.still_blade)))
    np.testing.assert_allclose(bodies.swell, plain, atol=1e-10 * abs(plain).max())


def test_rotation_changes_the_stiffness_alone(mesh):
    """Mass and order of the elimination are those at rest, modes those of a sector made anew."""
    bodies = Bodies(load_scene("scenes/wedge.toml", COARSE), mesh)
    still = bodies.still.con.K
    under = bodies.frame
    assert under.opened.M is bodies.still.con.M.A
    assert under.opened.elimination.order is still.core.order
    assert under.opened.elimination.core() is not still.core.core()
    anew = transformation(bodies.blade, "clamp", True)
    found, expected, at_rest = (
        modes(at_diameter(t, 9), 4).frequencies
        for t in (under, anew, transformation(bodies.still_blade, "clamp", True))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    assert found[0] > 1.001 * at_rest[0]
