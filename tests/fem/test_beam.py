"""Beams and convergence orders."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jv, jvp, yv, yvp
from structured import box, sector

from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material

STEEL = Material()


def lowest(mesh, count=1, plane="stress", material=STEEL):
    return modes(constrain(assemble(mesh, "blade", material, plane=plane)), count).frequencies


def euler(length, height, material=STEEL):
    """First bending frequencies of a cantilever [Hz], h/L -> 0."""
    roots = np.array([1.8751040687, 4.6940911330, 7.8547574382])
    return (roots / length) ** 2 * np.sqrt(material.E / material.rho / 12) * height / (2 * np.pi)


def timoshenko(length, height, material=STEEL):
    """First bending frequencies of a Timoshenko cantilever [Hz], shear coefficient 10 (1 + nu) /
    (12 + 11 nu) (Cowper 1966); the characteristic determinant is scanned for roots.
    """
    E, nu, rho = material.E, material.nu, material.rho
    area, inertia = height, height**3 / 12
    shear = 10 * (1 + nu) / (12 + 11 * nu) * E / (2 * (1 + nu)) * area

    def determinant(w):
        # (W, Theta) e^{s x}: shear (s^2 W - s Theta) + rho A w^2 W = 0 gives Theta / W, the moment
        # balance s
        a, b = shear * E * inertia, shear * rho * inertia * w**2 + E * inertia * rho * area * w**2
        c = rho * area * w**2 * (rho * inertia * w**2 - shear)
        s = np.sqrt(np.roots([a, b, c]).astype(complex))
        s = np.r_[s, -s]
        theta = (shear * s**2 + rho * area * w**2) / (shear * s)
        tip = np.exp(s * length)
        value = np.linalg.det(np.array([np.ones(4), theta, s * theta * tip, (s - theta) * tip]))
        return value.real + value.imag  # one of the two is zero

    out = []
    for w0 in 2 * np.pi * euler(length, height, material)[:2]:
        w = np.linspace(0.7 * w0, 1.02 * w0, 60)
        d = np.array([determinant(x) for x in w])
        i = np.flatnonzero(np.diff(np.sign(d)))[0]
        out.append(brentq(determinant, w[i], w[i + 1]) / (2 * np.pi))
    return np.array(out)


def test_slender_beam_tends_to_euler():
    """h/L 1/10 to 1/80 at nu = 0: shear and rotary inertia fall with (h/L)^2."""
    slender = []
    for ratio in (10, 20, 40, 80):
        mesh = box((ratio, 1), (1.0, 1.0 / ratio), "quad9", depth=0.1)
        slender.append(
            abs(lowest(mesh, material=Material(nu=0.0))[0] / euler(1.0, 1.0 / ratio)[0] - 1)
        )
    assert slender[-1] < 3e-4
    orders = np.log2(np.array(slender[:-1]) / slender[1:])
    assert (orders[:2] > 1.7).all()
    assert (orders[:2] < 2.3).all()


def test_stocky_beam_is_timoshenko():
    """h/L = 1/10, nu = 0 (no Poisson effect at the clamp): two bending modes to 2e-3, the theory's
    own error.
    """
    material = Material(nu=0.0)
    mesh = box((24, 3), (1.0, 0.1), "quad9")
    f = lowest(mesh, 3, material=material)
    np.testing.assert_allclose(f[:2], timoshenko(1.0, 0.1, material), rtol=2e-3)


@pytest.mark.parametrize(
    "cell_type, order", [("triangle", 2), ("triangle6", 4), ("quad", 2), ("quad9", 4)]
)
def test_order_of_convergence(cell_type, order):
    """Extension of a bar between y-rollers has the exact wave speed sqrt(E/rho) at nu = 0: error ~
    h^2p.
    """
    material = Material(nu=0.0)
    exact = np.sqrt(material.E / material.rho) / 4
    errors = []
    for n in (2, 4, 8):
        mesh = box((n, n), (1.0, 1.0), cell_type)
        f = lowest(mesh, 4, material=material)
        errors.append(abs(f / exact - 1).min())
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed[-1] == pytest.approx(order, abs=0.35)


def circumferential(inner, outer, material=STEEL):
    """First frequency [Hz] of a disc turning about its axis against a clamped bore: u = J1(kr) + B
    Y1(kr), free rim.
    """

    def rim(k):
        ratio = -jv(1, k * inner) / yv(1, k * inner)
        slope = k * (jvp(1, k * outer) + ratio * yvp(1, k * outer))
        return slope - (jv(1, k * outer) + ratio * yv(1, k * outer)) / outer

    k = brentq(rim, 0.3 / (outer - inner), 2.5 / (outer - inner))
    return k * np.sqrt(material.E / (2 * (1 + material.nu)) / material.rho) / (2 * np.pi)


@pytest.mark.parametrize(
    "cell_type, straight, order",
    [
        ("triangle6", False, 4),
        ("triangle6", True, 2),
        ("triangle", False, 2),
        ("tetra10", False, 4),
    ],
)
def test_curved_elements_keep_their_order(cell_type, straight, order):
    """P2 on curved sides converges with h^4, on straight sides with the facets' h^2 only."""
    exact, errors = circumferential(0.1, 0.3), []
    for n in (1, 2, 4) if cell_type == "tetra10" else (4, 8, 16):
        divisions = (n, n) if cell_type.startswith("tri") else (n, n, 1)
        mesh = sector(5, divisions, cell_type, inner=0.1, outer=0.3, straight=straight)
        f = modes(constrain(assemble(mesh, "blade", STEEL), "clamp", 0), 6).frequencies
        errors.append(abs(f / exact - 1).min())
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed[-1] == pytest.approx(order, abs=0.5)
