"""Labelled drawings of every part of a geometry, from its parameters: what the documentation
shows.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bladefem.scene.units import show
from geometry.parameters import DEG, Aerofoil, Disc, Plane, Platform, Shank, Wedge, ZMass
from geometry.plane import blade_corners, damper_corners
from geometry.profile import sector_profile
from geometry.section import centroid, section_frame, section_shape
from geometry.zmass import z_corners

from .dimensions import draw_angle, draw_length, draw_note, draw_outline
from .style import COLOURS, canvas, headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MM = 1e3
DAMPER_COLOUR = "#e3cfa4"
NEIGHBOUR_COLOUR = "#eceff2"


def parameter_words(table: Any, name: str) -> str:
    """ "span 120 mm", from a parameter table."""
    field = type(table).__dataclass_fields__[name]
    return f"{name} {show(getattr(table, name), field.metadata['unit'] or '1')}"


def equal_axes(
    ax: Axes,
    title: str,
    horizontal: str,
    vertical: str,
) -> None:
    """Axes of a drawing: equal scales, no grid."""
    ax.set(aspect="equal", xlabel=f"{horizontal} [mm]", ylabel=f"{vertical} [mm]")
    ax.set_title(title, fontsize=9.5)
    ax.grid(False)
    ax.margins(0.12)


def draw_aerofoil(aerofoil: Aerofoil, file: str | Path | None = None) -> object:
    """Section over chord, root and tip sections as stacked, and the side view; returns the
    figure.
    """
    with canvas(file, size=(11.4, 4.6), grid=(1, 3), width_ratios=[1.2, 1.2, 1.0]) as axes:
        draw_section(axes[0], aerofoil)
        draw_stacking(axes[1], aerofoil)
        draw_side(axes[2], aerofoil)
        headline(axes[0].figure, "aerofoil")
        return axes[0].figure


def draw_section(ax: Axes, blade: Aerofoil) -> None:
    """The root section along its chord, with thickness and camber."""
    chord = MM * blade.chord_root
    points = chord * section_shape(blade, 0.0)
    draw_outline(ax, points)
    half = len(points) // 2
    upper = points[: half + 1][::-1]
    lower = points[half:]
    middle = 0.5 * (upper + lower)
    ax.plot(*middle.T, color=COLOURS[1], lw=1, ls="-.", zorder=3)
    ax.plot([0, chord], [0, 0], color="#555555", lw=0.8, ls="--", zorder=3)
    thick = np.argmax(np.hypot(*(upper - lower).T))
    draw_length(ax, lower[thick], upper[thick], "", 0.0)
    draw_note(ax, upper[thick], f"{parameter_words(blade, 'thickness_root')} of the chord", (0, 26))
    high = np.argmax(middle[:, 1])
    draw_note(
        ax,
        middle[high] + [0.25 * chord, -0.2 * middle[high][1]],
        f"mean line, {parameter_words(blade, 'camber')}",
        (20, 30),
    )
    draw_length(ax, (0, 0), (chord, 0), parameter_words(blade, "chord_root"), -0.22 * chord)
    equal_axes(ax, f'root section, "{blade.section}"', "along the chord", "across it")
    ax.set(xlim=(-0.15 * chord, 1.35 * chord), ylim=(-0.4 * chord, 0.45 * chord))


def plane_section(blade: Aerofoil, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Section (n, 2) and chord line (2, 2) as (axial, circumferential) [mm], seen from the tip
    towards the axis.
    """
    origin, along, across, chord = section_frame(blade, 0.0, t)
    flat = section_shape(blade, t)
    local = chord * (np.vstack([flat, [[0, 0], [1, 0]]]) - centroid(flat))
    space = origin + local[:, :1] * along + local[:, 1:] * across
    return MM * space[:-2, [2, 1]], MM * space[-2:, [2, 1]]


