"""Frequencies over speed: Campbell table, engine-order crossings, interference (SAFE) table and
margins.

The stiffness about the linear preload is a polynomial of second degree in the square of the speed,
K0 + s K1 + s^2 K2, so three speeds give it everywhere; about the nonlinear preload the same is an
interpolation. The modes at these three speeds span those between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.linalg import eigh

from geometry.mesh import sector_of

from ...data import ModeSet
from ...errors import InputError
from ...scene.fields import split_values
from ...scene.units import is_plain, parse
from ..pipeline.bodies import Bodies, is_wheel
from .crossings import (
    campbell_crossings,
    crossing_margins,
    fold_order,
    interference_table,
    wave_sense,
)

if TYPE_CHECKING:
    from ...fem.body import Body

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
    diameters: Sequence[int] | None = None,
    count: int = 5,
) -> Campbell:
    """Campbell and interference tables of the blade or wheel without damper.

    Args:
        speeds: [rad/s]; the scene's own speed is added.
        orders: engine orders.
        diameters: nodal diameters; those that the orders excite when left out.
        count: modes of each.

    Raises:
        InputError: fewer than two speeds, negative ones.
    """
    sectors = sector_of(bodies.mesh).count if is_wheel(bodies.mesh) else 0
    operating = bodies.scene.operation.speed
    if sectors and diameters is None:
        diameters = sorted({fold_order(order, sectors) for order in orders})
    table = campbell_table(bodies, sorted({*speeds, operating}), diameters, count)
    at_speed = table[table["speed"] == operating]
    crossed = [
        campbell_crossings(_excited_waves(table, order, sectors), [order], sectors or None)
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


def campbell_table(
    bodies: Bodies,
    speeds: Sequence[float],
    diameters: Sequence[int] | None,
    count: int = 5,
) -> pd.DataFrame:
    """One row a mode and speed.

    Args:
        diameters: nodal diameters of a wheel.

    Returns:
        columns nodal_diameter (wheels), mode, speed [rad/s], frequency [Hz] without Coriolis
        forces, forward and
        backward [Hz] with them, error [1]: how far the frequency moves when the middle speed's
        modes are left out, a pessimistic measure of what the basis misses.
    """
    if len(speeds) < 2 or min(speeds) < 0 or not np.isfinite(speeds).all():
        raise InputError(f"speeds are {list(speeds)} rad/s, expected at least two, not negative")
    from ...contact.seating import counting_sense, spin_axis

    squares = np.linspace(0.0, max(speeds) ** 2, 3)
    at = [bodies.blade_at(float(np.sqrt(s))) for s in squares]
    sets = [
        _modes_at_speed(bodies, body, diameters, count + GUARD_MODES)
        for body in bodies.progress(at, "speeds")
    ]
    axis = spin_axis(bodies.mesh)
    rows = [
        _frequency_lines(
            at, [s[i] for s in sets], squares, speeds, axis, counting_sense(bodies.mesh)
        )
        for i in range(len(sets[0]))
    ]
    return pd.concat(rows, ignore_index=True)


def read_speeds(text: str) -> list[float]:
    """Speeds [rad/s] from a text such as "0, 2000, 4000 rpm", or "0, 500, ..., 12000 rpm" with
    equal steps.

    Raises:
        InputError: not speeds, no unit, or dots without a step before and an end after them.
    """
    items = split_values(text)
    if not items:
        raise InputError(f"campbell = {text!r}: expected speeds, such as '0, 2000, 4000 rpm'")
    for item in items:
        if is_plain(item) and parse(item, "rad/s", "campbell"):
            example = f"{text.strip()} rpm" if is_plain(items[-1]) else "0, 2000, 4000 rpm"
            raise InputError(f"campbell = {text}: expected a unit, such as '{example}'")
    numbers = [
        None if item.startswith("...") else parse(item, "rad/s", "campbell") for item in items
    ]
    out: list[float] = []
    for i, number in enumerate(numbers):
        if number is not None:
            out.append(number)
            continue
        end = numbers[i + 1] if i + 1 < len(numbers) else None
        if len(out) < 2 or end is None or not out[-1] > out[-2]:
            raise InputError(
                f"campbell = {text}: expected two rising speeds before '...' and the last one "
                "after it"
            )
        step = out[-1] - out[-2]
        if (end - out[-1]) / step > MAX_SPEEDS:
            raise InputError(
                f"campbell = {text}: {(end - out[-1]) / step:.3g} speeds, expected at "
                f"most {MAX_SPEEDS}"
            )
        out += list(np.arange(out[-1] + step, end - step / 2, step))
    if min(out, default=0.0) < 0:
        raise InputError(f"campbell = {text}: expected speeds of at least 0 rpm")
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

    if is_wheel(bodies.mesh):
        return all_diameters(body, count, diameters)
    return [modes(constrain(body), count)]


def _frequency_lines(
    at: list[Any],
    sets: list[ModeSet],
    squares: np.ndarray,
    speeds: Sequence[float],
    axis: tuple[float, float, float],
    sense: int,
) -> pd.DataFrame:
    """All speeds of one nodal diameter, in the space of the modes at three speeds; the guards are
    left out.
    """
    count = len(sets[0].frequencies)
    shown = slice(0, count - GUARD_MODES)
    K, M, g = _project_speeds(at, sets, axis)
    outer = np.r_[0:count, 2 * count : 3 * count]
    frames = []
    for speed in speeds:
        weights = _lagrange_weights(squares, speed**2)
        small = reduce(np.add, [weight * part for weight, part in zip(weights, K, strict=True)])
        f, Z = _lowest_frequencies(small, M, count)
        rough, _ = _lowest_frequencies(small[np.ix_(outer, outer)], M[np.ix_(outer, outer)], count)
        forward, backward = _split_waves(
            f, Z.conj().T @ g @ Z, speed, sense, sets[0].nodal_diameter
        )
        values = {
            "frequency": f,
            "forward": forward,
            "backward": backward,
            "error": np.abs(rough / f - 1),
        }
        frames.append(
            pd.DataFrame({"mode": np.arange(1, count + 1), "speed": float(speed), **values})[shown]
        )
    table = pd.concat(frames, ignore_index=True)
    if sets[0].nodal_diameter is not None:
        table.insert(0, "nodal_diameter", sets[0].nodal_diameter)
    return table


def _project_speeds(
    at: list[Any],
    sets: list[ModeSet],
    axis: tuple[float, float, float],
) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Stiffness of each speed, mass and Coriolis matrix on the modes of all three."""
    from ...fem.gyroscopic import own_rows, project_coriolis
    from ...fem.linalg import apply_block, hermitian_part, inner_products

    comm = at[0].comm
    X = own_rows(at[0], np.concatenate([s.shapes for s in sets]))
    K = [hermitian_part(inner_products(comm, X, apply_block(body.K, X))) for body in at]
    M = hermitian_part(inner_products(comm, X, apply_block(at[0].M, X)))
    return K, M, project_coriolis(at[0], X, axis)


