"""Mode shapes: one sector, the full wheel with its nodal lines, contact sheets, travelling
waves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from bladefem.data import ModeSet
from geometry.mesh import Mesh

from .mesh import (
    FRONT_VIEW,
    RADIAL_DIRECTION,
    carry_round,
    edge_lines,
    polydata,
    save_wheel_vtu,
    view_of,
)
from .skin import Skin, skin, wheel_count, wheel_skin
from .style import (
    DIVERGING_COLOURS,
    RENDER_OPTIONS,
    SEQUENTIAL_COLOURS,
    aim_camera,
    canvas,
    enlarged,
    enlarged_lines,
    headline,
    open_plotter,
    photograph,
    reduced,
    resized,
    show_photograph,
    size_for,
    trim_border,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WHEEL_VIEW = (0.0, -0.55, 1.0)
COMPONENTS = ("radial", "circumferential", "axial")
# share of the largest displacement below which a sign means nothing
NEGLIGIBLE_DISPLACEMENT_SHARE = 1e-5
# largest drawn displacement over the sector's height
DRAWN_DISPLACEMENT_SHARE = 0.1
# pictures before cropping (width, height): of one shape, of one among several, of a wheel
SHAPE_PIXELS = (880, 960)
TILE_PIXELS = (450, 520)
WHEEL_PIXELS = (1130, 890)
# part of a tile's width that a picture takes, and the gap below its title [inch]
TILE_SHARE = 0.98
TITLE_GAP = 0.06
# modes of a contact sheet
SHEET_MODES = 8
# in an animated wave
WAVE_COLOURS = 224


def best_phase(shape: np.ndarray) -> complex:
    """The factor e^{j phi} that makes the real part of a complex shape as large as possible."""
    square = np.sum(np.asarray(shape) ** 2)
    return np.exp(-0.5j * np.angle(square)) if abs(square) > 0 else 1.0 + 0.0j


def mode_title(
    modes: ModeSet,
    number: int,
    family: str = "",
) -> str:
    """ "mode 1, first flap: 812.4 Hz, nodal diameter 6" (number counts from 0)."""
    diameter = "" if modes.nodal_diameter is None else f", nodal diameter {modes.nodal_diameter}"
    return (
        f"mode {number + 1}{', ' + family if family else ''}: {modes.frequencies[number]:.5g} "
        f"Hz{diameter}"
    )


def moving_bodies(mesh: Mesh, shape: np.ndarray) -> Mesh:
    """The mesh without bodies at rest (a damper that is not part of the mode)."""
    bodies = {name: cells for name, cells in mesh.bodies.items() if np.any(shape[cells])}
    return replace(mesh, bodies=bodies) if bodies else mesh


def scale_of(mesh: Mesh, shape: np.ndarray) -> float:
    """Factor that draws the largest displacement of a shape as a tenth of the sector's radial
    height.
    """
    largest = np.max(np.linalg.norm(shape, axis=-1), initial=0.0)
    height = np.ptp(mesh.points[:, 0])
    return DRAWN_DISPLACEMENT_SHARE * height / largest if largest > 0 else 0.0


def draw_mode(
    mesh: Mesh,
    modes: ModeSet,
    number: int,
    file: str | Path | None = None,
    *,
    family: str = "",
) -> object:
    """A mode on its sector: deformed, coloured by magnitude, the undeformed edges behind; returns
    the figure.

    Args:
        mesh: the sector or body.
        modes: shapes on the nodes of ``mesh``.
        number: which mode, counted from 0.
        file: PNG to write.
        family: name of the mode family, shown in the title.
    """
    shape = np.real(modes.shapes[number] * best_phase(modes.shapes[number]))
    factor = scale_of(mesh, shape)
    direction = view_of(mesh)
    image = photograph_shape(mesh, shape, factor, direction)
    with canvas(file, size=size_for(image, margin=1.6)) as ax:
        show_photograph(ax, image, direction, RADIAL_DIRECTION)
        headline(ax.figure, mode_title(modes, number, family))
        add_colour_bar(
            ax, Normalize(0, 1), SEQUENTIAL_COLOURS, "displacement over its largest value [1]"
        )
        say_exaggeration(ax, mesh, modes)
        return ax.figure


def say_exaggeration(
    ax: Axes,
    mesh: Mesh,
    modes: ModeSet,
    also: str = "",
) -> None:
    """How much the picture exaggerates, and what else there is to say."""
    wave = ",\nat the phase of the largest motion" if np.iscomplexobj(modes.shapes) else ""
    ax.figure.supxlabel(f"{exaggeration(mesh)}{wave}{also}", fontsize=7.5, color="#555555")


def exaggeration(mesh: Mesh) -> str:
    """ "largest displacement drawn as 12 mm (10 % of the height)"."""
    drawn = DRAWN_DISPLACEMENT_SHARE * np.ptp(mesh.points[:, 0])
    return (
        f"largest displacement drawn as {1e3 * drawn:.3g} mm "
        f"({100 * DRAWN_DISPLACEMENT_SHARE:.0f} % of the height)"
    )


def add_colour_bar(
    ax: Axes,
    norm: Normalize,
    colours: str,
    label: str,
) -> None:
    """A thin bar to the right of a picture."""
    bar = ax.figure.colorbar(ScalarMappable(norm, colours), ax=ax, shrink=0.6, aspect=30, pad=0.03)
    bar.set_label(label, fontsize=8.5)
    bar.ax.tick_params(labelsize=8)
    bar.outline.set_linewidth(0.5)


def photograph_shape(
    mesh: Mesh,
    shape: np.ndarray,
    factor: float,
    direction: tuple[float, float, float],
    values: np.ndarray | None = None,
) -> np.ndarray:
    """Rendering of a deformed sector coloured by relative magnitude, with the undeformed edges in
    grey.

    Args:
        values: (n_points,) to be coloured by in place of the magnitude of the shape.
    """
    magnitude = np.linalg.norm(shape, axis=1) if values is None else values
    [image] = photograph_shapes(mesh, [(shape, factor, magnitude)], direction, SHAPE_PIXELS)
    return image


def photograph_shapes(
    mesh: Mesh,
    shapes: Sequence[tuple[np.ndarray, float, np.ndarray]],
    direction: tuple[float, float, float],
    size: tuple[int, int],
    coarse: bool = False,
) -> Iterator[np.ndarray]:
    """``photograph_shape`` of several shapes, in one window and with one search for the outer
    faces.

    Args:
        shapes: displacements (n_points, dim), the factor they are drawn with, and values
            (n_points,) to be coloured by.
        size: width and height before cropping [pixels].
        coarse: element edges straight from corner to corner, for small pictures.
    """
    extent = np.sum([abs(shape) for shape, _, _ in shapes], axis=0)
    surface = skin(moving_bodies(mesh, extent), coarse)
    body = polydata(surface, surface.points.copy())
    body.point_data["magnitude"] = np.zeros(len(surface.points))
    lines = edge_lines(surface, surface.points, direction)
    lift = lines.points - surface.points
    parts = [
        {"mesh": body, "scalars": "magnitude", "cmap": SEQUENTIAL_COLOURS, "clim": (0, 1)},
        {"mesh": lines, "color": "black", "line_width": 0.5, "opacity": 0.25, "lighting": False},
    ]
    outline = polydata(surface).extract_feature_edges(
        30.0, boundary_edges=True, non_manifold_edges=False, manifold_edges=False
    )
    if outline.n_points:
        parts.append({"mesh": outline, "color": "#888888", "line_width": 1.2, "lighting": False})
    plotter = open_plotter(enlarged(size), smooth=False)
    for part in parts:
        plotter.add_mesh(**{**RENDER_OPTIONS, **enlarged_lines(part)})
    for shape, factor, values in shapes:
        drawn = np.pad(shape, ((0, 0), (0, 3 - shape.shape[1])))
        body.points = surface.points + factor * drawn[surface.nodes]
        body.point_data["magnitude"] = values[surface.nodes] / max(values.max(), 1e-300)
        lines.points = body.points + lift
        everything = np.concatenate([body.points, lines.points, outline.points])
        aim_camera(plotter, direction, RADIAL_DIRECTION, everything)
        plotter.render()
        image = np.asarray(plotter.screenshot(return_img=True))
        yield trim_border(reduced(image, size))
    plotter.close()


def draw_mode_sheet(
    mesh: Mesh,
    modes: ModeSet,
    file: str | Path | None = None,
    *,
    families: Sequence[str] = (),
) -> object:
    """The first modes of a sector side by side; returns the figure."""
    count = min(SHEET_MODES, len(modes.frequencies))
    columns = min(count, 4)
    rows = -(-count // columns)
    direction = view_of(mesh)
    real = [np.real(shape * best_phase(shape)) for shape in modes.shapes[:count]]
    drawn = [(shape, scale_of(mesh, shape), np.linalg.norm(shape, axis=1)) for shape in real]
    images = photograph_shapes(mesh, drawn, direction, TILE_PIXELS, coarse=True)
    titles = [
        f"{number + 1}  {modes.frequencies[number]:.5g} Hz\n{name}"
        for number, name in enumerate([*families, *[""] * count][:count])
    ]
    with canvas(file, size=(2.45 * columns, 3.0 * rows + 0.5)) as ax:
        # axes of their own for all pictures take as long as the pictures
        ax.set_axis_off()
        figure = ax.figure
        figure.set_layout_engine(None)
        _place_tiles(figure, list(images), titles, (rows, columns))
        diameter = (
            "" if modes.nodal_diameter is None else f", nodal diameter {modes.nodal_diameter}"
        )
        headline(figure, f"first modes{diameter}")
        figure.supxlabel(
            "colour: displacement over its largest value, drawn as "
            f"{100 * DRAWN_DISPLACEMENT_SHARE:.0f} % of the height",
            fontsize=7.5,
            color="#555555",
        )
        return figure


def _place_tiles(
    figure: Any,
    images: Sequence[np.ndarray],
    titles: Sequence[str],
    grid: tuple[int, int],
) -> None:
    """Pictures in rows and columns, each as large as its tile allows, with its title above."""
    rows, columns = grid
    width, height = figure.get_size_inches() * figure.dpi
    # of the headline, the line below and the titles between the rows
    top, bottom, title = np.array([0.72, 0.3, 0.45]) * figure.dpi
    tile = (0.98 * width / columns, (height - top - bottom - (rows - 1) * title) / rows)
    for number, (image, text) in enumerate(zip(images, titles, strict=True)):
        row, column = divmod(number, columns)
        scale = min(TILE_SHARE * tile[0] / image.shape[1], tile[1] / image.shape[0])
        pixels = round(scale * image.shape[1]), round(scale * image.shape[0])
        left = round(0.01 * width + (column + 0.5) * tile[0] - pixels[0] / 2)
        upper = round(height - top - row * (tile[1] + title) - (tile[1] - pixels[1]) / 2)
        figure.figimage(resized(image, pixels), left, upper - pixels[1], zorder=1)
        figure.text(
            left / width,
            (upper + TITLE_GAP * figure.dpi) / height,
            text,
            fontsize=9,
            fontweight="bold",
            verticalalignment="bottom",
        )


def wheel_motion(
    mesh: Mesh,
    shape: np.ndarray,
    nodal_diameter: int,
) -> tuple[Skin, np.ndarray]:
    """The skin of the wheel and the complex displacement (n, 3) of its points."""
    wheel = wheel_skin(moving_bodies(mesh, shape))
    one = wheel.nodes[: len(wheel.nodes) // wheel_count(mesh)]
    return wheel, np.asarray(
        carry_round(mesh, shape[one] * best_phase(shape), nodal_diameter), dtype=complex
    )


def components(
    wheel: Skin,
    motion: np.ndarray,
    flat: bool = False,
) -> np.ndarray:
    """(n, 3) radial, circumferential and axial parts about the z axis; x, y and z for a flat
    row.
    """
    if flat:
        return motion
    angle = np.arctan2(wheel.points[:, 1], wheel.points[:, 0])
    cos = np.cos(angle)
    sin = np.sin(angle)
    return np.stack(
        [
            motion[:, 0] * cos + motion[:, 1] * sin,
            motion[:, 1] * cos - motion[:, 0] * sin,
            motion[:, 2],
        ],
        axis=1,
    )


def wheel_component(
    mesh: Mesh,
    wheel: Skin,
    motion: np.ndarray,
) -> tuple[str, np.ndarray]:
    """The strongest component of the motion, scaled to a largest value of 1."""
    parts = components(wheel, motion, flat=mesh.sector is not None and mesh.sector.count == 0)
    which = int(np.argmax(np.sum(np.abs(parts) ** 2, axis=0)))
    return COMPONENTS[which], parts[:, which] / max(np.abs(parts[:, which]).max(), 1e-300)


def draw_wheel_mode(
    mesh: Mesh,
    modes: ModeSet,
    number: int,
    file: str | Path | None = None,
    *,
    family: str = "",
) -> object:
    """A mode on the full wheel: one signed component in colour, its nodal lines in black; returns
    the figure.

    Args:
        mesh: one sector.
        modes: shapes on the nodes of ``mesh``.
        number: which mode, counted from 0.
        file: PNG to write.
        family: name of the mode family, shown in the title.
    """
    wheel, motion = wheel_motion(mesh, modes.shapes[number], modes.nodal_diameter or 0)
    name, signed = wheel_component(mesh, wheel, motion)
    moved = wheel.points + scale_of(mesh, modes.shapes[number]) * motion.real
    surface = polydata(wheel, moved)
    surface.point_data["signed"] = signed.real
    parts: list[dict[str, Any]] = [
        {
            "mesh": surface,
            "scalars": "signed",
            "cmap": DIVERGING_COLOURS,
            "clim": (-1, 1),
            **hidden_faces(mesh),
        }
    ]
    surface.point_data["envelope"] = np.abs(signed)
    # Where nothing moves (the clamp) the sign is noise, not a nodal line.
    lines = surface.contour([0.0], scalars="signed").threshold(
        NEGLIGIBLE_DISPLACEMENT_SHARE, scalars="envelope"
    )
    marked = ""
    if lines.n_points:
        marked = "; black: nodal lines"
        lines.points += 2e-3 * np.ptp(moved[:, 0]) * np.asarray(WHEEL_VIEW)
        parts.append({"mesh": lines, "color": "black", "line_width": 2.2, "lighting": False})
    direction, up = wheel_camera(mesh)
    image = photograph(parts, direction, up, WHEEL_PIXELS, fine=True)
    with canvas(file, size=size_for(image, margin=1.0)) as ax:
        show_photograph(ax, image)
        headline(ax.figure, mode_title(modes, number, family))
        add_colour_bar(
            ax,
            Normalize(-1, 1),
            DIVERGING_COLOURS,
            f"{name} displacement over its largest value [1]",
        )
        say_exaggeration(ax, mesh, modes, marked)
        return ax.figure


def hidden_faces(mesh: Mesh) -> dict[str, str]:
    """Options of ``Plotter.add_mesh`` for a whole wheel: faces that look away are behind others,
    and not to draw them spares a third of the time; a row without end is open at its ends.
    """
    closed = mesh.dimension == 3 and (mesh.sector is None or mesh.sector.count > 0)
    return {"culling": "back"} if closed else {}


def wheel_camera(mesh: Mesh) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Direction and up for a wheel; a flat row is seen along z."""
    return (
        (WHEEL_VIEW, (0.0, 1.0, 0.0))
        if mesh.dimension == 3
        else (view_of(mesh, FRONT_VIEW), RADIAL_DIRECTION)
    )


