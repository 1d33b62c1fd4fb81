"""The shipped mistuned wheel marched in time at its reported resonance, by code of its own: all
blades and dampers from rest, friction by a return map written here, no nodal diameters, no
harmonics, no mean displacement held.

    python benchmarks/wheel_in_time.py [--set KEY=VALUE ...] [--harmonics 1 3 5 7] [--hold-means]
        [--output FOLDER]

Taken from the package is the reduced sector alone: modes, residual flexibility, elements, the
forces and the pattern. Beside the march stand the balances with several harmonics at the same
frequency, with means held as in the run and with free ones as in the march. With --hold-means the
wheel is marched once more under the mean contact forces of the richest balance with held means, as
if these were its preload: what free means change is the difference.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from bladefem.hbm.solver.newton import Options
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.band_sweep import solver_options
from bladefem.study.mistuning.blade_material import deviation_pattern
from bladefem.study.mistuning.pattern_response import PatternResponse
from bladefem.study.mistuning.stage import with_whole_wheel
from bladefem.study.mistuning.validate import scene_deviations
from bladefem.study.mistuning.whole_wheel import reduce_wheel, whole_wheel
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.run_records import SolvedRun
from bladefem.wheel.model import Pattern, Wheel
from bladefem.wheel.solution import WheelSolution
from bladefem.wheel.solve import solve_wheel

SCENE = Path(__file__).parents[1] / "scenes" / "mistuned.toml"
STEPS = 256
# periods over which the force grows, and after which a march is given up
RAMP = 10
PERIODS = 600
# two means of the amplitudes over so many periods that follow each other, relative
STEADY_PERIODS = 20
STEADY = 2e-4
# of the forces of a step, to the largest
STEP_ACCURACY = 1e-7


@dataclass(frozen=True)
class Marched:
    """The last periods of a march; N blades."""

    # (N,) root of the sum of squares of harmonics 1 to 7 of the probe [m]
    size: np.ndarray
    # (N,) complex amplitude of harmonic 1 [m]
    first: np.ndarray
    # change of the largest between the last two means, relative
    change: float
    periods: int
    # share of all contacts that slipped in the last period, and that lifted off
    slipping: float
    lifting: float
    # how far the contacts go on in the last period, root of the mean of squares [m]
    walk: float
    # (steps, N n, 3) relative displacements of the contacts in the last period, from the first
    # step's end on [m]
    contacts: np.ndarray


@dataclass(frozen=True)
class Ring:
    """All bodies of a wheel in real coordinates of mass 1; rows of a port blade by blade."""

    # (M,) circular frequencies [rad/s], and damping ratios
    omega: np.ndarray
    ratio: np.ndarray
    # port to (rows, M) displacements by the coordinates
    shapes: dict[str, np.ndarray]
    # (port, port) to (rows, rows) displacements by forces, without inertia [m/N]
    residual: dict[tuple[str, str], np.ndarray]


def ring_of(wheel: Wheel) -> Ring:
    """The sectors of all nodal diameters as standing waves, and the rigid dampers."""
    N = wheel.count
    names = ("contact", "blade", "load", "probe")
    ports = wheel.sectors[0].ports
    everything = np.arange(len(wheel.sectors[0].residual))
    rows = {name: everything[ports[name]] for name in names}
    parts: dict[str, list[np.ndarray]] = {name: [] for name in names}
    omega = []
    for d, body in wheel.sectors.items():
        turn = np.exp(2j * np.pi * d * np.arange(N) / N)
        for name in names:
            wave = (turn[:, None, None] * body.shapes[rows[name]]).reshape(-1, len(body.omega))
            if 2 * d % N == 0:
                parts[name].append(wave.real / np.sqrt(N))
            else:
                parts[name].append(np.hstack([wave.real, -wave.imag]) * np.sqrt(2 / N))
        omega.append(np.tile(body.omega, 1 if 2 * d % N == 0 else 2))
    shapes = {name: np.hstack(part) for name, part in parts.items()}
    blades = np.concatenate(omega)
    # a damper's coordinates move its side of the contacts, so that blade minus damper has -B
    own = wheel.damper.B @ np.linalg.inv(np.linalg.cholesky(wheel.damper.mass)).T
    k = own.shape[1]
    for name in names:
        added = (
            -np.kron(np.eye(N), own) if name == "contact" else np.zeros((len(shapes[name]), N * k))
        )
        shapes[name] = np.hstack([shapes[name], added])
    ratio = np.concatenate([np.full(len(blades), wheel.damping.ratio), np.zeros(N * k)])
    residual = {}
    for a in names:
        for b in names:
            by_distance = np.zeros((N, len(rows[a]), len(rows[b])), dtype=complex)
            for d in range(N):
                body = wheel.sectors[min(d, N - d)]
                R = body.residual[np.ix_(rows[a], rows[b])]
                turn = np.exp(2j * np.pi * d * np.arange(N) / N)
                by_distance += turn[:, None, None] * (R if 2 * d <= N else R.conj()) / N
            s = np.arange(N)
            full = by_distance.real[(s[:, None] - s) % N]
            residual[a, b] = full.transpose(0, 2, 1, 3).reshape(N * len(rows[a]), -1)
    return Ring(np.concatenate([blades, np.zeros(N * k)]), ratio, shapes, residual)


def exact_step(ring: Ring, dt: float) -> tuple[np.ndarray, ...]:
    """(M, 2, 2) motion and (M, 2) what forces at the beginning and at the end of a step add to
    displacement and velocity; forces are linear between.
    """
    M = len(ring.omega)
    E = np.empty((M, 2, 2))
    begin, end = np.empty((M, 2)), np.empty((M, 2))
    wide = np.zeros((4, 4))
    for i, (w, z) in enumerate(zip(ring.omega, ring.ratio, strict=True)):
        # displacement, velocity, force and its rate
        wide[:] = 0.0
        wide[0, 1] = 1.0
        wide[1, :3] = -(w**2), -2 * z * w, 1.0
        wide[2, 3] = 1.0
        flow = expm(wide * dt)
        E[i] = flow[:2, :2]
        end[i] = flow[:2, 3] / dt
        begin[i] = flow[:2, 2] - end[i]
    return E, begin, end


def friction(w, slider, kt, kn, mu, n0):
    """Forces (n, 3) at relative displacements w (n, 3) from sliders (n, 2), where these are moved
    to, and the contacts that slip and that are open.
    """
    normal = np.maximum(n0 + kn * w[:, 0], 0.0)
    trial = kt[:, None] * (w[:, 1:] - slider)
    size = np.hypot(trial[:, 0], trial[:, 1])
    limit = mu * normal
    slips = size > limit
    held = trial * np.where(slips, limit / np.maximum(size, 1e-300), 1.0)[:, None]
    moved = np.where(slips[:, None], w[:, 1:] - held / kt[:, None], slider)
    return np.column_stack([normal, held]), moved, slips, normal == 0.0


def march(
    wheel: Wheel,
    pattern: Pattern,
    omega: float,
    steps: int = STEPS,
    most: int = PERIODS,
    steady: float = STEADY,
    mean: np.ndarray | None = None,
) -> Marched:
    """From rest under a growing force to a steady state at circular frequency omega.

    Args:
        mean: (N n, 3) mean contact forces that hold each other; those of the preload when None [N].
    """
    N = wheel.count
    ring = ring_of(wheel)
    e = wheel.all_elements
    dt = 2 * np.pi / omega / steps
    E, begin, end = exact_step(ring, dt)
    # contacts and deviating readings of the blades push alike
    q = len(pattern.stiffness[0])
    contacts = 3 * len(e.kt)
    ports = ("contact", "blade")
    U = np.vstack([ring.shapes[p] for p in ports])
    R = np.block([[ring.residual[a, b] for b in ports] for a in ports])
    by_load = np.vstack([ring.residual[p, "load"] for p in ports])
    F = R + (U * end[:, 0]) @ U.T
    amplitude = wheel.excitation[1].ravel()
    preload = np.zeros((len(e.kt), 3))
    preload[:, 0] = np.maximum(e.n0, 0.0)
    preload[:, 1:] = e.traction
    if mean is not None:
        preload = mean
    # sliders from which the friction forces of the preload state follow at rest
    slider = -e.traction / e.kt[:, None]
    x, v = np.zeros(len(ring.omega)), np.zeros(len(ring.omega))
    push = np.zeros(contacts + N * q)
    modal = np.zeros(len(x))
    waves = np.exp(-1j * np.outer(np.arange(1, 8), 2 * np.pi * (1 + np.arange(steps)) / steps))
    history: list[np.ndarray] = []
    motion = np.empty((steps, N))
    moves = np.zeros((steps, len(e.kt), 3))
    change = np.inf
    walk = 0.0
    for period in range(most):
        began = moves[-1].copy()
        slipped = np.zeros(len(e.kt), dtype=bool)
        lifted = np.zeros(len(e.kt), dtype=bool)
        for step in range(steps):
            t = (period * steps + step + 1) * dt
            load = (
                min(1.0, omega * t / (2 * np.pi * RAMP)) * (amplitude * np.exp(1j * omega * t)).real
            )
            before = modal
            outer = ring.shapes["load"].T @ load
            x0 = E[:, 0, 0] * x + E[:, 0, 1] * v + begin[:, 0] * before + end[:, 0] * outer
            v0 = E[:, 1, 0] * x + E[:, 1, 1] * v + begin[:, 1] * before + end[:, 1] * outer
            free = U @ x0 + by_load @ load
            while True:
                w = free - F @ push
                contact = w[:contacts].reshape(-1, 3)
                f, moved, slips, opens = friction(contact, slider, e.kt, e.kn, e.mu, e.n0)
                z = pattern.stiffness @ w[contacts:].reshape(N, q, 1)
                new = np.concatenate([(f - preload).ravel(), z.ravel()])
                far = abs(new - push)[:contacts].max()
                push = new
                if far <= STEP_ACCURACY * max(abs(push[:contacts]).max(), 1e-6):
                    break
            slider = moved
            moves[step] = contact
            slipped |= slips
            lifted |= opens
            inner = U.T @ push
            modal = outer - inner
            x, v = x0 - end[:, 0] * inner, v0 - end[:, 1] * inner
            motion[step] = ring.shapes["probe"] @ x + ring.residual["probe", "load"] @ load
            motion[step] -= ring.residual["probe", "contact"] @ push[:contacts]
            motion[step] -= ring.residual["probe", "blade"] @ push[contacts:]
        history.append(2 / steps * waves @ motion)
        walk = float(np.sqrt(np.mean(np.sum((moves[-1] - began) ** 2, axis=1))))
        if (period + 1) % STEADY_PERIODS == 0 and period + 1 >= 2 * STEADY_PERIODS + RAMP:
            means = [
                np.mean(
                    history[-STEADY_PERIODS * (i + 1) : len(history) - STEADY_PERIODS * i], axis=0
                )
                for i in range(2)
            ]
            change = abs(means[0] - means[1]).max() / abs(means[0]).max()
            if change < steady:
                break
    last = history[-1]
    return Marched(
        np.linalg.norm(last, axis=0),
        last[0],
        float(change),
        period + 1,
        float(slipped.mean()),
        float(lifted.mean()),
        walk,
        moves,
    )


def wheel_of_run(run: SolvedRun) -> tuple[Wheel, Pattern, PatternResponse]:
    """The reduced wheel of a run under the load of its whole wheel, its pattern and response."""
    scene = run.scene
    (found,) = run.wheel
    (curve,) = (c for c in run.response.curves if (c.load, c.mass) == (found.load, found.mass))
    patches = list(run.contact.problem.patches)
    sector = reduce_wheel(
        Bodies(scene, run.mesh),
        patches,
        curve.settings.modes,
        run.clamped,
        scene.mistuning.families,
    )
    cases = {(case.load, case.mass): case for case in load_cases(scene, run.mesh, run.contact)}
    wheel = whole_wheel(
        scene, run.mesh, sector, patches, cases[curve.load, curve.mass], curve.settings
    )
    deviation = scene_deviations(scene, wheel.count, scene.mistuning.families)
    return wheel, deviation_pattern(sector.families, deviation), found


def balances(
    wheel: Wheel, pattern: Pattern, omega: float, harmonics: list[int], options: Options
) -> WheelSolution | None:
    """Print the highest blade with several harmonics, each from the one before; the last one with
    held means that is solved.
    """
    start: WheelSolution | None = None
    for coupled in (True, False):
        one = replace(wheel, coupled=coupled)
        start = None
        for H in harmonics:
            begun = time.process_time()
            point = solve_wheel(
                one, omega, H, max(128, 32 * (H + 1)), pattern=pattern, start=start, options=options
            )
            size = point.size()
            print(
                f"balance, means {'free' if coupled else 'held'}, {H} harmonics, "
                f"{point.samples} samples: blade {size.argmax() + 1}, {1e6 * size.max():.2f} um; "
                f"{point.reason}, residual {point.residual:.1e}, {point.method}, "
                f"{point.iterations} steps, {time.process_time() - begun:.1f} s of CPU",
                flush=True,
            )
            start = point if point.converged else start
    return start


def print_march(marched: Marched, steps: int, seconds: float, found: PatternResponse) -> None:
    """What a march gave, beside the response of the run."""
    print(
        f"marched, {steps} steps: blade {marched.size.argmax() + 1}, "
        f"{1e6 * marched.size.max():.2f} um after {marched.periods} periods, still changing by "
        f"{100 * marched.change:.2g} %; {100 * marched.slipping:.0f} % of the contacts slip, "
        f"{100 * marched.lifting:.0f} % lift off; they go on by {1e6 * marched.walk:.2g} um a "
        f"period; {seconds:.0f} s of CPU",
        flush=True,
    )
    off = np.abs(marched.size - found.solution.size()).max() / marched.size.max()
    print(f"largest difference of any blade {100 * off:.2g} % of the highest", flush=True)


def main() -> None:
    """March the wheel of a scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--set", action="append", default=[], dest="overrides")
    parser.add_argument("--harmonics", type=int, nargs="+", default=[1, 3, 5, 7])
    parser.add_argument("--hold-means", action="store_true")
    parser.add_argument("--steps", type=int, nargs="+", default=[STEPS])
    parser.add_argument("--output", type=Path, default=Path("runs") / "mistuned")
    arguments = parser.parse_args()
    run = with_whole_wheel(
        pipeline.run(load_scene(SCENE, tuple(arguments.overrides)), arguments.output)
    )
    wheel, pattern, found = wheel_of_run(run)
    omega = found.peak.omega
    print(
        f"reported: blade {found.peak.blade + 1}, {1e6 * found.peak.height:.2f} um at "
        f"{omega / (2 * np.pi):.3f} Hz, {found.solution.probe.shape[1] - 1} harmonics; estimated "
        f"error {100 * found.truncation:.2g} %",
        flush=True,
    )
    options = solver_options(run.scene.accuracy)
    point = balances(wheel, pattern, omega, arguments.harmonics, options)
    means: list[np.ndarray | None] = [None]
    if arguments.hold_means and point is not None:
        means.append(point.f[..., 0].reshape(-1, point.f.shape[2]))
    for steps in arguments.steps:
        for mean in means:
            begun = time.process_time()
            marched = march(wheel, pattern, omega, steps, mean=mean)
            print("free means:" if mean is None else "mean forces of the balance:")
            print_march(marched, steps, time.process_time() - begun, found)


if __name__ == "__main__":
    sys.exit(main())
