"""Is the automatic choice of a resonance ever wrong, and does it pay? Random models, half of them
with lift-off, against a fixed rich model.

    python benchmarks/choice_random.py [first seed] [last seed] [accuracy]

The choice finds harmonics and samples for the highest resonance of the band, search included. The
rich model sweeps the same band with 15 harmonics and 1024 samples, and closes in its maxima as the
choice does. Contacts of these models are no neighbours on a surface, so that points and modes stay
as they are.

Seeds at 2 %, on an idle machine, one process a core; of CPU time, that of the rich model is 1:

    seeds             in the band    wrong    too low    unknown    all     median    above 1.1
    even, to 160      80             0        0          0          0.11    0.50      5
    odd, to 101       45             0        0          2          0.28    0.60      5
    both              125            0        0          2          0.20    0.53      10
    both, before      125            0        0          2          0.25    0.64      15

Before: paths, slopes and points with two tangents not compiled, the same day. Seeds 4, 73 and 95
are most of what all take. Unknown are seeds 33 and 69, whose richer models were not solved. Where a
point of the rich model takes over 1 ms a third is reached by 31 of 62, by 26 of 70 before. Ratios
scatter by 10 %. Seed 73 is told an error of 400 %, with which it is left: its rippled top has no
maximum for one of the richer models. Seed 192, which was wrong once, is in a test; the other seeds
to 199 were not measured again. At 0.1 % it was measured last for seeds 0 to 32, by an earlier
version: 0.82 in all, none wrong, 8 above 1.1.

Seeds that nothing was tuned on, even from 400 to 520 and odd from 401 to 481, all solved. At 2 %
none of 100 wrong, one told too low (449, repaired), unknown 411, 421 and 473. At 0.1 %, the first
20 of both: seed 413 was 82 % wrong before paths began at lost ends of the band, 0.03 % now with
0.44 % told; 411 unknown.

To follow curves with lift-off only where the tangents of a sweep leave folds open saved 13 of these
models half of their time, took as long in all, and on the odd seeds from 201 to 699 missed a peak
5 % higher (seed 227).


Above 1.1 at 2 % for another reason than the time of Python (164 and 192 are none of the table's):
    seed    ratio
    34      1.4     two points of the rough sweep, where a damper begins to walk, take 80 of 97 ms
    43      1.4     15 harmonics are sought from seven twice, in vain
    61      1.8     needs 15 harmonics, with 128 samples whose points are harder than those of 1024
    67      1.2     followed round folds, as the rich model is, in 390 ms; two judges end elsewhere
    79, 85  1.2     followed round folds, as the rich model is, in 50 to 60 ms
    95      0.5     needs 31 harmonics; the rich model is followed round folds
    164     3.0     a flank asks for 15 harmonics, whose points are hard with few samples
    192     7       needs 31 harmonics, which 63 judge in 2.7 s; those of 15 are 1.6 % off
The other ones (62, 100, 126, 134) take 8 to 30 ms, most of it Python.

Where the fixed rich model has its curve in 5 to 20 ms a point of either takes 0.2 ms, most of
it Python, and both solve as many points. The choice adds a second sweep and three peaks found by
exact slopes.

What was above 1.1 before, and why: walks were looked for by a merit that leads to none (seed 34,
6.1); a rough look climbed to a jump in 400 steps (57, 1.15); peaks at a fold were not closed in, so
that every richer model seemed to lie a step farther (43, 53, 67, 85: 1.3 to 5.8); curves were swept
again with the harmonics that had been taken back (59, 1.6); the modes, of which these families know
nothing, were judged. Estimates were below half of the true error for seeds 1, 10 and 63, since the
peak that was judged lies on a shoulder, up to 0.6 % below the highest point of the curve; the
difference is part of the estimate now.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from branch_models import random_case

from bladefem import balance as bf
from bladefem.errors import NotSolvedError
from bladefem.hbm.peak import find_peak
from bladefem.hbm.precompile import compile_kernels
from bladefem.study.adaptive.check_points import peak_of
from bladefem.study.adaptive.checked_curve import CheckedCurve
from bladefem.study.adaptive.family import Family, Member
from bladefem.study.adaptive.resonance_curve import MAXIMUM_SHARE, resonance_curve
from bladefem.study.adaptive.settings import first_for

HARMONICS = 15
SAMPLES = 1024
# of the model that tells the truth
TRUE_HARMONICS = 31
TRUE_SAMPLES = 4096
# relative difference of its peak up to which it is the same
SAME_PEAK = 0.05
# and of that which begins at the peak of the choice
SAME_RESONANCE = 0.25
# accuracy over the tolerance to which the choice closes in its peak, which no estimate contains
SEARCHED = 80
# CPU time over the rich model's that is too much
SLOWER = 1.1
# of a point of the rich model, from which the choice is to take a third of it [s]
LONG_POINT = 1e-3
# runs of a model whose time is short [s]
REPEATS = 3
SHORT = 0.3
# models that load the kernels
WARMING_SEEDS = (0, 1, 3, 13)
HZ = 2 * np.pi
Result = TypeVar("Result")


def timed(compute: Callable[[bf.ReducedModel], Result], seed: int) -> tuple[Result, float]:
    """The result, and the CPU time that it took [s]: of a fresh model, which has nothing at hand
    yet; the shortest of REPEATS where it is short, since 10 ms scatter by a fifth.
    """
    spent: list[float] = []
    while not spent or (len(spent) < REPEATS and max(spent) < SHORT):
        model = random_case(seed).model
        clock = time.process_time()
        result = compute(model)
        spent.append(time.process_time() - clock)
    return result, min(spent)


def chosen_curve(
    model: bf.ReducedModel, band: tuple[float, float], accuracy: float
) -> CheckedCurve:
    """The automatic choice for the highest resonance of a band [rad/s], and its curve."""
    nodes = np.arange(len(model.elements.kt))
    family = Family(lambda _: Member(model, nodes), len(model.sides[0].omega))
    start = replace(first_for(10), points=None, chosen=("harmonics", "samples"))
    return resonance_curve(family, start, (band[0] / HZ, band[1] / HZ), 1, accuracy)


def warm_up(accuracy: float) -> None:
    """What numba compiles or loads on first use is nobody's time."""
    compile_kernels()
    for seed in WARMING_SEEDS:
        case = random_case(seed)
        list(bf.sweep(case.model, case.band, HARMONICS, SAMPLES))
        chosen_curve(case.model, case.band, accuracy)


