"""The engine orders of a mistuned scene as harmonics of one period: that of their greatest common
divisor, which is the scene's own order where all others are its multiples.
"""

from __future__ import annotations

from math import gcd

import numpy as np

from ...errors import InputError
from ...scene.tables import Scene
from ...scene.units import parse
from ...wheel.model import engine_order

# harmonics of the common divisor beyond which the balance takes too long
HIGHEST_HARMONIC = 60


def read_orders(scene: Scene) -> list[tuple[int, float, float]]:
    """Order, amplitude [N] and phase [rad] of each entry of mistuning.orders.

    Raises:
        InputError: an entry is not "18: 0.3 N" or "18: 0.3 N; 90 deg", or the orders have no common
            period that could be solved.
    """
    found = []
    for entry in scene.mistuning.orders or ():
        order, colon, rest = entry.partition(":")
        force, _, phase = rest.partition(";")
        name = f"mistuning.orders '{entry}'"
        if not colon or not order.strip().isdigit():
            raise InputError(
                f"{name}: expected a whole order and a force, such as '18: 0.3 N; 90 deg'"
            )
        own = scene.excitation.engine_order
        if own == 0 or int(order) == 0:
            raise InputError(
                f"{name}: expected an order above 0, next to excitation.engine_order = {own} above "
                "0: order 0 stands still on the wheel"
            )
        angle = parse(phase.strip(), "rad", name) if phase.strip() else 0.0
        found.append((int(order), parse(force.strip(), "N", name), angle))
    orders = [scene.excitation.engine_order, *(one for one, _, _ in found)]
    base = gcd(*orders)
    if found and max(orders) > HIGHEST_HARMONIC * base:
        raise InputError(
            f"mistuning.orders: order {max(orders)} is harmonic {max(orders) // base} of the "
            f"common divisor {base} of all orders, expected {HIGHEST_HARMONIC} at most"
        )
    return found


def own_harmonic(scene: Scene) -> int:
    """Number of the scene's own engine order among the harmonics of the common period."""
    order = scene.excitation.engine_order
    others = read_orders(scene)
    return order // gcd(order, *(other for other, _, _ in others)) if others else 1


def order_forces(scene: Scene, count: int) -> dict[int, np.ndarray]:
    """Harmonic of the common period to the amplitudes (N, 1) of all engine orders [N]."""
    order = scene.excitation.engine_order
    first = own_harmonic(scene)
    found = {first: engine_order(count, order, np.array([scene.excitation.force]))}
    for other, force, phase in read_orders(scene):
        part = engine_order(count, other, np.array([force]), phase)
        harmonic = other * first // order
        found[harmonic] = found.get(harmonic, 0.0) + part
    return found