def animate_wave(
    mesh: Mesh,
    modes: ModeSet,
    number: int,
    file: str | Path,
    *,
    family: str = "",
    frames: int = 16,
    pixels: int = 480,
    forward: bool = False,
) -> Path:
    """Write an endless GIF of one period: a travelling wave for complex modes, a standing one for
    real modes.

    Args:
        mesh: one sector.
        modes: shapes on the nodes of ``mesh``.
        number: which mode, counted from 0.
        file: GIF to write.
        family: name of the mode family, shown in the title.
        frames: pictures in one period.
        pixels: width and height.
        forward: the wave runs in the sense in which the blades are counted, that of rotation, as
            those of engine orders above half their number do; else against it.
    """
    import matplotlib
    from PIL import Image, ImageDraw, ImageFont

    face = str(Path(matplotlib.get_data_path(), "fonts/ttf/DejaVuSans.ttf"))
    font, small = (ImageFont.truetype(face, max(pixels // k, 9)) for k in (34, 42))
    pictures = []
    for image in wave_frames(mesh, modes, number, frames, pixels, forward):
        picture = Image.fromarray(image)
        ImageDraw.Draw(picture).text(
            (10, 8), mode_title(modes, number, family), fill="black", font=font
        )
        ImageDraw.Draw(picture).text(
            (10, pixels - 2 * font.size), exaggeration(mesh), fill="#555555", font=small
        )
        pictures.append(picture)
    # at opposite phases all colours are seen
    both = Image.fromarray(np.hstack([pictures[0], pictures[frames // 2]]))
    palette = both.quantize(WAVE_COLOURS)
    pictures = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(
        file,
        save_all=True,
        append_images=pictures[1:],
        duration=1600 // frames,
        loop=0,
        optimize=True,
    )
    return Path(file)


def wave_frames(
    mesh: Mesh,
    modes: ModeSet,
    number: int,
    frames: int,
    pixels: int,
    forward: bool = False,
) -> Iterator[np.ndarray]:
    """(pixels, pixels, 3) pictures of Re(u e^{j 2 pi k / frames}), k = 0.. frames - 1; of a forward
    wave with the opposite sign of time.
    """
    wheel, motion = wheel_motion(mesh, modes.shapes[number], modes.nodal_diameter or 0)
    _, signed = wheel_component(mesh, wheel, motion)
    factor = scale_of(mesh, modes.shapes[number])
    surface = polydata(wheel, wheel.points.copy())
    surface.point_data["signed"] = signed.real
    size = (pixels, pixels)
    plotter = open_plotter(enlarged(size), smooth=False)
    plotter.add_mesh(
        surface,
        scalars="signed",
        cmap=DIVERGING_COLOURS,
        clim=(-1, 1),
        **RENDER_OPTIONS,
        **hidden_faces(mesh),
    )
    aim_camera(plotter, *wheel_camera(mesh), wheel.points, border=1.15)
    for k in range(frames):
        turn = np.exp((-2j if forward else 2j) * np.pi * k / frames)
        surface.points = wheel.points + factor * (motion * turn).real
        surface.point_data["signed"] = (signed * turn).real
        plotter.render()
        yield reduced(np.asarray(plotter.screenshot(return_img=True)), size)
    plotter.close()


def save_modes_vtu(
    mesh: Mesh,
    modes: ModeSet,
    file: str | Path,
    *,
    volume: bool = False,
) -> Path:
    """Write all shapes of a mode set on the full wheel (or on the body alone without a sector)."""
    count = len(modes.frequencies)
    return save_wheel_vtu(mesh, file, named_shapes(modes, count), modes.nodal_diameter or 0, volume)


def named_shapes(modes: ModeSet, count: int) -> dict[str, np.ndarray]:
    """The first shapes under the names that they have in files."""
    return {
        f"mode {i + 1}, {f:.6g} Hz [kg^-1/2]": modes.shapes[i]
        for i, f in enumerate(modes.frequencies[:count])
    }