def draw_stacking(ax: Axes, blade: Aerofoil) -> None:
    """Root and tip sections over each other: stagger, twist, lean and sweep."""
    for t, colour, name in ((0.0, "#d5dbe1", "root"), (1.0, "#9fc5e0", "tip")):
        points, chord = plane_section(blade, t)
        draw_outline(ax, points, colour, alpha=0.85)
        ax.plot(*chord.T, color="#555555", lw=0.8, ls="--", zorder=3)
        draw_note(ax, points[np.argmin(points[:, 0])], name, (10, -16) if t else (-8, 16))
    reach = MM * blade.chord_root
    ax.plot([0, 0.8 * reach], [0, 0], color="#333333", lw=0.8, ls="-.", zorder=1)
    draw_angle(ax, (0, 0), 0.0, blade.stagger, 0.62 * reach, parameter_words(blade, "stagger"))
    draw_angle(
        ax,
        (0, 0),
        blade.stagger,
        blade.stagger + blade.twist,
        0.74 * reach,
        parameter_words(blade, "twist"),
    )
    equal_axes(ax, "root and tip, seen along the span", "z, engine axis", "y, circumferential")
    ax.set(xlim=(-0.6 * reach, 1.25 * reach), ylim=(-0.6 * reach, 0.75 * reach))


def draw_side(ax: Axes, blade: Aerofoil) -> None:
    """Span against the engine axis, with the extents of the turned sections."""
    shares = np.linspace(0, 1, 21)
    extents = [plane_section(blade, t)[0][:, 0] for t in shares]
    height = MM * blade.span * shares
    low = np.array([e.min() for e in extents])
    high = np.array([e.max() for e in extents])
    draw_outline(
        ax, np.concatenate([np.stack([low, height], 1), np.stack([high, height], 1)[::-1]])
    )
    tip = MM * blade.chord_tip
    draw_length(
        ax, (low.min(), 0), (low.min(), height[-1]), parameter_words(blade, "span"), 0.25 * tip
    )
    draw_note(
        ax,
        (high[-1], height[-1]),
        f"{parameter_words(blade, 'chord_tip')}\n{parameter_words(blade, 'thickness_tip')}\n"
        "(turned)",
        (14, -14),
    )
    axis = MM * np.array([section_frame(blade, 0.0, t)[0][2] for t in (0.0, 1.0)])
    ax.plot(axis, [0, height[-1]], color=COLOURS[1], lw=1, ls="-.", zorder=3)
    draw_note(
        ax,
        (float(np.mean(axis)), 0.5 * height[-1]),
        f"stacking line\n{parameter_words(blade, 'lean')}\n{parameter_words(blade, 'sweep')}",
        (44, 0),
    )
    draw_note(
        ax, (high[0], 0), parameter_words(blade, "fillet") if blade.fillet else "fillet", (12, 16)
    )
    equal_axes(ax, "side view", "z, engine axis", "x above the platform")
    ax.set_xlim(low.min() - 0.6 * tip, high.max() + 1.1 * tip)


def about_seat_plane(points: np.ndarray, theta: float) -> np.ndarray:
    """(n, 2) x, y to (across, radial) [mm] about the radial plane between this blade and the
    next.
    """
    c = np.cos(theta)
    s = np.sin(theta)
    return MM * np.stack(
        [points[:, 1] * c - points[:, 0] * s, points[:, 0] * c + points[:, 1] * s], axis=1
    )


def draw_platform(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    file: str | Path | None = None,
) -> object:
    """Two neighbouring platforms and the damper between them, seen along the engine axis; returns
    the figure.
    """
    cut = sector_profile(platform, shank, disc, wedge)
    blade = about_seat_plane(cut.blade, cut.theta)
    damper = about_seat_plane(cut.damper, cut.theta)
    inner, outer = about_seat_plane(cut.seats[0], cut.theta)
    foot = inner - [0, MM * wedge.base]
    corner = about_seat_plane(cut.corners[:1], cut.theta)[0]
    with canvas(file, size=(8.4, 5.6)) as ax:
        draw_outline(ax, blade)
        draw_outline(
            ax, about_seat_plane(cut.blade * [1, -1], cut.theta) * [-1, 1], NEIGHBOUR_COLOUR
        )
        draw_outline(ax, damper, DAMPER_COLOUR)
        ax.plot([0, 0], [foot[1] - 6, corner[1] + 7], color="#555555", lw=0.8, ls="-.", zorder=3)
        next_seat = about_seat_plane(cut.seats[1] * [1, -1], cut.theta) * [-1, 1]
        for seat in (np.stack([inner, outer]), next_seat):
            ax.plot(*seat.T, color=COLOURS[1], lw=3, zorder=4)
        label_platform(ax, platform, shank, wedge, np.stack([foot, inner, outer, corner]))
        span = max(2.6 * abs(inner[0]), 4 * MM * platform.thickness)
        equal_axes(
            ax,
            "platforms and damper, seen along the engine axis",
            "circumferential, from the gap",
            "radial",
        )
        low = min(foot[1], damper[:, 1].min())
        ax.set(xlim=(-span, span), ylim=(low - 8, corner[1] + 8))
        return ax.figure


