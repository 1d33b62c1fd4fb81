"""Time against error of every way to one point: reference blade, 60 g, 1.4 N a seat, 1315.5 Hz,
first harmonic.

    python benchmarks/paper_speed.py      about a minute

CPU seconds of one thread, relative error against shooting. Direct integration starts from the stuck
motion and stops at a change of 1e-6 over a period. Recorded on a busy 2-core machine (trust ratios
of ten):

    balance H 1, 3, 7, 15, 31          2, 4, 51, 103, 46 ms    7e-3, 6e-4, 3e-5, 2e-6, 2e-7
    the paper's iteration              54 to 185 ms            4e-3, whatever its harmonics and
                                                               averaging
    explicit, 128 to 512 steps         104 to 200 ms           2e-3 to 1.4e-4
    Newmark, 64 and 128 steps          2.2 and 5.4 s           1.7e-2 and 4.7e-3
    shooting                           234 ms                  exact
"""

import time
from collections.abc import Callable

import numpy as np

from bladefem.damper.accelerate import Rules, iterate
from bladefem.damper.direct import direct
from bladefem.damper.paper import platform
from bladefem.hbm.solve import solve
from bladefem.time.event_integrator import stuck_start
from verification.paper.blades import judge, paper_blade

MODEL, FREQUENCY = paper_blade(load=1.4), 1315.5
OMEGA = 2 * np.pi * FREQUENCY


def timed(call: Callable[[], complex]) -> tuple[complex, float]:
    """Value and CPU seconds of the second call, compilation done."""
    call()
    started = time.process_time()
    return call(), time.process_time() - started


def main() -> None:
    solution, tip, system = judge(MODEL, FREQUENCY)
    probe = system.probe[0]

    def marched(steps: int, explicit: bool) -> complex:
        cycle = direct(system, OMEGA, steps, stuck_start(system, OMEGA), explicit=explicit)
        return 2 * np.fft.rfft(cycle.q @ probe)[1] / steps

    side = {H: platform(MODEL, OMEGA, H) for H in (1, 3)}
    ways = {"shooting on the exact flow": lambda: judge(MODEL, FREQUENCY)[1][1]}
    for H, samples in ((1, 64), (3, 128), (5, 256), (7, 512), (9, 512), (15, 1024), (31, 4096)):
        ways[f"balance H {H}, {samples} samples"] = lambda H=H, n=samples: solve(
            MODEL, OMEGA, H, n
        ).probe[1, 0]
    for averaged in (True, False):
        name = "averaged" if averaged else "per harmonic"
        ways[f"paper's loop, 3 harmonics, {name}"] = lambda a=averaged: iterate(
            side[3], "amplitude", Rules(averaged=a)
        ).probe[1, 0]
    ways["paper's loop, 1 harmonic, damper exact"] = lambda: iterate(
        side[1], "amplitude", Rules()
    ).probe[1, 0]
    ways["paper's loop, 1 harmonic, damper from rest"] = lambda: iterate(
        side[1], "amplitude", Rules(damper="march")
    ).probe[1, 0]
    for steps in (128, 256, 512):
        ways[f"explicit, {steps} steps"] = lambda n=steps: marched(n, True)
    for steps in (64, 128):
        ways[f"Newmark, {steps} steps"] = lambda n=steps: marched(n, False)
    print(f"reference: residual of periodicity {solution.residual:.1e}")
    for name, call in ways.items():
        value, seconds = timed(call)
        print(
            f"{name:44s} {1e3 * seconds:10.1f} ms   error {abs(value / tip[1] - 1):.1e}", flush=True
        )


if __name__ == "__main__":
    main()
