"""Load cases of a scene with one contact parameter changed, the damper seated anew for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...contact.equivalent_layer import decay_lengths
from ...contact.frictional_seating import FrictionalProblem
from ...contact.interface_elements import (
    friction_elements,
    pair_ratio,
    rougher_contact,
    scaled_contact,
    with_interface_law,
)
from ...contact.numerical_stiffness import numerical_stiffness, split_stiffness, stiffest_layer
from ...contact.seating import ContactProblem
from ...contact.seating import solve_seating as seat
from ...data import PressureMap
from ...scene.material_table import operating_materials
from ...scene.tables import Contact, Scene, Seat
from .assemble_model import LoadCase
from .history import seat_by_history


def seated_case(
    scene: Scene,
    problem: ContactProblem,
    maps: Sequence[PressureMap],
    load: float,
    tangents: int,
    mass: float | None = None,
) -> LoadCase:
    """The friction elements of a seated damper, stiff layers split.

    Args:
        maps: static pressure of each patch under the mean normal load [N] of a seat.
        tangents: 2 for solids, 1 for plane models.
    """
    ratio = pair_ratio(*operating_materials(scene))
    elements, selection = friction_elements(problem, maps, scene.contact, ratio, tangents)
    decay = decay_lengths(elements, maps, scene.contact)
    # a layer that is given is that of the seating as well, however stiff
    stiffest = stiffest_layer(problem) if scene.contact.stiffness == "rigid" else np.inf
    elements, series = split_stiffness(
        elements, maps, scene.contact, numerical_stiffness(problem), stiffest
    )
    stiffens = decay if np.isfinite(decay).any() else None
    return LoadCase(load, elements, selection, mass, series, stiffens)


def cases_of(
    scene: Scene,
    problem: ContactProblem,
    tangents: int,
    mass: float | None = None,
    rough: FrictionalProblem | None = None,
) -> Callable[[float], LoadCase]:
    """Mean normal load of a seat [N] -> the seated damper's friction elements.

    Args:
        problem: with the scene's interface layer.
        tangents: 2 for solids, 1 for plane models.
        rough: all ports of the seats, where friction takes part in the seating.
    """

    def case_at(load: float) -> LoadCase:
        if rough is None:
            speed = scene.operation.speed
            maps = seat(problem, speed, normal=load, bedded=scene.contact.bedded)
        else:
            maps = seat_by_history(scene, rough, load).maps
        return seated_case(scene, problem, maps, load, tangents, mass)

    return case_at


def changed_cases(
    scene: Scene,
    problem: ContactProblem,
    tangents: int,
    mass: float | None = None,
    rough: FrictionalProblem | None = None,
) -> Callable[[str, float], Callable[[float], LoadCase]]:
    """Name of a parameter and its factor -> the load cases with it.

    "kt", "kn", "roughness" and "mu" change [contact] on both seats; "seat friction" the normal load
    that a nominal one makes; "damping" no contact.
    """
    ratio = pair_ratio(*operating_materials(scene))

    @lru_cache(maxsize=64)
    def changed(name: str, factor: float) -> Callable[[float], LoadCase]:
        if name in ("kt", "kn"):
            contact = scaled_contact(scene.contact, ratio, **{name: factor})
        elif name == "roughness":
            contact = rougher_contact(scene.contact, factor) if factor != 1 else scene.contact
        elif name == "mu":
            contact = _with_friction(scene.contact, factor)
        else:
            contact = scene.contact
        there = replace(scene, contact=contact)
        case_at = cases_of(
            there, with_interface_law(problem, contact, ratio), tangents, mass, rough
        )
        by_load = factor if name == "seat friction" else 1.0

        @lru_cache(maxsize=64)
        def nominal(load: float) -> LoadCase:
            return replace(case_at(by_load * load), load=load)

        return nominal

    return changed


def _with_friction(contact: Contact, factor: float) -> Contact:
    """[contact] with the friction coefficients of all seats times a factor."""

    def scaled(seat_values: Seat) -> Seat:
        own = seat_values.mu
        return seat_values if own is None else replace(seat_values, mu=factor * own)

    return replace(
        contact,
        mu=factor * contact.mu,
        left=scaled(contact.left),
        right=scaled(contact.right),
    )
