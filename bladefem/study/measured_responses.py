"""Measured responses of a scene's blade, from a file, and the contact that fits them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError, missing_file
from ..scene.fields import field_at
from ..scene.tables import Scene
from ..scene.toml import vary
from ..scene.units import parse, show
from ..util.arrays import RealArray
from ..util.communicator import Communicator
from ..util.csv_text import csv_lines
from ..util.progress import Progress, without_progress
from .adaptive.settings import Settings
from .contact_identification import CONTACT_PARAMETERS, ContactFit, MeasuredLevel, fit_contact
from .fit_intervals import MAX_LOG_HALF_WIDTH
from .measured_models import MeasuredModels, Readings, first_fit_settings, measured_models
from .pipeline import pipeline
from .pipeline.run_records import ReducedRun
from .pipeline.stage_runner import Folder

# column of the file to the unit inside; the first two may be left out for those of the scene
COLUMNS = {"load": "N", "force": "N", "frequency": "Hz", "amplitude": "m"}
OPTIONAL_COLUMNS = ("load", "force")
EXAMPLES = {
    "load": "load [N]",
    "force": "force [N]",
    "frequency": "frequency [Hz]",
    "amplitude": "amplitude [um]",
}
# of the half width of an interval by the readings: up to such a shift by a richer model the
# interval is widened, beyond it a richer model is fitted
ENOUGH_SHIFT = 0.5
# parameter: fields of [contact] and of its seats that it scales
SCALED_FIELDS = {
    "mu": ("mu",),
    "kt": ("kt_area", "kt"),
    "kn": ("kn_area", "kn"),
    "stiffness": ("kt_area", "kt", "kn_area", "kn"),
}
# fits with richer models, each of which begins where the last one ended
MOST_ENRICHMENTS = 4
# of the size of the sector: largest amplitude of which a linear elastic blade is a model
LARGEST_AMPLITUDE = 0.05


@dataclass(frozen=True)
class FittedField:
    """A field that the scene gives and that a fitted parameter scales."""

    # under [contact]: "mu", "left.kt_area"; empty for the load of the readings
    name: str
    # number of the parameter
    parameter: int
    # fitted value and ends of its interval [SI]
    value: float
    low: float
    high: float
    # SI
    unit: str
    # ends of the values that a scene takes [SI]
    allowed: tuple[float, float]

    @property
    def allows(self) -> bool:
        """A scene takes the fitted value."""
        return self.allowed[0] <= self.value <= self.allowed[1]


@dataclass(frozen=True)
class FittedScene:
    """A scene's contact by measured responses."""

    run: ReducedRun
    readings: Readings
    fit: ContactFit
    # relative error of an amplitude that was assumed
    error: float
    # (k,) by the contact of the scene as it is, and by the fitted one [m]; NaN where not solved
    before: RealArray
    fitted: RealArray
    # the model that was fitted
    settings: Settings

    @property
    def fields(self) -> list[FittedField]:
        """Fields that the scene gives and that a fitted parameter scales."""
        contact = self.run.scene.contact
        seats = {"": contact, "left.": contact.left, "right.": contact.right}
        # both seats have a friction coefficient of their own: none has that of [contact]
        unused = "mu" if contact.left.mu is not None and contact.right.mu is not None else ""
        return [
            self._field(number, seat + field, value)
            for number, name in enumerate(self.fit.names)
            for field in SCALED_FIELDS.get(name, ())
            for seat, values in seats.items()
            if seat + field != unused and (value := getattr(values, field)) is not None
        ]

    @property
    def absolute_values(self) -> list[FittedField]:
        """The fields, and the normal load where all readings have the same one."""
        loads = np.unique(self.readings.load)
        if "load" not in self.fit.names or len(loads) > 1:
            return self.fields
        number = self.fit.names.index("load")
        load = float(loads[0])
        low, high = (float(end) * load for end in self.fit.knowledge.intervals[number])
        fitted = float(self.fit.factors[number]) * load
        return [*self.fields, FittedField("", number, fitted, low, high, "N", (0.0, np.inf))]

    def _field(self, number: int, name: str, value: float) -> FittedField:
        meta = field_at(f"contact.{name}").meta
        ends = self.fit.knowledge.intervals[number]
        low, high = (float(end) * value if value else 0.0 for end in ends)
        fitted = float(self.fit.factors[number]) * value
        return FittedField(
            name, number, fitted, low, high, meta["unit"], (meta["low"], meta["high"])
        )

    @property
    def scene_values(self) -> dict[str, float]:
        """Field under [contact] to its fitted value [SI], of those that the readings determine and
        that a scene takes.
        """
        known = self.fit.knowledge.known
        return {one.name: one.value for one in self.fields if known[one.parameter] and one.allows}

    @property
    def sector_size(self) -> float:
        """Diagonal of the box round the meshed bodies [m]."""
        return _size_of(self.run)


