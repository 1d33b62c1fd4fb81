"""Flutter of a scene's wheel: which waves the flow feeds, and the limit cycles at which friction
holds each of them.

One limit cycle does not push out another one: where dampers slip in one wave at x times the motion
at which they begin to, a small motion in another wave is damped by 1 / (2x) (incremental describing
function of a Jenkins element, over 4 kt / pi), which is more than the 1/4 that friction holds in
any limit cycle as long as x < 2. So each fed wave may survive, and the start decides which does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...data import Patch
from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.nonlinear_modes import NonlinearMode, modal_damping, nonlinear_mode
from ...reduction.assemble import conjugate_wave, folded_diameter, pair_model
from ...reduction.truncate import truncate_modes
from ...scene.units import newtons, show
from ...util.arrays import IntegerArray, RealArray
from ...util.counted import counted
from ...util.message import warning
from ...wheel.aerodynamics import limit_cycles, with_flow
from ..adaptive.settings import Settings
from .assemble_model import LoadCase, joint_model
from .bodies import Bodies
from .case_models import load_cases
from .coriolis import with_coriolis
from .flow import Flow, family_numbers, port_shapes, scene_flow
from .joined_contacts import joined_member
from .reduced_sector import Reduced, reduce_sector, with_damper_mass
from .run_records import ReducedRun, SolvedRun
from .stage_inputs import stage_key
from .stage_runner import StageRunner

# amplitudes of each load, from sticking contacts to where friction does nearly nothing, over the
# amplitude at which all contacts together begin to slip
AMPLITUDES = 50
LOWEST_RATIO, HIGHEST_RATIO = 0.2, 300.0
# further ones between two of them where friction balances the flow
CLOSER_AMPLITUDES = 8
# motions between two amplitudes after which the branch is begun anew beyond: far from limit cycles
# contacts that lift off fold it often
MAX_ARCS = 40
# relative difference of normal loads that are the same but for a factor
SAME_SHAPE = 1e-9
# modal amplitude at which nothing slips [m kg^1/2]
STICKING_AMPLITUDE = 1e-10


@dataclass(frozen=True)
class HeldFlutter:
    """One fed wave under one load."""

    # [N], and of the damper [kg]
    load: float
    mass: float | None
    # nodal diameter, see `FlutterResult.diameters`
    wave: int
    # limit cycle at the probe [m] and where [Hz]
    amplitude: float
    frequency: float
    # amplitude at the probe from which motions grow [m]; NaN where none that was looked at does
    stability_limit: float
    # largest damping by friction [1]
    largest_friction_damping: float


@dataclass(frozen=True)
class FlutterResult:
    """Waves of 0..N-1 nodal diameters in a flow."""

    # (N,) relative frequency shift, damping by the flow and with that of the blade [1]
    shift: RealArray
    flow_damping: RealArray
    net_damping: RealArray
    # load by load, each with all fed waves, the least damped one first; empty where none is fed
    held: tuple[HeldFlutter, ...]

    @property
    def diameters(self) -> IntegerArray:
        """(N,) nodal diameters. Positive ones run as engine orders up to half the number of blades
        do, against the rotation; negative ones run with it.
        """
        d = np.arange(len(self.net_damping))
        return np.where(2 * d <= len(d), d, d - len(d))

    @property
    def worst(self) -> int:
        """Nodal diameter of the least damped wave."""
        return int(self.diameters[np.argmin(self.net_damping)])

    @property
    def fed(self) -> list[int]:
        """Nodal diameters of the waves that flutter without dampers, the least damped one first."""
        order = np.argsort(self.net_damping, kind="stable")
        return [int(self.diameters[i]) for i in order if self.net_damping[i] < 0]

    @property
    def largest_cycles(self) -> tuple[HeldFlutter, ...]:
        """The largest limit cycle of each load and mass, in their order."""
        found: dict[tuple[float, float | None], HeldFlutter] = {}
        for one in self.held:
            case = (one.load, one.mass)
            if case not in found or one.amplitude > found[case].amplitude:
                found[case] = one
        return tuple(found.values())

    @property
    def onset(self) -> float:
        """Factor of the whole influence at which the first wave flutters; infinite where none
        does.
        """
        blade = float((self.net_damping - self.flow_damping)[0])
        lowest = float(self.flow_damping.min())
        return blade / -lowest if lowest < 0 else np.inf


def find_flutter(
    run: ReducedRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
) -> FlutterResult | None:
    """Damping of all waves, and limit cycles under each load of the study; None without a flow.

    Raises:
        InputError: friction holds a fed wave under some load at no amplitude.
    """
    scene = run.scene
    flow = scene_flow(scene, run.reduced.sectors)
    if flow is None:
        return None
    fed = flow.influence.imag
    found = FlutterResult(flow.influence.real, fed, fed + scene.operation.damping, ())
    if not found.fed:
        return found
    sector = _flutter_sector(found, flow, run, bodies, patches, keep)
    cases = load_cases(scene, run.mesh, run.contact)

    def compute() -> tuple[HeldFlutter, ...]:
        solved: list[tuple[LoadCase, list[HeldFlutter]]] = []
        for case in cases:
            held = _by_scale(case, solved)
            if held is None:
                held = [_held(run, sector, patches, case, flow, wave) for wave in found.fed]
            solved.append((case, held))
        return tuple(one for _, held in solved for one in held)

    key = stage_key("response", scene, "flutter", found.fed, [(c.load, c.mass) for c in cases])
    return replace(found, held=keep("flutter", key, compute))


def with_best_load(
    found: FlutterResult,
    run: SolvedRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
) -> FlutterResult:
    """With the limit cycles under the best load of the forced response, where a search has found it
    and none was asked for: at no cost where they follow by a factor.

    A best load under which friction holds some wave at no amplitude is reported in a message.
    """
    curve = run.response.curves[run.response.best_curve]
    best = (curve.load, curve.mass)
    known = {(one.load, one.mass) for one in found.held}
    if not known or best in known:
        return found
    solved: list[tuple[LoadCase, list[HeldFlutter]]] = []
    cases = load_cases(run.scene, run.mesh, run.contact)
    for case in cases:
        here = (case.load, case.mass)
        if here in known:
            solved.append((case, [one for one in found.held if (one.load, one.mass) == here]))
    wanted = next(c for c in cases if (c.load, c.mass) == best)
    try:
        held = _by_scale(wanted, solved) or _held_anew(found, run, bodies, patches, wanted, keep)
    except InputError as error:
        keep.clock.messages.append(
            warning(f"flutter under the best load, {newtons(curve.load)}, is not known: {error}")
        )
        return found
    ordered = sorted([*solved, (wanted, held)], key=lambda one: (one[0].mass or 0, one[0].load))
    return replace(found, held=tuple(one for _, held in ordered for one in held))


def _held_anew(
    found: FlutterResult,
    run: ReducedRun,
    bodies: Bodies,
    patches: list[Patch],
    case: LoadCase,
    keep: StageRunner,
) -> list[HeldFlutter]:
    """The limit cycles of all fed waves under a load, solved."""
    flow = scene_flow(run.scene, run.reduced.sectors)
    assert flow is not None
    key = stage_key("response", run.scene, "flutter", found.fed, case.load, case.mass)

    def compute() -> list[HeldFlutter]:
        sector = _flutter_sector(found, flow, run, bodies, patches, keep)
        return [_held(run, sector, patches, case, flow, wave) for wave in found.fed]

    return keep("flutter_best", key, compute)


def _flutter_sector(
    found: FlutterResult,
    flow: Flow,
    run: ReducedRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
) -> Reduced:
    """The sector in the nodal diameters of all fed waves and of the engine order."""
    # of the sector: negative waves are the positive ones, mirrored
    wanted = sorted({0, flow.own, *(abs(wave) for wave in found.fed)})
    modes = run.settings.modes
    sector = keep(
        "flutter_sector",
        stage_key("reduction", run.scene, "flutter", np.array(wanted), modes),
        lambda: reduce_sector(bodies, patches, wanted, modes),
    )
    sector = with_coriolis(run.scene, sector)
    # as the response has it
    if run.reduced.damper.damping is None:
        return sector
    return replace(sector, damper=replace(sector.damper, damping=sector.damper_coriolis))


def _by_scale(
    case: LoadCase,
    solved: list[tuple[LoadCase, list[HeldFlutter]]],
) -> list[HeldFlutter] | None:
    """The limit cycles of a case from those of another one, or None.

    With all normal loads and friction forces times a factor, and nothing else, all motions have
    that factor too: Coulomb's law and contacts that lift off are homogeneous.
    """
    for other, held in solved:
        factor = _load_factor(other, case)
        if factor is not None:
            return [
                replace(
                    one,
                    load=case.load,
                    amplitude=factor * one.amplitude,
                    stability_limit=factor * one.stability_limit,
                )
                for one in held
            ]
    return None


def _load_factor(one: LoadCase, other: LoadCase) -> float | None:
    """Factor of the normal loads from one case to another that differs by nothing else; None where
    it does. Layers that stiffen and laws of other authors have a scale of their own.
    """
    a, b = one.elements, other.elements
    laws = (a.law, b.law, one.decay, other.decay)
    if any(law is not None for law in laws) or one.mass != other.mass:
        return None
    same = [(a.kt, b.kt), (a.kn, b.kn), (a.mu, b.mu)]
    if (one.series is None) != (other.series is None):
        return None
    if one.series is not None and other.series is not None:
        same.append((one.series, other.series))
    if any(np.shape(x) != np.shape(y) or not np.array_equal(x, y) for x, y in same):
        return None
    if abs(one.selection - other.selection).max() > 0:
        return None
    factor = other.load / one.load
    for x, y in ((a.n0, b.n0), (a.traction, b.traction)):
        if abs(factor * x - y).max() > SAME_SHAPE * abs(b.n0).max():
            return None
    return factor


def _held(
    run: ReducedRun,
    sector: Reduced,
    patches: list[Patch],
    case: LoadCase,
    flow: Flow,
    wave: int,
) -> HeldFlutter:
    """The limit cycle of a wave under one load, by its nonlinear mode in one harmonic."""
    n, _ = folded_diameter(1, wave % len(flow.influence), len(flow.influence))
    mode = family_numbers({d: port_shapes(b) for d, b in sector.sector.items()}, flow)[n]
    model = _wave_model(run, sector, patches, case, flow, wave, mode)
    samples = max(run.settings.samples, 32)
    (stuck,) = nonlinear_mode(model, [STICKING_AMPLITUDE], mode, 1, samples)
    slips = _slip_amplitude(model, stuck)
    amplitudes = slips * np.geomspace(LOWEST_RATIO, HIGHEST_RATIO, AMPLITUDES)
    own = model.blades(1).omega[-1][mode]
    damping = float(modal_damping(model, [stuck])[0] / (2 * own))
    points = _closed_in(model, amplitudes, mode, samples, damping)
    try:
        cycles = limit_cycles(points, damping)
    except InputError as error:
        raise InputError(
            f"aerodynamics: waves of {wave} nodal diameters under {newtons(case.load)}: {error}"
        ) from None
    stable = next((c for c in cycles if c.stable), None)
    if stable is None:
        raise InputError(
            f"aerodynamics: waves of {wave} nodal diameters under {newtons(case.load)}: flutter, "
            "no limit cycle between sticking and free dampers, expected less negative damping"
        )
    beyond = [float(c.probe[0]) for c in cycles if not c.stable and c.amplitude > stable.amplitude]
    return HeldFlutter(
        case.load,
        case.mass,
        wave,
        float(stable.probe[0]),
        stable.omega / (2 * pi),
        min(beyond) if beyond else float("nan"),
        max(p.zeta for p in points if p.converged),
    )


def _closed_in(
    model: ReducedModel,
    amplitudes: np.ndarray,
    mode: int,
    samples: int,
    damping: float,
) -> list[NonlinearMode]:
    """The nonlinear mode at some amplitudes, and closer where its damping balances the rest; in
    the order of its branch.
    """
    points = list(
        nonlinear_mode(model, [float(a) for a in amplitudes], mode, 1, samples, arcs=MAX_ARCS)
    )
    known = [p for p in points if p.converged]
    net = np.array([p.zeta for p in known]) + damping
    found = list(known)
    # from the end, so that the places before stay
    for i in np.flatnonzero(np.sign(net[1:]) != np.sign(net[:-1]))[::-1]:
        between = np.geomspace(known[i].amplitude, known[i + 1].amplitude, CLOSER_AMPLITUDES + 2)
        closer = [float(a) for a in between[1:-1]]
        found[i + 1 : i + 1] = nonlinear_mode(model, closer, mode, 1, samples, known[i], MAX_ARCS)
    return found


def _slip_amplitude(model: ReducedModel, stuck: NonlinearMode) -> float:
    """Modal amplitude at which the friction forces of sticking contacts add up to their limits."""
    e = model.elements
    tangents = stuck.w[:, -e.tangents :, 1:]
    motion = np.linalg.norm(tangents.reshape(len(e.kt), -1), axis=1) / stuck.amplitude
    limit = float((e.mu * np.maximum(e.n0, 0.0)).sum())
    return limit / float((e.kt * motion)[e.n0 > 0].sum())


def _wave_model(
    run: ReducedRun,
    sector: Reduced,
    patches: list[Patch],
    case: LoadCase,
    flow: Flow,
    wave: int,
    number: int,
) -> ReducedModel:
    """Blade and damper in one wave, with the flow on it: the mean and one harmonic."""
    settings: Settings = run.settings
    count = len(flow.influence)
    n, mirrored = folded_diameter(1, wave % count, count)
    bodies = [truncate_modes(sector.sector[d], settings.modes) for d in (0, n)]
    if mirrored:
        bodies[1] = conjugate_wave(bodies[1])
    sides = [
        pair_model(body, sector.following, phase)
        for body, phase in zip(bodies, (0.0, 2 * pi * wave / count), strict=True)
    ]
    sides[1] = with_flow(sides[1], flow.stiffness(sides[1].omega, wave, number))
    reduced = with_damper_mass(sector, case.mass)
    model = joint_model(
        run.scene, run.mesh, reduced, patches, case, 1, settings.damper, tuple(sides)
    )
    return joined_member(model, patches, settings.points, run.scene.contact.points).model


def flutter_sentences(found: FlutterResult) -> list[str]:
    """What the flow does, in words."""
    d = int(np.argmin(found.net_damping))
    net, by_flow = 100 * found.net_damping[d], 100 * found.flow_damping[d]
    share = (
        f"least damped wave: {wave_words(found.worst, len(found.net_damping))}, "
        f"{net:.3g} % of critical ({by_flow:+.3g} % by the flow)"
    )
    if not found.held:
        onset = "" if np.isinf(found.onset) else f"; {found.onset:.3g} times this flow flutters"
        return [f"flow: no wave flutters; {share}{onset}"]
    flutter = "flutters" if len(found.fed) == 1 else "flutter"
    sentences = [
        f"flow: {counted(len(found.fed), 'wave')} {flutter} without dampers, from "
        f"{found.onset:.3g} times this flow on; {share}"
    ]
    first = [one for one in found.held if one.wave == found.worst]
    for one, most in zip(first, found.largest_cycles, strict=True):
        others = ""
        if most.wave != one.wave:
            others = f"; {_cycle(most)} in {wave_words(most.wave, len(found.net_damping))}"
        sentences.append(
            f"flutter under {newtons(one.load)}: friction holds it in a limit cycle of "
            f"{_cycle(one)}{growing_words(one)}{others} (one harmonic; forced responses leave it "
            "out)"
        )
    if len(found.fed) > 1:
        sentences.append(
            "flutter: each fed wave has a limit cycle of its own, and the start decides which of "
            "them stays; the largest is that to judge by"
        )
    return sentences


def growing_words(one: HeldFlutter) -> str:
    """From which amplitude flutter grows, far above limit cycles: three digits; empty where that
    is not known.
    """
    if np.isnan(one.stability_limit):
        return ""
    return f"; motions above {show(float(f'{one.stability_limit:.3g}'), 'm')} grow"


def wave_words(wave: int, sectors: int) -> str:
    """A wave's nodal diameters, and its direction on the wheel where it does not stand, in words:
    forward with the rotation, as in Campbell diagrams.

    >>> wave_words(-2, 36), wave_words(1, 36), wave_words(18, 36)
    ('2 nodal diameters, forward', '1 nodal diameter, backward', '18 nodal diameters, standing')
    """
    way = "forward" if wave < 0 else "backward"
    if 2 * wave % sectors == 0:
        way = "standing"
    return f"{counted(abs(wave), 'nodal diameter')}, {way}"


def _cycle(one: HeldFlutter) -> str:
    return f"{1e6 * one.amplitude:.4g} um at {one.frequency:.5g} Hz"
