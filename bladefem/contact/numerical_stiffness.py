"""Stiff interface layers in the balance: a numerical stiffness on the friction elements, the rest
of the layer's compliance among the bodies' flexibility.

Springs in series carry the same force, so that each contact direction may be written

    1 / k = 1 / k_num + c,    c = 1 / k - 1 / k_num,

with an element of stiffness k_num and c added to the flexibility of its own node. The equations are
the same for every k_num; what changes is how fast the iteration converges and how a few harmonics
see a contact that opens. Rigid faces are 1 / k = 0: k_num then is the penalty of the dynamic
Lagrangian of Nacivet, Pierre, Thouverez, Jezequel, J. Sound Vib. 265 (2003) 201-219, DOI
10.1016/S0022-460X(02)01447-5, whose result does not depend on it either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..data import Elements, PressureMap
from ..scene.tables import Contact
from .interface_elements import aggregation
from .seating import ContactProblem

# Numerical stiffness over that of the softest common motion of the bodies at the seats. On the
# shipped wedge with 8 points a seat and a layer of 4000 N/mm^3 7 harmonics are 8 % off without the
# split; 1.0, 1.5 and 4 % with 4, 8 and 20 times. With 1e4 N/mm^3 and more small values lose points.
MULTIPLE = 20.0


def numerical_stiffness(problem: ContactProblem) -> float:
    """Stiffness per unit area [N/m^3] above which a layer is split.

    The bodies' softest common motion is the largest eigenvalue of their flexibility for an evenly
    shared pressure, which does not depend on the number of nodes.
    """
    root = np.sqrt(np.concatenate([patch.area for patch in problem.patches]))
    softest = np.linalg.eigvalsh(root[:, None] * problem.flexibility * root)[-1]
    return float(MULTIPLE / softest)


def split_stiffness(
    elements: Elements,
    maps: Sequence[PressureMap],
    contact: Contact,
    areal: float,
) -> tuple[Elements, np.ndarray | None]:
    """Elements no stiffer than a numerical stiffness, and what of their compliance goes to the
    bodies.

    Args:
        elements: of ``friction_elements``.
        maps: static pressure of each patch.
        areal: numerical stiffness per unit area [N/m^3].

    Returns:
        The elements, which rest in the same state, and (n, 1 + tangents) compliances [m/N], not
        positive; None where nothing is stiff.
    """
    area = np.concatenate([_element_areas(m, contact) for m in maps])
    kt = np.minimum(elements.kt, areal * area)
    kn = np.minimum(elements.kn, areal * area)
    if np.array_equal(kt, elements.kt) and np.array_equal(kn, elements.kn):
        return elements, None
    normal = np.divide(kn, elements.kn, out=np.ones_like(kn), where=elements.kn > 0)
    tangential = 1.0 / elements.kt - 1.0 / kt
    series = np.column_stack([np.zeros(len(kt)), *[tangential] * elements.tangents])
    # (1 - kn / k_num) / kn, zero where the normal load is prescribed
    np.divide(normal - 1.0, kn, out=series[:, 0], where=kn > 0)
    # an open node keeps its gap, a pressed one its force
    n0 = np.where(elements.n0 > 0, elements.n0, normal * elements.n0)
    return replace(elements, kt=kt, kn=kn, n0=n0), series


def physical_stiffness(elements: Elements, series: np.ndarray | None) -> Elements:
    """The elements with the stiffness of the whole layer again; infinite for rigid faces."""
    if series is None:
        return elements
    with np.errstate(divide="ignore"):
        kt = 1.0 / np.maximum(1.0 / elements.kt + series[:, 1], 0.0)
        kn = 1.0 / np.maximum(1.0 / np.where(elements.kn > 0, elements.kn, 1.0) + series[:, 0], 0.0)
    kn = np.where(elements.kn > 0, kn, 0.0)
    ratio = np.divide(kn, elements.kn, out=np.ones_like(kn), where=elements.kn > 0)
    open_load = np.where(elements.n0 < 0, elements.n0, 0.0) * ratio
    return replace(elements, kt=kt, kn=kn, n0=np.where(elements.n0 < 0, open_load, elements.n0))


def _element_areas(pressure: PressureMap, contact: Contact) -> np.ndarray:
    """(m,) what each element of a patch stands for [m^2]."""
    groups = aggregation(pressure.patch, contact.points).indices
    return np.bincount(groups, pressure.patch.area)
