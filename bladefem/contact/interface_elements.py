"""From pressure maps to friction elements: contact stiffnesses, static normal forces, and fewer
elements than nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from ..data import Elements, Patch, PressureMap
from ..errors import InputError
from ..scene.tables import Contact, Material, Seat
from .interface_law import InterfaceLaw, rigid_faces
from .joined_points import aggregation_matrix, joined_motion
from .rough_layer import GROUND_FINISH, TOUCHING_PRESSURE, decay_length
from .seating import ContactProblem

# [contact], or the values of one seat
Layer = TypeVar("Layer", Contact, Seat)

# stiffness per unit area that represents rigid faces in the elements [N/m^3]: a layer of
# 1e-8 of the compliance of steel over a millimetre
RIGID_STIFFNESS = 1e22


def pair_ratio(a: Material, b: Material) -> float:
    """k_t / k_n of two bodies of different materials, from 1 / k_n ~ 1 / E* and 1 / k_t ~ 1 / (4
    G*).

    Source: Johnson, Contact Mechanics (1985), Eq. 4.24 and 7.44: k_n = 2 a E*, k_t = 8 a G*,
    1 / G* = sum (2 - nu) / G; 2 (1 - nu) / (2 - nu) for equal bodies (Mindlin 1949).
    """
    normal = sum((1 - m.nu**2) / m.E for m in (a, b))
    tangential = sum((2 - m.nu) * 2 * (1 + m.nu) / m.E for m in (a, b)) / 4
    return normal / tangential


def seat_contact(contact: Contact, patch: str) -> Contact:
    """The values of one seat: "this" is the blade's right one, "next" the next blade's left one.

    A stiffness of the seat itself, total or areal, wins over both of [contact]. Where neither gives
    one, the layer of rough faces is written out (``with_rough_layer``).
    """
    own = {"this": contact.right, "next": contact.left}.get(patch, Seat())
    changes: dict[str, Any] = {} if own.mu is None else {"mu": own.mu}
    for total, areal in (("kt", "kt_area"), ("kn", "kn_area")):
        if getattr(own, total) is not None or getattr(own, areal) is not None:
            changes |= {total: getattr(own, total), areal: getattr(own, areal)}
    return with_rough_layer(replace(contact, **changes))


def with_rough_layer(contact: Contact) -> Contact:
    """The values of a seat; where they give no stiffness, with that of the layer of rough faces:
    k_n at first touch, and the pressure at which it has doubled.

    ``contact.stiffening`` takes the place of TOUCHING_PRESSURE where it is given.
    """
    if contact.stiffness != "given" or _gives(contact, "kt") or _gives(contact, "kn"):
        return contact
    pressure = TOUCHING_PRESSURE if contact.stiffening is None else contact.stiffening
    return replace(
        contact, kn_area=pressure / decay_length(mean_roughness(contact)), stiffening=pressure
    )


def mean_roughness(contact: Contact) -> float:
    """Mean roughness Ra of each face [m]."""
    return GROUND_FINISH if contact.roughness is None else contact.roughness


def rougher_contact(contact: Contact, factor: float) -> Contact:
    """[contact] with the roughness of its faces times a factor."""
    return replace(contact, roughness=factor * mean_roughness(contact))


def gives_stiffness(contact: Contact) -> bool:
    """The scene says how stiff the layer is, on both seats."""
    both = all(_gives(seat, "kt") or _gives(seat, "kn") for seat in (contact.left, contact.right))
    given = contact.stiffness != "given" or _gives(contact, "kt") or _gives(contact, "kn")
    return both or given


def _gives(table: Contact | Seat, name: str) -> bool:
    """A stiffness is given, for the whole patch or each unit of area."""
    return getattr(table, name) is not None or getattr(table, f"{name}_area") is not None


def scaled_contact(
    contact: Contact,
    ratio: float,
    kt: float = 1.0,
    kn: float = 1.0,
) -> Contact:
    """[contact] with the tangential and the normal stiffness of all seats times factors.

    What follows from the other stiffness by ``ratio`` = k_t / k_n is written out first, so that
    one changes without the other. The layer of rough faces stays: it depends on their roughness
    (``rougher_contact``).
    """
    followed = {
        "kt": (not _gives(contact, "kt"), "kn", ratio),
        "kn": (not _gives(contact, "kn"), "kt", 1 / ratio),
    }

    def scaled(table: Layer) -> Layer:
        changes: dict[str, Any] = {}
        for name, factor in (("kt", kt), ("kn", kn)):
            follows, other, quotient = followed[name]
            if follows and not _gives(table, name):
                source, factor = other, factor * quotient
            else:
                source = name
            for kind in ("", "_area"):
                value = getattr(table, f"{source}{kind}")
                if value is not None:
                    changes[f"{name}{kind}"] = factor * value
        return replace(table, **changes)

    return replace(scaled(contact), left=scaled(contact.left), right=scaled(contact.right))


def stiffnesses(
    contact: Contact,
    ratio: float,
    area: np.ndarray,
    mapped: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """k_t and k_n (n,) [N/m] of the points of a patch, at first touch of a layer that stiffens.

    Each is as given, else follows from the other by ``ratio`` = k_t / k_n.

    Args:
        contact: of the seat (``seat_contact``).
        area: (n,) area that each point represents [m^2]; totals are shared in proportion to it.
        mapped: (n,) k_n from the pressure map, in place of a given one.

    Raises:
        InputError: neither stiffness is given.
    """
    if contact.stiffness == "rigid":
        return RIGID_STIFFNESS * area, RIGID_STIFFNESS * area
    kt = _shared(contact.kt, contact.kt_area, area)
    kn = _shared(contact.kn, contact.kn_area, area)
    kn = kn if mapped is None else mapped
    if kt is not None:
        return kt, kt / ratio if kn is None else kn
    if kn is None:
        raise InputError("contact: no stiffness of the seat is given, expected kt, kn or roughness")
    return ratio * kn, kn


def doubling_force(contact: Contact, area: np.ndarray) -> np.ndarray:
    """(n,) normal force [N] at which the layer of the points of a patch is twice as stiff as at
    first touch; infinite for a linear one.
    """
    pressure = np.inf if contact.stiffening is None else contact.stiffening
    return pressure * area


def stiffnesses_at(
    contact: Contact,
    ratio: float,
    area: np.ndarray,
    force: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """k_t and k_n (n,) [N/m] of the points of a patch under normal forces (n,) [N].

    Args:
        contact: of the scene, where both seats have the same values.
    """
    seat = with_rough_layer(contact)
    growth = 1.0 + force / doubling_force(seat, area)
    kt, kn = stiffnesses(seat, ratio, area)
    return kt * growth, kn * growth


def interface_law(
    patches: Sequence[Patch],
    contact: Contact,
    ratio: float,
) -> InterfaceLaw:
    """The interface law of all nodes of some patches, one patch after the other.

    Rigid faces where ``contact.stiffness`` is "rigid", and where it is "map": the paper's Eq. 23
    takes the stiffness of the elements from the pressure between rigid faces, after the seating.

    Args:
        ratio: k_t / k_n, used where only one of the two is given (``pair_ratio``).
    """
    area = np.concatenate([patch.area for patch in patches])
    if contact.stiffness != "given":
        return rigid_faces(len(area))
    seats = [seat_contact(contact, patch.name) for patch in patches]
    pairs = list(zip(seats, patches, strict=True))
    kn = [stiffnesses(seat, ratio, patch.area)[1] for seat, patch in pairs]
    doubling = [doubling_force(seat, patch.area) for seat, patch in pairs]
    return InterfaceLaw(np.concatenate(kn), np.concatenate(doubling))


def layer_friction(
    patches: Sequence[Patch],
    contact: Contact,
    ratio: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Tangential stiffness (n,) [N/m] and friction coefficient (n,) of the layer at all nodes of
    some patches; of a layer that stiffens the stiffness at first touch.
    """
    seats = [seat_contact(contact, patch.name) for patch in patches]
    kt = [
        stiffnesses(seat, ratio, patch.area)[0] for seat, patch in zip(seats, patches, strict=True)
    ]
    mu = [np.full(len(p.area), seat.mu) for seat, p in zip(seats, patches, strict=True)]
    return np.concatenate(kt), np.concatenate(mu)


