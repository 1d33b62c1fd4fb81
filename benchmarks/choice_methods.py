"""Is another method ever faster than the sampled balance by Newton, where it is as accurate? On the
68 choice cases.

    python benchmarks/choice_methods.py [every]

Each method takes each case with rising harmonics or steps until the first harmonic at the probe is
right to 2 %, 0.1 % and 0.001 %; the CPU time of the cheapest that is enough, over that of the
cheapest sampled balance that is enough. The truth is H 63 with 16384 samples. Starts are cold.

Measured, over the cheapest sampled balance (median in brackets), and how many cases have the
accuracy at all:

    method                  2 %                     0.1 %                   0.001 %
    exact events            1.0 to 2   (1.3) 60/60  1.0 to 5   (1.3) 60/60  1.0 to 12 (1.3) 60/60
    the paper's iteration   2.2 to 26  (4.2) 27/30  2.2 to 7   (3.0) 21/30  2.2 to 7  (3.0) 20/30
    shooting                1.9 to 104 (3.6) 30/30  1.9 to 76  (3.6) 30/30  1.9 to 25 (3.3) 30/30
    Newmark                 15 to 205  (51)  30/30  26 to 296  (140) 20/30  -               0/30
    explicit steps          1.3 to 52  (1.8) 30/30  1.3 to 42  (1.8) 27/30  1.3 to 19 (1.7) 21/30

None is ever faster. Small factors belong to cases that stick, where every method has nothing to do.
The bodies with 3-D contacts and lift-off are taken by the balance alone. What integrates in time
takes blades in phase only.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
from choice_cases import Case, beam_cases, random_cases

from bladefem.hbm.solve import solve
from bladefem.study.chart.methods import (
    Point,
    exact_shooting,
    obstacle_in_time,
    paper_iteration,
    sampled_balance,
    tangential_model,
    time_steps,
)

WANTED = (0.02, 1e-3, 1e-5)
HARMONICS, SAMPLES = (1, 3, 7, 15, 31), (64, 128, 256, 512, 1024, 4096)
Run = Callable[[object, float, object], Point]


def ways(case: Case) -> dict[str, list[Run]]:
    """Methods that take a case, each from cheap to expensive."""
    if case.model.elements.tangents > 1:
        return {}
    found = {"exact events": [sampled_balance(H, 0) for H in HARMONICS]}
    if not obstacle_in_time(case.model):
        found |= {
            "the paper's iteration": [paper_iteration(H, averaged=True) for H in (1, 3)],
            "shooting": [exact_shooting],
            "Newmark": [time_steps(steps, explicit=False) for steps in (64, 256)],
            "explicit steps": [time_steps(steps, explicit=True) for steps in (512, 2048)],
        }
    return found


def spent(case: Case, run: Run, truth: complex) -> tuple[float, float]:
    """CPU seconds, better of two, and error."""
    seconds = []
    for _ in range(2):
        start = time.process_time()
        point = run(tangential_model(case.model), case.omega, None)
        seconds.append(time.process_time() - start)
    return min(seconds), abs(point.first / truth - 1) if point.converged else np.inf


def cheapest(trials: Iterator[tuple[float, float]]) -> dict[float, float]:
    """Seconds for each wanted accuracy; infinite where no trial has it."""
    trials = list(trials)
    return {
        wanted: min((s for s, error in trials if error <= wanted), default=np.inf)
        for wanted in WANTED
    }


def main(every: int = 1) -> None:
    cases = [*beam_cases(), *random_cases()][::every]
    ratios: dict[str, dict[float, list[float]]] = {}
    alone = 0
    for k, case in enumerate(cases):
        others = ways(case)
        if not others:
            alone += 1
            continue
        truth = complex(solve(case.model, case.omega, 63, 16384).probe[1, 0])
        sampled = [
            sampled_balance(H, samples)
            for H in HARMONICS
            for samples in SAMPLES
            if samples >= 8 * H + 8
        ]
        if k == 0:
            spent(case, sampled[0], truth)  # compile
            spent(case, others["exact events"][0], truth)
        base = cheapest(spent(case, run, truth) for run in sampled)
        for name, runs in others.items():
            own = cheapest(spent(case, run, truth) for run in runs)
            for wanted in WANTED:
                ratios.setdefault(name, {}).setdefault(wanted, []).append(
                    own[wanted] / base[wanted]
                )
    print(f"{alone} cases that no other method takes")
    for name, found in ratios.items():
        for wanted, values in found.items():
            good = np.array([v for v in values if np.isfinite(v)])
            print(
                f"{name:22s} {wanted:7g}: enough in {len(good)} of {len(values)}"
                + (
                    f", times the balance {good.min():.2f} to {good.max():.0f}, median "
                    f"{np.median(good):.1f}"
                    if len(good)
                    else ""
                ),
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
