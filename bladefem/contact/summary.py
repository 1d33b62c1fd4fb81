"""Pressure maps as numbers: resultants of each face, rows for a table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..data import PressureMap

__all__ = ["Resultant", "map_rows", "resultant", "write_maps"]

COLUMNS = ("patch", "node", "x_m", "y_m", "z_m", "area_m2", "force_N", "pressure_Pa", "gap_m")


@dataclass(frozen=True)
class Resultant:
    """What a face carries, as the damper feels it, in the blade's axes."""

    force: np.ndarray               # (3,) [N]
    moment: np.ndarray              # (3,) about the engine's origin [N m]
    normal: float                   # sum of the normal forces [N]
    centre: np.ndarray              # (3,) force-weighted middle [m]
    area: float                     # pressed [m^2]
    share: float                    # pressed over whole area [1]
    peak: float                     # largest pressure [Pa]


def resultant(pressure: PressureMap) -> Resultant:
    """Resultant of one pressure map, with forces at the nodes' own places."""
    patch, f = pressure.patch, pressure.force
    vectors = patch.frame[:, 0] * f[:, None]
    pressed = f > 0
    weight = f if pressed.any() else patch.area
    area = float(patch.area[pressed].sum())
    return Resultant(vectors.sum(axis=0), np.cross(patch.points, vectors).sum(axis=0), float(f.sum()),
                     weight @ patch.points / weight.sum(), area, area / float(patch.area.sum()),
                     float(pressure.pressure.max(initial=0.0)))


def map_rows(maps: Sequence[PressureMap]) -> list[tuple]:
    """One row a contact node in the order of COLUMNS, SI units."""
    return [(m.patch.name, int(node), *map(float, point), float(a), float(f), float(f / a), float(g))
            for m in maps for node, point, a, f, g
            in zip(m.patch.blade_nodes, m.patch.points, m.patch.area, m.force, m.gap, strict=True)]


def write_maps(maps: Sequence[PressureMap], file: str | Path) -> None:
    """Write the rows as CSV."""
    with open(file, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        writer.writerows(map_rows(maps))
