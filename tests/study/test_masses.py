"""A damper of another mass: scaled from the reduced one as if it had been meshed with that
density.
"""

import numpy as np

from bladefem.scene.toml import load_scene
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.damper_contact import contact_patches
from bladefem.study.pipeline.reduced_sector import reduce_sector, with_damper_mass
from bladefem.study.pipeline.scene_mesh import build_mesh


def receptance(model, omega):
    """(p, p) displacement for a unit force at the ports [m/N]."""
    return (model.shapes / (model.omega**2 - omega**2)) @ model.shapes.T + model.residual


def test_weighted_damper_is_the_one_with_that_density():
    found = {}
    for mass in ("20 g", "70 g"):
        scene = load_scene("scenes/plane.toml", ["mesh.size=6 mm", f"plane.damper_mass={mass}"])
        bodies = Bodies(scene, build_mesh(scene))
        found[mass] = reduce_sector(bodies, contact_patches(bodies.mesh), [0], 4)
    scaled, meshed = with_damper_mass(found["20 g"], 0.07), found["70 g"]
    assert np.isclose(scaled.mass, 0.07) and np.isclose(meshed.mass, 0.07, rtol=1e-9)
    for omega in (300.0, 2 * np.pi * 5000.0):
        a, b = receptance(scaled.damper, omega), receptance(meshed.damper, omega)
        assert abs(a - b).max() < 1e-7 * abs(b).max()
    assert with_damper_mass(meshed, None) is meshed
