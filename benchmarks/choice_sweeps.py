"""Does the automatic choice pay along a sweep of 100 frequencies? Search and checks included,
against a fixed model.

    python benchmarks/choice_sweeps.py [number of the sweep ...]

CPU time of the choice at 2 % and at 0.1 % over that of a fixed rich model (15 harmonics, 1024
samples, all points and modes), whose points start from the curve through the last ones. Errors are
the largest at any frequency, in phasors over the highest point, against 31 harmonics and 4096
samples (plane blades: every fourth, against the rich model):

    sweep                       2 %   0.1 %  largest error    of the rich model  a rich point
    2 contacts, 1, 8, 60 N      0.53  0.59   8.2e-3  3.1e-4   4.4e-5             0.13 to 0.3 ms
                                0.42  0.66   1.7e-3  4.0e-4   7.7e-5
                                0.88  0.48   2.5e-4  8.6e-5   8.6e-5
    8 contacts                  0.34  0.43   2.7e-3  1.6e-4   2.4e-5             0.2 to 0.4 ms
                                0.36  0.45   3.0e-3  2.3e-4   1.3e-5
                                0.42  0.49   3.2e-3  2.1e-4   1.5e-5
    16 contacts, stiff          0.29  0.48   6.1e-3  7.1e-4   1.3e-4             0.5 to 1.6 ms
                                0.28  0.63   2.8e-3  2.7e-4   1.0e-4
                                0.25  0.30   3.2e-3  2.8e-4   8.9e-6
    32 contacts                 0.16  0.26   2.1e-3  3.3e-4   4.8e-5             1.2 to 2.2 ms
                                0.17  0.36   9.3e-4  2.6e-4   1.9e-5
                                0.15  0.19   9.3e-4  1.5e-4   7.3e-6
    body in 3-D that lifts off  0.14  0.28   6.4e-3  6.5e-4   6.7e-3             64 ms
    plane blades, 82 contacts,
    20 N                        0.34  0.57   3.8e-3  1.3e-4                      26 ms
    the twelve beams            0.25  0.37
    beams and body together     0.16  0.29
    all                         0.20  0.36

One run on an idle machine; ratios scatter by a sixth. A third is kept by each total at 2 %, at 0.1
% by beams and body together. It is missed

- with 2 and 8 contacts, where the whole sweep takes the rich model 13 to 40 ms: half of the
  choice's time is making models (a millisecond each) and checks;
- at 0.1 % where higher harmonics are in resonance (16 contacts): seven harmonics alone take a
  quarter, and parts of the curve need 15;
- at 0.1 % on plane blades, whose contacts lift off at all frequencies: round the peak, where a rich
  point takes longest, they need all contact points and 15 harmonics, which is what the rich model
  has.

The band of the plane blades is the one that a study takes, widened until the peak lies inside.
Where contacts lift off several solutions can coexist, on the plane blades at 1018 Hz two that lie
0.45 % of the peak apart; there the true solution next to the chosen one counts. The body's rich
model is 0.67 % off and misses 0.1 %; over 31 harmonics and 1024 samples the choice takes 0.03 and
0.06.

The rich models gain from what makes points faster as well: with a second level for their iterations
those of the body and of the plane blades take two thirds and less than half of the time that they
took before.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from choice_cases import RICH, TRUTH, Case, beam_cases, random_cases

from bladefem.hbm.linear_resonances import free_resonances, stuck_resonances
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.precompile import compile_kernels
from bladefem.hbm.response import response
from bladefem.hbm.solution import Solution, size
from bladefem.hbm.solve import solve
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.band_sweep import covered_band
from bladefem.study.adaptive.family import Family, family_member, family_of
from bladefem.study.adaptive.frequency_list import adapt_frequency_list
from bladefem.study.adaptive.settings import Settings, first_for, restarted_settings
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import family_of_case, load_cases, reduced_sector
from bladefem.study.pipeline.pipeline import run

HOLDS = (31, 1024)  # harmonics and samples of a fixed model that keeps 0.1 % over lift-off
ACCURACIES = (0.02, 0.001)
SCENE = "plane.toml"  # under the middle one of its loads


@dataclass(frozen=True)
class Swept:
    """Models at 100 circular frequencies [rad/s]; both makers begin anew, so that what they make
    ready is counted.
    """

    name: str
    rich: Callable[[], ReducedModel]
    family: Callable[[], Family]
    first: Settings
    omegas: np.ndarray
    repeats: int
    truth: tuple[int, int] = TRUTH
    every: int = 1  # frequency is compared with the truth


def sweeps() -> Iterator[Swept]:
    """All beams of choice_cases.py round mode 2, a body that lifts off over its peak, and plane
    blades with dampers.
    """
    for case in list(beam_cases())[2::5]:
        yield of_case(case.name.split(" x")[0], case, between(case), 9)
    body = list(random_cases())[-2]
    yield of_case("body in 3-D that lifts off", body, around(body.model, 1), 1)
    yield of_scene()


def of_case(name: str, case: Case, omegas: np.ndarray, repeats: int) -> Swept:
    family = family_of(case.model, case.patches)
    return Swept(
        name,
        lambda: replace(case.model),
        lambda: family_of(case.model, case.patches),
        first_for(family.modes),
        omegas,
        repeats,
    )


def of_scene() -> Swept:
    scene = load_scene(Path(__file__).parents[1] / "scenes" / SCENE, [])
    done = run(scene, None, until="contact")
    patches, cases = list(done.contact.problem.patches), load_cases(scene, done.mesh, done.contact)
    case = cases[len(cases) // 2]
    settings, reduced = reduced_sector(
        scene, Bodies(scene, done.mesh), case, patches, lambda name, key, make: make()
    )

    def family() -> Family:
        return family_of_case(scene, done.mesh, reduced, patches, case)

    def rich() -> ReducedModel:
        return family_member(family(), Settings(family().modes, RICH[0], RICH[1], "elastic")).model

    return Swept(
        f"{SCENE}, {case.load:g} N",
        rich,
        family,
        restarted_settings(settings),
        around(rich(), scene.excitation.mode),
        1,
        RICH,
        4,
    )


def between(case: Case, points: int = 100) -> np.ndarray:
    """Circular frequencies round the free and the stuck resonance next to a case [rad/s]."""
    free, stuck = free_resonances(case.model), stuck_resonances(case.model)
    near = min(range(len(free)), key=lambda i: abs(free[i] - case.omega))
    low, high = sorted((free[near], stuck[near]))
    return np.linspace(low - 0.1 * (high - low), high + 0.1 * (high - low), points)


def around(model: ReducedModel, mode: int, points: int = 100) -> np.ndarray:
    """Circular frequencies of the band that a study would take, which is as wide as its peak needs
    [rad/s].
    """
    rough = covered_band(model, first_for(len(model.sides[0].omega)), None, mode, 1.0)
    return np.linspace(rough[0].omega, rough[-1].omega, points)


def fixed(swept: Swept, settings: tuple[int, int], every: int = 1) -> list[Solution]:
    """A fixed model, each point started from the curve through the last ones."""
    return list(response(swept.rich(), swept.omegas[::every], *settings))


def chosen(swept: Swept, accuracy: float) -> list[Solution]:
    """The automatic choice."""
    return adapt_frequency_list(swept.family(), swept.omegas, swept.first, accuracy).points


def measured(swept: Swept) -> dict[str, tuple[float, list[Solution]]]:
    """CPU seconds and points of each way, best of several that take turns, since other work comes
    and goes.
    """
    ways: dict[str, Callable[[], list[Solution]]] = {"rich": lambda: fixed(swept, RICH)}
    ways |= {f"{100 * a:g} %": lambda a=a: chosen(swept, a) for a in ACCURACIES}
    if swept.rich().elements.tangents > 1:
        ways["31 harmonics"] = lambda: fixed(swept, HOLDS)
    found: dict[str, tuple[float, list[Solution]]] = {}
    for _ in range(swept.repeats):
        for name, way in ways.items():
            start = time.process_time()
            points = way()
            found[name] = min(time.process_time() - start, found.get(name, (np.inf,))[0]), points
    return found


def farthest(points: list[Solution], truth: list[Solution], others: list[Solution] = ()) -> float:
    """Largest distance of first harmonics over the highest point, where both were solved.

    Args:
        others: further true solutions, where several coexist; the nearer one counts.
    """
    top = max(size(p) for p in truth if p.converged)
    return max(
        min(abs(p.probe[1, 0] - q.probe[1, 0]) for q in both if q.converged) / top
        for p, *both in zip(points, truth, *([others] if others else []), strict=True)
        if p.converged and both[0].converged
    )


def from_there(swept: Swept, points: list[Solution]) -> list[Solution]:
    """True solutions next to the points: where contacts lift off several coexist. Joined points
    start from stick.
    """
    H, samples = swept.truth
    model = swept.rich()
    if model.directions == model.elements.tangents:
        return []
    return [
        solve(model, p.omega, H, samples, start=p if p.w.shape[:2] == model.springs.shape else None)
        for p in points
    ]


def main(numbers: list[int]) -> None:
    compile_kernels()
    total: dict[str, float] = {}
    for number, swept in enumerate(sweeps()):
        if numbers and number not in numbers:
            continue
        found, truth = measured(swept), fixed(swept, swept.truth, swept.every)
        rich = found["rich"][0]
        print(f"{number:2d} {swept.name:42s} ", end="")
        for name, (seconds, points) in found.items():
            some, lost = points[:: swept.every], sum(not p.converged for p in points)
            print(
                f"{name}: {1e3 * seconds:.4g} ms ({seconds / rich:.2f}), "
                f"{farthest(some, truth, from_there(swept, some)):.1e} off"
                + f", {lost} unsolved"
                * (lost > 0),
                end="  ",
                flush=True,
            )
        print()
        for name, (seconds, _) in found.items():
            total[name] = total.get(name, 0.0) + seconds
    print(
        "   all: "
        + "  ".join(
            f"{name}: {seconds / total['rich']:.2f}"
            for name, seconds in total.items()
            if name != "31 harmonics"
        )
    )


if __name__ == "__main__":
    main([int(number) for number in sys.argv[1:]])
