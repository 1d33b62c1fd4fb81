"""Where the paper's formulas need a correction before they can be used."""

from __future__ import annotations

from typing import NamedTuple


class Erratum(NamedTuple):
    """One formula."""

    where: str
    printed: str
    right: str


ERRATA = (
    Erratum(
        "Eq. 18, 19, 28",
        "f = k_t g in one, df = -k_t dg in the others; no offset after slip",
        "force on the structure -f, f = k_t (g - z), |f| ≤ μ max(N, 0): dissipative contact adds "
        "positive K and C",
    ),
    Erratum(
        "Eq. 19-21",
        "rate law with H(0) = 0",
        "it freezes at the first slip; with H(0) = 1 it cannot stick again while N falls; N < 0 "
        "flips its sign. Return map: f = clamp(f + k_t dg, ± μN), f = 0 for N ≤ 0",
    ),
    Erratum(
        "Eq. 16",
        "C = Σ (a f_c - b f_s) / (ω Σ k (a² + b²))",
        "C = Σ k (a f_c - b f_s) / (ω Σ k² (a² + b²)): a factor k is missing in both sums",
    ),
    Erratum(
        "Eq. 6a with 15",
        "F_c0 = f_0 for any mean displacement",
        "F_c0 of Eq. 11, or K q_0 = f_0 + mean of F_c, not both",
    ),
    Erratum(
        "Eq. 24",
        "p = P / (a² - x²)^½, u_z = π P (1 - ν²) / E",
        "this P is p_0 a [N/m]; in terms of the force P / (2 π a (a² - r²)^½) and P (1 - ν²) / (2 "
        "a E)",
    ),
    Erratum(
        "Eq. 25",
        "k_n(x), stiffness of the element at x",
        "stiffness of the ring at radius x; it sums to 2 a E / (1 - ν²)",
    ),
    Erratum("Eq. 26", "T > D / c", "T well above D / c; 5 kHz at D = 1 m is the limit itself"),
    Erratum("Eq. 28", "1/dr, H(f - f_max)", "1/dt, H(|f| - f_max)"),
    Erratum(
        "Eq. 29",
        "a limit for each axis",
        "radial return onto the circle |f| ≤ μN: on a circular orbit the printed limits lose half "
        "of the work",
    ),
    Erratum("Eq. 30, 31", "x_b a velocity; x_r = x_b - x", "x_b is a displacement, and x_r = -g"),
    Erratum(
        "Eq. 32",
        "force on the damper's right equals that on the blade's left",
        "for nodal diameter 0 only; harmonic h carries e^(-jhφ), φ the inter-blade phase",
    ),
    Erratum("Eq. 34", "k > 1", "k ≥ 1"),
    Erratum("Eq. 35", "small step: converged", "small residual of the equilibrium: converged"),
)