def true_height(model: bf.ReducedModel, top: bf.Solution, chosen: bf.Solution) -> float:
    """Height of the peak that the rich model's sweep has found, with TRUE_HARMONICS [m].

    The choice takes more harmonics than the rich model where it has to, and that sweep closes its
    peak in to 1e-3 only: both are more than many an estimate. Where the search from that peak ends
    at another one it begins at the peak of the choice where that has more: on seed 413, 15
    harmonics are 8.3 % off what 31 have, 8.6 % off what a march keeps.
    """
    starts = [(top, SAME_PEAK)]
    if chosen.harmonics > top.harmonics:
        starts.append((chosen, SAME_RESONANCE))
    for start, same in starts:
        try:
            found = find_peak(
                model, start.omega, TRUE_HARMONICS, TRUE_SAMPLES, near=start, tolerance=1e-7
            ).height
        except NotSolvedError:
            continue
        if abs(found / bf.size(top) - 1) < same:
            return found
    return bf.size(top)


def main(first: int, last: int, accuracy: float) -> None:
    wrong, unsure, unknown, unsolved, outside, slower = [], [], [], [], [], []
    ratios: list[float] = []
    long_ratios: list[float] = []
    spent = np.zeros(2)
    warm_up(accuracy)
    for seed in range(first, last):
        case = random_case(seed)
        band = case.band
        rich, expensive = timed(
            lambda model, band=band: list(
                bf.sweep(model, band, HARMONICS, SAMPLES, peak=MAXIMUM_SHARE * accuracy)
            ),
            seed,
        )
        try:
            found, cheap = timed(lambda model, band=band: chosen_curve(model, band, accuracy), seed)
        except NotSolvedError as error:
            unsolved.append(seed)
            print(f"seed {seed}, {case.name}: not solved, {error}", flush=True)
            continue
        places = [peak_of(points).omega for points in (rich, found.points)]
        if min(places) <= band[0] or max(places) >= band[1]:
            # the choice follows a peak beyond the band
            outside.append(seed)
            continue
        spent += cheap, expensive
        ratios.append(cheap / expensive)
        if expensive > LONG_POINT * len(rich):
            long_ratios.append(cheap / expensive)
        truth = true_height(case.model, peak_of(rich), peak_of(found.points))
        error = abs(bf.size(peak_of(found.points)) / truth - 1)
        reported = found.settings.error
        if reported is None or not np.isfinite(reported):
            unknown.append(seed)
            reported = np.inf
        bad = error > accuracy >= reported
        slow = cheap > SLOWER * expensive
        wrong += [seed] * bad
        slower += [seed] * slow
        unsure += [seed] * (reported < error / 2 and error > accuracy / SEARCHED)
        if bad or slow or not np.isfinite(reported):
            print(
                f"seed {seed}, {case.name}: error {error:.2%}, estimated {reported:.2%}, "
                f"H {found.settings.harmonics}, CPU {cheap:.3f} s against {expensive:.3f} s",
                flush=True,
            )
    print(
        f"accuracy {accuracy:.1%}, {len(ratios)} models, not solved: {unsolved}, resonance outside "
        f"the band: {outside}"
    )
    print(f"wrong beyond the accuracy and not said: {len(wrong)} {wrong}")
    print(f"estimate below half of the true error: {len(unsure)} {unsure}")
    print(f"error unknown: {len(unknown)} {unknown}")
    print(
        f"CPU over the rich model's: {spent[0] / spent[1]:.2f} in all, median "
        f"{np.median(ratios):.2f}, above {SLOWER} in {len(slower)} {slower}; where a point of the "
        f"rich model takes over 1 ms: {len(long_ratios)}, median {np.median(long_ratios):.2f}, "
        f"above a third in {sum(r > 1 / 3 for r in long_ratios)}"
    )


if __name__ == "__main__":
    seeds = [int(a) for a in sys.argv[1:3]] if len(sys.argv) > 2 else [0, 60]
    main(seeds[0], seeds[1], float(sys.argv[3]) if len(sys.argv) > 3 else 0.02)
