"""The interface layer of ground faces: what a scene gets that gives no contact stiffness.

Nominally flat, randomly rough faces press with p ~ exp(-s / u0) at a mean separation s, so that the
layer's normal stiffness per unit area is in proportion to the pressure,

    k_n = dp/dc = p / u0,    u0 = LENGTH_RATIO times the rms roughness of both faces together.

Theory: Persson, Phys. Rev. Lett. 99, 125502 (2007), arXiv:0706.2762, with u0 of some 0.4 times the
rms roughness. Experiment: Lorenz, Persson, J. Phys.: Condens. Matter 21, 015003 (2009),
arXiv:0810.0950. Simulation: Akarapu, Sharp, Robbins, Phys. Rev. Lett. 106, 204301 (2011); Pastewka
et al., Phys. Rev. E 87, 062809 (2013), arXiv:1210.4635, over a wide range of pressure.
Tangentially k_t = r k_n with Mindlin's ratio r: Campana, Persson, Mueser, J. Phys.: Condens. Matter
23, 085001 (2011).
"""

from __future__ import annotations

from math import sqrt

# u0 over the rms roughness of both faces together
LENGTH_RATIO = 0.4
# rms roughness over the mean one, Ra: sqrt(pi / 2) for heights of normal distribution
RMS_RATIO = 1.25
# finish of a ground seat where the scene says nothing: Ra of each face [m]
GROUND_FINISH = 0.8e-6
# pressure [Pa] at which the stiffness is twice that of faces that just touch. The law in proportion
# to pressure has no first touch; far above this pressure the layer does not know of it: k_n at
# 0.33 MPa is 3 % more than p / u0.
TOUCHING_PRESSURE = 1e4
# factor on each side of the stiffness: finishes from Ra 0.4 to 1.6 um (2), and what measured values
# of known finish are off the law (2.3, docs/contact.md)
RANGE = 5.0
SOURCE = "Persson 2007, Lorenz and Persson 2009"


def decay_length(roughness: float) -> float:
    """u0 [m] of two faces with the same mean roughness Ra [m]."""
    return LENGTH_RATIO * sqrt(2.0) * RMS_RATIO * roughness


def rough_stiffness(pressure: float, roughness: float) -> float:
    """Normal stiffness of the layer per unit area [N/m^3] at a pressure [Pa]."""
    return (pressure + TOUCHING_PRESSURE) / decay_length(roughness)
