"""Forced responses for a list of damper loads, and the design curve: resonance amplitude against load."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..hbm.api import free
from ..hbm.model import ReducedModel
from ..hbm.resonance import free_resonances
from ..hbm.solution import Solution
from ..hbm.sweep import size
from ..scene import Scene
from .choice import adapted, checked, estimated, peak_of
from .family import Family
from .joint import LoadCase
from .settings import Settings, restarted

Progress = Callable[[Iterable[Any], str], Iterable[Any]]

__all__ = ["Curve", "curve_of", "default_loads", "free_peak", "study_loads", "summary", "unwatched"]


def unwatched(items: Iterable[Any], label: str = "") -> Iterable[Any]:
    """The progress display that shows nothing."""
    return items


@dataclass(frozen=True)
class Curve:
    """A frequency response; points in ascending frequency, unconverged ones included and marked."""

    load: float                 # [N]
    settings: Settings          # with the estimated error at the resonance
    frequency: np.ndarray       # (k,) [Hz]
    amplitude: np.ndarray       # (k,) root of the sum of squares of the harmonics at the probe [m]
    first: np.ndarray           # (k,) complex first harmonic at the probe [m]
    converged: np.ndarray       # (k,) bool
    method: np.ndarray          # (k,) text
    residual: np.ndarray        # (k,) relative residual of the balance
    iterations: np.ndarray      # (k,)
    slipping: np.ndarray        # (k,) number of elements that slip or lift off in a period
    dissipated: np.ndarray      # (k,) friction work a period [J]
    imbalance: np.ndarray       # (k,) |work put in - work lost| over work put in
    estimated: np.ndarray       # (k,) estimated relative error of the first harmonic
    tolerated: np.ndarray       # (k,) the same as wanted: the scene's accuracy times peak over amplitude
    checked: np.ndarray         # (k,) bool: estimated at this very point; else between its neighbours
    peak: Solution              # the highest converged point

    @property
    def peak_frequency(self) -> float:
        """[Hz]"""
        return self.peak.frequency

    @property
    def peak_amplitude(self) -> float:
        """[m]"""
        return size(self.peak)


def study_loads(scene: Scene, cases: list[LoadCase], family: Callable[[LoadCase], Family], settings: Settings,
                comm: Any = None, progress: Progress = unwatched) -> list[Curve]:
    """One response curve a load case, shared over the ranks; every rank returns all of them.

    Args:
        family: of a load case, its models.
        settings: modes and damper model to keep; each case then takes the rest from what its own curve needs.
        progress: wraps the list of cases of this rank, as tqdm does; the second argument is a label.
    """
    rank, ranks = (comm.rank, comm.size) if comm is not None else (0, 1)
    curves = {i: curve_of(scene, cases[i].load, family(cases[i]), settings)
              for i in progress(range(rank, len(cases), ranks), "forced responses")}
    for part in comm.allgather(curves) if ranks > 1 else []:
        curves.update(part)
    return [curves[i] for i in range(len(cases))]


def curve_of(scene: Scene, load: float, family: Family, settings: Settings) -> Curve:
    """Sweep a band with points where the curve needs them, with settings that hold at its peak and on its flanks.

    Raises:
        NotSolvedError: no point converged.
    """
    curve = adapted(family, restarted(settings), scene.study.band, scene.excitation.mode, scene.accuracy,
                    fixed=("modes",))
    top = peak_of(curve.points)
    heights = np.array([size(p) for p in curve.points])
    tolerated = scene.accuracy * size(top) / np.maximum(heights, 1e-6 * size(top))
    return Curve(load, curve.settings, *(np.array(c) for c in zip(*map(_record, curve.points), strict=True)),
                 estimated(curve), tolerated, checked(curve), top)


def _record(p: Solution) -> tuple[object, ...]:
    return (p.frequency, size(p), p.probe[1, 0], p.converged, p.method, p.residual, p.iterations,
            p.states["slip"] + p.states["lift"], p.work.dissipated, p.work.imbalance)


def summary(curves: list[Curve], undamped: float) -> dict[str, np.ndarray]:
    """The design table: one row a load.

    Args:
        undamped: resonance amplitude without damper [m].
    """
    return {
        "load": np.array([c.load for c in curves]),
        "peak_frequency": np.array([c.peak_frequency for c in curves]),
        "peak_amplitude": np.array([c.peak_amplitude for c in curves]),
        "reduction": undamped / np.array([c.peak_amplitude for c in curves]),
        "dissipated": np.array([c.peak.work.dissipated for c in curves]),
        "slipping": np.array([c.peak.states["slip"] + c.peak.states["lift"] for c in curves]),
        "error": np.array([np.nan if c.settings.error is None else c.settings.error for c in curves]),
        "harmonics": np.array([c.settings.harmonics for c in curves]),
        "points": np.array([len(c.frequency) for c in curves]),
        "unconverged": np.array([int((~c.converged).sum()) for c in curves]),
    }


def default_loads(scene: Scene, count: int = 8) -> tuple[float, ...]:
    """Loads when none are given: three decades round the force at which friction can hold the excitation."""
    held = scene.excitation.force / max(scene.contact.mu, 1e-3)
    return tuple(float(f"{x:.2g}") for x in np.geomspace(held, 300 * held, count))


def free_peak(model: ReducedModel, mode: int) -> tuple[float, float]:
    """Resonance without damper: frequency [Hz] and amplitude [m] of the first harmonic at the probe."""
    omega = free_resonances(model)[mode - 1]
    near = omega * np.linspace(0.995, 1.005, 401)
    heights = np.array([abs(free(model, w)[1, 0]) for w in near])
    return near[heights.argmax()] / (2 * np.pi), float(heights.max())
