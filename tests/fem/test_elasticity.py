"""Crystals: against CalculiX on the same mesh (``python benchmarks/fem_decks.py``), and what must
hold whatever the constants are.
"""

import json
from pathlib import Path

import decks
import numpy as np
import pytest
from structured import box

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.elasticity import crystal_rotation, stiffness
from bladefem.fem.modes import modes
from bladefem.fem.rotation import body_under_rotation
from bladefem.fem.stress import gauss_stress
from bladefem.scene.tables import Material
from bladefem.scene.toml import scene_of

GOLDEN = json.loads((Path(__file__).parent / "ccx_decks.json").read_text())["crystals"]


@pytest.mark.parametrize("kind", ["cubic", "orthotropic"])
def test_same_frequencies_as_calculix(kind):
    """A clamped bar whose crystal is turned about three axes; ccx prints seven digits."""
    mesh, _ = decks.bar()
    body = assemble(mesh, "blade", Material(**decks.CRYSTALS[kind]), quadrature="ccx")
    found = modes(constrain(body), 6).frequencies
    np.testing.assert_allclose(found, GOLDEN[kind], rtol=1e-6)


def test_isotropic_constants_written_as_a_crystal():
    """The same matrix by both ways, whatever the angles."""
    mesh = box((4, 2, 1), (0.1, 0.03, 0.02), "tetra10")
    plain = Material(E=1.1e11, nu=0.33)
    crystal = Material(E=1.1e11, nu=0.33, G=1.1e11 / 2 / 1.33, angles=(0.4, 0.2, 1.0))
    ours, theirs = (
        modes(constrain(assemble(mesh, "blade", material)), 4).frequencies
        for material in (crystal, plain)
    )
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


def test_turned_bar_and_turned_crystal():
    """A crystal turned with its bar is the same; Young's modulus along a turned axis is that of the
    closed form 1/E = S11 - 2 (S11 - S12 - S44/2) (l2 m2 + m2 n2 + n2 l2).
    """
    material = Material(**decks.CRYSTALS["cubic"])
    S11 = 1 / material.E
    S12 = -material.nu / material.E
    S44 = 1 / material.G
    l2, m2, n2 = crystal_rotation(material.angles)[0] ** 2
    closed = S11 - 2 * (S11 - S12 - S44 / 2) * (l2 * m2 + m2 * n2 + n2 * l2)
    assert np.linalg.inv(stiffness(material))[0, 0] == pytest.approx(closed, rel=1e-12)


def test_stresses_hold_the_energy():
    """Half of stress times strain in all Gauss points is the energy that the stiffness gives."""
    mesh, _ = decks.bar()
    material = Material(**decks.CRYSTALS["orthotropic"])
    body = assemble(mesh, "blade", material)
    found = modes(constrain(body), 1)
    u = found.shapes[0]
    stress = gauss_stress(body, u)
    # gauss_stress orders xx, yy, zz, xy, yz, zx
    s = stress.stress[..., [0, 1, 2, 4, 5, 3]]
    energy = np.einsum("cq,cqi,ij,cqj->", stress.volume, s, np.linalg.inv(stiffness(material)), s)
    assert energy == pytest.approx((2 * np.pi * found.frequencies[0]) ** 2, rel=1e-6)


def test_nine_constants_are_asked_for():
    with pytest.raises(InputError, match=r"material\.blade\.orthotropic has 2 values"):
        scene_of({"kind": "wedge sector", "material": {"blade": {"orthotropic": [1e11, 2e11]}}})


def test_rotation_of_a_crystal():
    """Nonlinear and linear preload meet at low speed, and stiffen the bar."""
    mesh, _ = decks.bar()
    body = assemble(mesh, "blade", Material(**decks.CRYSTALS["cubic"]))
    still, linear, large = (
        modes(constrain(some), 3).frequencies
        for some in (
            body,
            body_under_rotation(body, 300.0, linear=True),
            body_under_rotation(body, 300.0),
        )
    )
    assert (large[:2] > still[:2]).all()
    np.testing.assert_allclose(linear, large, rtol=1e-5)


def test_constants_that_no_solid_has():
    with pytest.raises(InputError, match="stable material"):
        stiffness(
            Material(E=1e11, nu=0.49, G=1e11, orthotropic=(1e11,) * 3 + (0.9,) * 3 + (1e11,) * 3)
        )
    with pytest.raises(InputError, match="plane mesh needs an isotropic material"):
        assemble(box((2, 1), (0.1, 0.02), "triangle6"), "blade", Material(G=5e10))
