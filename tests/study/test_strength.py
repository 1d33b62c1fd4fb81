"""Stress of the mode studied, and of rotation, against bar and beam theory."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from bladefem.report.run_messages import coriolis_messages
from bladefem.scene.tables import Excitation, Material, Materials, Operation, Scene
from bladefem.study.modes.linear_response import steady_state
from bladefem.study.modes.stress import mode_strength
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import excited_modes, find_modes
from bladefem.util.message import by_level

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


def test_a_leaning_blade_under_a_nonlinear_preload():
    """It straightens, and where the stress is reported largest it is that of the forces beyond: pull
    over area and moment over section of the deformed blade.

    The linear state moves the tip by 68 mm, where it leans by 20 mm from its radius, and gave 2.2
    times the stress.
    """
    foot, lean, speed, width, thick = 0.3, 0.1, 1000.0, 0.02, 0.006

    def leaning(x):
        x = x + [foot, 0, 0]
        x[:, 1] += lean * (x[:, 0] - foot)
        return x

    mesh = box((16, 1, 1), (0.2, thick, width), "hexahedron27", map=leaning)
    steel = Material(E=E, nu=0.0, rho=RHO)
    scene = Scene(
        kind="imported",
        material=Materials(steel, steel),
        operation=Operation(speed=speed, preload="nonlinear"),
        excitation=Excitation(at="x1", direction=(0.0, 1.0, 0.0), mode=1),
    )
    bodies = Bodies(scene, mesh)
    found = mode_strength(bodies, excited_modes(scene, mesh, find_modes(bodies, count=2)))
    moved = steady_state(bodies).displacement
    assert abs(moved[:, 1]).max() < 0.02
    # the middle line, as deformed, with trapezoids of its mass
    x = mesh.points
    middle = np.flatnonzero(
        (abs(x[:, 1] - lean * (x[:, 0] - foot) - thick / 2) < 1e-9)
        & (abs(x[:, 2] - width / 2) < 1e-9)
    )
    middle = middle[x[middle, 0].argsort()]
    reach, height = (x + moved)[middle, :2].T
    at, up, _ = found.steady_at
    beyond = np.linspace(at, x[:, 0].max(), 400)
    radius, side = (np.interp(beyond, x[middle, 0], part) for part in (reach, height))
    pull = (
        RHO
        * width
        * thick
        * speed**2
        * np.array([trapezoid(radius, beyond), trapezoid(side, beyond)])
    )
    moment = side[0] * pull[0] - radius[0] * pull[1]
    along = np.array([radius[1] - radius[0], side[1] - side[0]])
    axial = pull @ along / np.linalg.norm(along) / (width * thick)
    across = abs(up - lean * (at - foot) - thick / 2)
    bending = abs(moment) * across / (width * thick**3 / 12)
    assert found.steady == pytest.approx(axial + bending, rel=0.03)


@pytest.mark.parametrize(
    "shift, damping, count, words",
    [
        (0.0, None, 0, ""),
        (1e-4, None, 1, "left out of"),
        (0.02, None, 1, "2 %.*coriolis = false"),
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
    warnings = by_level(said)["warning"]
    assert all("operation.coriolis = true" in text.advice for text in warnings)
    assert bool(warnings) == (damping is None and shift > 1e-3)