def _lowest_frequencies(
    K: np.ndarray,
    M: np.ndarray,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Lowest frequencies [Hz] and vectors in a basis that may nearly depend on itself."""
    from ...fem.linalg import hermitian_part

    size, Q = np.linalg.eigh(M)
    keep = size > 1e-11 * size[-1]
    W = Q[:, keep] / np.sqrt(size[keep])
    lam, Z = eigh(hermitian_part(W.conj().T @ K @ W))
    return np.sqrt(np.maximum(lam[:count], 0)) / (2 * np.pi), W @ Z[:, :count]


def _split_waves(
    f: np.ndarray,
    g: np.ndarray,
    speed: float,
    sense: int,
    diameter: int | None,
) -> tuple[np.ndarray, np.ndarray]:
    from ...fem.gyroscopic import waves

    found = waves(ModeSet(f, np.zeros((len(f), 0, 3)), diameter, np.zeros(len(f))), g, speed, sense)
    return found.forward, found.backward


def _lagrange_weights(nodes: np.ndarray, s: float) -> list[float]:
    """Weights of the values at the nodes for the value at s."""
    return [float(np.prod([(s - b) / (a - b) for b in nodes if b != a])) for a in nodes]


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
    backward = sectors and wave_sense(order, sectors) == "with"
    return table.assign(frequency=table["backward" if backward else "forward"])


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
