"""One look for every picture: a matplotlib style, a colour-blind safe palette, and renderings
without a window.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.axis import Axis
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito, Color Universal Design (2008); yellow last because it is weak on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
SEQUENTIAL_COLOURS = "viridis"
# of seats, pale to purple: the black at the end of "inferno_r" hides marks, and prints an even
# pressure, which is the largest everywhere, as a black page
SEAT_COLOURS = ListedColormap(colormaps["inferno_r"](np.linspace(0.0, 0.7, 256)), "seats")
DIVERGING_COLOURS = "RdBu_r"
INK_COLOUR = "#222222"
# pixels of the window to one of the picture, along each side, in place of several samples a pixel
SUPERSAMPLING = 1.5
# of a rendering in its figure [inch]
RENDERING_HEIGHT = 5.2
WIDEST_RENDERING = 9.0
# round what a rendering shows [pixel]
BORDER = 12
# zlib's level: two thirds of the time of the usual one, 2 to 4 % more room
PNG_OPTIONS = {"compress_level": 4}
# mark of images that are renderings
PHOTOGRAPH = "photograph"
FAILED_COLOUR = "#d62728"
# from metres to micrometres
MICRO = 1e6
RENDER_OPTIONS = {"show_scalar_bar": False, "ambient": 0.42, "diffuse": 0.62, "specular": 0.05}

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.8,
    "axes.labelcolor": INK_COLOUR,
    "text.color": INK_COLOUR,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.7,
    "lines.markersize": 5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.dpi": 160,
    "savefig.dpi": 160,
    "savefig.facecolor": "white",
    "axes.prop_cycle": matplotlib.cycler(color=COLOURS),
    "image.cmap": SEQUENTIAL_COLOURS,
    "axes.formatter.useoffset": False,
}


@contextmanager
def canvas(
    file: str | Path | None = None,
    ax: Axes | None = None,
    size: tuple[float, float] = (7.2, 4.4),
    grid: tuple[int, int] = (1, 1),
    **subplots: Any,
) -> Iterator[Any]:
    """Axes in the common style: the caller's ``ax``, or a new figure saved to ``file`` at the end.

    Args:
        file: PNG (or any matplotlib format) to write; parent folders are made.
        ax: axes to draw into instead of a new figure.
        size: of a new figure [inch].
        grid: rows and columns of a new figure; more than one cell yields an array of axes.
        subplots: passed to ``Figure.subplots``.
    """
    own_figure = ax is None
    with matplotlib.rc_context(STYLE):
        if ax is None:
            ax = Figure(figsize=size, layout="constrained").subplots(*grid, **subplots)
        yield ax
        figure = np.ravel(ax)[0].figure
        # of a given place the rest of the figure is the caller's
        for drawn in [figure] if own_figure else np.ravel(ax):
            take_words_as_they_are(drawn)
        if file is not None:
            Path(file).parent.mkdir(parents=True, exist_ok=True)
            _settle_layout(figure)
            _fit_photographs(figure)
            quick = {"pil_kwargs": PNG_OPTIONS} if Path(file).suffix.lower() == ".png" else {}
            figure.savefig(file, **quick)


def _settle_layout(figure: Any) -> None:
    """Place what a figure holds now: while it is saved, matplotlib would draw it twice for that,
    pictures included.
    """
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine(None)


def _fit_photographs(figure: Any) -> None:
    """Bring renderings to the pixels that they are shown with: Pillow does it in a tenth of
    matplotlib's time.
    """
    for ax in figure.axes:
        for image in ax.get_images():
            if image.get_gid() != PHOTOGRAPH:
                continue
            ax.apply_aspect()
            box = ax.get_window_extent()
            extent = image.get_extent()
            pixels = max(round(box.width), 1), max(round(box.height), 1)
            image.set_data(resized(image.get_array(), pixels))
            image.set_extent(extent)
            image.set_interpolation("nearest")


def take_words_as_they_are(drawn: Any) -> None:
    """Titles, labels and legends of a figure, or of axes, hold the user's own words: a dollar sign
    in one is no formula.
    """
    for text in _texts(drawn):
        if "$" in text.get_text():
            text.set_parse_math(False)


def _texts(artist: Any) -> Iterator[Text]:
    """All texts of a figure but the numbers along its axes: those of logarithmic ones are formulas
    of matplotlib's own, and making them takes as long as the picture itself.
    """
    if isinstance(artist, Text):
        yield artist
    for child in artist.get_children():
        if isinstance(child, Axis):
            yield child.label
        else:
            yield from _texts(child)


def log_axis(
    ax: Axes,
    which: str,
    factor: float = 1.0,
) -> None:
    """A logarithmic "x" or "y" axis with plain numbers, times a factor, also at 2 and 5 when there
    are few decades.
    """
    axis = ax.xaxis if which == "x" else ax.yaxis
    (ax.set_xscale if which == "x" else ax.set_yscale)("log")
    low, high = axis.get_view_interval()
    few = 0 < low < high < 300 * low
    axis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{factor * x:g}"))
    axis.set_minor_formatter(NullFormatter())


def photograph(
    parts: list[dict[str, Any]],
    direction: tuple[float, float, float],
    up: tuple[float, float, float],
    size: tuple[int, int] = (1400, 1100),
    fine: bool = False,
) -> np.ndarray:
    """Render pyvista meshes without a window, in parallel projection, and cut away the white
    border.

    Args:
        parts: keyword arguments of ``Plotter.add_mesh``, one dict a mesh.
        direction: from the object to the eye.
        up: what points upwards in the picture.
        size: width and height before cropping [pixels].
        fine: drawn larger and reduced, in place of several samples a pixel: a third of the time
            where triangles are about as small as pixels.

    Returns:
        (rows, columns, 3) uint8.
    """
    plotter = open_plotter(enlarged(size) if fine else size, smooth=not fine)
    for part in parts:
        plotter.add_mesh(**{**RENDER_OPTIONS, **(enlarged_lines(part) if fine else part)})
    aim_camera(plotter, direction, up, np.concatenate([part["mesh"].points for part in parts]))
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return trim_border(reduced(image, size) if fine else image)


def enlarged(size: tuple[int, int]) -> tuple[int, int]:
    """The window [pixels] for a picture that is ``reduced`` to a size."""
    return round(SUPERSAMPLING * size[0]), round(SUPERSAMPLING * size[1])


def enlarged_lines(part: dict[str, Any]) -> dict[str, Any]:
    """Arguments of ``Plotter.add_mesh`` for a window that is ``enlarged``: lines as wide as in the
    picture.
    """
    if "line_width" not in part:
        return part
    return {**part, "line_width": SUPERSAMPLING * part["line_width"]}


def reduced(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture (rows, columns, 3) drawn larger, at its size (width, height) with smooth edges."""
    from PIL import Image

    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BILINEAR))