def with_interface_law(
    problem: ContactProblem,
    contact: Contact,
    ratio: float,
) -> ContactProblem:
    """The contact problem with the interface law of [contact] between its faces."""
    return replace(problem, layer=interface_law(problem.patches, contact, ratio))


def _shared(
    total: float | None,
    areal: float | None,
    area: np.ndarray,
) -> np.ndarray | None:
    if total is not None:
        return total * area / area.sum()
    return None if areal is None else areal * area


def friction_elements(
    problem: ContactProblem | None,
    maps: Sequence[PressureMap],
    contact: Contact,
    ratio: float,
    tangents: int = 2,
) -> tuple[Elements, sp.csr_matrix]:
    """Node-to-node elements of all patches, one after the other.

    They rest in the seated state: a pressed node carries its static force, which is kn times the
    closure of its layer, and an open one keeps its gap. A layer that stiffens with pressure is
    linearised about the seated state, in both directions.

    Args:
        problem: that the maps solve; only read for a normal stiffness from the map.
        maps: static pressure of each patch.
        contact: mu, stiffnesses (totals of a patch win over areal ones), points, and how the normal
            load behaves.
        ratio: k_t / k_n, used where only one of the two is given (``pair_ratio``).
        tangents: 2 for solids, 1 for plane models.

    Returns:
        The elements, and S (ports, element ports): element displacements = S^T port displacements,
        port forces = S element forces, node-major like the ports. S is the identity when every node
        is an element.

    Raises:
        InputError: a normal load that follows the motion needs a normal stiffness.
    """
    G = [aggregation_matrix(m.patch, contact.points) for m in maps]
    members = _members(G)
    seats = [seat_contact(contact, m.patch.name) for m in maps]
    area = [a.T @ m.patch.area for a, m in zip(members, maps, strict=True)]
    mapped: list[np.ndarray | None] = [None] * len(maps)
    if contact.stiffness == "map":
        if problem is None:
            raise InputError("contact.stiffness = 'map': expected the contact problem of the maps")
        mapped = [a.T @ k for a, k in zip(members, mapped_stiffness(problem, maps), strict=True)]
    kt, kn = _layer_stiffness(seats, ratio, area, mapped)
    force = np.concatenate([a.T @ m.force for a, m in zip(members, maps, strict=True)])
    doubling = [doubling_force(seat, a) for seat, a in zip(seats, area, strict=True)]
    growth = 1.0 + force / np.concatenate(doubling)
    kt = kt * growth
    kn = kn * growth
    gap = np.concatenate([g.T @ m.gap for g, m in zip(G, maps, strict=True)])
    if contact.normal == "prescribed":
        kn = np.zeros_like(kn)
        n0 = force
    else:
        n0 = np.where(force > 0, force, -kn * gap)
    t0 = None
    if maps[0].traction is not None:
        t0 = np.vstack([a.T @ m.traction for a, m in zip(members, maps, strict=True)])
    moved = [_moved_shares(m.patch, g) for m, g in zip(maps, G, strict=True)]
    S = sp.kron(sp.block_diag(moved), sp.identity(1 + tangents), format="csr")
    mu = np.repeat([c.mu for c in seats], [len(a) for a in area])
    return Elements(kt, kn, mu, n0, tangents, t0=t0), S


