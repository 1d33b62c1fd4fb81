"""Stress of the mode studied, and of rotation, against bar and beam theory."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.report.run_messages import coriolis_messages
from bladefem.scene.tables import Excitation, Material, Materials, Operation, Scene
from bladefem.study.modes.stress import mode_strength
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import excited_modes, find_modes

sys.path.insert(0, str(Path(__file__).parents[1] / "fem"))
from structured import box

L, T, E, RHO, SPEED = 0.15, 0.004, 210e9, 7850.0, 800.0


def test_slender_blade_without_contraction():
    """Unit motion of the tip bends the root by 1.8751^2 / L^2; rotation about it pulls there with
    rho w^2 L^2 / 2.

    Gauss points lie inside the surface and beyond the clamp: 60 by 6 quadratic cells, 2 % and 1 %.
    """
    mesh = box((60, 6), (L, T), "triangle6")
    steel = Material(E=E, nu=0.0, rho=RHO)
    scene = Scene(
        kind="plane blades",
        material=Materials(steel, steel),
        operation=Operation(speed=SPEED, stiffening=False),
        excitation=Excitation(at="x1", direction=(0.0, 1.0, 0.0), mode=1),
    )
    bodies = Bodies(scene, mesh)
    found = mode_strength(bodies, excited_modes(scene, mesh, find_modes(bodies, count=2)))
    outermost = 1 - 2 * abs(found.alternating_at[1] / T - 0.5)  # 0 at the surface
    bending = E * T / 2 * 1.875104**2 / L**2 * (1 - outermost) * (1 - found.alternating_at[0] / L)
    assert found.alternating == pytest.approx(bending, rel=0.02)
    assert found.alternating_at[0] < 0.02 * L
    assert found.steady == pytest.approx(
        RHO * SPEED**2 * (L**2 - found.steady_at[0] ** 2) / 2, rel=0.01
    )
    assert np.isfinite(found.steady_at).all()
    # a plane blade turns about an axis in its plane: no Coriolis force in it
    assert found.coriolis < 1e-9


@pytest.mark.parametrize(
    "shift, damping, count, words",
    [
        (0.0, None, 0, ""),
        (1e-4, None, 1, "left out of"),
        (0.02, None, 1, "2 %.*coriolis = false.*--campbell"),
        (0.02, np.eye(2), 1, "2 %.*responses have them"),
    ],
)
def test_what_is_said_of_coriolis_forces(shift, damping, count, words):
    """Nothing at rest, a note where they are small against the accuracy or counted, else a
    warning.
    """
    found = SimpleNamespace(
        strength=SimpleNamespace(coriolis=shift, mode=1),
        scene=SimpleNamespace(accuracy=0.02),
        reduced=SimpleNamespace(sector={0: SimpleNamespace(damping=damping)}),
    )
    said = coriolis_messages(found)
    assert len(said) == count and all(re.search(words, text) for text in said)
