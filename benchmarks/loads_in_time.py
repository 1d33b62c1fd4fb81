"""A shipped scene marched in time at its reported resonances, by code of its own.

Blades and dampers that may move as they like (as many as the engine order needs to repeat: four
with engine order 9 of 36; one of a row that moves in step), all contact nodes, friction by a return
map written here, small explicit steps, no harmonics.

    python benchmarks/loads_in_time.py [run folder] [--loads 36 73 ...] [--steps 1000]
        [--around 0.5 1] [--law]

The run folder is that of `./run` (runs/wedge) or of `bladefem run scenes/plane.toml`, whose
scene.toml tells the scene and summary.csv loads, frequencies, amplitudes, friction work and
estimated errors. Taken from the package are the reduced sector (modes and residual flexibility in
the nodal diameters that repeat), the preload of the seats and the layer. Residual flexibility has
no inertia: its stiffest part is left out, the rest becomes modes at RESIDUAL_FREQUENCY. Where the
blade, from rest, keeps to less than half of the amplitude reported, it is driven STRONG times as
hard first: where contacts lift off there are several motions. With --around, frequencies so many
percent below and above are passed upwards and downwards as well, each from the motion before. With
--law a layer that stiffens with pressure does so in the march; without it its stiffness at rest
stays, as in the balance.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit

from bladefem.data import PortModel
from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene, vary
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.bodies import Bodies, is_wheel
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.reduced_sector import Reduced, reduce_sector
from geometry.mesh import sector_of

MODES = 20
# [rad/s] of the modes that stand for the residual flexibility, and their damping ratio
RESIDUAL_FREQUENCY = 2 * np.pi * 40e3
RESIDUAL_DAMPING = 0.05
# [rad/s] modes above it count as residual flexibility
HIGHEST_MODE = 2 * np.pi * 30e3
# of the largest eigenvalue of the residual flexibility: stiffer motions are left out
SMALLEST_COMPLIANCE = 0.04
# periods whose mean is compared with that of as many before, and what counts as steady
STEADY_PERIODS = 20
STEADY = 5e-4
MOST_PERIODS = 600
# of the force, and for how many periods
STRONG = 8.0
STRONG_PERIODS = 25
# that the amplitude is made of
HARMONICS = 7
# step times the highest frequency of the stuck ring, beyond which explicit steps grow
LARGEST_STEP = 2.0
# stiffness over that at rest that counts at most: of a march that has grown without bound
LARGEST_GROWTH = 1e6


@dataclass(frozen=True)
class Ring:
    """Blades until their motion repeats, and their dampers, by modes."""

    # (m,) [rad/s] and damping ratios of the blades' modes, and of one damper's
    omega: np.ndarray
    damping: np.ndarray
    damper_omega: np.ndarray
    damper_damping: np.ndarray
    # (blades * rows, m) displacements at the contacts; (m, blades) force and reading of each blade
    contact: np.ndarray
    force: np.ndarray
    reading: np.ndarray
    # (rows, modes) displacements of a damper at its contacts
    damper: np.ndarray
    # contact rows on the seat that touches the blade before the damper
    first: int
    # between a blade and the next [rad]
    phase: float

    @cached_property
    def pushed(self) -> np.ndarray:
        """(m, blades * rows) of the contact forces."""
        return np.ascontiguousarray(self.contact.T)

    @property
    def blades(self) -> int:
        return self.force.shape[1]


@dataclass
class State:
    """Where a march is: at the end of a period."""

    q: np.ndarray
    v: np.ndarray
    p: np.ndarray
    z: np.ndarray
    # (blades, nodes, tangents) friction [N], and (blades, rows) displacements before
    friction: np.ndarray
    before: np.ndarray
    # (blades, nodes) steps of the last period in which a node slips, and in which it is open
    slips: np.ndarray
    opens: np.ndarray
    # (blades,) friction work of each damper over the last period [J]
    work: np.ndarray
    # (nodes,) largest stiffness of a layer that stiffens so far, over that at rest
    growth: np.ndarray


@dataclass(frozen=True)
class Layer:
    """The contact nodes of one damper, as the march takes them."""

    # (n,) [N/m], [N/m], [1], [N], and the length over which the stiffness grows by e [m]
    kt: np.ndarray
    kn: np.ndarray
    mu: np.ndarray
    n0: np.ndarray
    decay: np.ndarray
    # (n, tangents) friction of the preload state [N]
    t0: np.ndarray

    @property
    def table(self) -> tuple[np.ndarray, ...]:
        return self.kt, self.kn, self.mu, self.n0, self.decay


def layer_of(case: LoadCase, stiffens: bool = False) -> Layer:
    """The whole layer of each contact node, however the balance splits it.

    Args:
        stiffens: with its pressure, where the scene says so; at rest otherwise.

    Raises:
        ValueError: rigid faces, which have no stiffness to march with.
    """
    e = case.elements
    n = len(e.kt)
    kt, kn, mu, n0 = (np.broadcast_to(x, n).astype(float) for x in (e.kt, e.kn, e.mu, e.n0))
    if case.series is not None:
        compliance = 1 / np.stack([kn, kt]) + case.series[:, :2].T
        if (compliance <= 0).any():
            raise ValueError("rigid faces: expected a layer with some compliance")
        n0 = np.where(n0 < 0, n0 / kn / compliance[0], n0)
        kn, kt = 1 / compliance
    decay = np.full(n, np.inf)
    if stiffens and case.decay is not None:
        decay = case.decay
    return Layer(kt, kn, mu, n0, decay, e.traction)


def with_residual_modes(body: PortModel, damping: float) -> tuple[np.ndarray, ...]:
    """Frequencies, damping ratios and shapes with those that stand for the residual flexibility."""
    kept = body.omega < HIGHEST_MODE
    high = body.shapes[:, ~kept]
    residual = np.asarray(body.residual) + (high / body.omega[~kept] ** 2) @ high.conj().T
    values, vectors = np.linalg.eigh((residual + residual.conj().T) / 2)
    soft = (values > SMALLEST_COMPLIANCE * values.max()) & (values > 0)
    added = vectors[:, soft] * np.sqrt(values[soft]) * RESIDUAL_FREQUENCY
    omega = np.append(body.omega[kept], np.full(soft.sum(), RESIDUAL_FREQUENCY))
    ratios = np.append(np.full(kept.sum(), damping), np.full(soft.sum(), RESIDUAL_DAMPING))
    return omega, ratios, np.concatenate([body.shapes[:, kept], added], axis=1)


def repeating_blades(scene: Scene, sectors: int) -> int:
    """Blades after which the excitation repeats.

    Raises:
        ValueError: a row of blades that does not move in step.
    """
    if sectors:
        return sectors // math.gcd(scene.excitation.engine_order, sectors)
    if scene.excitation.phase != 0:
        raise ValueError(f"excitation.phase {scene.excitation.phase:g} rad: expected 0")
    return 1


def reduced_scene(
    file: str | Path, folder: str, loads: list[float]
) -> tuple[Scene, Reduced, list[LoadCase], int]:
    """A scene, its sector, its seats under these loads, and the contact rows of the first."""
    scene = vary(load_scene(file), "study.loads", loads, "study.own_load", False)
    ready = pipeline.run(scene, folder, until="contact")
    patches = list(ready.contact.problem.patches)
    sectors = sector_of(ready.mesh).count if is_wheel(ready.mesh) else 0
    blades = repeating_blades(scene, sectors)
    diameters = [n for n in range(sectors // 2 + 1) if n * blades % max(sectors, 1) == 0]
    reduced = reduce_sector(Bodies(scene, ready.mesh), patches, diameters, MODES)
    cases = load_cases(scene, ready.mesh, ready.contact)
    return scene, reduced, cases, reduced.following.start


def ring_of(scene: Scene, reduced: Reduced, first: int) -> Ring:
    """Blades that may move as they like, with the waves of the wheel that repeat after them.

    Args:
        first: contact rows of the first seat.
    """
    sectors = reduced.sectors
    blades = repeating_blades(scene, sectors)
    omega, damping, shapes = [], [], []
    for n, body in reduced.sector.items():
        own_omega, own_damping, own = with_residual_modes(body, scene.operation.damping)
        turn = np.exp(2j * np.pi * n * np.arange(blades) / max(sectors, 1))
        waves = turn[None, :, None] * own.T[:, None, :]
        parts = [waves.real / np.sqrt(blades)]
        if n != 0 and 2 * n != sectors:
            parts = [waves.real * np.sqrt(2 / blades), -waves.imag * np.sqrt(2 / blades)]
        for part in parts:
            omega.append(own_omega)
            damping.append(own_damping)
            shapes.append(part)
    everywhere = np.concatenate(shapes)
    ports = reduced.sector[0].ports
    contact = everywhere[:, :, ports["contact"]]
    damper_omega, damper_damping, damper = with_residual_modes(
        reduced.damper, scene.operation.damping
    )
    return Ring(
        np.concatenate(omega),
        np.concatenate(damping),
        damper_omega,
        damper_damping,
        np.ascontiguousarray(contact.reshape(len(contact), -1).T),
        scene.excitation.force * everywhere[:, :, ports["load"]][:, :, 0],
        everywhere[:, :, ports["probe"]][:, :, 0].copy(),
        np.ascontiguousarray(damper.real[reduced.damper.ports["contact"]]),
        first,
        2 * np.pi * scene.excitation.engine_order / sectors if sectors else 0.0,
    )


def steps_needed(ring: Ring, layer: Layer, frequency: float, growth: np.ndarray) -> float:
    """Steps a period below which explicit ones grow where all contacts stick.

    Args:
        growth: (nodes,) stiffness of the contacts over that at rest.
    """
    alike = np.column_stack([layer.kn] + [layer.kt] * layer.t0.shape[1])
    springs = (growth[:, None] * alike).ravel()
    rows, blades = len(springs), ring.blades
    both = np.zeros((blades * rows, len(ring.omega) + blades * len(ring.damper_omega)))
    both[:, : len(ring.omega)] = ring.contact
    own = len(ring.damper_omega)
    for b in range(blades):
        for part, blade in ((slice(None, ring.first), b), (slice(ring.first, None), b + 1)):
            there = np.arange(rows)[part]
            at = blade % blades * rows + there
            columns = len(ring.omega) + b * own + np.arange(own)
            both[np.ix_(at, columns)] = -ring.damper[there]
    stiffness = np.diag(np.r_[ring.omega**2, np.tile(ring.damper_omega**2, blades)])
    stiffness += both.T @ (np.tile(springs, blades)[:, None] * both)
    highest = np.sqrt(np.linalg.eigvalsh(stiffness)[-1])
    return float(highest / frequency / LARGEST_STEP)


@njit(cache=True, error_model="numpy")
def contact_forces(w, before, friction, layer, out, slips, opens, work, most):
    """Forces (blades, rows) on the dampers beyond the preload; friction holds the sliders', and
    most (nodes,) the largest stiffness over that at rest.
    """
    kt, kn, mu, n0, decay, t0 = layer
    per = 1 + friction.shape[2]
    x = np.zeros(friction.shape[2])
    for b in range(w.shape[0]):
        for k in range(kt.size):
            i = per * k
            growth = 1.0
            normal = n0[k] + kn[k] * w[b, i]
            if np.isfinite(decay[k]):
                growth = np.exp(w[b, i] / decay[k])
                normal = n0[k] + kn[k] * decay[k] * (growth - 1)
                most[k] = max(most[k], growth)
            if normal <= 0:
                normal = 0.0
                opens[b, k] += 1
            size = 0.0
            for t in range(per - 1):
                moved = w[b, i + 1 + t] - before[b, i + 1 + t]
                x[t] = friction[b, k, t] + growth * kt[k] * moved
                size += x[t] * x[t]
            size = np.sqrt(size)
            limit = mu[k] * normal
            if size > limit:
                for t in range(per - 1):
                    x[t] *= limit / size
                if normal > 0:
                    slips[b, k] += 1
            for t in range(per - 1):
                moved = w[b, i + 1 + t] - before[b, i + 1 + t]
                work[b] += 0.5 * (x[t] + friction[b, k, t]) * moved
                friction[b, k, t] = x[t]
                out[b, i + 1 + t] = x[t] - t0[k, t]
            out[b, i] = normal - max(n0[k], 0.0)
        for i in range(w.shape[1]):
            before[b, i] = w[b, i]


@njit(cache=True, error_model="numpy")
def march_steps(ring, damper, contact, state, drive, out):
    """Semi-implicit Euler steps; out (steps, blades) becomes the readings.

    In loops: expressions of whole arrays take 20 s to compile.
    """
    moved, pushed, force, reading, stiffness, damping = ring
    shapes, damper_stiffness, damper_damping = damper
    q, v, p, z, friction, before, slips, opens, work, most = state
    omega, phase, dt, first = drive
    blades = p.shape[0]
    rows = shapes.shape[0]
    half = int(first)
    w = np.zeros((blades, rows))
    on_damper = np.zeros((blades, rows))
    on_blade = np.zeros(blades * rows)
    waves = np.zeros(blades)
    turned = np.ascontiguousarray(shapes.T)
    for i in range(out.shape[0]):
        u = np.dot(moved, q)
        d = np.dot(p, turned)
        for b in range(blades):
            for r in range(rows):
                # the first seat touches this blade, the other one the next
                blade = b if r < half else (b + 1) % blades
                w[b, r] = u[blade * rows + r] - d[b, r]
        contact_forces(w, before, friction, contact, on_damper, slips, opens, work, most)
        for b in range(blades):
            for r in range(rows):
                blade = b if r < half else (b + 1) % blades
                on_blade[blade * rows + r] = on_damper[b, r]
        push = np.dot(pushed, on_blade)
        push_damper = np.dot(on_damper, shapes)
        for b in range(blades):
            waves[b] = np.cos(omega * (i * dt) + b * phase)
        for m in range(q.size):
            total = -push[m]
            for b in range(blades):
                total += force[m, b] * waves[b]
            v[m] = (v[m] + dt * (total - stiffness[m] * q[m])) / (1 + dt * damping[m])
            q[m] += dt * v[m]
        for b in range(blades):
            for m in range(p.shape[1]):
                step = dt * (push_damper[b, m] - damper_stiffness[m] * p[b, m])
                z[b, m] = (z[b, m] + step) / (1 + dt * damper_damping[m])
                p[b, m] += dt * z[b, m]
            out[i, b] = 0.0
            for m in range(q.size):
                out[i, b] += reading[m, b] * q[m]


def start_at_rest(ring: Ring, layer: Layer) -> State:
    modes, own, blades = len(ring.omega), len(ring.damper_omega), ring.blades
    nodes = len(layer.kt)
    return State(
        np.zeros(modes),
        np.zeros(modes),
        np.zeros((blades, own)),
        np.zeros((blades, own)),
        np.tile(layer.t0, (blades, 1, 1)),
        np.zeros((blades, len(ring.damper))),
        np.zeros((blades, nodes)),
        np.zeros((blades, nodes)),
        np.zeros(blades),
        np.ones(nodes),
    )


def march(
    ring: Ring, layer: Layer, state: State, frequency: float, steps: int, scale: float = 1.0
) -> np.ndarray:
    """(blades,) amplitudes over one period [m]: root of the sum of squares of the harmonics."""
    omega = 2 * np.pi * frequency
    dt = 2 * np.pi / omega / steps
    out = np.zeros((steps, ring.blades))
    for count in (state.slips, state.opens, state.work):
        count[:] = 0.0
    march_steps(
        (
            ring.contact,
            ring.pushed,
            scale * ring.force,
            ring.reading,
            ring.omega**2,
            2 * ring.damping * ring.omega,
        ),
        (ring.damper, ring.damper_omega**2, 2 * ring.damper_damping * ring.damper_omega),
        (*layer.table, layer.t0),
        (
            state.q,
            state.v,
            state.p,
            state.z,
            state.friction,
            state.before,
            state.slips,
            state.opens,
            state.work,
            state.growth,
        ),
        (omega, ring.phase, dt, float(ring.first)),
        out,
    )
    return 2 * np.linalg.norm(np.fft.rfft(out, axis=0)[1 : HARMONICS + 1], axis=0) / steps


@dataclass(frozen=True)
class Kept:
    """What a march keeps over its last periods."""

    # of all blades [m]
    low: float
    high: float
    # friction work of a damper and period [J]
    work: float
    # of the nodes and instants of these periods
    slip: float
    open: float
    # until mean and highest amplitude stayed
    periods: int

    @property
    def steady(self) -> bool:
        return self.periods < MOST_PERIODS


def kept(ring: Ring, layer: Layer, state: State, frequency: float, steps: int) -> Kept:
    """The amplitudes of the last periods, once their mean and their highest stay."""
    heights: list[np.ndarray] = []
    shares: list[tuple[float, ...]] = []
    last = np.full(2, np.inf)
    while len(heights) < MOST_PERIODS:
        for _ in range(STEADY_PERIODS):
            heights.append(march(ring, layer, state, frequency, steps))
            slip, opens = (float(x.mean() / steps) for x in (state.slips, state.opens))
            shares.append((float(state.work.mean()), slip, opens))
        # beats that die out leave the mean where it is
        now = np.array([np.mean(heights[-STEADY_PERIODS:]), np.max(heights[-STEADY_PERIODS:])])
        if (abs(now / last - 1) < STEADY).all() or not np.isfinite(now).all():
            break
        last = now
    few = np.array(heights[-STEADY_PERIODS:])
    work, slip, opens = np.mean(shares[-STEADY_PERIODS:], axis=0)
    return Kept(few.min(), few.max(), work, slip, opens, len(heights))


def passed_band(
    ring: Ring,
    layer: Layer,
    state: State,
    frequency: float,
    around: Sequence[float],
    steps: int,
) -> tuple[float, float]:
    """Frequency [Hz] and amplitude [m] of the highest motion over a band passed upwards, then
    downwards.

    Args:
        state: at rest; changed.
        around: [%] of the frequency, below and above.
    """
    offsets = np.unique(np.r_[[-x for x in around], 0.0, around])
    places = frequency * (1 + np.r_[offsets, offsets[-2::-1]] / 100)
    heights = [kept(ring, layer, state, place, steps).high for place in places]
    top = int(np.argmax(heights))
    return float(places[top]), heights[top]


def has_enough_steps(
    ring: Ring, layer: Layer, state: State, load: float, frequency: float, steps: int
) -> bool:
    """Whether steps are short enough for the stiffness that the layer has reached; prints how many
    it takes where they are not.
    """
    needed = steps_needed(ring, layer, frequency, np.minimum(state.growth, LARGEST_GROWTH))
    if steps < needed:
        print(
            f"{load:g} N: {steps} steps a period, expected more than {needed:.0f} for a layer "
            f"{state.growth.max():.3g} times as stiff as at rest",
            flush=True,
        )
    return steps >= needed


def print_load(
    ring: Ring, layer: Layer, load: float, reported: pd.Series, steps: int, around: Sequence[float]
) -> None:
    """One row of the table."""
    begin = time.process_time()
    frequency = reported["peak_frequency [Hz]"]
    amplitude = reported["peak_amplitude [m]"]
    state = start_at_rest(ring, layer)
    if not has_enough_steps(ring, layer, state, load, frequency, steps):
        return
    words = "rest"
    found = kept(ring, layer, state, frequency, steps)
    if found.high < amplitude / 2:
        words = f"{STRONG:g} times the force"
        state = start_at_rest(ring, layer)
        for _ in range(STRONG_PERIODS):
            march(ring, layer, state, frequency, steps, STRONG)
        found = kept(ring, layer, state, frequency, steps)
    if not has_enough_steps(ring, layer, state, load, frequency, steps):
        return
    beside = "-"
    if around:
        state = start_at_rest(ring, layer)
        place, height = passed_band(ring, layer, state, frequency, around, steps)
        if not has_enough_steps(ring, layer, state, load, frequency, steps):
            return
        beside = f"{1e6 * height:.4g} at {place:.2f}"
    seconds = time.process_time() - begin
    print(
        f"| {load:g} | {frequency:.2f} | {1e6 * amplitude:.4g} | {100 * reported['error']:.1f} | "
        f"{1e6 * found.low:.4g} to {1e6 * found.high:.4g} | "
        f"{100 * (amplitude / found.high - 1):+.1f} | {beside} | "
        f"{1e3 * reported['dissipated [J]']:.4g} / {1e3 * found.work:.4g} | "
        f"{100 * found.slip:.0f}, {100 * found.open:.0f} | {words} | "
        f"{found.periods}{'' if found.steady else ' (not steady)'} | {seconds:.0f} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", nargs="?", default="runs/wedge", help="of a run of the scene")
    parser.add_argument("--loads", type=float, nargs="+", help="[N], all of the run when left out")
    parser.add_argument("--steps", type=int, default=1000, help="a period")
    parser.add_argument(
        "--around", type=float, nargs="+", default=[], help="[%%] of the frequency, passed as well"
    )
    parser.add_argument("--law", action="store_true", help="the layer stiffens with its pressure")
    options = parser.parse_args()
    folder = Path(options.folder)
    summary = pd.read_csv(folder / "summary.csv").set_index("load [N]")
    summary = summary[(summary.index > 0) & np.isfinite(summary.index)]
    loads = options.loads or list(summary.index)
    scene, reduced, cases, first = reduced_scene(folder / "scene.toml", tempfile.mkdtemp(), loads)
    ring = ring_of(scene, reduced, first)
    heads = [
        "load [N]",
        "at [Hz]",
        "reported [um]",
        "estimated error [%]",
        "marched [um]",
        "reported over marched [%]",
        "highest around [um]",
        "friction work reported / marched [mJ]",
        "slip, open [%]",
        "from",
        "periods",
        "CPU [s]",
    ]
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}")
    for case in cases:
        nearest = abs(summary.index.to_numpy() - case.load).argmin()
        layer = layer_of(case, options.law)
        print_load(ring, layer, case.load, summary.iloc[nearest], options.steps, options.around)


if __name__ == "__main__":
    main()
