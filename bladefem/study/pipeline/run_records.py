"""What a run has found: one record for each stage that it reached.

A record holds results only, never a place for those still to come: a function that needs responses
takes a :class:`SolvedRun`, and whoever asks a shorter run for them gets one sentence that says so.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.mesh import Mesh

from ...contact.frictional_seating import FrictionalProblem
from ...contact.seating import ContactProblem
from ...data import ModeSet, PressureMap
from ...errors import InputError, StageMissingError
from ...scene.tables import Scene
from ...scene.units import newtons
from ..adaptive.settings import Settings
from ..influences import Influence
from ..modes.stress import Strength
from .best_load import BestLoad, studied_load
from .body_mesh import ModeErrors
from .curve import Curve
from .damped_motion import DampedStress
from .history import DamperMass
from .linear_limits import Limit
from .loads import best_curve
from .other_diameters import ClassVerdict
from .reduced_sector import Reduced

if TYPE_CHECKING:
    from ..mistuning.pattern_response import PatternResponse
    from .flutter import FlutterResult

# results of a run to the stage that finds them
STAGE_OF = {
    "mesh": "mesh",
    "modes": "modes",
    "clamped": "modes",
    "contact": "contact",
    "strength": "reduction",
    "settings": "reduction",
    "reduced": "reduction",
    "flutter": "response",
    "response": "response",
    "damped": "response",
    "wheel": "response",
}
# those that name a run when it is shown
SHOWN_RESULTS = ("mesh", "modes", "contact", "reduced", "response")


@dataclass(frozen=True)
class Seating:
    """The seated damper: the condensed problem, and the pressure of each load."""

    problem: ContactProblem
    # mean normal load of a seat [N] to the map of each patch
    maps: dict[float, list[PressureMap]]
    # that load by the damper's own mass at the operating speed [N]
    own: float | None = None
    # the damper that makes each load, where friction takes part in the seating
    masses: tuple[DamperMass, ...] = ()
    # all ports of the seats, where friction takes part in the seating
    rough: FrictionalProblem | None = None


@dataclass(frozen=True, repr=False)
class Response:
    """Forced responses and what they were made with."""

    settings: Settings
    curves: list[Curve]
    # no damper, and full stick of each mass of the damper
    limits: tuple[Limit, ...]
    # of each mass of the damper; empty where a single load was asked for
    best: tuple[BestLoad, ...] = ()
    # what the lowest of them depends on, the largest influence first
    influences: tuple[Influence, ...] = ()
    # number of a curve to the verdicts on its resonance against disturbances in nodal diameters
    # that its wave does not reach
    others: dict[int, tuple[ClassVerdict, ...]] = field(default_factory=dict)

    @property
    def free_peak(self) -> tuple[float, float]:
        """Resonance without damper: [Hz], [m]."""
        return self.limits[0].peak_frequency, self.limits[0].peak_amplitude

    @property
    def best_curve(self) -> int:
        """Number of the curve that the report begins with."""
        return best_curve(self.curves, self.best)

    @property
    def best_found(self) -> BestLoad | None:
        """The best load there, where it was searched and found."""
        there = self.curves[self.best_curve]
        found = (b for b in self.best if (studied_load(b), b.mass) == (there.load, there.mass))
        return next(found, None)

    def __repr__(self) -> str:
        best = min(self.curves, key=lambda curve: curve.peak_amplitude)
        return (
            f"<bladefem response: {len(self.curves)} loads, smallest resonance "
            f"{1e6 * best.peak_amplitude:.4g} µm under {newtons(best.load)}>"
        )


@dataclass(frozen=True, repr=False, kw_only=True)
class Run:
    """A run with its mesh; the records of later stages have more."""

    scene: Scene
    # None: in memory
    folder: Path | None
    mesh: Mesh
    # stage to seconds
    timings: dict[str, float] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)

    # Hidden from type checkers: to them a missing result is an error of the program.
    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Called for what this record does not have.

            Raises:
                StageMissingError: a result of a stage that the run did not reach.
            """
            if name not in STAGE_OF:
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
            raise StageMissingError(
                f"run of '{self.scene.title}': '{name}' is found by the stage "
                f"'{STAGE_OF[name]}', expected a run that reached it; this one has "
                f"{', '.join(_shown_results(self))}"
            )

    def __repr__(self) -> str:
        where = "in memory" if self.folder is None else f"in '{self.folder}'"
        stages = ", ".join(_shown_results(self))
        return f"<bladefem run of '{self.scene.title}' {where}: {stages}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the stages and what they found."""
        rows = {"scene": self.scene.title, "folder": self.folder}
        found = vars(self)
        rows |= {name: found[name] for name in ("mesh", "modes", "response") if name in found}
        cells = "".join(
            f"<tr><th>{name}</th><td>{escape(str(value))}</td></tr>" for name, value in rows.items()
        )
        return f"<table>{cells}</table>"


@dataclass(frozen=True, repr=False, kw_only=True)
class ModalRun(Run):
    """A run that has the normal modes without damper."""

    modes: list[ModeSet]
    # of the aerofoil held at its root, at rest; None where the blade is that itself
    clamped: ModeSet | None = None


@dataclass(frozen=True, repr=False, kw_only=True)
class SeatedRun(ModalRun):
    """A run that has the damper on its seats."""

    contact: Seating


@dataclass(frozen=True, repr=False, kw_only=True)
class ReducedRun(SeatedRun):
    """A run that has blade and damper reduced to their ports."""

    strength: Strength
    # of the balance, to start the responses from
    settings: Settings
    reduced: Reduced
    # of the stiffness, by the body's mesh
    mode_errors: ModeErrors
    # of the waves in the scene's flow; None without one
    flutter: FlutterResult | None = None


@dataclass(frozen=True, repr=False, kw_only=True)
class SolvedRun(ReducedRun):
    """A run that has its forced responses."""

    response: Response
    # number of a curve to the stress at its resonance: of the lowest one and of the own load
    damped: dict[int, DampedStress]
    # of each load; None where all blades are alike
    wheel: list[PatternResponse] | None = None


def folder_of(run: Run) -> Path:
    """The folder that results are written to.

    Raises:
        InputError: the run was made in memory.
    """
    if run.folder is None:
        raise InputError(
            f"run of '{run.scene.title}': it was made in memory, expected a folder for its files"
        )
    return run.folder


def _shown_results(run: Run) -> list[str]:
    return [name for name in SHOWN_RESULTS if name in vars(run)]
