"""Claims about Fig. 15 and 16: responses round mode 2 and the friction loops at their
resonances.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from bladefem.data import Elements
from bladefem.friction.fourier import synthesis
from bladefem.hbm.solution import Solution, size
from bladefem.hbm.sweep import sweep
from bladefem.view.paper import draw_friction_loops, draw_tip_responses
from verification.paper.blades import peak, seat_loop

from .claim import Claim, verdict
from .claims_blades import BANDS, LOADS, STIFF, dips, model_of
from .claims_loop import loop_points

# [Hz]
BAND = (1060.0, 1260.0)


def responses(folder: Path) -> Iterator[Claim]:
    """Fig. 15 and 16, mode 2, damper of 60 g, soft contact."""
    curves = {}
    tops = {}
    for load in LOADS:
        points = [
            s
            for s in sweep(
                model_of("soft", load), tuple(2 * np.pi * f for f in BAND), 5, 256, curve=0.01
            )
            if s.converged
        ]
        points.sort(key=lambda s: s.omega)
        tops[load] = max(points, key=size)
        curves[load] = np.array([(s.frequency, size(s)) for s in points]).T
    dots, crosses = (
        {load: loop_points(load, how) for load in LOADS} for how in ("shooting", "march")
    )
    draw_tip_responses(
        curves,
        folder / "fig_15.png",
        "mode 2, damper of 60 g, 1e6 N/m a seat",
        dots,
        crosses,
    )
    loops = {load: seat_loop(top) for load, top in tops.items()}
    draw_friction_loops(loops, folder / "fig_16.png")
    yield from _resonances(tops)
    yield from _loops(tops, loops)


def _resonances(tops: Mapping[float, Solution]) -> Iterator[Claim]:
    """Fig. 15."""
    ends, heights = (
        [f(top) for top in tops.values()] for f in (lambda s: s.frequency, lambda s: 1e6 * size(s))
    )
    rises = ends == sorted(ends)
    yield Claim(
        "Fig. 15",
        "with the load the second resonance rises, its amplitude falls and rises again",
        f"{ends[0]:.1f} to {ends[-1]:.1f} Hz; {heights[0]:.1f}, {min(heights):.1f}, "
        f"{heights[-1]:.1f} µm at {LOADS[0]:g}, {LOADS[int(np.argmin(heights))]:g}, {LOADS[-1]:g} "
        "N",
        verdict(rises and dips(heights), rises or dips(heights)),
        ("fig_15.png",),
        "Lines: full balance with 5 harmonics. Dots: the loop with the damper solved exactly. "
        "Crosses: the paper's loop, its damper integrated from rest. Both only where they stopped "
        "by themselves.",
    )
    stiff = [
        peak(model_of("stiff", load), BANDS["stiff", 2]).frequency for load in (LOADS[0], LOADS[-1])
    ]
    damper = 0.06 * (2 * np.pi * ends[0]) ** 2
    spring = 2 * STIFF
    yield Claim(
        "Sect. 6",
        "the frequency rises with the load, in general",
        f"with {STIFF:.3g} N/m a seat it goes from {stiff[0]:.1f} to {stiff[1]:.1f} Hz: 2 k_t = "
        f"{spring:.2g} N/m against m w² = {damper:.2g} N/m, and a stuck damper on springs that "
        "stiff is mere mass",
        verdict(stiff[1] > stiff[0]),
    )


def _loops(
    tops: Mapping[float, Solution], loops: Mapping[float, tuple[np.ndarray, np.ndarray]]
) -> Iterator[Claim]:
    """Fig. 16 and what Sect. 5.2 reads from it."""
    widths, forces = (
        np.array([f(loop) for loop in loops.values()])
        for f in (lambda p: 1e6 * np.ptp(p[0]), lambda p: np.ptp(p[1]) / 2)
    )
    falls = bool((np.diff(widths) < 0).all())
    rises = bool((np.diff(forces) > 0).all())
    yield Claim(
        "Fig. 16",
        "with the load the relative displacement falls and the friction force rises",
        f"loops at resonance are {widths[0]:.1f}, {min(widths):.1f}, {widths[-1]:.1f} µm wide at "
        f"{LOADS[0]:g}, {LOADS[int(np.argmin(widths))]:g}, {LOADS[-1]:g} N: past the optimum the "
        f"blade swings more again; the force goes from {forces[0]:.2f} to {forces[-1]:.2f} N",
        verdict(falls and rises, falls or rises),
        ("fig_16.png",),
        "Friction force of a whole seat over its mean relative displacement, each at its own "
        "resonance.",
    )
    spent = [1e6 * top.work.friction for top in tops.values()]
    heights = [size(top) for top in tops.values()]
    most = int(np.argmax(spent))
    calm = int(np.argmin(heights))
    once = dips([-w for w in spent])
    yield Claim(
        "Sect. 5.2",
        "the loop's area rises first and then falls, and the amplitude with it",
        "friction work a cycle at resonance "
        + ", ".join(f"{w:.1f}" for w in spent)
        + " µJ: largest at "
        f"{LOADS[most]:g} N, the amplitude is least at {LOADS[calm]:g} N, where the blade is too "
        "calm to lose "
        "much",
        verdict(once and most == calm, once),
    )
    shares = [100 * slip_share(top, model_of("soft", load).elements) for load, top in tops.items()]
    yield Claim(
        "Sect. 5.2",
        "the share of slip in a period falls with the load",
        "mean over the pressed points, weighted by their loads: "
        + ", ".join(f"{s:.0f}" for s in shares)
        + " % at "
        + ", ".join(f"{load:g}" for load in LOADS)
        + " N",
        verdict(bool((np.diff(shares) < 0).all()), shares[-1] < shares[0]),
    )


def slip_share(solution: Solution, elements: Elements, samples: int = 1024) -> float:
    """Part of the period in which a point of prescribed load slips, weighted by the loads [1]."""
    pressed = elements.n0 > 0
    motion = elements.kt[pressed] * (
        synthesis(solution.harmonics, samples) @ solution.w[pressed, 0].T
    )
    limit = (elements.mu * elements.n0)[pressed]
    slips = np.zeros(int(pressed.sum()))
    force = np.clip(motion[-1], -limit, limit)
    # the first one forgets the start
    for turn in range(2):
        for before, now in zip(np.roll(motion, 1, axis=0), motion, strict=True):
            elastic = force + now - before
            force = np.clip(elastic, -limit, limit)
            slips += turn * (elastic != force)
    return float(limit @ slips / limit.sum() / samples)