def resized(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture (rows, columns, 3) at another size (width, height), as sharp as it can be."""
    from PIL import Image

    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.LANCZOS))


def open_plotter(size: tuple[int, int], smooth: bool = True) -> Any:
    """A pyvista plotter on an off-screen EGL surface with the common theme.

    Args:
        smooth: several samples a pixel; without a graphics card they take three times as long where
            triangles are small, see ``reduced``.
    """
    # VTK reads this when it makes its first window: say EGL before, or it complains about a missing
    # X display.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    theme = pyvista.themes.DocumentTheme()
    theme.background = "white"
    theme.font.color = "black"
    plotter = pyvista.Plotter(
        off_screen=True, window_size=list(size), theme=theme, lighting="light kit"
    )
    if smooth:
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
    else:
        plotter.disable_anti_aliasing()
    return plotter


def screen_axes(
    direction: tuple[float, float, float], up: tuple[float, float, float]
) -> np.ndarray:
    """(3, 3) rows: rightwards and upwards in the picture, and towards the eye."""
    eye = np.asarray(direction, float) / np.linalg.norm(direction)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def aim_camera(
    plotter: Any,
    direction: tuple[float, float, float],
    up: tuple[float, float, float],
    points: np.ndarray,
    border: float = 1.04,
) -> None:
    """Look at ``points`` from ``direction`` in parallel projection, as large as the window
    allows.
    """
    axes = screen_axes(direction, up)
    low = (points @ axes.T).min(axis=0)
    high = (points @ axes.T).max(axis=0)
    width, height, depth = high - low
    centre = axes.T @ (0.5 * (low + high))
    plotter.camera_position = [centre + (depth + max(width, height)) * axes[2], centre, axes[1]]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = (
        0.5 * border * max(height, width * plotter.window_size[1] / plotter.window_size[0])
    )
    plotter.renderer.ResetCameraClippingRange()


def trim_border(image: np.ndarray) -> np.ndarray:
    """Cut the white border off a picture."""
    inked = np.any(image < 250, axis=2)
    rows = np.flatnonzero(inked.any(axis=1))
    columns = np.flatnonzero(inked.any(axis=0))
    if len(rows) == 0:
        return image
    top = max(rows[0] - BORDER, 0)
    left = max(columns[0] - BORDER, 0)
    return image[top : rows[-1] + BORDER + 1, left : columns[-1] + BORDER + 1]


def show_photograph(
    ax: Axes,
    image: np.ndarray,
    direction: tuple[float, float, float] | None = None,
    up: tuple[float, float, float] = (1.0, 0.0, 0.0),
) -> None:
    """Put a rendering on axes, with a small triad (x radial, y circumferential, z axial) when a
    direction is given.
    """
    ax.imshow(image, interpolation="lanczos").set_gid(PHOTOGRAPH)
    ax.set_axis_off()
    if direction is not None:
        figure = ax.figure
        place = ax.get_subplotspec()
        width = 0.75 / figure.get_figwidth()
        height = 0.75 / figure.get_figheight()
        left = place.colspan.start / place.get_gridspec().ncols
        draw_triad(figure.add_axes((left, 0.0, width, height)), direction, up)


def size_for(image: np.ndarray, margin: float) -> tuple[float, float]:
    """Figure size [inch] for a rendering RENDERING_HEIGHT tall, unless that is too wide, with a
    margin next to it and a line above and below.
    """
    rows, columns = image.shape[:2]
    height = min(RENDERING_HEIGHT, WIDEST_RENDERING * rows / columns)
    width = height * columns / rows
    return max(width + margin, 4.4), height + 0.8


def headline(figure: Any, text: str) -> None:
    """A title at the left edge of the figure, for pictures without axes."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=10.5, fontweight="bold")


def draw_triad(
    ax: Axes,
    direction: tuple[float, float, float],
    up: tuple[float, float, float],
) -> None:
    """The three axes as the camera sees them."""
    screen = screen_axes(direction, up)[:2]
    for axis, colour in zip(range(3), (COLOURS[1], COLOURS[2], COLOURS[0]), strict=True):
        tip = screen[:, axis]
        if np.linalg.norm(tip) < 0.15:
            continue
        ax.annotate(
            "", xy=tip, xytext=(0, 0), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.4}
        )
        ax.text(*(1.25 * tip), "xyz"[axis], color=colour, ha="center", va="center", fontsize=8)
    ax.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
    ax.patch.set_alpha(0.0)
    ax.set_axis_off()
