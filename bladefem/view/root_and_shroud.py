"""Labelled drawings of roots in the disc and of shrouds on the aerofoil; where a scene has none,
examples of both.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry.parameters import Aerofoil, Disc, Platform, Root, Shank, Shroud, Wedge
from geometry.profile import sector_profile
from geometry.root import root_corners, root_slots
from geometry.section import section_outline
from geometry.shroud import Block, shroud_block

from .dimensions import draw_length, draw_note, draw_outline
from .parts import MM, equal_axes, parameter_words, ring_segment
from .style import COLOURS, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SLOT = "#ffffff"
NEIGHBOUR = "#eceff2"
BLOCK = "#e3cfa4"
# of the drawing without a shroud
EXAMPLE_THICKNESS = 3e-3
EXAMPLE_AT = 0.6


def draw_roots(
    shank: Shank,
    disc: Disc,
    root: Root,
    file: str | Path | None = None,
) -> object:
    """A dovetail and the scene's fir-tree, or one of two lobes, along the engine axis; returns the
    figure.
    """
    both = {
        "dovetail, lobes 1": replace(root, lobes=1),
        f"fir-tree, lobes {max(root.lobes, 2)}": replace(root, lobes=max(root.lobes, 2)),
    }
    with canvas(file, size=(9.6, 4.6), grid=(1, 2), sharey=True, width_ratios=[2.2, 3.1]) as axes:
        for ax, (name, one) in zip(axes, both.items(), strict=True):
            _draw_root(ax, shank, disc, one)
            equal_axes(ax, name, "y, circumferential", "x, radial")
            start, _ = root_corners(both[f"fir-tree, lobes {max(root.lobes, 2)}"], shank, disc)
            half = MM * disc.rim_radius * pi / disc.sectors
            low = MM * (start[-1, 0] - 2 * root.pitch)
            ax.set(
                xlim=(-1.1 * half, (1.1 if ax is axes[0] else 2.0) * half),
                ylim=(low, MM * disc.rim_radius + 0.5 * half),
            )
            ax.label_outer()
        _label_root(axes[1], shank, disc, list(both.values())[1])
        return axes[0].figure


def _draw_root(ax: Axes, shank: Shank, disc: Disc, root: Root) -> None:
    """Disc and shank, slots cut out, bearing flanks in colour."""
    theta = pi / disc.sectors
    draw_outline(ax, ring_segment(disc.bore_radius, disc.rim_radius, theta))
    half = MM * shank.width / 2
    rim = MM * np.sqrt(disc.rim_radius**2 - (shank.width / 2) ** 2)
    up = rim + MM * shank.height
    draw_outline(ax, np.array([[-half, rim], [half, rim], [half, up], [-half, up]]))
    # one solid: no edge between shank and disc
    ax.plot([-half, half], [rim, rim], color="#d5dbe1", lw=2.5, zorder=3)
    for slot in root_slots(root, shank, disc):
        below = np.minimum(slot[:, 0], np.sqrt(disc.rim_radius**2 - slot[:, 1] ** 2))
        draw_outline(ax, MM * np.column_stack([slot[:, 1], below]), SLOT, zorder=4, lw=0.8)
    for first, last in zip(*root_corners(root, shank, disc), strict=True):
        for side in (1, -1):
            flank = MM * np.array([first, last])[:, ::-1] * [side, 1]
            ax.plot(*flank.T, color=COLOURS[1], lw=2.5, zorder=5)


def _label_root(ax: Axes, shank: Shank, disc: Disc, root: Root) -> None:
    start, end = (MM * one[:, ::-1] for one in root_corners(root, shank, disc))
    rim = MM * disc.rim_radius
    mirror = np.array([-1, 1])
    neck = "neck" if root.neck is None else parameter_words(root, "neck")
    draw_length(ax, [-start[0, 0], rim], [start[0, 0], rim], neck, 3.0)
    draw_length(ax, start[0] * mirror, start[1] * mirror, parameter_words(root, "pitch"), -9.0)
    words = "\n".join(
        ["bearing flank, bonded", *(parameter_words(root, n) for n in ("bearing", "flank_angle"))]
    )
    draw_note(ax, 0.5 * (start[0] + end[0]), words, (75, 14))
    slot = 0.5 * (end[0] + start[1]) + [0.4, 0.0]
    words = f"slot\n{parameter_words(root, 'clearance')}"
    draw_note(ax, slot, words, (75, -16))
    draw_note(ax, end[-1] * [0.5, 1] - [0, 2], parameter_words(root, "taper"), (110, -34))


def draw_shrouds(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    damper: Wedge,
    shroud: Shroud,
    file: str | Path | None = None,
) -> object:
    """A tip shroud and a snubber with their neighbours, seen along the span; returns the figure."""
    top = sector_profile(platform, shank, disc, damper).top
    thick = shroud.thickness or EXAMPLE_THICKNESS
    part_way = shroud.at if shroud.at < 1 else EXAMPLE_AT
    given = shroud.thickness > 0
    both = {
        "tip shroud": replace(shroud, thickness=thick, at=1.0),
        "snubber": replace(shroud, thickness=thick, at=part_way),
    }
    with canvas(file, size=(9.6, 4.8), grid=(1, 2), sharey=True) as axes:
        for ax, (name, one) in zip(axes, both.items(), strict=True):
            own = given and one == shroud
            # an example does not take the lengths of another shape
            block = shroud_block(
                one if own or not given else replace(one, length=None, width=None),
                aerofoil,
                disc,
                top,
            )
            assert block is not None
            _draw_shroud(ax, aerofoil, disc, top, block)
            _label_shroud(ax, one, block)
            equal_axes(
                ax, f"{name}, {parameter_words(one, 'at')}", "z, engine axis", "y, circumferential"
            )
            ax.label_outer()
        return axes[0].figure


def _draw_shroud(
    ax: Axes,
    aerofoil: Aerofoil,
    disc: Disc,
    top: float,
    block: Block,
) -> None:
    """This blade's block and section, and half of the neighbours'."""
    middle = float((block.low[0] + block.high[0]) / 2)
    pitch = 2 * np.tan(pi / disc.sectors) * block.low[0]
    section = MM * section_outline(aerofoil, top, (middle - top) / aerofoil.span)[:, [2, 1]]
    corners = MM * np.array(
        [
            [block.low[2], block.low[1]],
            [block.high[2], block.low[1]],
            [block.high[2], block.high[1]],
            [block.low[2], block.high[1]],
        ]
    )
    for shift in (-pitch, pitch):
        draw_outline(ax, corners + np.array([0, MM * shift]), NEIGHBOUR)
    draw_outline(ax, corners, BLOCK)
    draw_outline(ax, section, "#9fc5e0", zorder=3, alpha=0.85)
    # one scale for both drawings, whatever their radius
    reach = 0.75 * MM * 2 * np.tan(pi / disc.sectors) * (top + aerofoil.span)
    middle_y = float(corners[:, 1].mean())
    ax.set(xlim=(-1.25 * reach, 1.25 * reach), ylim=(middle_y - reach, middle_y + reach))


def _label_shroud(ax: Axes, shroud: Shroud, block: Block) -> None:
    low, high = MM * block.low, MM * block.high
    draw_length(ax, [low[2], low[1]], [low[2], high[1]], _given(shroud, "width"), 12.0)
    draw_length(ax, [low[2], low[1]], [high[2], low[1]], _given(shroud, "length"), 4.0)
    words = f"{parameter_words(shroud, 'thickness')}\n(radial)"
    draw_note(ax, [high[2], 0.75 * low[1]], words, (16, -6))
    draw_note(ax, [high[2], high[1]], parameter_words(shroud, "gap"), (16, 10))
    draw_note(ax, [0.6 * high[2], high[1]], "shroud_right", (-20, 16))
    draw_note(ax, [0.6 * high[2], low[1]], "shroud_left", (34, -16))


def _given(shroud: Shroud, name: str) -> str:
    """ "width 40 mm", or the name alone where it is left open."""
    return name if getattr(shroud, name) is None else parameter_words(shroud, name)
