"""Labelled drawings of the contact pairs for verification: half sections through the axis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry.contact_pairs import SEAT_RATIO
from geometry.parameters import HertzPair, Punch

from .dimensions import draw_length, draw_note, draw_outline
from .parts import DAMPER_COLOUR, MM
from .style import COLOURS, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_hertz(hertz: HertzPair, file: str | Path | None = None) -> object:
    """Sphere or cylinder on a block, half of it; returns the figure."""
    wide = MM * hertz.half_width
    radius = MM * hertz.radius
    contact = MM * hertz.contact_radius
    x = np.linspace(0, wide, 60)
    cap = np.column_stack([x, radius - np.sqrt(radius**2 - x**2)])
    with canvas(file, size=(7.2, 6.4)) as ax:
        _draw_block(ax, wide)
        draw_outline(ax, np.vstack([cap, [[wide, wide], [0, wide]]]), DAMPER_COLOUR)
        ax.plot([0, SEAT_RATIO * contact], [0, 0], color=COLOURS[1], lw=3.5, zorder=4)
        draw_length(ax, (0, 0), (contact, 0), "", 0.12 * wide)
        draw_note(ax, (0.5 * contact, 0.12 * wide), f"contact_radius {contact:g} mm", (40, 26))
        draw_length(ax, (0, -wide), (wide, -wide), f"half_width {wide:g} mm", -0.14 * wide)
        draw_note(ax, cap[45], f"radius {radius:g} mm", (60, -14))
        draw_note(ax, (1.7 * contact, 0), "seat_right and damper_left", (70, -30))
        draw_note(ax, (0.6 * wide, wide), "load", (20, 14))
        _draw_axes(ax, wide, hertz.dimension, "Hertz pair, half section")
        return ax.figure


def draw_punch(punch: Punch, file: str | Path | None = None) -> object:
    """Flat punch on a block, half of it; returns the figure."""
    wide = MM * punch.half_width
    radius = MM * punch.radius
    with canvas(file, size=(7.2, 5.2)) as ax:
        _draw_block(ax, wide)
        draw_outline(
            ax, np.array([[0, 0], [radius, 0], [radius, radius], [0, radius]]), DAMPER_COLOUR
        )
        ax.plot([0, radius], [0, 0], color=COLOURS[1], lw=3.5, zorder=4)
        draw_length(ax, (0, radius), (radius, radius), "", 0.05 * wide)
        draw_note(ax, (radius / 2, radius + 0.05 * wide), f"radius {radius:g} mm", (50, 12))
        draw_length(ax, (0, -wide), (wide, -wide), f"half_width {wide:g} mm", -0.14 * wide)
        draw_note(ax, (0.7 * radius, 0), "seat_right and damper_left", (70, -30))
        draw_note(ax, (0.5 * radius, radius), "load", (60, -8))
        _draw_axes(ax, wide, punch.dimension, "flat punch, half section")
        return ax.figure


def _draw_block(ax: Axes, wide: float) -> None:
    draw_outline(ax, np.array([[0, -wide], [wide, -wide], [wide, 0], [0, 0]]))
    draw_note(ax, (0.6 * wide, -wide), "clamp", (14, 24))


def _draw_axes(
    ax: Axes,
    wide: float,
    dimension: int,
    title: str,
) -> None:
    """The axis and what is drawn on it."""
    ax.axvline(0, color="#555555", lw=0.8, ls="-.", zorder=3)
    faces = (
        "symmetry_x (x = 0)\nsymmetry_y (y = 0,\nthe drawing's plane)"
        if dimension == 3
        else "symmetry_x (x = 0)"
    )
    draw_note(ax, (0, -0.5 * wide), faces, (-16, 0))
    ax.set(aspect="equal", xlabel="x [mm]", ylabel=f"{'z' if dimension == 3 else 'y'}, up [mm]")
    ax.set_title(title, fontsize=9.5)
    ax.grid(False)
    ax.margins(0.12)
    ax.set_xlim(-0.8 * wide, 1.35 * wide)
