"""Stiff interface layers in the balance: a numerical stiffness on the friction elements, the rest
of the layer's compliance among the bodies' flexibility.

Springs in series carry the same force, so that each contact direction may be written

    1 / k = 1 / k_num + c,    c = 1 / k - 1 / k_num,

with an element of stiffness k_num and c added to the flexibility of its own node. The equations are
the same for every k_num; what changes is how fast the iteration converges and how a few harmonics
see a contact that opens. Rigid faces are 1 / k = 0: k_num then is the penalty of the dynamic
Lagrangian of Nacivet, Pierre, Thouverez, Jezequel, J. Sound Vib. 265 (2003) 201-219, DOI
10.1016/S0022-460X(02)01447-5, whose result does not depend on it either. In the balance they keep
a layer that is stiff compared with the bodies (RIGID_FACE_STIFFNESS_RATIO);
a layer given by the scene is used as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..data import Elements, PressureMap
from ..scene.tables import Contact
from .joined_points import aggregation_matrix
from .seating import ContactProblem

# Numerical stiffness over that of the bodies under a medium wave of pressure. The part of the
# compliance that goes to the bodies is negative: where it outweighs their own compliance under
# short waves, Newton's method loses points, and where it is small it takes many iterations. Points
# lost with other values: docs/verification.md, "Limits of marches and balances".
STIFFNESS_OVER_BODY_STIFFNESS = 0.05
# Stiffness that represents rigid faces in the balance over the same. Without any layer, forces of
# short waves are all but undetermined and sweeps lose points; 1.3 to 6.5 times differ by 0.1 %.
RIGID_FACE_STIFFNESS_RATIO = 6.5


def medium_stiffness(problem: ContactProblem) -> float:
    """Stiffness per unit area [N/m^3] of the bodies under a medium wave of pressure: half of the
    waves that the contact mesh resolves meet a softer, half a stiffer body.

    It grows as the contact mesh gets finer, and common motions of the seats, however soft, do not
    change it.
    """
    root = np.sqrt(np.concatenate([patch.area for patch in problem.patches]))
    compliances = np.linalg.eigvalsh(root[:, None] * problem.flexibility * root)
    return float(1.0 / np.median(compliances))


def numerical_stiffness(problem: ContactProblem) -> float:
    """Stiffness per unit area [N/m^3] above which a layer is split."""
    return STIFFNESS_OVER_BODY_STIFFNESS * medium_stiffness(problem)


def stiffest_layer(problem: ContactProblem) -> float:
    """Stiffness per unit area [N/m^3] that represents rigid faces in the balance."""
    return RIGID_FACE_STIFFNESS_RATIO * medium_stiffness(problem)


def split_stiffness(
    elements: Elements,
    maps: Sequence[PressureMap],
    contact: Contact,
    areal: float,
    stiffest: float = np.inf,
) -> tuple[Elements, np.ndarray | None]:
    """Elements no stiffer than a numerical stiffness, and what of their compliance goes to the
    bodies.

    Args:
        elements: of ``friction_elements``.
        maps: static pressure of each patch.
        areal: numerical stiffness per unit area [N/m^3].
        stiffest: of a layer per unit area [N/m^3]; stiffer ones are taken as that.

    Returns:
        The elements, which rest in the same state, and (n, 1 + tangents) compliances [m/N], not
        positive; None where nothing is stiff.
    """
    area = np.concatenate([_element_areas(m, contact) for m in maps])
    kt = np.minimum(elements.kt, areal * area)
    kn = np.minimum(elements.kn, areal * area)
    if np.array_equal(kt, elements.kt) and np.array_equal(kn, elements.kn):
        return elements, None
    layer_kt = np.minimum(elements.kt, stiffest * area)
    layer_kn = np.minimum(elements.kn, stiffest * area)
    normal = np.divide(kn, layer_kn, out=np.ones_like(kn), where=kn > 0)
    tangential = 1.0 / layer_kt - 1.0 / kt
    series = np.column_stack([np.zeros(len(kt)), *[tangential] * elements.tangents])
    # (1 - kn / k_num) / kn, zero where the normal load is prescribed
    np.divide(normal - 1.0, kn, out=series[:, 0], where=kn > 0)
    # an open node keeps its gap, a pressed one its force
    ratio = np.divide(kn, elements.kn, out=np.ones_like(kn), where=kn > 0)
    n0 = np.where(elements.n0 > 0, elements.n0, ratio * elements.n0)
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
    """(m,) area that each element of a patch represents [m^2]."""
    groups = aggregation_matrix(pressure.patch, contact.points).indices
    return np.bincount(groups, pressure.patch.area)
