"""Nonlinear modes of a run's blade and damper: frequency and damping against amplitude for each
load, and the resonance that they predict next to that of the balance.

Damping by friction and frequency do not depend on the excitation. The resonance amplitude under a
force is where the damping that friction and blade give meets the one that the force needs,
|phi^H F| / (2 omega^2 a): a design map, read for any excitation of the same mode.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..hbm.model import ReducedModel
from ..hbm.nonlinear_modes import (
    force_at_resonance,
    modal_damping,
    modal_forces,
    nonlinear_mode,
)
from ..io.stage_cache import cached_stage, found_remark, on_root
from ..util.arrays import BooleanArray, RealArray
from ..util.communicator import Communicator
from ..util.progress import Progress, without_progress
from .adaptive.family import family_member
from .pipeline.case_models import family_of_case, load_cases
from .pipeline.curve import Curve
from .pipeline.run_records import SolvedRun
from .pipeline.stage_inputs import stage_key

# amplitudes of each load
AMPLITUDES_PER_LOAD = 40
# ends of the amplitudes over the lowest and the highest resonance of the run
LOWEST_AMPLITUDE_RATIO, HIGHEST_AMPLITUDE_RATIO = 0.03, 3.0


@dataclass(frozen=True)
class Backbone:
    """One nonlinear mode under one load; k amplitudes in the order of its branch, which ascend but
    between its folds.
    """

    # [N], and of the damper [kg]
    load: float
    mass: float | None
    # (k,) root of the sum of squares of the harmonics at the probe [m]
    amplitude: RealArray
    # (k,) [Hz]
    frequency: RealArray
    # (k,) shares of critical damping: by friction, and of blade and disc [1]
    friction: RealArray
    own: RealArray
    # (k,) force that keeps the motion up at its resonance, over the scene's [1]
    drive: RealArray
    converged: BooleanArray
    # (k,) the branch turns back in amplitude here
    fold: BooleanArray
    # resonance amplitude [m] and frequency [Hz] of the balance
    balance: tuple[float, float]
    # (k,) amplitudes of the blade mode alone at the probe [m], also of motions that were not found
    wanted: RealArray
    # why the first of those was not found; empty where all were
    lost: str

    @property
    def resonances(self) -> list[tuple[float, float]]:
        """Amplitudes [m] and frequencies [Hz] of the resonances under the scene's force, where
        `drive` rises through 1, in the order of the branch. The first ends the motions that grow
        from rest, later ones those that are detached from them: in between the force is too small.
        """
        known = np.flatnonzero(self.converged)
        enough = self.drive[known] <= 1
        tops = np.flatnonzero(enough[:-1] & ~enough[1:])
        return [self._crossing(known[k], known[k + 1]) for k in tops]

    @property
    def predicted(self) -> tuple[float, float]:
        """The first of the `resonances`; NaN where the amplitudes do not reach it."""
        return next(iter(self.resonances), (np.nan, np.nan))

    def _crossing(self, i: int, j: int) -> tuple[float, float]:
        """Amplitude [m] and frequency [Hz] where `drive` is 1 between two points."""
        share = -np.log(self.drive[i]) / np.log(self.drive[j] / self.drive[i])
        amplitude = self.amplitude[i] * (self.amplitude[j] / self.amplitude[i]) ** share
        frequency = self.frequency[i] + share * (self.frequency[j] - self.frequency[i])
        return float(amplitude), float(frequency)

    @property
    def error(self) -> float:
        """Relative difference of the predicted resonance amplitude from the balance's."""
        return self.predicted[0] / self.balance[0] - 1

    def response(self) -> tuple[np.ndarray, np.ndarray]:
        """Forced response by the mode alone: frequencies (m,) [Hz] and amplitudes (m,) [m], from
        below the resonance over it to above; NaN before each piece that is detached.

        At each amplitude |omega^2 - Omega^2 + 2i zeta omega Omega| a = |phi^H F| has two
        frequencies where the force is more than the resonance needs.
        """
        known = np.flatnonzero(self.converged)
        enough = self.drive[known] <= 1
        ends = np.flatnonzero(np.diff(enough.astype(int))) + 1
        pieces = [piece for piece in np.split(np.arange(len(known)), ends) if enough[piece].all()]
        out = [np.zeros((2, 0))]
        for piece in pieces:
            first, last = piece[0], piece[-1]
            foot = [self._crossing(known[first - 1], known[first])] if first else []
            tip = [self._crossing(known[last], known[last + 1])] if last + 1 < len(known) else []
            gap = [(np.nan, np.nan)] if len(out) > 1 else []
            below, above = self._flanks(known[piece])
            out += [_columns(gap + foot), below, _columns(tip), above[:, ::-1], _columns(foot)]
        frequency, amplitude = np.hstack(out)
        return frequency, amplitude

    def _flanks(self, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frequency [Hz] and amplitude [m], (2, k), below and above the resonance at points."""
        omega = 2 * np.pi * self.frequency[kept]
        rate = 2 * (self.friction + self.own)[kept] * omega
        half = omega**2 - rate**2 / 2
        root = np.sqrt(np.maximum(half**2 - omega**4 + (rate * omega / self.drive[kept]) ** 2, 0))
        amplitude = self.amplitude[kept]
        below = np.sqrt(np.maximum(half - root, 0)) / (2 * np.pi)
        above = np.sqrt(half + root) / (2 * np.pi)
        return np.array([below, amplitude]), np.array([above, amplitude])


def _columns(pairs: list[tuple[float, float]]) -> np.ndarray:
    """(2, k) amplitudes and frequencies as frequency and amplitude."""
    return np.array(pairs).reshape(-1, 2).T[::-1]


def run_backbones(
    run: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> tuple[list[Backbone], list[str]]:
    """The nonlinear mode under every load of a run, and remarks on those that were found in the
    folder; computed on one rank.

    Raises:
        InputError: a model is too large for dense factors, or its mode is no elastic one.
    """
    scene = run.scene
    curves = run.response.curves
    peaks = [curve.balance_amplitude for curve in curves]
    ends = LOWEST_AMPLITUDE_RATIO * min(peaks), HIGHEST_AMPLITUDE_RATIO * max(peaks)
    patches = list(run.contact.problem.patches)
    cases = {(case.load, case.mass): case for case in load_cases(scene, run.mesh, run.contact)}
    found = []
    remarks: list[str] = []

    def alone(curve: Curve) -> Backbone:
        case = cases[curve.load, curve.mass]
        family = family_of_case(scene, run.mesh, run.reduced, patches, case)
        model = family_member(family, curve.settings).model
        return curve_backbone(model, curve, scene.excitation.mode - 1, ends)

    def compute(curve: Curve) -> Backbone:
        return on_root(comm, partial(alone, curve))

    for curve in progress(curves, "nonlinear modes", len(curves)):
        name = f"backbone_{curve.load:g}N" + (
            "" if curve.mass is None else f"_{1e3 * curve.mass:g}g"
        )
        key = stage_key("response", scene, "backbone", curve.load, curve.mass, *ends)
        made, seconds = cached_stage(run.folder, name, key, partial(compute, curve), comm)
        found.append(made)
        if seconds is not None:
            remarks.append(found_remark(name, seconds))
    return found, remarks


def curve_backbone(
    model: ReducedModel,
    curve: Curve,
    mode: int,
    ends: tuple[float, float],
) -> Backbone:
    """The nonlinear mode of a model, with the settings of its curve.

    Args:
        mode: number of the blade mode, from 0.
        ends: smallest and largest amplitude at the probe [m].
    """
    blades = model.blades(1)
    seen = float(abs(blades.shapes[-1, blades.probe][0, mode]))
    wanted = [float(a) / seen for a in np.geomspace(*ends, AMPLITUDES_PER_LOAD)]
    H = max(curve.settings.harmonics, *model.excitation)
    points = list(nonlinear_mode(model, wanted, mode, H, curve.settings.samples))
    omega = np.array([p.omega for p in points])
    return Backbone(
        curve.load,
        curve.mass,
        np.array([np.linalg.norm(p.probe[1:, 0]) for p in points]),
        omega / (2 * np.pi),
        np.array([p.zeta for p in points]),
        modal_damping(model, points) / (2 * omega),
        np.array([force_at_resonance(model, p) for p in points]) / modal_forces(model, points),
        np.array([p.converged for p in points]),
        np.array([p.fold for p in points]),
        (curve.balance_amplitude, curve.peak.frequency),
        seen * np.array([p.amplitude for p in points]),
        next((_ended(p.reason) for p in points if not p.converged), ""),
    )


def _ended(reason: str) -> str:
    """Why the branch ended, without its amplitudes, which are those of the mode."""
    before, _, last = reason.rpartition(", then ")
    folded = "after folds in amplitude, " if before else ""
    return folded + (last if before else reason.rpartition(": ")[2])