def _size_of(run: ReducedRun) -> float:
    return float(np.linalg.norm(np.ptp(run.mesh.points, axis=0)))


def _positive_numbers(row: list[str], count: int, path: Path) -> list[float]:
    """The cells of one row.

    Raises:
        InputError: they are not so many positive numbers.
    """
    try:
        numbers = [float(cell) for cell in row]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(0 < number < np.inf for number in numbers):
        raise InputError(
            f"--measured {path}: row '{', '.join(row)}', expected {count} positive numbers in each "
            "row"
        )
    return numbers


def read_readings(path: str | Path, scene: Scene) -> Readings:
    """A CSV file with the columns of COLUMNS, each with its unit: "frequency [Hz]"; "#" starts a
    comment.

    Raises:
        InputError: the file is missing, or its columns are not those, have no unit or no positive
            numbers.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"--measured {path}: {missing_file(path)}")
    rows = csv_lines(path, f"--measured {path}")
    cells = [[cell.strip() for cell in row.split(",")] for row in rows if row]
    if len(cells) < 2:
        raise InputError(f"--measured {path}: expected a row of names and readings")
    values = np.array([_positive_numbers(row, len(cells[0]), path) for row in cells[1:]])
    found = {}
    for head, column in zip(cells[0], values.T, strict=True):
        name, _, unit = (part.strip(" ]") for part in head.partition("["))
        if name not in COLUMNS:
            raise InputError(
                f"--measured {path}: column '{head}', expected {', '.join(COLUMNS)}, each with "
                "its unit: 'amplitude [um]'"
            )
        where = f"--measured {path}: column '{head}'"
        if not unit:
            # a plain number is SI elsewhere; readings are in micrometres more often than in metres
            raise InputError(f"{where} has no unit, expected one, such as '{EXAMPLES[name]}'")
        found[name] = parse(f"1 {unit}", COLUMNS[name], where) * column
    missing = [name for name in COLUMNS if name not in found and name not in OPTIONAL_COLUMNS]
    if missing:
        raise InputError(f"--measured {path}: expected a column '{EXAMPLES[missing[0]]}'")
    if "load" not in found:
        found["load"] = np.full(len(values), _only_load(scene, path))
    found.setdefault("force", np.full(len(values), scene.excitation.force))
    return Readings(**found)


def _only_load(scene: Scene, path: Path) -> float:
    loads = scene.study.loads or ()
    if len(loads) != 1:
        raise InputError(
            f"--measured {path}: no column 'load [N]', expected it, or one load in study.loads"
        )
    return float(loads[0])


def check_parameters(names: Sequence[str], scene: Scene) -> None:
    """Parameters that no scene or that this scene does not have are refused, before any work.

    Raises:
        InputError: the first of them, with what was expected.
    """
    given = ", ".join(names)
    unknown = [name for name in names if name not in CONTACT_PARAMETERS]
    if unknown:
        raise InputError(
            f"--parameters {given}: '{unknown[0]}' is no parameter, expected some of "
            f"{', '.join(CONTACT_PARAMETERS)}"
        )
    if len(set(names)) < len(names):
        raise InputError(f"--parameters {given}: one is given twice, expected each once")
    if {"kt", "kn"} & set(names) and "stiffness" in names:
        raise InputError(
            f"--parameters {given}: 'stiffness' is both kt and kn, expected it or these"
        )
    if {"kt", "kn"} & set(names) and not _gives_both_stiffnesses(scene):
        raise InputError(
            f"--parameters {given}: one stiffness follows the other in this scene, expected "
            "'stiffness', or both contact.kt_area and contact.kn_area in the scene"
        )


def fit_scene(
    scene: Scene,
    readings: Readings,
    names: Sequence[str],
    error: float,
    folder: Folder = None,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> FittedScene:
    """The contact of a scene that comes closest to measured amplitudes at its probe.

    Args:
        names: of the parameters to fit, see `contact_identification`; empty for all that the
            scene has.
        error: relative error of a measured amplitude.

    Raises:
        InputError: the scene, the readings or the names cannot be used.
    """
    if len(scene.study.masses or ()) > 1:
        raise InputError(
            f"study.masses: {len(scene.study.masses or ())} damper masses, expected one for "
            "'bladefem fit'"
        )
    check_parameters(names, scene)
    loads = tuple(float(load) for load in np.unique(readings.load))
    run = pipeline.run(vary(scene, study__loads=loads), folder, "reduction", comm, progress)
    _refuse_amplitudes(readings, _size_of(run))
    models = measured_models(run, readings)
    settings = first_fit_settings(run.settings)
    levels, order = models.levels(settings)
    chosen = tuple(names) or _parameters_of(scene, levels)
    first = fit = _fitted(models, settings, chosen, error)
    for _ in range(MOST_ENRICHMENTS):
        more = _missing(models, settings, fit)
        if more is None:
            break
        settings = more
        fit = _fitted(models, settings, chosen, error, fit.factors)
    before, fitted = (np.empty(len(order)) for _ in range(2))
    before[order] = np.concatenate(first.before)
    fitted[order] = np.concatenate(fit.fitted)
    return FittedScene(run, readings, fit, error, before, fitted, settings)


def _refuse_amplitudes(readings: Readings, size: float) -> None:
    """Amplitudes that no blade has.

    Args:
        size: of the sector [m].

    Raises:
        InputError: one is larger than the sector.
    """
    largest = float(readings.amplitude.max())
    if largest > size:
        raise InputError(
            f"--measured: an amplitude of {show(largest, 'm')} is larger than the sector, "
            f"{show(size, 'm')}; expected amplitudes in the unit of their column"
        )


def _fitted(
    models: MeasuredModels,
    settings: Settings,
    names: tuple[str, ...],
    error: float,
    start: RealArray | None = None,
) -> ContactFit:
    """With a model of these settings, its intervals widened by what richer ones change."""
    levels, _ = models.levels(settings)
    richer = models.richer(settings)
    H, samples = settings.harmonics, settings.samples
    return fit_contact(levels, names, H, samples, error, richer, start)


def _missing(models: MeasuredModels, settings: Settings, fit: ContactFit) -> Settings | None:
    """Settings richer in what moves some parameter most, against its interval by the readings;
    None where nothing moves any by much, or no more can be had.
    """
    determined = fit.half_by_readings < MAX_LOG_HALF_WIDTH
    if not determined.any():
        return None
    sizes = {
        one.what: float((abs(one.shift) / fit.half_by_readings)[determined].max())
        for one in fit.left_out
        if one.widens
    }
    for what in sorted(sizes, key=sizes.__getitem__, reverse=True):
        if sizes[what] <= ENOUGH_SHIFT:
            break
        more = models.enriched(settings, what, sizes[what] / ENOUGH_SHIFT)
        if more is not None:
            return more
    return None


def _gives_both_stiffnesses(scene: Scene) -> bool:
    """Neither of them follows from the other by Mindlin."""
    return scene.contact.kt_area is not None and scene.contact.kn_area is not None


def _parameters_of(scene: Scene, levels: Sequence[MeasuredLevel]) -> tuple[str, ...]:
    """All that can be fitted: one stiffness where the scene gives the other by it."""
    if not _gives_both_stiffnesses(scene):
        return ("mu", "stiffness", "load")
    if all((level.model.elements.kn > 0).any() for level in levels):
        return ("mu", "kt", "kn", "load")
    return ("mu", "kt", "load")
