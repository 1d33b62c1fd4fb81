"""A run folder opened again: results as labelled arrays that plot themselves.

``bladefem.open("runs/wedge")`` reads nothing but the scene; each result is read when it is first
asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from html import escape
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..data import ModeSet
from ..errors import InputError
from ..io.stage_cache import read_results
from ..io.stored_stage import stored_stage
from ..scene.tables import Scene
from ..scene.toml import load_scene
from ..scene.units import newtons
from ..study.pipeline.seated_loads import seating_stage
from ..util.nodal_diameter import excited_diameter
from ..util.picture_files import PICTURES
from ..view import contact, hysteresis, modes, response
from .tables import COLUMNS

if TYPE_CHECKING:
    import xarray as xr

    from geometry.mesh import Mesh

    from ..data import Patch


@dataclass(frozen=True, repr=False)
class Arrays:
    """Labelled arrays of one kind of result, and their picture.

    ``sel`` and ``isel`` choose by label or number and keep the picture; ``data`` is the xarray
    Dataset itself; ``["name"]`` is one of its arrays.
    """

    # "response", "modes", ...
    name: str
    data: xr.Dataset
    # draws the data into a file or axes
    draw: Callable[..., object]

    def sel(self, **labels: Any) -> Arrays:
        """The part with these labels, numbers to the nearest one within one in a thousand."""
        return Arrays(self.name, _selected(self.data, labels), self.draw)

    def isel(self, **numbers: Any) -> Arrays:
        """The part with these numbers, which count from 0."""
        kept = {key: [n] if np.ndim(n) == 0 else n for key, n in numbers.items()}
        return Arrays(self.name, self.data.isel(kept), self.draw)

    def __getitem__(self, name: str) -> Any:
        return self.data[name]

    def plot(self, file: str | Path | None = None, **options: Any) -> object:
        """The picture, written to a file where one is named; returns the matplotlib figure.

        Raises:
            InputError: a file that is no picture, or a label that the results do not have.
        """
        if file is not None and Path(file).suffix.lower() not in PICTURES:
            raise InputError(
                f"plot: '{file}', expected a file name that ends with {' or '.join(PICTURES)}"
            )
        return self.draw(self.data, file, **options)

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} {size}" for name, size in self.data.sizes.items())
        return f"<bladefem {self.name}: {', '.join(map(str, self.data.data_vars))} over {sizes}>"

    def _repr_html_(self) -> str:
        return f"<b>{escape(self.name)}</b>{self.data._repr_html_()}"


def _selected(data: xr.Dataset, labels: dict[str, Any]) -> xr.Dataset:
    """Dimensions stay, so that pictures and tables keep their form."""
    for name, label in labels.items():
        if name not in data.indexes:
            raise InputError(f"sel: no dimension '{name}', expected one of {list(data.indexes)}")
        index = data.indexes[name]
        wanted = [label] if np.ndim(label) == 0 and not isinstance(label, slice) else label
        if not isinstance(wanted, slice) and index.dtype.kind == "f":
            wanted = [_nearest(name, index.to_numpy(), float(one)) for one in wanted]
        try:
            data = data.sel({name: wanted})
        except KeyError:
            raise InputError(
                f"sel: {name} = {label!r} is not there, expected one of {list(index)}"
            ) from None
    return data


def _nearest(
    name: str,
    known: np.ndarray,
    wanted: float,
) -> float:
    """The label that is meant, round-off apart."""
    same = known[np.isclose(known, wanted, rtol=1e-3, atol=0.0)]
    if not len(same):
        shown = ", ".join(f"{value:.6g}" for value in known[:20])
        raise InputError(f"sel: {name} = {wanted:g} is not there, expected one of {shown}")
    return float(same[np.argmin(abs(same - wanted))])


@dataclass(frozen=True, repr=False)
class RunFolder:
    """The results of a run; see :func:`open_run`."""

    folder: Path
    scene: Scene

    @cached_property
    def response(self) -> Arrays:
        """Amplitude and phase over (load, frequency); ``.plot()`` draws the curves, with what the
        table of points knows of branches, stability and marches.
        """
        draw = partial(_draw_response, self._points)
        return Arrays("response", self.group("response"), draw)

    @cached_property
    def _points(self) -> pd.DataFrame | None:
        """One row a response point; None where the results have no such table."""
        try:
            return self.group("points").to_dataframe()
        except InputError:
            return None

    @cached_property
    def resonance(self) -> Arrays:
        """Harmonics of the motion at each resonance over (load, harmonic)."""
        return Arrays("resonance", self.group("resonance"), _draw_resonance)

    @cached_property
    def contact(self) -> Arrays:
        """Static pressure, force and gap over (load, contact); ``.plot()`` draws one load."""
        maps = self.group("contact")
        return Arrays("contact", maps, self._draw_contact)

    @cached_property
    def cycle(self) -> Arrays:
        """Stick, slip, separation and friction work at each resonance over (load, node)."""
        return Arrays("cycle", self.group("cycle"), _draw_cycle)

    @cached_property
    def loops(self) -> Arrays:
        """Hysteresis at each resonance over (load, seat, phase)."""
        return Arrays("loops", self.group("loops"), _draw_loops)

    @cached_property
    def modes(self) -> Arrays:
        """Frequencies and shapes over (nodal_diameter, mode, node, direction)."""
        return Arrays("modes", self.group("modes"), self._draw_modes)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """One row a load: resonance, amplitude, friction work, estimated error (SI)."""
        return self.group("summary").to_dataframe().reset_index(drop=True)

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh."""
        return stored_stage(self.folder, "mesh")

    def group(self, name: str) -> xr.Dataset:
        """A group of ``results.nc`` as an xarray Dataset.

        Raises:
            InputError: the run has no such results.
        """
        file = self.folder / "results.nc"
        if name == "modes" and not file.is_file():
            file = self.folder / "modes.nc"
        return read_results(file, name)

    def __repr__(self) -> str:
        return f"<bladefem run '{self.folder}': {self.scene.title} ({self.scene.kind})>"

    def _repr_html_(self) -> str:
        """The design table, where there is one."""
        head = f"<b>{escape(self.scene.title)}</b> ({escape(self.scene.kind)})"
        try:
            table = self.summary
        except InputError:
            return f"{head}<br>{escape(str(self.folder))}: no responses"
        shown = [name for name in SHOWN_COLUMNS if name in table]
        titles = {
            name: f"{COLUMNS[name].title} [{COLUMNS[name].shown or COLUMNS[name].unit}]"
            for name in shown
        }
        scaled = table[shown] * [COLUMNS[name].factor for name in shown]
        return head + scaled.rename(columns=titles).to_html(index=False, float_format="%.5g")

    def _draw_contact(
        self,
        data: xr.Dataset,
        file: str | Path | None = None,
        load: float | None = None,
    ) -> object:
        """Both seats under one load, the middle one when none is named."""
        loads = data["load"].to_numpy()
        chosen = loads[len(loads) // 2] if load is None else _nearest("load", loads, load)
        part = data.sel(load=[chosen]).isel(load=0)
        stored = _patches(self.scene, self.folder)
        maps, start = [], 0
        for patch in stored:
            rows = slice(start, start + len(patch.area))
            start = rows.stop
            force, gap = part["force"].to_numpy()[rows], part["gap"].to_numpy()[rows]
            maps.append(contact.PressureMap(patch, force, gap, 0.0))
        title = f"contact pressure under {newtons(chosen)} per seat"
        return contact.draw_pressure(maps, file, title=title)

    def _draw_modes(
        self,
        data: xr.Dataset,
        file: str | Path | None = None,
        mode: int = 1,
        nodal_diameter: int | None = None,
    ) -> object:
        """One mode on the sector, of the excited nodal diameter when none is named."""
        part, single = self._modes_of(data, "plot", mode, nodal_diameter)
        shapes = ModeSet(
            part["frequency"].to_numpy(),
            part["shape"].to_numpy(),
            single,
            part["residual"].to_numpy(),
        )
        return modes.draw_mode(self.mesh, shapes, mode - 1, file)

    def mode_shape(self, mode: int = 1, nodal_diameter: int | None = None) -> pd.DataFrame:
        """The shape of one mode as a table, a row a node, for a spreadsheet or another program.

        Args:
            mode: number from 1.
            nodal_diameter: the excited one when left out.

        Returns:
            columns "x [m]", "y [m]", "z [m]", the places of the points of ``mesh.vtu``, and
            "ux real", "ux imaginary", ... over the largest displacement of a node in the sector or
            body (1); real where that node moves most. ``attrs`` has frequency [Hz] and
            nodal_diameter.

        Raises:
            InputError: the run has no such mode.
        """
        part, single = self._modes_of(self.modes.data, "mode_shape", mode, nodal_diameter)
        one = part.isel(mode=mode - 1)
        shape = one["shape"].to_numpy()
        length = np.linalg.norm(shape, axis=1)
        # the displacement of a node is an ellipse; its longest direction is in the larger part
        largest = shape[length.argmax()]
        turned = shape * np.exp(-1j * np.angle(np.sum(largest**2)) / 2) / length.max()
        table = pd.DataFrame(one["position"].to_numpy(), columns=["x [m]", "y [m]", "z [m]"])
        for k, axis in enumerate("xyz"):
            table[f"u{axis} real"] = turned[:, k].real
            table[f"u{axis} imaginary"] = turned[:, k].imag
        table.attrs = {"frequency": float(one["frequency"]), "nodal_diameter": single}
        return table

    def _modes_of(
        self, data: xr.Dataset, asked: str, mode: int, nodal_diameter: int | None
    ) -> tuple[xr.Dataset, int | None]:
        """The modes of one nodal diameter, the excited one when none is named, with its number;
        None for a body without a wheel.

        Raises:
            InputError: no such mode or nodal diameter; begins with what was asked for.
        """
        known = data["nodal_diameter"].to_numpy()
        wanted = nodal_diameter
        if wanted is None:
            order = self.scene.excitation.engine_order
            sectors = 0 if self.mesh.sector is None else self.mesh.sector.count
            excited = excited_diameter(order, sectors) if sectors else order
            wanted = min(known, key=lambda n: abs(n - excited))
        # the modes of a body without cyclic faces are stored under -1
        listed = [int(n) for n in known if n >= 0]
        if nodal_diameter is not None and not (_is_whole(wanted) and wanted in listed):
            one = f"one of {', '.join(map(str, listed))}"
            raise InputError(
                f"{asked}: nodal_diameter = {_as_given(wanted)} is not there, expected "
                f"{one if listed else 'it to be left out: no wheel'}"
            )
        part = data.sel(nodal_diameter=wanted)
        if not (_is_whole(mode) and 1 <= mode <= part.sizes["mode"]):
            raise InputError(
                f"{asked}: mode = {_as_given(mode)}, expected a whole number from 1 to "
                f"{part.sizes['mode']}"
            )
        return part, None if wanted < 0 else int(wanted)


SHOWN_COLUMNS = (
    "load",
    "mass",
    "peak_frequency",
    "peak_amplitude",
    "reduction",
    "dissipated",
    "error",
)


def open_run(folder: str | Path) -> RunFolder:
    """The results in the folder of an earlier run.

    Raises:
        InputError: the folder holds no run.

    >>> import tempfile
    >>> from bladefem.scene.toml import dump_scene
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "scene.toml").write_text(dump_scene(Scene(title="A wheel")))
    ...     open_run(folder).scene.title
    'A wheel'
    """
    folder = Path(folder)
    if not (folder / "scene.toml").is_file():
        raise InputError(f"{folder}: no scene.toml in it, expected the folder of an earlier run")
    return RunFolder(folder, load_scene(folder / "scene.toml"))


def _is_whole(value: object) -> bool:
    """Whether a number counts; True and False do not."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def _as_given(value: object) -> str:
    """A count plainly, other values as Python writes them: '1' in quotes is none."""
    return str(value) if _is_whole(value) else repr(value)


def _patches(scene: Scene, folder: Path) -> list[Patch]:
    """Contact patches of the stored seating."""
    return list(stored_stage(folder, seating_stage(scene)).patches)


def _draw_response(
    points: pd.DataFrame | None,
    data: xr.Dataset,
    file: str | Path | None = None,
    **options: Any,
) -> object:
    """Curves of one damper mass, the first where there are several.

    Args:
        points: table of all points, with columns that the arrays do not have.
    """
    table = data.to_dataframe().reset_index() if points is None else points
    if "mass" in data.dims:
        mass = float(data["mass"][0])
        table = table[table["mass"].isna() | (table["mass"] == mass)]
    table = table[table["load"].isin(data["load"].to_numpy())]
    table = table[table["frequency"].isin(data["frequency"].to_numpy())]
    table = table[table["converged"].notna()].copy()
    table["converged"] = table["converged"].astype(bool)
    return response.draw_responses(table, file, **options)


def _draw_resonance(
    data: xr.Dataset,
    file: str | Path | None = None,
    ax: Any = None,
) -> object:
    """Amplitude of each harmonic, a line a load."""
    with response.canvas(file, ax) as ax:
        if "mass" in data.dims:
            data = data.isel(mass=0)
        for load in data["load"].to_numpy():
            part = abs(data["motion"].sel(load=load)).dropna("harmonic")
            label = response.load_name(float(load))
            ax.semilogy(part["harmonic"], 1e6 * part, "o-", label=label)
        response.log_axis(ax, "y")
        ax.xaxis.get_major_locator().set_params(integer=True)
        ax.set(xlabel="harmonic", ylabel="amplitude [µm]", title="harmonics at the resonance")
        ax.legend()
        return ax.figure


def _draw_cycle(
    data: xr.Dataset,
    file: str | Path | None = None,
    ax: Any = None,
) -> object:
    """Mean shares of the period in stick, slip and separation over load, weighted by area."""
    with response.canvas(file, ax) as ax:
        if "mass" in data.dims:
            data = data.isel(mass=0)
        for name in ("stick", "slip", "separated"):
            share = data[name].weighted(data["area"]).mean("node")
            ax.plot(data["load"], 100 * share, "o-", label=name)
        ax.set(
            xlabel="normal load per seat [N]",
            ylabel="share of period and area [%]",
            title="what the seats do at the resonance",
        )
        ax.legend()
        return ax.figure


def _draw_loops(data: xr.Dataset, file: str | Path | None = None) -> object:
    """A panel a load."""
    if "mass" in data.dims:
        data = data.isel(mass=0)
    cases = {}
    for load in data["load"].to_numpy():
        part = data.sel(load=load)
        cases[newtons(load, 4)] = {
            f"{seat} seat": (
                part["displacement"].sel(seat=seat).to_numpy(),
                part["force"].sel(seat=seat).to_numpy(),
            )
            for seat in data["seat"].to_numpy()
        }
    return hysteresis.draw_seat_loops(cases, file)
