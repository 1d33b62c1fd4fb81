"""Aerodynamic influence of a scene, read from its texts: by nodal diameter, or by the distance of
blades. All numbers are relative to the blade's mode: (c_d / 2 omega^2) = frequency shift +
i damping, c_d as in `bladefem.wheel.aerodynamics`.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..util.arrays import ComplexArray
from .fields import value_at
from .kinds import kind_named
from .tables import Aerodynamics, Scene
from .units import parse


def has_flow(scene: Scene) -> bool:
    """The scene gives an aerodynamic influence."""
    return bool(scene.aerodynamics.waves or scene.aerodynamics.influence)


def wave_influence(scene: Scene, count: int) -> ComplexArray:
    """(N,) relative frequency shift + i damping of waves of 0..N-1 nodal diameters d, whose blade s
    moves by e^{j 2 pi d s / N}: against the rotation up to N/2, with it beyond.

    Raises:
        InputError: an entry cannot be read, or does not fit the wheel.
    """
    given = scene.aerodynamics
    if given.waves and given.influence:
        raise InputError(
            "aerodynamics.influence: given beside aerodynamics.waves, expected either the waves or "
            "the influence coefficients"
        )
    return _by_diameter(given.waves, count) if given.waves else _by_distance(given, count)


def _by_diameter(entries: tuple[str, ...], count: int) -> ComplexArray:
    found: dict[int, complex] = {}
    for entry in entries:
        name = f"aerodynamics.waves '{entry}'"
        diameter, damping, shift = _parts(entry, name, "'-5: -0.12 %; 0.05 %'")
        if 2 * abs(diameter) > count and not 0 <= diameter < count:
            raise InputError(f"{name}: expected a nodal diameter from {-(count // 2)} to {count}")
        if diameter % count in found:
            raise InputError(f"{name}: expected each nodal diameter once")
        found[diameter % count] = parse(shift, "1", name) + 1j * parse(damping, "1", name)
    known = sorted(found)
    values = np.array([found[d] for d in known])
    places = np.arange(count)
    # linear in between, round the wheel
    shift = np.interp(places, known, values.real, period=count)
    return shift + 1j * np.interp(places, known, values.imag, period=count)


def _by_distance(given: Aerodynamics, count: int) -> ComplexArray:
    waves = np.zeros(count, dtype=complex)
    for entry in given.influence or ():
        name = f"aerodynamics.influence '{entry}'"
        distance, size, phase = _parts(entry, name, "'-1: 0.08 %; 120 deg'")
        if 2 * abs(distance) > count:
            raise InputError(f"{name}: expected a distance of half the wheel at most")
        value = parse(size, "1", name) * np.exp(1j * parse(phase, "rad", name))
        waves += value * np.exp(2j * np.pi * np.arange(count) * distance / count)
    return waves


def _parts(entry: str, name: str, example: str) -> tuple[int, str, str]:
    """A whole number and two texts; the second one is zero when left out."""
    number, colon, rest = entry.partition(":")
    first, _, second = (part.strip() for part in rest.partition(";"))
    try:
        whole = int(number)
    except ValueError:
        whole = None
    if whole is None or not colon or not first:
        raise InputError(f"{name}: expected a whole number and two values, such as {example}")
    return whole, first, second or "0"


def refuse_flow(scene: Scene) -> None:
    """Refuse a flow that responses cannot have.

    Raises:
        InputError: it does not fit the wheel, or the waves of the engine order are not damped.
    """
    name = kind_named(scene.kind).sectors
    if not has_flow(scene) or name is None:
        return
    count = value_at(scene, name)
    if count == 0:
        raise InputError("aerodynamics: expected a wheel, imported.sectors = 0 has a single blade")
    if scene.model.reduction != "rubin":
        raise InputError(
            'model.reduction = "craig-bampton": the flow acts on free modes, expected "rubin" '
            "with [aerodynamics]"
        )
    waves = wave_influence(scene, count)
    order = scene.excitation.engine_order
    net = scene.operation.damping + waves[order % count].imag
    if net <= 0:
        raise InputError(
            f"aerodynamics: the waves of excitation.engine_order = {order} have "
            f"{100 * net:.3g} % of critical damping and flutter by themselves, expected an order "
            "whose waves are damped"
        )
