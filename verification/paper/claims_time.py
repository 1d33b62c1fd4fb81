"""Claims about the blades, judged by integration in time of the complete coupled system: blades,
damper, contacts.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bladefem.damper.branch import state_of
from bladefem.damper.direct import direct
from bladefem.damper.explicit import Cycle, explicit_march
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.response import response
from bladefem.hbm.solution import Solution, size
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import stability_verdict
from bladefem.hbm.time_model import time_system
from bladefem.study.stability.verdicts import in_one_body, judged_motion
from bladefem.time.shooting import floquet_multipliers, periodic_solution, probe_harmonics
from bladefem.time.system import System
from verification.paper.blades import judge, peak
from verification.paper.plane_row import whole_model
from verification.paper.view_contact import draw_sweeps

from .claim import Claim, verdict
from .claims_blades import BANDS, LOADS, MASSES, model_of, row_and_scene

# of the explicit march
STEPS = 1024
TOLERANCE = 1e-6
# largest multiplier; 1 where a contact sticks all the time
UNSTABLE = 1.001


def in_time(_: Path) -> Iterator[Claim]:
    """Fig. 15 and 17 at resonance: both modes, all masses, all loads; then with normal loads that
    follow the motion.
    """
    errors = []
    periods = []
    lost = []
    for mode in (1, 2):
        for mass in MASSES:
            for load in LOADS:
                model = model_of("soft", load, mass)
                top = peak(model, BANDS["soft", mode], 3, 128).solution
                exact, tip, _system = judge(model, top.frequency)
                found = solve(model, top.omega, 7, 1024, start=top)
                if exact.converged and found.converged:
                    errors.append(abs(found.probe[1, 0] / tip[1] - 1))
                    periods.append(exact.periods)
                else:
                    lost.append(f"mode {mode}, {1e3 * mass:g} g, {load:g} N")
    count = 2 * len(MASSES) * len(LOADS)
    yield Claim(
        "Fig. 15, 17",
        "the harmonic balance gives the response of the coupled system",
        f"{len(errors)} of {count} resonances (modes 1 and 2, {len(MASSES)} masses, {len(LOADS)} "
        f"loads) closed in time, after {int(np.median(periods))} periods in the middle; 7 "
        f"harmonics are {max(errors):.0e} off at worst, {np.median(errors):.0e} in the middle"
        + (f"; not closed: {'; '.join(lost)}" if lost else ""),
        verdict(not lost and max(errors) < 0.02, len(errors) > 0.9 * count),
    )
    yield from following()


def following(loads: tuple[float, ...] = (4.0, 20.0, 100.0)) -> Iterator[Claim]:
    """The rigid damper with its three degrees of freedom, on contacts whose normal load follows and that may
    open.
    """
    row, scene = row_and_scene("soft")
    reported = []
    worst = 0.0
    largest = 0.0
    for load in loads:
        model = in_one_body(whole_model(scene, row, load))
        top = peak(model, BANDS["soft", 2], 5).solution
        found = solve(model, top.omega, 9, 1024, start=top)
        system = time_system(model, 1)
        begin = state_of(found, system)
        exact = periodic_solution(system, top.omega, begin, samples=512)
        error = abs(found.probe[1, 0] / probe_harmonics(exact, system, 1)[0, 1] - 1)
        multiplier = np.abs(floquet_multipliers(exact)).max()
        cycle = direct(
            system,
            top.omega,
            STEPS,
            begin if multiplier > UNSTABLE else None,
            4000,
            TOLERANCE,
            True,
        )
        marched = 2 * np.fft.rfft(cycle.q @ system.probe[0])[1] / len(cycle.q)
        worst = max(worst, error)
        largest = max(largest, multiplier)
        settled = f"{cycle.periods} periods" if cycle.reason == "periodic" else cycle.reason
        off = f"{abs(found.probe[1, 0] / marched - 1):.0e} from explicit steps from rest, {settled}"
        end = _afterwards(system, cycle, found) if multiplier > UNSTABLE else off
        closed = "" if exact.converged else f" (closed to {exact.residual:.0e} only)"
        reported.append(
            f"{load:g} N at {top.frequency:.1f} Hz {error:.0e} from the exact flow{closed}, "
            f"largest multiplier {multiplier:.4f}, {end}"
        )
    yield Claim(
        "Fig. 13, 14",
        "the same where the damper moves in its plane and the normal load follows",
        "balance with 9 harmonics: "
        + "; ".join(reported)
        + ". Points that always stick may carry any mean force "
        "that they can hold, so that not all digits need to agree",
        "fails" if worst > 0.01 else "holds in part" if largest > UNSTABLE else "holds",
    )


def _afterwards(system: System, cycle: Cycle, found: Solution, periods: int = 100) -> str:
    """Where the motion goes that an unstable solution is left for: the last periods of a march that
    did not settle.
    """
    march = explicit_march(system, found.omega, STEPS)
    state = cycle.state
    tip = []
    for _ in range(periods):
        state, q, _, _ = march(state)
        tip.append(q @ system.probe[0])
    tip = np.concatenate(tip) - np.mean(tip)
    swing = 1e6 * np.array(
        [np.sqrt(np.mean(tip**2)), np.abs(tip).max(), size(found) / np.sqrt(2), size(found)]
    )
    return (
        f"unstable: explicit steps leave it, {cycle.reason}; over {periods} more periods the tip "
        f"then swings by {swing[0]:.1f} µm rms, {swing[1]:.1f} µm at most, where the periodic "
        f"motion has {swing[2]:.1f} and about {swing[3]:.1f} µm"
    )


def two_motions(folder: Path) -> Iterator[Claim]:
    """Sweeps up and down where the normal load follows the motion, and where it does not."""
    row, scene = row_and_scene("soft")
    load = 3.0
    model = in_one_body(whole_model(scene, row, load))
    frequency = np.linspace(1125, 1175, 51)
    ways = {}
    reported = []
    for name, points in _both_ways(model, frequency).items():
        heights = np.array([size(s) for s in points])
        largest = np.array(
            [stability_verdict(model, judged_motion(model, s)).multiplier for s in points]
        )
        ways[name] = heights, largest
        reported.append(
            f"{name} it reaches {1e6 * heights.max():.1f} µm, {int((largest > UNSTABLE).sum())} of "
            f"{len(points)} points unstable, {int(np.isnan(largest).sum())} not judged, "
            f"largest multiplier {np.nanmax(largest):.3f}"
        )
    draw_sweeps(frequency, ways, folder / "stability_blades.png")
    up, down = (amplitude for amplitude, _ in ways.values())
    apart = frequency[np.abs(up / down - 1) > 0.01]
    plain = [
        np.array([size(s) for s in way])
        for way in _both_ways(model_of("soft", load), frequency).values()
    ]
    where = f"part from {apart.min():.1f} to {apart.max():.1f} Hz" if len(apart) else "agree"
    yield Claim(
        "Fig. 15",
        "one response for a frequency",
        f"plane blades, {load:g} N, rigid damper whose normal load follows: sweeps up and down {where}; "
        + "; ".join(reported)
        + "; with the paper's constant loads they agree to "
        f"{np.abs(plain[0] / plain[1] - 1).max():.0e}",
        verdict(not len(apart)),
        ("stability_blades.png",),
        "The same blade and damper swept up and down: two motions at one frequency where seats "
        "lift off. Left: circles stable, squares unstable. Right: the multipliers of both.",
    )


def _both_ways(model: ReducedModel, frequency: np.ndarray) -> dict[str, list[Solution]]:
    """Points of a sweep up and of one down, ascending in frequency."""
    return {
        "upwards": list(response(model, 2 * np.pi * frequency, 3, 256)),
        "downwards": list(response(model, 2 * np.pi * frequency[::-1], 3, 256))[::-1],
    }