def _layer_stiffness(
    seats: Sequence[Contact],
    ratio: float,
    area: Sequence[np.ndarray],
    mapped: Sequence[np.ndarray | None],
) -> tuple[np.ndarray, np.ndarray]:
    """Tangential and normal stiffness (n,) [N/m] of the elements of all seats."""
    parts = [stiffnesses(c, ratio, a, k) for c, a, k in zip(seats, area, mapped, strict=True)]
    kt = np.concatenate([tangential for tangential, _ in parts])
    kn = np.concatenate([normal for _, normal in parts])
    _require_stiffness(kt, kn)
    return kt, kn


def _require_stiffness(kt: np.ndarray, kn: np.ndarray) -> None:
    """Both stiffnesses of the layer are above zero; also refuses NaN."""
    for name, value in (("tangential", kt), ("normal", kn)):
        if not (value > 0).all():
            raise InputError(
                f"contact: a {name} stiffness is {value[~(value > 0)][0]:g} N/m, expected a "
                "positive value"
            )


def normal_stiffness(problem: ContactProblem, maps: Sequence[PressureMap]) -> np.ndarray:
    """k_n = P_i / u_zi (n,) [N/m] of each pressed node, the paper's Eq. 23; zero where nothing
    presses.

    u_z is the elastic approach of the two bodies at the node, C f. It holds the bodies' own
    flexibility, which the port models have already: use it to compare with measured contact
    stiffnesses, or for otherwise rigid bodies.
    """
    force = np.concatenate([m.force for m in maps])
    approach = problem.flexibility @ force
    return np.divide(force, approach, out=np.zeros_like(force), where=(force > 0) & (approach > 0))


def mapped_stiffness(problem: ContactProblem, maps: Sequence[PressureMap]) -> list[np.ndarray]:
    """``normal_stiffness`` of each patch; nodes that nothing presses take their patch's mean for
    their area.

    So they can close when they vibrate, which a stiffness of zero would never let them.
    """
    cuts = np.cumsum([len(m.force) for m in maps])[:-1]
    found = []
    for k, m in zip(np.split(normal_stiffness(problem, maps), cuts), maps, strict=True):
        mean = k.sum() / m.patch.area[k > 0].sum() if (k > 0).any() else 0.0
        found.append(np.where(k > 0, k, mean * m.patch.area))
    return found


def _moved_shares(patch: Patch, G: sp.csr_matrix) -> sp.csr_matrix:
    """(n, m) share of each node in the motion of its element, which keeps the seat's stiffness
    against rotation.
    """
    if G.shape[0] == G.shape[1]:
        return G
    return sp.csr_matrix(joined_motion([patch], G.indices, patch.area).T)


def _members(G: Sequence[sp.csr_matrix]) -> list[sp.csr_matrix]:
    """Matrices that sum over the groups of nodes whose means G takes: ones in place of shares."""
    return [sp.csr_matrix((np.ones_like(g.data), g.indices, g.indptr), shape=g.shape) for g in G]
