"""Frequencies over speed: Campbell table, engine-order crossings, interference (SAFE) table and
margins.

The stiffness about the linear preload is a polynomial of second degree in the square of the speed,
K0 + s K1 + s^2 K2, so three speeds give it everywhere; about the nonlinear preload the same is an
interpolation. The modes at these three speeds span those between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from geometry.mesh import counting_sense, sector_of, spin_axis

from ...data import ModeSet
from ...errors import InputError
from ...scene.fields import convert_value, field_at, split_values
from ...scene.units import is_plain, parse
from ...util.nodal_diameter import excited_diameter
from ..pipeline.bodies import Bodies, is_wheel
from ..pipeline.normal_modes import eigensolver
from .crossings import (
    campbell_crossings,
    crossing_margins,
    interference_table,
    wave_sense,
)

if TYPE_CHECKING:
    from ...fem.body import Body
    from .speed_model import SpeedModel

# modes beyond those asked for: Coriolis forces mix neighbours
GUARD_MODES = 6
# of one diagram: more cannot be distinguished in a picture
MAX_SPEEDS = 2000


@dataclass(frozen=True)
class Campbell:
    """What an engineer reads off the diagrams; SI columns."""

    # nodal_diameter, mode, speed, frequency, forward, backward, error
    table: pd.DataFrame
    # engine orders against the wave that each excites
    crossings: pd.DataFrame
    # SAFE: every order against the modes of its nodal diameter, at the operating speed
    interference: pd.DataFrame
    # the closest mode to each order
    margins: pd.DataFrame
    # [rad/s] of interference and margins
    speed: float


def campbell_tables(
    bodies: Bodies,
    speeds: Sequence[float],
    orders: Sequence[int],
    count: int = 5,
) -> Campbell:
    """Campbell and interference tables of the blade or wheel without damper.

    Args:
        speeds: [rad/s]; the scene's own speed is added.
        orders: engine orders; the tables have the nodal diameters that these excite.
        count: modes of each.

    Raises:
        InputError: fewer than two speeds, negative ones.
    """
    sectors = sector_of(bodies.mesh).count if is_wheel(bodies.mesh) else 0
    operating = bodies.scene.operation.speed
    diameters = sorted({excited_diameter(order, sectors) for order in orders}) if sectors else None
    all_speeds = sorted({*speeds, operating})
    models = speed_models(bodies, all_speeds, diameters, count)
    table = pd.concat([model.table(all_speeds) for model in models], ignore_index=True)
    at_speed = table[table["speed"] == operating]
    crossed = [
        campbell_crossings(
            _excited_waves(table, order, sectors),
            [order],
            sectors or None,
            _excited_line(models, order, sectors),
        )
        for order in orders
    ]
    # one without rows stands for all where no order crosses a mode
    crossed = [rows for rows in crossed if len(rows)] or crossed[:1]
    tables = [_order_interference(at_speed, order, sectors, operating) for order in orders]
    return Campbell(
        table,
        pd.concat(crossed, ignore_index=True).sort_values("speed", ignore_index=True),
        pd.concat([t for t, _ in tables], ignore_index=True),
        pd.concat([m for _, m in tables], ignore_index=True),
        operating,
    )


def speed_models(
    bodies: Bodies,
    speeds: Sequence[float],
    diameters: Sequence[int] | None,
    count: int = 5,
) -> list[SpeedModel]:
    """The small matrices of each nodal diameter, for speeds [rad/s] from zero to the largest.

    Raises:
        InputError: fewer than two speeds, negative ones.
    """
    if len(speeds) < 2 or min(speeds) < 0 or not np.isfinite(speeds).all():
        raise InputError(f"speeds are {list(speeds)} rad/s, expected at least two, not negative")
    from ...fem.constraint import transformation
    from .speed_model import speed_model

    squares = np.linspace(0.0, max(speeds) ** 2, 3)
    at = [bodies.blade_at(float(np.sqrt(s))) for s in squares]
    sets = [
        _modes_at_speed(bodies, body, diameters, count + GUARD_MODES)
        for body in bodies.progress(at, "speeds")
    ]
    frame = transformation(at[1], cyclic=is_wheel(bodies.mesh))
    axis, sense = spin_axis(bodies.mesh), counting_sense(bodies.mesh)
    return [
        speed_model(at, frame, same_diameter, squares, count, axis, sense)
        for same_diameter in zip(*sets, strict=True)
    ]


def read_speeds(text: str) -> list[float]:
    """Speeds [rad/s] from a text such as "0, 2000, 4000 rpm", or "0, 500, ..., 12000 rpm" with
    equal steps.

    Raises:
        InputError: not speeds, no unit, or dots without a step before and an end after them.
    """
    items = split_values(text)
    if not items:
        raise InputError(f"--campbell {text!r}: expected speeds, such as '0, 2000, 4000 rpm'")
    for item in items:
        if is_plain(item) and parse(item, "rad/s", "--campbell"):
            example = f"{text.strip()} rpm" if is_plain(items[-1]) else "0, 2000, 4000 rpm"
            raise InputError(f"--campbell {text}: expected a unit, such as '{example}'")
    speed = field_at("operation.speed")._replace(name="--campbell")
    numbers = [None if item.startswith("...") else convert_value(item, speed) for item in items]
    out: list[float] = []
    for i, number in enumerate(numbers):
        if number is not None:
            out.append(number)
            continue
        end = numbers[i + 1] if i + 1 < len(numbers) else None
        if len(out) < 2 or end is None or not end > out[-1] > out[-2]:
            raise InputError(
                f"--campbell {text}: expected two rising speeds before '...' and a higher one, "
                "the last, after it"
            )
        step = out[-1] - out[-2]
        if (end - out[-1]) / step > MAX_SPEEDS:
            raise InputError(
                f"--campbell {text}: {(end - out[-1]) / step:.3g} speeds, expected at "
                f"most {MAX_SPEEDS}"
            )
        out += list(np.arange(out[-1] + step, end - step / 2, step))
    return out


def _modes_at_speed(
    bodies: Bodies,
    body: Body,
    diameters: Sequence[int] | None,
    count: int,
) -> list[ModeSet]:
    """Modes with the stiffness of one speed."""
    from ...fem.all_diameters import all_diameters
    from ...fem.constraint import constrain
    from ...fem.modes import modes

    solver = eigensolver(bodies.scene)
    if is_wheel(bodies.mesh):
        return all_diameters(body, count, diameters, solver=solver)
    return [modes(constrain(body), count, solver=solver)]


def _excited_waves(
    table: pd.DataFrame,
    order: int,
    sectors: int,
) -> pd.DataFrame:
    """The table with the frequency of the wave that an order excites.

    A pattern at rest in space runs against the rotation for a rider on the wheel; orders
    beyond half the number of blades are seen by the blades as a wave in the other sense. Coriolis
    forces move standing waves and single blades too, which have the same frequency in both columns.
    """
    return table.assign(frequency=table[_excited_column(order, sectors)])


def _excited_column(order: int, sectors: int) -> str:
    return "backward" if sectors and wave_sense(order, sectors) == "with" else "forward"


def _excited_line(
    models: Sequence[SpeedModel], order: int, sectors: int
) -> Callable[[dict[str, int], float], float]:
    """The frequency [Hz] that an order excites, from the names of a line and a speed [rad/s]."""
    place = ("forward", "backward").index(_excited_column(order, sectors))
    by_diameter = {model.nodal_diameter: model for model in models}

    def frequency(line: dict[str, int], speed: float) -> float:
        _, *both = by_diameter[line.get("nodal_diameter")].waves_at(speed)
        return float(both[place][line["mode"] - 1])

    return frequency


def _order_interference(
    table: pd.DataFrame,
    order: int,
    sectors: int,
    speed: float,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """SAFE rows and the closest mode of one order; single blades take every order."""
    rows = _excited_waves(table, order, sectors)
    if sectors:
        return interference_table(rows, sectors, speed, [order]), crossing_margins(
            rows, sectors, speed, [order]
        )
    rows = rows.assign(nodal_diameter=0)
    return tuple(
        found(rows, 1, speed, [order]).drop(columns=["nodal_diameter", "wave"])
        for found in (interference_table, crossing_margins)
    )
