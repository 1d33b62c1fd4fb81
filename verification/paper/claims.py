"""Claims of the paper, each with a number computed here and a verdict that follows from it:
element, contact, maps.

The mass is in ``paper_mass``, the blades in ``paper_blades``, ``paper_loop``, ``paper_response``
and ``paper_optima``.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from bladefem.damper.branch import branch, inclined_contact
from bladefem.damper.loops import count_loops
from bladefem.hbm.solve import solve
from bladefem.scene.toml import load_scene
from bladefem.study.kinds.punch import (
    indent_punch,
    johnson_approach,
    johnson_pressure,
    ring_stiffness,
    spring_tilt,
)
from bladefem.time.event_integrator import State
from bladefem.time.shooting import floquet_multipliers, periodic_solution, probe_harmonics
from bladefem.view.paper import draw_coupled_loops, draw_fit
from verification.paper.blades import judge, optimum, paper_blade, peak
from verification.paper.element import coupled_loop, linear_fit, printed_loop, two_slope_loop, work
from verification.paper.method_maps import count_outcomes
from verification.paper.view_contact import draw_branches, draw_punch
from verification.paper.view_outcomes import draw_outcomes

from . import claims_blades as blades
from . import claims_loop as paper_loop
from . import claims_optima as paper_optima
from . import claims_response as paper_response
from . import claims_time as paper_time
from .claim import Chapter, Claim, verdict
from .claims_mass import mass

SCENES = Path(__file__).parents[2] / "scenes"
MAPS = {
    "frequency": ("frequency", "frequency [Hz]", 1.0),
    "stiffness": ("stiffness", "contact stiffness [N/µm]", 1e-6),
}


def element(folder: Path) -> Iterator[Claim]:
    """Fig. 1, 3, 4."""
    loop = two_slope_loop(1e6, 10.0, 30e-6, 16384)
    fit, linear = linear_fit(loop)
    draw_fit(loop.angle, loop.motion, loop.force, linear, folder / "fig_1.png")
    theta = np.arccos(1 - 2 / 3)
    closed = 1e6 / np.pi * (theta - np.sin(2 * theta) / 2)
    yield Claim(
        "Fig. 1, 3, Eq. 11",
        "the best linear force is K u + C u' + F0",
        f"K = {fit.stiffness:.0f} N/m, closed form {closed:.0f} N/m",
        verdict(abs(fit.stiffness / closed - 1) < 1e-4),
        ("fig_1.png",),
        "The two-slope loop of Fig. 3, amplitude 30 µm, and the linear force that is closest to "
        "it in the mean square.",
    )
    same = np.sum((linear[1:] + linear[:-1]) / 2 * np.diff(loop.motion)) / work(loop)
    yield Claim(
        "Eq. 13",
        "it does the work of the friction force",
        f"ratio of works {same:.7f}",
        verdict(abs(same - 1) < 1e-5),
    )
    yield _printed_damping()
    yield from _varying_loads(folder, work(loop))


def _varying_loads(folder: Path, whole: float) -> Iterator[Claim]:
    """Fig. 4, and the printed law; ``whole`` is the work of a period under constant load [J]."""
    pictures = {}
    ratio = {}
    loops = {}
    works = {}
    for title, orders in (
        ("load at half the frequency", (1, 2)),
        ("at twice", (2, 1)),
        ("at a quarter", (1, 4)),
    ):
        right = coupled_loop(1e6, 0.5, (20.0, 12.0), 30e-6, orders, 16384)
        printed = printed_loop(1e6, 0.5, (20.0, 12.0), 30e-6, orders, 16384)
        slip = np.diff(right.motion - right.force / 1e6)
        loops[title] = count_loops(np.where(np.abs(slip) > 1e-3 * np.abs(slip).max(), slip, 0.0))
        works[title], ratio[title] = work(right), work(printed) / work(right)
        pictures[title] = [
            (name, loop.motion, loop.force)
            for name, loop in (("corrected", right), ("printed, H(0) = 1", printed))
        ]
    draw_coupled_loops(pictures, folder / "fig_4.png")
    yield Claim(
        "Fig. 4, Eq. 22",
        "a varying load links several open loops",
        ", ".join(f"{title} {loops[title]} ({1e3 * w:.3f} mJ)" for title, w in works.items())
        + " a period",
        verdict(list(loops.values()) == [2, 1, 4], max(loops.values()) > 1),
        ("fig_4.png",),
        "Limit 10 N + 6 N sin; the law as printed, with H(0) = 1, loses part of the loop, since "
        "it cannot stick again while the load falls.",
    )
    frozen = work(printed_loop(1e6, 1.0, (10.0, 0.0), 30e-6, (1, 1), 16384, at_zero=0)) / whole
    yield Claim(
        "Eq. 19-21",
        "the rate law gives the friction force for any load",
        f"with H(0) = 0 (Eq. 20) {abs(frozen):.3f} of the true work under constant load; with H(0) "
        f"= 1 {ratio['load at half the frequency']:.3f} and {ratio['at twice']:.3f} of it under "
        "loads at half and twice the frequency: it cannot stick again while the load falls",
        verdict(all(abs(r - 1) < 0.01 for r in (frozen, *ratio.values()))),
    )


def _printed_damping() -> Claim:
    """Eq. 16 on a motion and a force of one harmonic, and of three."""
    printed = {}
    mended = {}
    for highest in (1, 3):
        rng = np.random.default_rng(3)
        k = np.arange(1, highest + 1)
        a, b, fs, fc = rng.normal(size=(4, highest))
        t = 2 * np.pi * np.arange(256)[:, None] / 256
        rate = (k * (a * np.cos(k * t) - b * np.sin(k * t))).sum(axis=1)
        force = (fs * np.sin(k * t) + fc * np.cos(k * t)).sum(axis=1)
        right = rate @ force / (rate @ rate)
        printed[highest] = (a @ fc - b @ fs) / (k @ (a**2 + b**2)) / right
        mended[highest] = k @ (a * fc - b * fs) / (k**2 @ (a**2 + b**2)) / right
    return Claim(
        "Eq. 16",
        "C from Fourier coefficients, several harmonics",
        f"three harmonics: {printed[3]:.3f} of Eq. 11 as printed, {mended[3]:.6f} with the factor "
        f"k that is missing in both sums; one harmonic: {printed[1]:.6f}",
        verdict(abs(printed[3] - 1) < 1e-3, abs(printed[1] - 1) < 1e-3),
    )


def contact(folder: Path) -> Iterator[Claim]:
    """Fig. 5, 6, Eq. 23-26."""
    scene = load_scene(SCENES / "punch.toml")
    a = scene.punch.radius
    block = scene.material.blade
    found = indent_punch(scene)
    edges = np.linspace(0, 1, 11)
    r = np.linspace(0, 0.995, 200)
    springs = ring_stiffness(edges * a, a, block.E, block.nu)
    draw_punch(
        found.radius / a,
        found.pressure / (found.total / np.pi / a**2),
        4 * found.force / found.approach,
        (r, johnson_pressure(r * a, a, 1.0) * np.pi * a**2),
        (edges, springs),
        folder / "fig_5.png",
    )
    inner = found.radius < 0.8 * a
    area = found.patch.area[inner]
    exact = johnson_pressure(found.radius[inner], a, found.total)
    error = np.sqrt(area @ (found.pressure[inner] - exact) ** 2 / (area @ exact**2))
    approach = found.approach / johnson_approach(a, found.total, block.E, block.nu) - 1
    yield Claim(
        "Fig. 5, Eq. 24",
        "pressure P / sqrt(a² - x²), approach pi P (1 - v²) / E",
        "as printed only if P is p0 a, a force for each unit of length; in terms of the force, P "
        f"/ (2 pi a sqrt(a² - r²)) holds to {100 * error:.1f} % for r < 0.8 a, and P (1 - v²) / (2 "
        f"a E) to {100 * abs(approach):.1f} % (block of 50 radii)",
        verdict(False, error < 0.03 and abs(approach) < 0.03),
        ("fig_5.png",),
        "Round rigid punch on an elastic block, quarter model, elements of a tenth of the radius. "
        "Left, Fig. 5: pressure. Right, Fig. 6: the stiffness of discretised springs within a "
        "radius.",
    )
    whole = springs.sum() * found.approach / found.total
    yield Claim(
        "Fig. 6, Eq. 25",
        "k_n(x) is the normal stiffness of the contact element at x",
        f"it is that of a ring of radius x: the rings together carry {whole:.3f} of the load at "
        "this approach",
        verdict(False, abs(whole - 1) < 0.05),
    )
    true = 4 / 3 * a**3 * block.E / (1 - block.nu**2)
    tilted = spring_tilt(edges * a, a, block.E, block.nu) / true
    solid = found.tilt_stiffness / true
    yield Claim(
        "Sect. 3.2",
        "springs that do not see each other must change with the contact state",
        f"tilted, these springs resist with {tilted:.3f} of the half space's moment; the finite "
        f"elements with {solid:.3f}",
        verdict(abs(tilted - 1) > 0.1 and abs(solid - 1) < 0.05),
    )
    waves = 5200.0 / (5000.0 * 1.0)
    yield Claim(
        "Eq. 26",
        "quasi-static for T > D / c; D = 1 m of steel below some 5 kHz",
        f"that is the limit, not a safe bound: at 5 kHz the wave length is {waves:.2f} D",
        verdict(waves > 10, waves > 1),
    )


def reference(_: Path) -> Iterator[Claim]:
    """The beam of known modes that the method was developed with."""
    stuck = [
        peak(paper_blade(kt, load=load, phase=phase), band).frequency
        for kt, load, phase, band in (
            (1e6, 1000.0, 0.0, (1300, 1450)),
            (2e7, 1000.0, 0.0, (1000, 1250)),
            (2e7, 30.0, np.pi, (1900, 2200)),
        )
    ]
    rises = [f > 1236.6 for f in stuck]
    yield Claim(
        "Fig. 15",
        "the frequency rises with the load",
        f"from 1236.6 Hz to {stuck[0]:.0f} Hz (1e6 N/m a seat), {stuck[1]:.0f} Hz (2e7 N/m: mere "
        f"mass), {stuck[2]:.0f} Hz (2e7 N/m, neighbours in antiphase: the damper is at rest)",
        verdict(all(rises), any(rises)),
    )
    best = {
        m: optimum(
            lambda load, m=m: paper_blade(mass=m, load=load), (0.5, 4.0), (1100, 1600), samples=128
        )
        for m in (0.03, 0.06, 0.12)
    }
    yield Claim(
        "Fig. 17d",
        "a heavier damper has a smaller least amplitude (mode 2)",
        "; ".join(
            f"{1e3 * m:.0f} g {1e6 * p.amplitude:.2f} µm at {x:.2f} N" for m, (x, p) in best.items()
        )
        + ": 30 g on these springs is nearly a tuned absorber",
        verdict(all(a.amplitude > b.amplitude for (_, a), (_, b) in pairwise(best.values()))),
    )
    solution, tip, _ = judge(paper_blade(load=1.4), 1315.5, highest=1)
    off = abs(solve(paper_blade(load=1.4), solution.omega, 15, 2048).probe[1, 0] / tip[1] - 1)
    yield Claim(
        "Sect. 5.1",
        "the balance of harmonics is accurate enough",
        f"15 harmonics against exact integration: {off:.0e}",
        verdict(off < 0.02),
    )


def stability(folder: Path) -> Iterator[Claim]:
    """Whether periodic motions are stable and single."""
    model, system = inclined_contact()
    points = list(branch(model, system, (110.0, 200.0)))
    marks = [(p.frequency, p.amplitude) for p in points[::60]]
    draw_branches(
        *(
            np.array([getattr(p, name) for p in points])
            for name in ("frequency", "amplitude", "multiplier")
        ),
        marks,
        folder / "stability.png",
    )
    worst = max(p.multiplier for p in points)
    fold = max(p.frequency for p in points if p.fold)
    low = min(p.frequency for p in points if p.multiplier > 1 + 1e-6)
    yield Claim(
        "Sect. 2.1",
        "the steady state is one periodic motion",
        f"not where the normal load follows the motion: from {low:.1f} to {fold:.1f} Hz an "
        "inclined contact sticks, or its mass rocks off it with several times the amplitude; the "
        f"motion between the two is unstable, largest multiplier {worst:.2f}",
        verdict(worst < 1 + 1e-6),
        ("stability.png",),
        "One mass on an inclined contact that can open: path of periodic motions and their "
        "largest Floquet multiplier, by event-exact monodromy matrices (1: the slider of a "
        "contact that always sticks).",
    )
    row = blades.model_of("soft", 6.0)
    solution, _, coupled = judge(row, 1148.7)
    rng = np.random.default_rng(1)
    d = len(coupled.stiffness)
    n = len(coupled.kt)
    first = []
    sizes = [np.abs(floquet_multipliers(solution)).max()]
    for _ in range(3):
        start = State(
            1e-5 * rng.normal(size=d),
            1e-5 * solution.omega * rng.normal(size=d),
            1e-5 * rng.normal(size=n),
        )
        other = periodic_solution(coupled, solution.omega, start)
        first.append(probe_harmonics(other, coupled, 1)[0, 1])
        sizes.append(np.abs(floquet_multipliers(other)).max())
    spread = np.abs(np.array(first) / first[0] - 1).max()
    yield Claim(
        "Sect. 5",
        "prescribed normal loads: one response for a frequency",
        f"plane blades at resonance, 6 N, three random starts: amplitudes agree to {spread:.0e}, "
        f"largest multiplier {max(sizes):.6f}",
        verdict(spread < 1e-6 and max(sizes) < 1 + 1e-6),
    )


def methods(folder: Path) -> Iterator[Claim]:
    """Convergence, from the method map (``benchmarks/paper_maps.py``)."""
    rows = pd.read_csv(folder / "method_map.csv")
    plane = np.where(rows["frequency"] == rows["frequency"].mode()[0], "stiffness", "frequency")
    for name, axis in MAPS.items():
        draw_outcomes(rows.assign(plane=plane), {name: axis}, folder / f"map_load_{name}.png")
    table = count_outcomes(rows.to_dict("records"))
    points = sum(next(iter(table.values())).values())
    others = sum(counts.get("false", 0) for method, counts in table.items() if method != "paper")
    reported = "; ".join(
        f"{m}: {c.get('converged', 0)} right, {c.get('false', 0)} false" for m, c in table.items()
    )
    yield Claim(
        "Abstract",
        "the method does not suffer convergence problems",
        f"{points} points, {reported}",
        verdict(table["paper"].get("converged", 0) == points),
        ("map_load_frequency.png",),
        "Each method over normal load and frequency, reference blade. Blue: converged, darker "
        "with more iterations; how many, and how many false, above each map.",
    )
    yield Claim(
        "Eq. 35",
        "a small step means convergence",
        f"of {points - table['paper'].get('no convergence', 0)} points that the paper's loop "
        f"accepts, {table['paper'].get('false', 0)} are more than 10 % off, most of them since a "
        "stuck damper never settles from rest; with the damper solved exactly the step still "
        f"deceives the other methods at {others} points",
        verdict(table["paper"].get("false", 0) + others == 0),
        ("map_load_stiffness.png",),
        "The same over normal load and contact stiffness.",
    )


CHAPTERS = (
    Chapter(
        "Element",
        "One node-to-node element with the force that it gives (Sect. 2.2 and 3.1). Stiffness 1e6 "
        "N/m, friction limit 10 N. demos/paper_element.py.",
        (element,),
    ),
    Chapter(
        "Contact",
        "A flat rigid punch on an elastic block (Sect. 3.2), by 3-D finite elements with "
        "unilateral contact: scenes/punch.toml, demos/paper_contact.py.",
        (contact,),
    ),
    Chapter(
        "Mass on a vibrating foundation",
        "A Z-shaped steel plate with the mass and moment of inertia of Table 1 on a block of "
        "steel (Sect. 4), scenes/zmass.toml: pressure by finite elements, then three degrees of freedom "
        "with coupled friction at 40 points, 1e6 N/m in all, integrated in time. "
        "demos/paper_zmass.py, or bladefem run scenes/zmass.toml.",
        (mass,),
    ),
    Chapter(
        "Blades with underplatform dampers",
        "scenes/plane.toml: a clamped blade of 150 x 6 x 30 mm with its platform, plane stress, a "
        "flat damper of 60 g to each side, 1 N at the tip, damping ratio 0.002, friction "
        "coefficient 0.3, inter-blade phase 0 (Eq. 32 holds for no other). Soft contact: 1e6 N/m "
        "a seat; stiff contact: 1.44e7 N/m. Seats of 40 elements, half of which press; with 160 a "
        "resonance of mode 2 grows by 0.2 % at 6 N, 0.9 % at 63 N, 1.9 % at 100 N, 5 % at 200 N "
        "(soft contact). The damper moves along the row only, as in the paper, unless said "
        "otherwise; the judge is the exact integration of the coupled system in time. "
        "demos/paper_blades.py.",
        (
            blades.finite_elements,
            paper_loop.accuracy,
            paper_time.in_time,
            paper_response.responses,
            blades.first_mode,
            blades.normal_motion,
            paper_optima.optima,
        ),
    ),
    Chapter(
        "Reference blade",
        "A beam with a lumped platform mass, so that anyone can repeat it without finite "
        "elements: 150 x 30 x 6 mm, steel, 0.05 kg at 45 mm; loads are friction limits of a seat.",
        (reference,),
    ),
    Chapter(
        "Stability of the solutions",
        "Floquet multipliers of periodic motions, on the path through its folds.",
        (stability, paper_time.two_motions),
    ),
    Chapter(
        "Where methods fail", "Every method on a grid of points of the reference blade.", (methods,)
    ),
)
