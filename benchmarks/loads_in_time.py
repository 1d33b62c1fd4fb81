"""The shipped wedge marched in time at its reported resonances, by code of its own.

Four free blades and dampers (engine order 9 of 36 repeats after four), all contact nodes, friction
by a return map written here, small explicit steps, no harmonics.

    python benchmarks/loads_in_time.py [run folder] [--loads 36 73 ...] [--steps 1000]

The run folder is that of `./run` (runs/wedge), whose summary.csv tells loads, frequencies,
amplitudes and estimated errors. Taken from the package are the reduced sector (modes and residual
flexibility in the nodal diameters 0, 9 and 18), the preload of the seats and the layer. Residual
flexibility has no inertia: its stiffest part is left out, the rest becomes modes at
RESIDUAL_FREQUENCY. Where the blade, from rest, keeps to less than half of the amplitude told, it is
driven STRONG times as hard first: where contacts lift off there are several motions.
"""

from __future__ import annotations

import argparse
import tempfile
import time
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
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.reduced_sector import Reduced, reduce_sector

SCENE = Path(__file__).parents[1] / "scenes" / "wedge.toml"
BLADES = 4
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


@dataclass(frozen=True)
class Ring:
    """Four blades and their dampers by modes."""

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
    # contact nodes on the seat that touches the blade before the damper
    first: int
    # between a blade and the next [rad]
    phase: float

    @cached_property
    def pushed(self) -> np.ndarray:
        """(m, blades * rows) of the contact forces."""
        return np.ascontiguousarray(self.contact.T)


@dataclass
class State:
    """Where a march is."""

    q: np.ndarray
    v: np.ndarray
    p: np.ndarray
    z: np.ndarray
    # (blades, nodes, 2) friction [N], and (blades, rows) displacements before
    friction: np.ndarray
    before: np.ndarray
    time: float = 0.0


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


def reduced_scene(folder: str, loads: list[float]) -> tuple[Scene, Reduced, list[LoadCase], int]:
    """The shipped scene, its sector, its seats under these loads, and the nodes of the first."""
    scene = vary(load_scene(SCENE), "study.loads", loads, "study.own_load", False)
    ready = pipeline.run(scene, folder, until="contact")
    patches = list(ready.contact.problem.patches)
    diameters = [0, scene.excitation.engine_order, scene.disc.sectors // 2]
    reduced = reduce_sector(Bodies(scene, ready.mesh), patches, diameters, MODES)
    cases = load_cases(scene, ready.mesh, ready.contact)
    return scene, reduced, cases, len(patches[0].area)


def ring_of(scene: Scene, reduced: Reduced, first: int) -> Ring:
    """Four blades that may move as they like, a quarter of the waves of the wheel.

    Args:
        first: contact nodes of the first seat.
    """
    sectors = scene.disc.sectors
    omega, damping, shapes = [], [], []
    for n, body in reduced.sector.items():
        own_omega, own_damping, own = with_residual_modes(body, scene.operation.damping)
        turn = np.exp(2j * np.pi * n * np.arange(BLADES) / sectors)
        waves = turn[None, :, None] * own.T[:, None, :]
        parts = [waves.real / np.sqrt(BLADES)]
        if n not in (0, sectors // 2):
            parts = [waves.real * np.sqrt(2 / BLADES), -waves.imag * np.sqrt(2 / BLADES)]
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
        2 * np.pi * scene.excitation.engine_order / sectors,
    )


@njit
def contact_forces(w, before, friction, kt, kn, mu, n0, out):
    """Forces (blades, rows) on the dampers beyond the preload; friction holds the sliders'."""
    for b in range(w.shape[0]):
        for k in range(kt.size):
            normal = max(n0[k] + kn[k] * w[b, 3 * k], 0.0)
            x = friction[b, k, 0] + kt[k] * (w[b, 3 * k + 1] - before[b, 3 * k + 1])
            y = friction[b, k, 1] + kt[k] * (w[b, 3 * k + 2] - before[b, 3 * k + 2])
            size = np.sqrt(x * x + y * y)
            limit = mu[k] * normal
            if size > limit:
                x *= limit / size
                y *= limit / size
            friction[b, k, 0] = x
            friction[b, k, 1] = y
            out[b, 3 * k] = normal - max(n0[k], 0.0)
            out[b, 3 * k + 1] = x
            out[b, 3 * k + 2] = y
    before[:] = w


@njit
def march_steps(ring, damper, contact, state, drive, out):
    """Semi-implicit Euler steps; out (steps, blades) becomes the readings."""
    moved, pushed, force, reading, stiffness, damping = ring
    shapes, damper_stiffness, damper_damping = damper
    q, v, p, z, friction, before = state
    omega, phase, dt, start, first = drive
    blades = p.shape[0]
    rows = shapes.shape[0]
    half = 3 * int(first)
    w = np.zeros((blades, rows))
    on_damper = np.zeros((blades, rows))
    on_blade = np.zeros((blades, rows))
    turned = np.ascontiguousarray(shapes.T)
    for i in range(out.shape[0]):
        u = np.dot(moved, q).reshape(blades, rows)
        d = np.dot(p, turned)
        for b in range(blades):
            # the first seat touches this blade, the other one the next
            w[b, :half] = u[b, :half] - d[b, :half]
            w[b, half:] = u[(b + 1) % blades, half:] - d[b, half:]
        contact_forces(w, before, friction, *contact, on_damper)
        for b in range(blades):
            on_blade[b, :half] = on_damper[b, :half]
            on_blade[b, half:] = on_damper[(b - 1) % blades, half:]
        push = -np.dot(pushed, on_blade.ravel())
        time = start + i * dt
        for b in range(blades):
            push += force[:, b] * np.cos(omega * time + b * phase)
        v[:] = (v + dt * (push - stiffness * q)) / (1 + dt * damping)
        q += dt * v
        push_damper = np.dot(on_damper, shapes)
        for b in range(blades):
            step = dt * (push_damper[b] - damper_stiffness * p[b])
            z[b] = (z[b] + step) / (1 + dt * damper_damping)
        p += dt * z
        for b in range(blades):
            out[i, b] = np.sum(reading[:, b] * q)


def start_at_rest(ring: Ring, nodes: int) -> State:
    modes, own = len(ring.omega), len(ring.damper_omega)
    sizes = (modes, modes, (BLADES, own), (BLADES, own), (BLADES, nodes, 2), (BLADES, 3 * nodes))
    return State(*(np.zeros(size) for size in sizes))


def march(
    ring: Ring, case: LoadCase, state: State, frequency: float, steps: int, scale: float = 1.0
) -> np.ndarray:
    """(blades,) amplitudes over one period [m]: root of the sum of squares of the harmonics."""
    e = case.elements
    nodes = len(e.kt)
    layer = tuple(np.broadcast_to(x, nodes).astype(float) for x in (e.kt, e.kn, e.mu, e.n0))
    omega = 2 * np.pi * frequency
    dt = 2 * np.pi / omega / steps
    out = np.zeros((steps, BLADES))
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
        layer,
        (state.q, state.v, state.p, state.z, state.friction, state.before),
        (omega, ring.phase, dt, state.time, float(ring.first)),
        out,
    )
    state.time += steps * dt
    return 2 * np.linalg.norm(np.fft.rfft(out, axis=0)[1 : HARMONICS + 1], axis=0) / steps


