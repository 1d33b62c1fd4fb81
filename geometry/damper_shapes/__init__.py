"""Shapes of underplatform dampers: one file and one record for each. A new shape is added to the
list below.
"""

from __future__ import annotations

from . import plate, round_bar, wedge
from .record import DamperShape

__all__ = ["SHAPES", "DamperShape"]

SHAPES: dict[str, DamperShape] = {
    module.SHAPE.name: module.SHAPE for module in (wedge, round_bar, plate)
}
