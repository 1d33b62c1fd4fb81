"""Claims about the blades, judged by integration in time of the complete coupled system: blades, damper, contacts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bladefem.damper.blades import judge, peak
from bladefem.damper.branch import state_of
from bladefem.damper.direct import direct
from bladefem.hbm.api import solve
from bladefem.hbm.in_time import time_system
from bladefem.hbm.shooting import harmonics, multipliers, periodic
from bladefem.study.row import whole_model
from bladefem.study.stability import in_one_body

from .claim import Claim
from .paper_blades import BANDS, LOADS, MASSES, model_of, row_and_scene

__all__ = ["following", "in_time"]

STEPS, TOLERANCE = 1024, 1e-6       # of the explicit march
UNSTABLE = 1.001                    # largest multiplier; 1 where a contact sticks all the time


def in_time(_: Path) -> Iterator[Claim]:
    """Fig. 15 and 17 at resonance: both modes, all masses, all loads; then with normal loads that follow the motion."""
    errors, periods, lost = [], [], []
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
    yield Claim("Fig. 15, 17", "the harmonic balance gives the response of the coupled system",
                f"{len(errors)} of {count} resonances (modes 1 and 2, {len(MASSES)} masses, {len(LOADS)} loads) closed "
                f"in time, after {int(np.median(periods))} periods in the middle; 7 harmonics are {max(errors):.0e} "
                f"off at worst, {np.median(errors):.0e} in the middle" + (f"; not closed: {'; '.join(lost)}" if lost
                                                                         else ""), "holds")
    yield from following()


def following(loads: tuple[float, ...] = (4.0, 20.0, 100.0)) -> Iterator[Claim]:
    """The rigid damper with its three freedoms, on contacts whose normal load follows and that may open."""
    row, scene = row_and_scene("soft")
    told, worst, largest = [], 0.0, 0.0
    for load in loads:
        model = in_one_body(whole_model(scene, row, load))
        top = peak(model, BANDS["soft", 2], 5).solution
        found = solve(model, top.omega, 9, 1024, start=top)
        system = time_system(model, 1)
        begin = state_of(found, system)
        exact = periodic(system, top.omega, begin, samples=512)
        error = abs(found.probe[1, 0] / harmonics(exact, system, 1)[0, 1] - 1)
        multiplier = np.abs(multipliers(exact)).max()
        cycle = direct(system, top.omega, STEPS, begin if multiplier > UNSTABLE else None, 4000, TOLERANCE, True)
        marched = 2 * np.fft.rfft(cycle.q @ system.probe[0])[1] / len(cycle.q)
        worst, largest = max(worst, error), max(largest, multiplier)
        end = (f"unstable: explicit steps leave it, {cycle.reason}" if multiplier > UNSTABLE else
               f"{abs(found.probe[1, 0] / marched - 1):.0e} from explicit steps from rest, {cycle.periods} periods")
        told.append(f"{load:g} N at {top.frequency:.1f} Hz {error:.0e} from the exact flow, largest multiplier "
                    f"{multiplier:.4f}, {end}")
    yield Claim("Fig. 13, 14", "the same where the damper moves in its plane and the normal load follows",
                "balance with 9 harmonics: " + "; ".join(told) + ". Points that always stick may carry any mean force "
                "that they can hold, so that not all digits need to agree",
                "fails" if worst > 0.01 else "holds in part" if largest > UNSTABLE else "holds")
