"""Does the automatic choice pay along a sweep of 100 frequencies? Search and checks included, against fixed models.

    python benchmarks/choice_sweeps.py [number of the sweep ...]

CPU time of the choice at 2 % and at 0.1 %, over that of a fixed rich model (15 harmonics, 1024 samples, all points and
modes), whose points start from the curve through the last ones ("rich", the measure asked for) or from the linear
response ("cold"). Errors are the largest at any frequency, in phasors over the highest point, against 31 harmonics and
4096 samples:

    contact points              rich           cold           largest error     of the rich model   a rich point
    2                           0.47  0.82     0.46  0.81     1.7e-3  4.0e-4    7.7e-5              0.17 ms
    8                           0.37  0.48     0.38  0.49     3.2e-3  2.1e-4    1.5e-5              0.27 ms
    16                          0.42  0.49     0.37  0.44     3.2e-3  2.8e-4    8.9e-6              0.55 ms
    32                          0.19  0.33     0.13  0.22     2.1e-3  3.3e-4    4.8e-5              2.9 ms
    8 in 3-D, lifting off       0.24  0.42     0.17  0.30     6.4e-3  5.3e-4    6.7e-3              90 ms
    all five                    0.24  0.42

One run on an idle machine; small sweeps scatter by 15 to 40 % (16 points: 0.28 and 0.35 an hour before). The body that
lifts off is swept over its peak, in the band that a study would take. The rich model is 0.67 % off there and misses
0.1 %; over 31 harmonics and 1024 samples, 0.12 % off, the choice takes 0.087 and 0.15. Beside the peak, between stick
and free, where the highest point lifts off as well: 0.25 and 1.05 (errors 4.1e-3 and 5.0e-4, of the rich model 4.6e-3).
At one frequency of it two solutions coexist, 0.12 % of the peak apart, which 10 modes do not tell.

A third of the rich model's time is missed with 2 to 16 points, and with lift-off at 0.1 % against the model that misses
the accuracy. A rich point took 0.17, 0.54, 2.1, 6.4 and 86 ms before points of up to 64 contact freedoms became one
compiled call; the choice gained as much (sweeps at 0.1 %: 27, 23, 38 and 298 ms, now 14, 13, 27 and 95). With few
contacts a third is a few milliseconds: models of the choice take half a millisecond each to make, and its five to nine
checks a quarter each. 3 harmonics for all points at 0.1 % would be faster with 8 and 32 points (0.26, 0.24), but leave
0.09 % at points that are not checked.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from choice_cases import RICH, TRUTH, Case, beam_cases, random_cases

from bladefem.hbm.api import solve
from bladefem.hbm.resonance import free_resonances, stuck_resonances
from bladefem.hbm.solution import Solution
from bladefem.hbm.sweep import response, size
from bladefem.hbm.warm import compile_kernels
from bladefem.study.along import along
from bladefem.study.choice import default_band
from bladefem.study.family import family_of
from bladefem.study.settings import first_for

HOLDS = (31, 1024)      # harmonics and samples of a fixed model that keeps 0.1 % over lift-off


@dataclass(frozen=True)
class Swept:
    """A model at 100 circular frequencies [rad/s]."""

    name: str
    case: Case
    omegas: np.ndarray


def sweeps() -> Iterator[Swept]:
    """Four beams round a mode, and a body that lifts off: over its peak, and beside it between stick and free."""
    cases = [*beam_cases(), *random_cases()]
    for part, points in ((1 / 12, 2), (2 / 5, 8), (3 / 5, 16), (7 / 10, 32)):
        case = cases[int(len(cases) * part)]
        yield Swept(f"{points} points", case, between(case))
    body = cases[-2]
    yield Swept("8 points in 3-D, lifting off", body, 2 * np.pi * np.linspace(*default_band(body.model, 1), 100))
    yield Swept("8 points in 3-D, beside the peak", body, between(body))


def between(case: Case, points: int = 100) -> np.ndarray:
    """Circular frequencies round the free and the stuck resonance next to a case [rad/s]."""
    free, stuck = free_resonances(case.model), stuck_resonances(case.model)
    near = min(range(len(free)), key=lambda i: abs(free[i] - case.omega))
    low, high = sorted((free[near], stuck[near]))
    return np.linspace(low - 0.1 * (high - low), high + 0.1 * (high - low), points)


def fixed(swept: Swept, settings: tuple[int, int]) -> list[Solution]:
    """A fixed model, each point started from the curve through the last ones; made ready anew, as chosen ones are."""
    return list(response(replace(swept.case.model), swept.omegas, *settings))


def cold(swept: Swept, settings: tuple[int, int]) -> list[Solution]:
    """The same, each point started from the linear response with all contacts sticking."""
    model = replace(swept.case.model)
    return [solve(model, omega, *settings) for omega in swept.omegas]


def chosen(swept: Swept, accuracy: float) -> list[Solution]:
    """The automatic choice."""
    family = family_of(swept.case.model, swept.case.patches)
    return along(family, swept.omegas, first_for(family.modes), accuracy).points


def timed(swept: Swept, run: Callable[..., list[Solution]], *given: object) -> tuple[float, list[Solution]]:
    """CPU seconds, best of several where they are short, and points."""
    best, points = np.inf, []
    for _ in range(9 if swept.case.model.directions == 1 else 1):
        start = time.process_time()
        points = run(swept, *given)
        best = min(best, time.process_time() - start)
    return best, points


def farthest(points: list[Solution], truth: list[Solution]) -> float:
    """Largest distance of first harmonics over the highest point, where both were solved."""
    top = max(size(p) for p in truth if p.converged)
    return max(abs(p.probe[1, 0] - q.probe[1, 0]) / top for p, q in zip(points, truth, strict=True)
               if p.converged and q.converged)


def main(numbers: list[int]) -> None:
    compile_kernels()
    for number, swept in enumerate(sweeps()):
        if numbers and number not in numbers:
            continue
        truth = fixed(swept, TRUTH)
        models = {"rich": (fixed, RICH), "rich, cold": (cold, RICH)}
        if swept.case.model.directions > 1:
            models["H 31"] = fixed, HOLDS
        spent = {name: timed(swept, *model) for name, model in models.items()}
        print(f"{swept.name}: " + ", ".join(f"{name} {1e3 * s:.1f} ms, {farthest(points, truth):.1e} off"
                                            for name, (s, points) in spent.items()), flush=True)
        for accuracy in (0.02, 0.001):
            seconds, points = timed(swept, chosen, accuracy)
            print(f"    {accuracy:g}: {1e3 * seconds:.1f} ms, {farthest(points, truth):.1e} off, "
                  f"{sum(not p.converged for p in points)} unsolved, over "
                  + ", ".join(f"{name} {seconds / s:.3f}" for name, (s, _) in spent.items()), flush=True)


if __name__ == "__main__":
    main([int(number) for number in sys.argv[1:]])