def label_platform(
    ax: Axes,
    platform: Platform,
    shank: Shank,
    wedge: Wedge,
    corners: np.ndarray,
) -> None:
    """Dimensions of platform and wedge; corners are the flank's foot, inner and outer end and the
    plate's corner.
    """
    foot, inner, outer, corner = corners
    mirror = np.array([-1, 1])
    draw_length(ax, corner, corner * mirror, parameter_words(platform, "gap"), 3.0)
    draw_length(ax, inner, outer, parameter_words(platform, "seat_width"), 2.0)
    draw_length(ax, corner * mirror, outer * mirror, parameter_words(platform, "thickness"), 2.5)
    if wedge.shape != "round bar":
        draw_length(ax, foot * mirror, inner * mirror, parameter_words(wedge, "base"), -2.5)
    if wedge.shape != "plate":
        _label_angles(ax, wedge, inner)
    draw_note(
        ax,
        0.3 * (inner * mirror) + 0.7 * (outer * mirror),
        "seat_left of the next blade\non damper_right",
        (60, -10),
    )
    draw_note(ax, 0.3 * inner + 0.7 * outer, "seat_right of this blade\non damper_left", (-70, 28))
    low = foot * [-0.3, 1] + [0, 0.6]
    words = (
        f"damper, shape {wedge.shape}, axial {wedge.axial}\n{parameter_words(wedge, 'length')}, "
        f"{parameter_words(wedge, 'clearance')}"
    )
    draw_note(ax, low, words, (20, -44))
    draw_note(
        ax,
        inner * [4, 1] - [0, 4],
        f"shank\n{parameter_words(shank, 'width')}\n{parameter_words(shank, 'height')}",
        (-20, -24),
    )


def _label_angles(ax: Axes, wedge: Wedge, inner: np.ndarray) -> None:
    """Angles of both flanks against the radial line between the blades."""
    apex = np.array([0.0, inner[1] - inner[0] / np.tan(wedge.angle)])
    draw_angle(
        ax,
        apex,
        -np.pi / 2 - wedge.angle,
        -np.pi / 2,
        0.75 * (apex[1] - inner[1]),
        parameter_words(wedge, "angle"),
    )
    draw_angle(
        ax,
        apex,
        -np.pi / 2,
        wedge.angles[1] - np.pi / 2,
        0.6 * (apex[1] - inner[1]),
        "angle_next" if wedge.angle_next is None else parameter_words(wedge, "angle_next"),
    )


def draw_damper_shapes(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    file: str | Path | None = None,
) -> object:
    """Every shape of damper between two platforms, with the scene's other values; returns the
    figure.
    """
    steep = max(wedge.angle - 15 * DEG, 15 * DEG)
    both = {
        "wedge": replace(wedge, shape="wedge", angle_next=None),
        "wedge, angle_next given": replace(wedge, shape="wedge", angle_next=steep),
        "round bar": replace(wedge, shape="round bar", angle_next=None),
        "plate": replace(wedge, shape="plate", angle=90 * DEG, angle_next=None),
    }
    with canvas(file, size=(11.4, 3.1), grid=(1, len(both)), sharey=True) as axes:
        for ax, (name, damper) in zip(axes, both.items(), strict=True):
            cut = sector_profile(platform, shank, disc, damper)
            # the next blade's side is this one's turned by a sector
            draw_outline(ax, about_seat_plane(cut.blade, cut.theta))
            draw_outline(ax, about_seat_plane(cut.blade, -cut.theta), NEIGHBOUR_COLOUR)
            draw_outline(ax, about_seat_plane(cut.damper, cut.theta), DAMPER_COLOUR)
            for seat, side in zip(cut.seats, (1, -1), strict=True):
                ax.plot(
                    *about_seat_plane(seat, side * cut.theta).T, color=COLOURS[1], lw=3, zorder=4
                )
            equal_axes(ax, name, "circumferential", "radial")
            middle = MM * cut.underside * np.cos(cut.theta)
            ax.set(xlim=(-14, 14), ylim=(middle - 13, middle + 14))
            ax.label_outer()
        return axes[0].figure


