"""Blades with underplatform dampers: the paper's Fig. 15-17 by full balance, by the paper's loop,
and judged in time.

What is true of the paper's statements on the reference blade (k_t 1e6 N/m a seat, phase 0, 1 N at
the tip):

- the frequency of mode 2 rises from 1236.6 Hz to 1386 Hz with 60 g, because the stuck damper is
  still a spring (2 k_t < m w^2); with k_t 2e7 N/m it falls to 1086 Hz, the stuck damper being mere
  mass;
- the peak falls to a minimum at an optimum load and rises again: true for every mass;
- "larger mass, larger optimum load and smaller minimum": false in mode 2, where 30, 60, 120 g leave
  1.32, 3.07, 4.20 um, because 30 g is close to a tuned absorber; true in mode 1, 969, 563, 278 um
  at 2.3, 2.9, 3.3 N;
- "the optimum load of mode 1 is much smaller": false, 2.9 N against 1.4 N with 60 g;
- these minima depend on how the load is spread: one point a seat gives 2.73 um with 60 g, ten on a
parabola 3.62 um;
- "jump of the resonance frequency": a switch between two peaks of equal height.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from bladefem.damper.accelerate import Iterated, Rules, iterate
from bladefem.damper.paper import platform
from bladefem.data import RigidBody
from bladefem.errors import NotSolvedError
from bladefem.friction.fourier import synthesis
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solution import Solution, size
from bladefem.hbm.sweep import sweep
from bladefem.time.shooting import Periodic, periodic_solution, probe_harmonics
from bladefem.time.system import System, blade_ring


def paper_blade(
    kt: float = 1e6,
    mass: float = 0.06,
    load: float = 10.0,
    *,
    phase: float = 0.0,
    points: int = 6,
    harmonics: int = 31,
) -> ReducedModel:
    """The reference blade with five modes and no residual flexibility, so that it can be integrated
    in time as well.

    Args:
        kt, load: stiffness [N/m] and friction limit [N] of a seat; the load on a parabola that
            vanishes one node beyond both ends of the patch.
        phase: interblade phase angle [rad].
    """
    model = reference_model(
        kt, mass, load, phase=phase, points=points, modes=5, harmonics=harmonics
    )
    share = np.arange(1, points + 1) * np.arange(points, 0, -1.0)
    sides = tuple(replace(side, residual=0 * side.residual) for side in model.sides)
    limits = load * np.tile(share / share.sum(), 2)
    return replace(model, sides=sides, elements=replace(model.elements, n0=limits))


@dataclass(frozen=True)
class Peak:
    """The highest point of a response in a band."""

    # [Hz]
    frequency: float
    # at the first probe, root of the sum of squares of the harmonics [m]
    amplitude: float
    solution: Solution
    # solved on the way
    points: int
    # of these without convergence
    unsolved: int


def peak(
    model: ReducedModel,
    band: tuple[float, float],
    H: int = 3,
    samples: int = 256,
    accuracy: float = 1e-3,
) -> Peak:
    """The resonance in a band [Hz] by the full balance.

    Raises:
        NotSolvedError: no point of the band was solved.
    """
    solved = list(
        sweep(
            model, (2 * np.pi * band[0], 2 * np.pi * band[1]), H, samples, peak=accuracy, curve=0.1
        )
    )
    good = [s for s in solved if s.converged]
    if not good:
        raise NotSolvedError(
            f"band {band} Hz: none of {len(solved)} points solved; last reason: {solved[-1].reason}"
        )
    best = max(good, key=size)
    return Peak(best.frequency, size(best), best, len(solved), len(solved) - len(good))


def load_curve(
    models: Iterable[tuple[float, ReducedModel]],
    band: tuple[float, float],
    H: int = 3,
    samples: int = 256,
) -> Iterator[tuple[float, Peak]]:
    """Resonance for each (load, model), as they are wanted (Fig. 17)."""
    for load, model in models:
        yield load, peak(model, band, H, samples)


def optimum(
    model: Callable[[float], ReducedModel],
    loads: tuple[float, float],
    band: tuple[float, float],
    H: int = 3,
    samples: int = 256,
) -> tuple[float, Peak]:
    """The load between two bounds that makes the resonance smallest, to 1 %, and the resonance
    there.

    Args:
        model: from the load.
    """
    peaks: dict[float, Peak] = {}

    def height(x: float) -> float:
        peaks[x] = peak(model(float(np.exp(x))), band, H, samples)
        return peaks[x].amplitude

    coarse = np.linspace(*np.log(loads), 7)
    best = int(np.argmin([height(x) for x in coarse]))
    minimize_scalar(
        height,
        bounds=(coarse[max(best - 1, 0)], coarse[min(best + 1, 6)]),
        method="bounded",
        options={"xatol": 0.01},
    )
    x = min(peaks, key=lambda x: peaks[x].amplitude)
    return float(np.exp(x)), peaks[x]


def seat_loop(solution: Solution, points: int = 512) -> tuple[np.ndarray, np.ndarray]:
    """Mean relative displacement [m] and total friction force [N] of the first seat over a period,
    (points,) each.
    """
    nodes = solution.w.shape[0] // 2
    basis = synthesis(solution.harmonics, points)
    return basis @ solution.w[:nodes, 0].mean(axis=0), basis @ solution.f[:nodes, 0].sum(axis=0)


def loop_response(
    model: ReducedModel,
    frequencies: Iterable[float],
    method: str = "amplitude",
    rules: Rules | None = None,
    H: int = 1,
) -> Iterator[Iterated]:
    """The paper's loop at each frequency [Hz], always from the motion without damper, as in Fig.
    14.
    """
    for frequency in frequencies:
        yield iterate(platform(model, 2 * np.pi * frequency, H), method, rules)


def judge(
    model: ReducedModel, frequency: float, highest: int = 1, blades: int = 1, waves: int = 0
) -> tuple[Periodic, np.ndarray, System]:
    """The same model as a coupled system in time, solved exactly: solution, harmonics at the probe
    [m], system.

    Args:
        blades, waves: the ring that a travelling wave of phase 2 pi waves / blades needs.

    Raises:
        InputError: the model has residual flexibility.
    """
    ratio = float(np.mean(model.damping.ratio))
    damper: RigidBody = model.damper
    system = blade_ring(
        model.side(0),
        ratio,
        model.elements,
        float(damper.mass[0, 0]),
        complex(model.excitation[1][0]),
        blades,
        waves,
    )
    solution = periodic_solution(system, 2 * np.pi * frequency)
    return solution, probe_harmonics(solution, system, highest)[0], system
