"""Which wave of the wheel the engine order excites, and how fast: what a scene implies without
any computing.
"""

from __future__ import annotations

from math import pi

from ..util.nodal_diameter import excited_diameter
from .fields import value_at
from .kinds import kind_named
from .tables import Scene
from .units import RPM


def excited_wave(scene: Scene) -> str:
    """One line, such as "engine order 40 excites nodal diameter 4 of 36 blades, at 2550 rpm with
    1700 Hz"; empty where no order excites a wheel.
    """
    sectors = kind_named(scene.kind).sectors
    count = int(value_at(scene, sectors)) if sectors is not None else 0
    order = scene.excitation.engine_order
    if not count or not order:
        return ""
    diameter = excited_diameter(order, count)
    speed = scene.operation.speed
    hertz = order * speed / (2 * pi)
    at_speed = f", at {speed * RPM:.5g} rpm with {hertz:.5g} Hz" if speed > 0 else ""
    return f"engine order {order} excites nodal diameter {diameter} of {count} blades{at_speed}"