def ring_segment(
    inner: float,
    outer: float,
    theta: float,
) -> np.ndarray:
    """Corners (n, 2) as (circumferential, radial) [mm] of a ring segment between -theta and
    theta.
    """
    turn = np.linspace(-theta, theta, 31)
    arcs = [
        r * np.stack([np.sin(t), np.cos(t)], axis=1)
        for r, t in ((inner, turn), (outer, turn[::-1]))
    ]
    return MM * np.concatenate(arcs)


def draw_disc(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    file: str | Path | None = None,
) -> object:
    """The sector from bore to tip, along the engine axis and from the side; returns the figure."""
    cut = sector_profile(platform, shank, disc, wedge)
    with canvas(file, size=(7.4, 6.8), grid=(1, 2), sharey=True) as axes:
        draw_front(axes[0], cut, aerofoil, disc)
        draw_meridian(axes[1], cut, aerofoil, platform, shank, disc)
        headline(axes[0].figure, f"sector, 1 of {disc.sectors}")
        return axes[0].figure


def draw_front(
    ax: Axes,
    cut: Any,
    aerofoil: Aerofoil,
    disc: Disc,
) -> None:
    """Along the engine axis."""
    draw_outline(ax, ring_segment(disc.bore_radius, disc.rim_radius, cut.theta))
    draw_outline(ax, MM * cut.blade[:, ::-1])
    draw_outline(ax, MM * cut.damper[:, ::-1], DAMPER_COLOUR)
    width = [np.ptp(plane_section(aerofoil, t)[0][:, 1]) / 2 for t in (0.0, 1.0)]
    top = MM * cut.top
    tip = MM * (cut.top + aerofoil.span)
    draw_outline(
        ax, np.array([[-width[0], top], [width[0], top], [width[1], tip], [-width[1], tip]])
    )
    corner = ring_segment(disc.bore_radius, disc.rim_radius, cut.theta)
    for side in (-1, 1):
        ax.plot([0, side * corner[0, 0]], [0, corner[0, 1]], color="#999999", lw=0.7, ls="--")
    draw_angle(
        ax,
        (0, 0),
        np.pi / 2 - cut.theta,
        np.pi / 2 + cut.theta,
        0.55 * MM * disc.bore_radius,
        "360° / sectors",
        rays=False,
    )
    draw_note(ax, corner[20], f"clamp\n{parameter_words(disc, 'bore_radius')}", (30, -14))
    draw_note(ax, 0.5 * (corner[0] + corner[-1]), "cyclic_low", (-14, -10))
    draw_note(ax, 0.5 * (corner[30] + corner[31]), "cyclic_high", (14, 0))
    equal_axes(ax, "along the engine axis", "y, circumferential", "x, radial")
    ax.set(xlim=(-0.28 * tip, 0.28 * tip), ylim=(-0.05 * tip, 1.06 * tip))


def draw_meridian(
    ax: Axes,
    cut: Any,
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
) -> None:
    """From the side: axial widths and radii."""
    levels = [disc.bore_radius, disc.rim_radius, cut.underside, cut.top, cut.top + aerofoil.span]
    for low, high, width in zip(
        levels[:3], levels[1:4], (disc.width, shank.length, platform.length), strict=True
    ):
        draw_outline(
            ax,
            MM
            * np.array(
                [[-width / 2, low], [width / 2, low], [width / 2, high], [-width / 2, high]]
            ),
        )
    shares = np.linspace(0, 1, 21)
    extents = [plane_section(aerofoil, t)[0][:, 0] for t in shares]
    height = MM * (cut.top + aerofoil.span * shares)
    low = np.array([e.min() for e in extents])
    high = np.array([e.max() for e in extents])
    draw_outline(
        ax, np.concatenate([np.stack([low, height], 1), np.stack([high, height], 1)[::-1]])
    )
    left = -MM * max(disc.width, platform.length) / 2
    draw_length(
        ax,
        (-MM * disc.width / 2, MM * levels[0]),
        (MM * disc.width / 2, MM * levels[0]),
        parameter_words(disc, "width"),
        -9,
    )
    draw_length(ax, (left, 0), (left, MM * levels[1]), parameter_words(disc, "rim_radius"), 22)
    draw_length(
        ax, (left, MM * levels[1]), (left, MM * levels[2]), parameter_words(shank, "height"), 9
    )
    draw_note(
        ax,
        (MM * shank.length / 2, MM * 0.5 * (levels[1] + levels[2])),
        f"shank\n{parameter_words(shank, 'length')}",
        (16, -16),
    )
    draw_note(
        ax,
        (MM * platform.length / 2, MM * 0.5 * (levels[2] + levels[3])),
        f"platform\n{parameter_words(platform, 'length')}",
        (10, 6),
    )
    right = MM * platform.length / 2
    draw_length(
        ax, (right, MM * levels[3]), (right, MM * levels[4]), parameter_words(aerofoil, "span"), -26
    )
    ax.axhline(0, color="#333333", lw=1, ls="-.")
    draw_note(ax, (1.1 * right, 0), "engine axis", (6, 12))
    equal_axes(ax, "from the side", "z, engine axis", "")
    ax.set(xlim=(-0.28 * MM * levels[4], 0.28 * MM * levels[4]), ylabel="")


