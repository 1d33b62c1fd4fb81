"""Pressure between a verification pair: seen from above, and over the radius next to its closed
form.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Patch

from bladefem.data import PressureMap

from ..scene.units import newtons
from .contact import OPEN_FACE_COLOUR, colour_pressure
from .style import COLOURS, SEAT_COLOURS, canvas, headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# radius [m], pressure [Pa]
Curve = tuple[np.ndarray, np.ndarray]


def draw_indentation(
    seats: dict[float, PressureMap],
    radius: np.ndarray,
    exact: Callable[[float], Curve],
    edge: float,
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """The pressure of the largest load on the meshed part of the contact, and that of all loads
    over the radius.

    Args:
        seats: load [N] to the pressure of the meshed quarter, or half in the plane (then without
            the map).
        radius: (n,) of the nodes [m].
        exact: the closed form under a load.
        edge: closed-form contact radius under the largest load [m].
        file: PNG to write.
        title: headline.
    """
    largest = max(seats)
    flat = seats[largest].patch.faces.shape[1] == 2
    with canvas(
        file, None, (5.6, 4.0) if flat else (9.6, 4.0), (1, 1 if flat else 2), squeeze=False
    ) as axes:
        if not flat:
            _from_above(
                axes[0, 0], seats[largest], edge, 1.5 * _inner(seats[largest], radius, edge)
            )
            axes[0, 0].set_title(
                f"load {newtons(largest, 5)}, meshed quarter", fontsize=9, fontweight="normal"
            )
        _over_radius(axes[0, -1], seats, radius, exact, edge)
        axes[0, -1].set_xlabel(
            "distance from the middle [mm]" if flat else "distance from the axis [mm]"
        )
        axes[0, 0].figure.get_layout_engine().set(wspace=0.06)
        headline(axes[0, 0].figure, title or "contact pressure")
        return axes[0, 0].figure


def _inner(
    seat: PressureMap,
    radius: np.ndarray,
    edge: float,
) -> float:
    """Largest pressure [Pa] that is no singularity of an edge."""
    return float(seat.pressure[radius < 0.9 * edge].max())


def _from_above(
    ax: Axes,
    seat: PressureMap,
    edge: float,
    most: float,
) -> None:
    peak = float(seat.pressure.max())
    norm = Normalize(0, min(peak, most) / 1e6)
    opened = colour_pressure(ax, 1e3 * seat.patch.points[:, :2], seat, norm)
    handles: list[Any] = [Patch(color=OPEN_FACE_COLOUR, label="open")] if opened else []
    turn = np.linspace(0, np.pi / 2, 60)
    handles += ax.plot(
        1e3 * edge * np.cos(turn),
        1e3 * edge * np.sin(turn),
        "--",
        color=COLOURS[5],
        label="edge, closed form",
    )
    ax.figure.colorbar(
        ScalarMappable(norm, SEAT_COLOURS),
        ax=ax,
        label="contact pressure [MPa]",
        aspect=25,
        extend="max" if peak > most else "neither",
    )
    ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    ax.grid(False)
    ax.legend(handles=handles, loc="upper right")


def _over_radius(
    ax: Axes,
    seats: dict[float, PressureMap],
    radius: np.ndarray,
    exact: Callable[[float], Curve],
    edge: float,
) -> None:
    order = np.argsort(radius)
    for i, (load, seat) in enumerate(seats.items()):
        r, p = exact(load)
        ax.plot(
            1e3 * r, p / 1e6, "-", color="black", lw=1, zorder=1, label="" if i else "closed form"
        )
        ax.plot(
            1e3 * radius[order],
            seat.pressure[order] / 1e6,
            "o",
            ms=2.5,
            color=COLOURS[i % len(COLOURS)],
            label=f"finite elements, {newtons(load, 5)}",
        )
    inner = max(_inner(seat, radius, edge) for seat in seats.values())
    ax.set(
        ylabel="contact pressure [MPa]", xlim=(0, 1e3 * radius.max()), ylim=(0, 1.5 * inner / 1e6)
    )
    ax.legend()
