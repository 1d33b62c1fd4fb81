"""Where engine orders meet natural frequencies: Campbell and interference (SAFE) crossings,
margins.

Frequency tables have one row a mode: nodal_diameter, mode, frequency [Hz], and for a Campbell
diagram speed [rad/s]. Frequencies are in the rotating frame, where engine order EO excites at EO
speed / (2 pi), in the nodal diameter that EO folds to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from ...util.nodal_diameter import excited_diameter

# of the speed at which an order crosses a line
CROSSING_TOLERANCE = 1e-9
# relative distance of an excitation from a mode, below which it is too near
CLOSE_MARGIN = 0.05
# verdict where engine orders have the frequency zero
AT_REST = "not excited at rest"


def wave_sense(order: int, sectors: int) -> str:
    """Sense of the excited wave relative to the engine order's own turning."""
    rest = order % sectors
    if rest in (0, sectors / 2):
        return "standing"
    return "with" if rest < sectors / 2 else "against"


def campbell_crossings(
    table: pd.DataFrame,
    orders: Iterable[int],
    sectors: int | None = None,
    line_at: Callable[[dict[str, int], float], float] | None = None,
) -> pd.DataFrame:
    """Speeds at which an engine-order line crosses a frequency line, one row a crossing.

    Where only the table is known, f^2 is taken for linear in speed^2 between two speeds
    (Southwell), which makes each crossing a closed form. Coriolis forces split waves in proportion
    to the speed: with them it is an approximation.

    Args:
        table: columns speed [rad/s], mode, frequency [Hz], and optionally nodal_diameter.
        orders: engine orders.
        sectors: number of blades; given, an order crosses only lines of the nodal diameter that it
            folds to.
        line_at: frequency [Hz] of a line, from its mode (and nodal_diameter), at a speed [rad/s]:
            crossings are solved on it.

    Returns:
        columns mode, nodal_diameter (if there), engine_order, speed [rad/s], frequency [Hz].
    """
    keys = [key for key in ("nodal_diameter", "mode") if key in table]
    rows = []
    for key, line in table.groupby(keys):
        named = {name: int(value) for name, value in zip(keys, key, strict=True)}
        curve = None if line_at is None else partial(line_at, named)
        for order in orders:
            if (
                sectors
                and "nodal_diameter" in named
                and excited_diameter(order, sectors) != named["nodal_diameter"]
            ):
                continue
            rows += [
                {
                    **named,
                    "engine_order": order,
                    "speed": speed,
                    "frequency": order * speed / (2 * np.pi),
                }
                for speed in line_crossings(line.sort_values("speed"), order, curve)
            ]
    columns = [*keys, "engine_order", "speed", "frequency"]
    return pd.DataFrame(rows, columns=columns).sort_values("speed", ignore_index=True)


def line_crossings(
    line: pd.DataFrame,
    order: int,
    frequency_at: Callable[[float], float] | None = None,
) -> list[float]:
    """Speeds [rad/s] where one frequency line meets one engine order; a crossing on a given speed
    counts once.

    Args:
        frequency_at: the line itself, [Hz] at a speed; straight in the squares when left out.
    """
    speed = line["speed"].to_numpy(float)
    f2 = line["frequency"].to_numpy(float) ** 2
    over = f2 - (order / (2 * np.pi)) ** 2 * speed**2
    found = []
    for k in np.flatnonzero((over[:-1] * over[1:] < 0) | (over[1:] == 0)):
        if frequency_at is None or over[k + 1] == 0:
            part = over[k] / (over[k] - over[k + 1])
            square = speed[k] ** 2 + part * (speed[k + 1] ** 2 - speed[k] ** 2)
            found.append(float(np.sqrt(square)))
        else:
            found.append(_solved_crossing(frequency_at, order, speed[k], speed[k + 1]))
    return found


def _solved_crossing(
    frequency_at: Callable[[float], float], order: int, low: float, high: float
) -> float:
    """The speed [rad/s] between two at which a line meets an engine order."""

    def distance(speed: float) -> float:
        return frequency_at(speed) - order * speed / (2 * np.pi)

    return float(brentq(distance, low, high, xtol=CROSSING_TOLERANCE * high))


def interference_table(
    table: pd.DataFrame,
    sectors: int,
    speed: float,
    orders: Iterable[int],
) -> pd.DataFrame:
    """Every engine order against the modes of the nodal diameter that it excites, at one speed
    (SAFE diagram).

    Args:
        table: columns nodal_diameter, mode, frequency [Hz] (and optionally family).
        sectors: number of blades.
        speed: [rad/s].
        orders: engine orders.

    Returns:
        columns engine_order, nodal_diameter, wave, mode, frequency [Hz], excitation [Hz], margin
        [1] = natural over excitation frequency - 1 (NaN at rest), speed_at_resonance [rad/s] (at
        constant natural frequency).
    """
    extra = [c for c in ("family",) if c in table]
    rows = []
    for order in orders:
        excitation = order * speed / (2 * np.pi)
        for _, mode in table[
            table["nodal_diameter"] == excited_diameter(order, sectors)
        ].iterrows():
            rows.append(
                {
                    "engine_order": order,
                    "nodal_diameter": int(mode["nodal_diameter"]),
                    "wave": wave_sense(order, sectors),
                    "mode": mode["mode"],
                    **{c: mode[c] for c in extra},
                    "frequency": mode["frequency"],
                    "excitation": excitation,
                    "margin": mode["frequency"] / excitation - 1 if excitation > 0 else np.nan,
                    "speed_at_resonance": 2 * np.pi * mode["frequency"] / order
                    if order
                    else np.inf,
                }
            )
    columns = [
        "engine_order",
        "nodal_diameter",
        "wave",
        "mode",
        *extra,
        "frequency",
        "excitation",
        "margin",
        "speed_at_resonance",
    ]
    return pd.DataFrame(rows, columns=columns)


def crossing_margins(
    table: pd.DataFrame,
    sectors: int,
    speed: float,
    orders: Iterable[int],
) -> pd.DataFrame:
    """The closest mode to each engine order, with a verdict: "close" below CLOSE_MARGIN, else
    "ok"; at rest the lowest mode, "not excited at rest".
    """
    rows = interference_table(table, sectors, speed, orders)
    if rows.empty:
        return rows.assign(verdict=[])
    if not speed > 0:
        lowest = rows.loc[rows.groupby("engine_order")["frequency"].idxmin()]
        return lowest.assign(verdict=AT_REST).reset_index(drop=True)
    closest = rows.loc[rows.groupby("engine_order")["margin"].apply(lambda m: m.abs().idxmin())]
    return closest.assign(
        verdict=np.where(closest["margin"].abs() >= CLOSE_MARGIN, "ok", "close")
    ).reset_index(drop=True)