def draw_plane(plane: Plane, file: str | Path | None = None) -> object:
    """Two plane blades with the flat damper between them; returns the figure."""
    blade = MM * blade_corners(plane)[:, ::-1]
    damper = MM * damper_corners(plane)[:, ::-1]
    pitch = MM * plane.pitch
    long = MM * plane.length
    half = MM * plane.thickness / 2
    wide = MM * plane.platform_width / 2
    low = MM * plane.platform_height
    thick = MM * plane.platform_thickness
    seat = MM * plane.seat_width
    with canvas(file, size=(6.6, 6.8)) as ax:
        draw_outline(ax, blade)
        draw_outline(ax, blade + np.array([pitch, 0.0]), NEIGHBOUR_COLOUR)
        draw_outline(ax, damper, DAMPER_COLOUR)
        for start in (wide - seat, pitch - wide):
            ax.plot([start, start + seat], [low, low], color=COLOURS[1], lw=3.5, zorder=4)
        ax.fill_between(
            [-3 * half, pitch + 3 * half], -4, 0, hatch="////", fc="none", ec="#777777", lw=0
        )
        draw_length(ax, (-wide, 0), (-wide, long), parameter_words(plane, "length"), 14)
        draw_length(ax, (-wide, 0), (-wide, low), parameter_words(plane, "platform_height"), 5)
        draw_length(ax, (-half, long), (half, long), parameter_words(plane, "thickness"), 5)
        draw_length(
            ax,
            (-wide, low + thick),
            (wide, low + thick),
            parameter_words(plane, "platform_width"),
            10,
        )
        draw_length(ax, (0, 0.75 * long), (pitch, 0.75 * long), parameter_words(plane, "pitch"))
        draw_length(ax, (wide - seat, low), (wide, low), parameter_words(plane, "seat_width"), -16)
        draw_note(
            ax,
            (pitch + wide, low + thick / 2),
            parameter_words(plane, "platform_thickness"),
            (-24, 60),
        )
        draw_note(
            ax,
            damper.mean(axis=0) * [1.2, 1],
            f"flat damper\n{parameter_words(plane, 'damper_height')}",
            (60, -34),
        )
        draw_note(ax, (0, 2), f"clamp; {parameter_words(plane, 'depth')}", (16, 14))
        equal_axes(ax, "plane blades with flat dampers", "y, circumferential", "x, radial")
        ax.margins(0.06)
        return ax.figure


def draw_z_mass(z: ZMass, file: str | Path | None = None) -> object:
    """The plate seen from above; returns the figure."""
    corners = MM * z_corners(z)
    wide = MM * z.width / 2
    high = MM * z.height / 2
    bar = MM * z.bar
    with canvas(file, size=(6.0, 5.4)) as ax:
        draw_outline(ax, corners, DAMPER_COLOUR)
        draw_length(ax, (-wide, -high), (wide, -high), parameter_words(z, "width"), -6)
        draw_length(ax, (wide, -high), (wide, high), parameter_words(z, "height"), -6)
        draw_length(ax, (-wide, high - bar), (-wide, high), parameter_words(z, "bar"), 5)
        draw_length(ax, corners[4] - [bar, 0], corners[4], "bar", -8)
        draw_note(
            ax, (0, -0.75 * high), f"{parameter_words(z, 'thickness')}, footprint at z = 0", (0, 0)
        )
        equal_axes(ax, "Z mass, seen from above", "x", "y")
        return ax.figure
