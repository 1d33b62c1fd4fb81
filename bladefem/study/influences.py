"""What the best load depends on: how it, its amplitude and its frequency change with what is known
least.

With A(L, p) the height of the resonance under load L with a parameter p, both as logarithms, the
best load L* is where dA/dL = 0. There

    d ln A / dp = A_p / A                    (A does not change with L to first order),
    d L* / dp = -A_Lp / A_LL,
    d omega / dp = omega_p + omega_L dL*/dp.

The first derivatives of A are exact (``hbm.node_gradients``), with the seating solved anew for the
parameter; second ones, and those of the frequency, are differences over steps so wide that the
ripple of sampled friction does not count. Ranges are wide, so that the two with the largest effect
on the amplitude are solved again at both ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np

from ..contact.interface_elements import gives_stiffness
from ..contact.numerical_stiffness import physical_stiffness
from ..contact.rough_layer import RANGE, SOURCE
from ..errors import NotSolvedError
from ..hbm.model import ReducedModel
from ..hbm.node_gradients import node_gradients
from ..hbm.parallel import share_work
from ..hbm.parameters import layer_share, vary
from ..hbm.peak import Peak, find_peak
from ..hbm.sensitivity import sensitivities
from ..scene.tables import Contact, Scene
from ..scene.validate_contact import friction_of_seats
from ..util.communicator import Communicator
from .adaptive.band_sweep import solver_options
from .adaptive.family import Family, Member, family_member, joined_elements
from .adaptive.settings import Settings
from .pipeline.assemble_model import LoadCase
from .pipeline.best_load import BestLoad
from .pipeline.best_load_search import find_best_load

# factor on each side of a stiffness that the scene gives: a joint measured twice
GIVEN_STIFFNESS = 2.0
# factor on each side of the friction coefficient and of the damping ratio
FRICTION_FACTOR = 1.3
DAMPING_FACTOR = 2.0
# relative step of a parameter by which the seating is differentiated
SEATING_STEP = 2e-2
# logarithmic step of a parameter, and of the load, on each side in differences of derivatives and
# of frequencies; sampled friction ripples: with a seventh of it the best load seemed to move the
# wrong way with the stiffness
WIDE_STEP = 0.14
# relative difference of heights up to which a peak is the one of the best load
SAME_PEAK = 0.01
# most harmonics and contact points of a seat in the model that estimates changes
COARSE_SETTINGS = {"harmonics": 3, "points": 8}
# least instants of a period there: with 64 slopes ripple by a tenth, and the derivative of the best
# load by the stiffness had the wrong sign; with so few points and harmonics they cost little
SMOOTH_SAMPLES = 512
# relative height at which the searches stop whose loads are compared: the minimum is flat, and with
# the tolerance of a run, 4e-4, a search that starts at the load by the derivatives keeps it where
# that is within 1.5 % of the best one
HEIGHT_TOLERANCE = 1e-5
# parameters that are solved again at the ends of their ranges
MAX_CHECKED_PARAMETERS = 2


@dataclass(frozen=True)
class Parameter:
    """One quantity of the scene that is multiplied by a factor."""

    # "kt", "kn", "roughness", "mu", "damping" or "seat friction"
    name: str
    # factors at the ends of its range
    low: float
    high: float
    # why this range
    range_from: str


@dataclass(frozen=True)
class Influence:
    """How the answer changes with one parameter; logarithmic derivatives are per factor e."""

    parameter: Parameter
    # d ln of the best load, of the amplitude and of the frequency there by d ln of the parameter
    load: float
    amplitude: float
    frequency: float
    # (2, 3) load [N], amplitude [m], frequency [Hz] at the low and the high end by the derivatives
    predicted: np.ndarray
    # (2, 3) the same solved again; NaN where it was not
    solved: np.ndarray
    # why an end was not solved
    reason: str = ""

    @property
    def span(self) -> float:
        """Change of ln amplitude over the whole range."""
        return abs(self.amplitude) * log(self.parameter.high / self.parameter.low)


# parameter name, factor -> load [N] -> load case with that parameter changed
ChangedCases = Callable[[str, float], Callable[[float], LoadCase]]


def parameters_of(
    scene: Scene,
    angles: tuple[float, float] | None = None,
) -> list[Parameter]:
    """The parameters that an answer depends on, with their ranges.

    Args:
        angles: of both flanks against the radial plane [rad], where the damper is a wedge.
    """
    found = [
        *_layer_parameters(scene.contact),
        Parameter("mu", 1 / FRICTION_FACTOR, FRICTION_FACTOR, "scatter of friction coefficients"),
        Parameter("damping", 1 / DAMPING_FACTOR, DAMPING_FACTOR, "damping without friction"),
    ]
    mu = float(np.mean(friction_of_seats(scene.contact)))
    ends = None if angles is None else seat_friction_range(mu, angles)
    if ends is not None:
        found.append(Parameter("seat friction", *ends, "friction while seating"))
    return found


def _layer_parameters(contact: Contact) -> list[Parameter]:
    """What the stiffness of the layer depends on; nothing of rigid faces."""
    if contact.stiffness == "rigid":
        return []
    if not gives_stiffness(contact):
        return [Parameter("roughness", 1 / RANGE, RANGE, f"published stiffnesses ({SOURCE})")]
    return [
        Parameter(name, 1 / GIVEN_STIFFNESS, GIVEN_STIFFNESS, "given by the scene")
        for name in ("kt", "kn")
    ]


def seat_friction_range(mu: float, angles: tuple[float, float]) -> tuple[float, float] | None:
    """Normal load of a seat with friction over that without, for friction either way.

    Friction turns both reactions by atan(mu). The radial force F on the damper and they are in
    balance: N_1 = F cos(mu) cos(a_2) / sin(a_1 + a_2) with both angles a larger or smaller by it,
    which is F / (2 (sin a +- mu cos a)) for equal angles.

    Returns:
        The least and the largest of both seats; None for a self-locking wedge, and for unequal
        angles where friction of one way is in balance only with a seat that pulls: there the
        damper turns, and neither seat has a load by these formulas.
    """
    turn = float(np.arctan(mu))
    if sum(angles) <= 2 * turn:
        return None
    ratios = [
        np.cos(turn) * _share_of_load(angles, side, way) / _share_of_load(angles, side, 0.0)
        for side in (0, 1)
        for way in (turn, -turn)
    ]
    if not min(ratios) > 0:
        return None
    return float(min(ratios)), float(max(ratios))


def _share_of_load(
    angles: tuple[float, float],
    side: int,
    turn: float,
) -> float:
    """Reaction of one seat over the radial force on the damper, turned by an angle [rad]."""
    return float(np.cos(angles[1 - side] + turn) / np.sin(sum(angles) + 2 * turn))


def influences(
    scene: Scene,
    best: BestLoad,
    family_of: Callable[[LoadCase], Family],
    changed: ChangedCases,
    parameters: Sequence[Parameter],
    comm: Communicator | None = None,
) -> list[Influence]:
    """The influence of each parameter, the largest on the amplitude first; dealt over the ranks.

    Where harmonics and contact points were chosen, a model of at most COARSE_SETTINGS of them gives
    the changes, relative to its own best load.

    Args:
        best: a best load that was found.
        changed: load cases with one parameter changed by a factor.

    Raises:
        NotSolvedError: the peak of the best load was not solved again.
    """
    if any(name in best.settings.chosen for name in ("harmonics", "points")):
        coarse = _coarse(best.settings)
        quick = replace(best, settings=coarse)
        if coarse != replace(best.settings, chosen=()):
            quick = find_best_load(
                scene,
                changed("kt", 1.0),
                family_of,
                coarse,
                best.mass,
                start=best.load,
                tolerance=HEIGHT_TOLERANCE,
                with_range=False,
            )
        if quick.reason:
            raise NotSolvedError(quick.reason)
        found = influences(scene, quick, family_of, changed, parameters, comm)
        return [_rescaled(one, quick, best) for one in found]
    study = _Study(scene, best, family_of, changed)
    base = study.peak("kt", 1.0, best.load)
    if abs(base.height / best.amplitude - 1) > SAME_PEAK:
        raise NotSolvedError(
            f"next to the resonance of {1e6 * best.amplitude:.4g} um one of "
            f"{1e6 * base.height:.4g} um was found: "
            "derivatives of one do not hold for both"
        )
    sides = [
        replace(study.peak("kt", 1.0, load, base), value=load)
        for load in best.load * np.exp([-WIDE_STEP, WIDE_STEP])
    ]
    found = share_work(lambda p: study.influence(p, base, sides), parameters, comm)
    found.sort(key=lambda one: -one.span)
    checked = _solved_again(study, found[:MAX_CHECKED_PARAMETERS], base, comm)
    return checked + found[MAX_CHECKED_PARAMETERS:]


def _solved_again(
    study: _Study, found: Sequence[Influence], base: Peak, comm: Communicator | None
) -> list[Influence]:
    """Influences whose predictions at both ends of the range are compared with another search."""
    # the low end of a range often takes less than the high one: in turns, both on each of two ranks
    ends = [(k, i if k % 2 == 0 else 1 - i) for k in range(len(found)) for i in (0, 1)]
    again = share_work(lambda end: study.solved_again(found[end[0]], end[1], base), ends, comm)
    by_end = dict(zip(ends, again, strict=True))
    return [
        replace(
            one,
            solved=np.array([by_end[k, i][0] for i in (0, 1)]),
            reason="; ".join(by_end[k, i][1] for i in (0, 1) if by_end[k, i][1]),
        )
        for k, one in enumerate(found)
    ]


def _coarse(settings: Settings) -> Settings:
    """The settings with at most COARSE_SETTINGS of what was chosen, and many samples; nothing is
    left to choose.
    """
    least: dict[str, Any] = {
        name: min(value, getattr(settings, name) or value)
        for name, value in COARSE_SETTINGS.items()
        if name in settings.chosen
    }
    # 0: exact in time
    samples = max(settings.samples, SMOOTH_SAMPLES) if settings.samples else 0
    return replace(settings, **least, samples=samples, chosen=())


def _rescaled(
    one: Influence,
    quick: BestLoad,
    best: BestLoad,
) -> Influence:
    """The changes of one best load, put on the values of another."""
    values = [np.array([b.load, b.amplitude, b.frequency]) for b in (quick, best)]
    ratio = values[1] / values[0]
    return replace(one, predicted=one.predicted * ratio, solved=one.solved * ratio)


@dataclass(frozen=True)
class _Study:
    """What the influences of one best load share."""

    scene: Scene
    best: BestLoad
    family_of: Callable[[LoadCase], Family]
    changed: ChangedCases

    def model(
        self,
        name: str,
        factor: float,
        load: float,
    ) -> ReducedModel:
        """The model of one load with a parameter changed."""
        case = self.changed(name, factor)(load)
        model = family_member(self.family_of(case), self.best.settings).model
        return vary(model, "damping", factor) if name == "damping" else model

    def peak(
        self,
        name: str,
        factor: float,
        load: float,
        near: Peak | None = None,
    ) -> Peak:
        """Its resonance."""
        settings = self.best.settings
        omega = 2 * np.pi * self.best.frequency if near is None else near.omega
        return find_peak(
            self.model(name, factor, load),
            omega,
            settings.harmonics,
            settings.samples,
            near=near,
            tolerance=1e-6,
            options=replace(solver_options(self.scene.accuracy), tolerance=1e-9),
        )

    def by_load(self, peak: Peak, load: float) -> float:
        """Derivative of ln height by ln load, the seating solved anew."""
        case_at = self.changed("kt", 1.0)
        ends = [case_at(load * f) for f in (1 - SEATING_STEP, 1 + SEATING_STEP)]
        return self._by_elements(peak, load, ends)

    def by_parameter(
        self,
        peak: Peak,
        name: str,
        load: float,
    ) -> float:
        """Derivative of ln height by the logarithm of a parameter at a load."""
        if name == "damping":
            model = self.model(name, 1.0, load)
            slope = sensitivities(model, peak.solution, ["damping"])["damping"].size[0]
            return float(slope) / peak.height
        ends = [self.changed(name, f)(load) for f in (1 - SEATING_STEP, 1 + SEATING_STEP)]
        return self._by_elements(peak, load, ends)

    def _by_elements(
        self,
        peak: Peak,
        load: float,
        ends: list[LoadCase],
    ) -> float:
        """Derivative by differences of the friction elements on both sides of a step.

        Stiffnesses are those of the whole layer. Elements of a split layer keep theirs over the
        step; for an open one that shifts the load at zero displacement, -kn times its gap.
        """
        member = family_member(self.family_of(self.changed("kt", 1.0)(load)), self.best.settings)
        model, groups = member.model, member.groups
        low, high = (joined_elements(end.elements, groups) for end in ends)
        layers = [physical_stiffness(end.elements, end.series) for end in ends]
        by_layer = _log_rate(*(np.bincount(groups, layer.kn) for layer in layers))
        shift = layer_share(model, "kn") * by_layer - _log_rate(low.kn, high.kn)
        rates = {
            "load": _log_rate(low.n0, high.n0) + np.where(low.n0 < 0, shift, 0.0),
            "kt": _log_rate(*(np.bincount(groups, layer.kt) for layer in layers)),
            "kn": by_layer,
            "mu": _log_rate(low.mu, high.mu),
        }
        names = [name for name in rates if np.any(rates[name])]
        gradients = node_gradients(model, peak.solution, names)
        return sum(float(gradients[name] @ rates[name]) for name in names) / peak.height

    def influence(
        self,
        parameter: Parameter,
        base: Peak,
        sides: Sequence[Peak],
    ) -> Influence:
        """All three derivatives of one parameter.

        Args:
            base: at the best load.
            sides: at WIDE_STEP below and above it, with their loads as values.
        """
        name = parameter.name
        load = self.best.load
        width = 2 * WIDE_STEP
        amplitude = self.by_parameter(base, name, load)
        below, above = (
            np.array([self.by_load(peak, peak.value), self.by_parameter(peak, name, peak.value)])
            for peak in sides
        )
        here = np.array([self.by_load(base, load), amplitude])
        moved_load = best_load_rate(below, here, above)
        low, high = (
            self.peak(name, float(np.exp(step)), load, base) for step in (-WIDE_STEP, WIDE_STEP)
        )
        by_load = np.log(sides[1].omega / sides[0].omega) / width
        moved = np.log(high.omega / low.omega) / width + by_load * moved_load
        rates = np.array([moved_load, amplitude, moved])
        # where a derivative is zero the ends are the best load itself, found again or not
        centre = np.log([load, self.best.amplitude, self.best.frequency])
        ends = np.log([parameter.low, parameter.high])
        return Influence(
            parameter,
            load=moved_load,
            amplitude=amplitude,
            frequency=float(moved),
            predicted=np.exp(centre + ends[:, None] * rates),
            solved=np.full((2, 3), np.nan),
        )

    def solved_again(self, one: Influence, end: int, base: Peak) -> tuple[np.ndarray, str]:
        """Load [N], amplitude [m] and frequency [Hz] of the best load searched again at one end of
        a range, 0 the low and 1 the high one; and why it was not found.

        Args:
            base: the peak of the best load with the parameter as it is.
        """
        name = one.parameter.name
        factor = (one.parameter.low, one.parameter.high)[end]

        def family_of(case: LoadCase) -> Family:
            family = self.family_of(case)
            if name != "damping":
                return family

            def build(settings: Settings) -> Member:
                made = family.build(settings)
                return replace(made, model=vary(made.model, "damping", factor))

            return replace(family, build=build)

        found = find_best_load(
            self.scene,
            self.changed(name, factor),
            family_of,
            replace(self.best.settings, chosen=()),
            self.best.mass,
            start=one.predicted[end, 0],
            tolerance=HEIGHT_TOLERANCE,
            near=base,
            with_range=False,
        )
        # of a point that was not solved: one of several attempts tells enough here
        first = found.reason.split("; ")[0]
        reason = f"{name} times {factor:.3g}: {first}" if first else ""
        return np.array([found.load, found.amplitude, found.frequency]), reason


def best_load_rate(below: np.ndarray, here: np.ndarray, above: np.ndarray) -> float:
    """Derivative of ln best load by the logarithm of a parameter, by differences of first
    derivatives of ln height.

    Over both steps; over one of them where the height is not convex over the other, since it is
    another motion's there: next to the best load of an imported wedge an internal resonance splits
    the peak on one side, and both steps together had the wrong sign.

    Args:
        below, here, above: (2,) derivatives by ln load and by the parameter, one WIDE_STEP of ln
            load below the best load, there and above it.

    Returns:
        NaN where the height is convex over neither step: there it has no minimum to follow.
    """
    steps = here - below, above - here
    convex = [step for step in steps if step[0] > 0]
    if not convex:
        return np.nan
    bend, mixed = np.sum(convex, axis=0)
    return float(-mixed / bend)


def _log_rate(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) derivative of ln |x| by the logarithm that was stepped; 0 where x is 0 or infinite."""
    finite = np.isfinite(low) & np.isfinite(high)
    middle = np.where(finite, low + high, 0.0) / 2
    change = np.subtract(high, low, out=np.zeros_like(middle), where=finite) / (2 * SEATING_STEP)
    rate = np.divide(change, middle, out=np.zeros_like(middle), where=middle != 0)
    return np.where(abs(rate) < 1e-9, 0.0, rate)