def kept(
    ring: Ring, case: LoadCase, state: State, frequency: float, steps: int
) -> tuple[float, float, int]:
    """Lowest and highest amplitude of the last periods [m], and the periods that it took."""
    heights: list[np.ndarray] = []
    last = np.inf
    while len(heights) < MOST_PERIODS:
        heights += [march(ring, case, state, frequency, steps) for _ in range(STEADY_PERIODS)]
        mean = float(np.mean(heights[-STEADY_PERIODS:]))
        if abs(mean / last - 1) < STEADY:
            break
        last = mean
    few = np.array(heights[-STEADY_PERIODS:])
    return few.min(), few.max(), len(heights)


def print_load(ring: Ring, case: LoadCase, told: pd.Series, steps: int) -> None:
    """One row of the table."""
    begin = time.process_time()
    frequency = told["peak_frequency [Hz]"]
    amplitude = told["peak_amplitude [m]"]
    words = "rest"
    state = start_at_rest(ring, len(case.elements.kt))
    low, high, periods = kept(ring, case, state, frequency, steps)
    if high < amplitude / 2:
        words = f"{STRONG:g} times the force"
        state = start_at_rest(ring, len(case.elements.kt))
        for _ in range(STRONG_PERIODS):
            march(ring, case, state, frequency, steps, STRONG)
        low, high, periods = kept(ring, case, state, frequency, steps)
    seconds = time.process_time() - begin
    print(
        f"| {case.load:g} | {frequency:.2f} | {1e6 * amplitude:.1f} | {100 * told['error']:.1f} | "
        f"{1e6 * low:.1f} to {1e6 * high:.1f} | {100 * (amplitude / high - 1):+.1f} | {words} | "
        f"{periods}{' (not steady)' if periods >= MOST_PERIODS else ''} | {seconds:.0f} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", nargs="?", default="runs/wedge", help="of a run of the scene")
    parser.add_argument("--loads", type=float, nargs="+", help="[N], all of the run when left out")
    parser.add_argument("--steps", type=int, default=1000, help="a period")
    options = parser.parse_args()
    summary = pd.read_csv(Path(options.folder) / "summary.csv").set_index("load [N]")
    summary = summary[(summary.index > 0) & np.isfinite(summary.index)]
    loads = options.loads or list(summary.index)
    scene, reduced, cases, first = reduced_scene(tempfile.mkdtemp(), loads)
    ring = ring_of(scene, reduced, first)
    print(
        "| load [N] | at [Hz] | told [um] | estimated error [%] | marched [um] | told over marched "
        "[%] | from | periods | CPU [s] |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    )
    for case in cases:
        nearest = abs(summary.index.to_numpy() - case.load).argmin()
        print_load(ring, case, summary.iloc[nearest], options.steps)


if __name__ == "__main__":
    main()
