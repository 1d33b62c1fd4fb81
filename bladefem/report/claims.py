"""Claims of the paper, each beside a number computed here and a verdict: element, contact, mass, methods.

The blades are in ``paper_blades``.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd

from bladefem.damper.blades import judge, optimum, paper_blade, peak
from bladefem.damper.branch import branch, inclined_contact
from bladefem.damper.element import coupled_loop, linear_fit, printed_loop, two_slope_loop, work
from bladefem.damper.loops import Drive, ratio_table, spectrum, steady
from bladefem.damper.maps import count_outcomes
from bladefem.hbm.api import solve
from bladefem.hbm.flow import State
from bladefem.hbm.shooting import harmonics, multipliers, periodic
from bladefem.scene_file import load_scene
from bladefem.study.punch import indent, johnson_approach, johnson_pressure, ring_stiffness, spring_tilt
from bladefem.study.zmass import mass_on_foundation, motions, press
from bladefem.view.outcomes import draw_outcomes
from bladefem.view.paper import draw_coupled_loops, draw_fit, draw_footprint
from bladefem.view.paper_contact import draw_branches, draw_punch

from . import paper_blades as blades
from . import paper_time
from .claim import Chapter, Claim
from .zmass import draw_motions

__all__ = ["CHAPTERS", "RATIOS"]

SCENES = Path(__file__).parents[2] / "scenes"
MAPS = {"frequency": ("frequency", "frequency [Hz]", 1.0), "stiffness": ("stiffness", "contact stiffness [N/µm]", 1e-6)}
RATIOS = [Fraction(r) for r in "0 1/5 1/4 1/3 2/5 1/2 3/5 2/3 3/4 4/5 1 6/5 4/3 3/2 2 5/2 3 4 5 6".split()]


def element(folder: Path) -> Iterator[Claim]:
    """Fig. 1, 3, 4."""
    loop = two_slope_loop(1e6, 10.0, 30e-6, 16384)
    fit, linear = linear_fit(loop)
    draw_fit(loop.angle, loop.motion, loop.force, linear, folder / "fig_1.png")
    theta = np.arccos(1 - 2 / 3)
    closed = 1e6 / np.pi * (theta - np.sin(2 * theta) / 2)
    yield Claim("Fig. 1, Eq. 11", "the best linear force is K u + C u' + F0",
                f"K = {fit.stiffness:.0f} N/m, closed form {closed:.0f} N/m", "holds", ("fig_1.png",),
                "Amplitude 30 µm: the loop and the linear force that is closest to it in the mean square.")
    same = np.sum((linear[1:] + linear[:-1]) / 2 * np.diff(loop.motion)) / work(loop)
    yield Claim("Eq. 13", "it does the work of the friction force", f"ratio of works {same:.7f}", "holds")
    yield _printed_damping()
    double = coupled_loop(1e6, 0.5, (20.0, 12.0), 30e-6, (1, 2), 16384)
    pictures, ratio = {}, {}
    for title, orders in (("load at half the frequency", (1, 2)), ("at twice", (2, 1)), ("at a quarter", (1, 4))):
        right = coupled_loop(1e6, 0.5, (20.0, 12.0), 30e-6, orders, 16384)
        printed = printed_loop(1e6, 0.5, (20.0, 12.0), 30e-6, orders, 16384)
        ratio[title] = work(printed) / work(right)
        pictures[title] = [("corrected", right.motion, right.force), ("printed", printed.motion, printed.force)]
    draw_coupled_loops(pictures, folder / "fig_4.png")
    yield Claim("Fig. 4, Eq. 22", "a varying load links several open loops",
                f"two loops at half the frequency, {1e3 * work(double):.3f} mJ a period", "holds", ("fig_4.png",),
                "Limit 10 N + 6 N sin; the law as printed loses part of the loop, since it cannot stick again while "
                "the load falls.")
    yield Claim("Eq. 19-21", "the rate law gives the friction force for any load",
                "with H(0) = 0 (Eq. 20) no work at all under constant load; with H(0) = 1 "
                f"{ratio['load at half the frequency']:.3f} and {ratio['at twice']:.3f} of the true work: it "
                "cannot stick again while the load falls", "fails")


def _printed_damping() -> Claim:
    """Eq. 16 on a motion and a force of three harmonics."""
    rng, k = np.random.default_rng(3), np.arange(1, 4)
    a, b, fs, fc = rng.normal(size=(4, 3))
    t = 2 * np.pi * np.arange(256)[:, None] / 256
    rate = (k * (a * np.cos(k * t) - b * np.sin(k * t))).sum(axis=1)
    force = (fs * np.sin(k * t) + fc * np.cos(k * t)).sum(axis=1)
    right = rate @ force / (rate @ rate)
    printed = (a @ fc - b @ fs) / (k @ (a**2 + b**2))
    mended = k @ (a * fc - b * fs) / (k**2 @ (a**2 + b**2))
    return Claim("Eq. 16", "C from Fourier coefficients, several harmonics",
                 f"three harmonics: {printed / right:.3f} of Eq. 11 as printed, {mended / right:.6f} with the factor k "
                 "that both sums lack; one harmonic: the same", "holds in part")


def contact(folder: Path) -> Iterator[Claim]:
    """Fig. 5, 6, Eq. 23-26."""
    scene = load_scene(SCENES / "punch.toml")
    a, block, found = scene.punch.radius, scene.material.blade, indent(scene)
    edges = np.linspace(0, 1, 11)
    r = np.linspace(0, 0.995, 200)
    springs = ring_stiffness(edges * a, a, block.E, block.nu)
    draw_punch(found.radius / a, found.pressure / (found.total / np.pi / a**2), 4 * found.force / found.approach,
               (r, johnson_pressure(r * a, a, 1.0) * np.pi * a**2), (edges, springs), folder / "fig_5.png")
    inner = found.radius < 0.8 * a
    area, exact = found.patch.area[inner], johnson_pressure(found.radius[inner], a, found.total)
    error = np.sqrt(area @ (found.pressure[inner] - exact) ** 2 / (area @ exact**2))
    approach = found.approach / johnson_approach(a, found.total, block.E, block.nu) - 1
    yield Claim("Fig. 5, Eq. 24", "pressure P / sqrt(a² - x²), approach pi P (1 - v²) / E",
                "as printed only if P is p0 a, a force for each unit of length; in terms of the force, P / (2 pi a "
                f"sqrt(a² - r²)) holds to {100 * error:.1f} % for r < 0.8 a, and P (1 - v²) / (2 a E) to "
                f"{100 * abs(approach):.1f} % (block of 50 radii)", "holds in part", ("fig_5.png",),
                "Round rigid punch on an elastic block, quarter model, elements of a tenth of the radius.")
    whole = springs.sum() * found.approach / found.total
    yield Claim("Fig. 6, Eq. 25", "k_n(x) is the normal stiffness of the contact element at x",
                f"it is that of a ring of radius x: the rings together carry {whole:.3f} of the load at this approach",
                "holds in part")
    true = 4 / 3 * a**3 * block.E / (1 - block.nu**2)
    yield Claim("Sect. 3.2", "springs that do not see each other must change with the contact state",
                f"tilted, these springs resist with {spring_tilt(edges * a, a, block.E, block.nu) / true:.3f} of the "
                f"half space's moment; the finite elements with {found.tilt_stiffness / true:.3f}", "holds")
    yield Claim("Eq. 26", "quasi-static for T > D / c; D = 1 m of steel below some 5 kHz",
                "that is the limit, not a safe bound: at 5 kHz the wave length equals D", "holds in part")


def mass(folder: Path) -> Iterator[Claim]:
    """Fig. 7-11, Table 1."""
    scene = load_scene(SCENES / "zmass.toml")
    seat = press(scene).seat
    body = mass_on_foundation(scene, seat)
    draw_footprint(seat, body.footprint, folder / "fig_8.png")
    more = press(scene.vary(study__loads=(80.0,))).seat
    mean = seat.force.sum() / seat.patch.area.sum()
    change = np.abs(more.force / 80 - seat.force / 50).max() * len(seat.force)
    yield Claim("Fig. 8, Eq. 27", "the pressure under the Z keeps its shape and follows the load",
                f"{seat.pressure.min() / mean:.2f} to {seat.pressure.max() / mean:.2f} of the mean on an elastic "
                f"foundation of steel, highest at the edges; shares at 50 N and 80 N differ by {change:.0e}", "holds",
                ("fig_8.png",), "Contact pressure under a uniformly loaded top, and the 40 contact points of Fig. 9.")
    found = list(motions(scene, body, 4000))
    draw_motions(found, folder / "fig_10.png", folder / "fig_11.png")
    results = {str(drive.ratio): result for drive, result in found}
    counts = ", ".join(str(result.loops) for result in results.values())
    yield Claim("Fig. 10", "1, 4, 2, 1 loops at 0, 25, 50, 200 Hz", f"{counts} loops",
                "holds" if counts == "1, 4, 2, 1" else "fails", ("fig_10.png",),
                "Friction force over the displacement of the foundation relative to the mass, its drift taken out.")
    rows = ratio_table(body, RATIOS, 1000)
    broken = {}
    for stroke in (2e-3, 1.2e-3, 0.8e-3):
        counts = {r: steady(body, Drive(r, amplitude=(stroke, 0.0)), 1000, most=60).loops for r in RATIOS[1:]}
        broken[stroke] = [f"{r} ({loops})" for r, loops in counts.items() if loops != r.denominator]
    yield Claim("Sect. 4.2", "open loops = denominator of the reduced frequency ratio",
                f"{sum(bool(row['rule']) for row in rows)} of {len(rows)} ratios at Table 1, where inertia is 4.6 "
                "times the friction limit; exceptions with smaller strokes, where the mass sticks part of the time: "
                + "; ".join(f"{1e3 * x:g} mm {', '.join(b) or 'none'}" for x, b in broken.items()), "holds in part")
    lines = spectrum(results["1/2"])[1][:, 0]
    yield Claim("Fig. 11", "more loops spread the response over more frequencies",
                f"at 50 Hz load a line of {1e3 * lines[0]:.3f} mm at 50 Hz beside {1e3 * lines[1]:.3f} mm at 100 Hz",
                "holds", ("fig_11.png",), "Amplitude spectra of the displacement without its drift.")
    every = steady(mass_on_foundation(scene.vary(contact__points=None), seat), Drive(Fraction(1, 2)), 2000)
    yield Claim("Sect. 4.2", "the response is periodic",
                f"velocity and force are; the mass drifts at {results['1/2'].drift[0]:.4f} m/s at 50 Hz "
                f"({every.drift[0]:.4f} m/s with all {len(seat.force)} contact nodes) and at "
                f"{1e3 * results['1/4'].drift[0]:.2f} mm/s at 25 Hz; no drift only for even numerators",
                "holds in part")
    bent = scene.vary(foundation__skew=(0.5, 0.3), foundation__amplitude=(0.005, 0.003), foundation__ratios=(0.0, 0.5))
    turned = [result for _, result in motions(bent, mass_on_foundation(bent, press(bent).seat), 1000)]
    yield Claim("Eq. 28, 29", "three freedoms, the two directions of friction coupled",
                "the symmetric pressure never uses them; top load skewed by 0.5 and 0.3, elliptic motion 5 mm by 3 mm: "
                "the mass turns at up to "
                f"{max(np.abs(r.motion.velocity[:, 2]).max() for r in turned):.1f} rad/s, at 50 Hz it drifts at "
                f"{turned[1].drift[0]:.3f}, {turned[1].drift[1]:.3f} m/s, and under constant load it keeps turning by "
                f"{turned[0].drift[2]:+.2f} rad/s on average, so that nothing repeats exactly. Eq. 29 limits each axis "
                "by itself: on a circle it loses half of the work; here the force stays on Coulomb's circle",
                "holds in part")


def reference(_: Path) -> Iterator[Claim]:
    """The beam of known modes that the method was developed with."""
    stuck = [peak(paper_blade(kt, load=load, phase=phase), band).frequency for kt, load, phase, band in (
        (1e6, 1000.0, 0.0, (1300, 1450)), (2e7, 1000.0, 0.0, (1000, 1250)), (2e7, 30.0, np.pi, (1900, 2200)))]
    yield Claim("Fig. 15", "the frequency rises with the load",
                f"from 1236.6 Hz to {stuck[0]:.0f} Hz (1e6 N/m a seat), {stuck[1]:.0f} Hz (2e7 N/m: mere mass), "
                f"{stuck[2]:.0f} Hz (2e7 N/m, neighbours in antiphase: the damper stands still)", "holds in part")
    best = {m: optimum(lambda load, m=m: paper_blade(mass=m, load=load), (0.5, 4.0), (1100, 1600), samples=128)
            for m in (0.03, 0.06, 0.12)}
    yield Claim("Fig. 17d", "a heavier damper has a smaller least amplitude (mode 2)",
                "; ".join(f"{1e3 * m:.0f} g {1e6 * p.amplitude:.2f} µm at {x:.2f} N" for m, (x, p) in best.items())
                + ": 30 g on these springs is nearly a tuned absorber", "fails")
    solution, tip, _ = judge(paper_blade(load=1.4), 1315.5, highest=1)
    full = solve(paper_blade(load=1.4), solution.omega, 15, 2048)
    yield Claim("Sect. 5.1", "the balance of harmonics is accurate enough",
                f"15 harmonics against exact integration: {abs(full.probe[1, 0] / tip[1] - 1):.0e}", "holds")


def stability(folder: Path) -> Iterator[Claim]:
    """Whether periodic motions are stable and single."""
    model, system = inclined_contact()
    points = list(branch(model, system, (110.0, 200.0)))
    marks = [(p.frequency, p.amplitude) for p in points[::60]]
    draw_branches(*(np.array([getattr(p, name) for p in points]) for name in ("frequency", "amplitude", "multiplier")),
                  marks, folder / "stability.png")
    worst = max(p.multiplier for p in points)
    fold = max(p.frequency for p in points if p.fold)
    low = min(p.frequency for p in points if p.multiplier > 1 + 1e-6)
    yield Claim("Sect. 2.1", "the steady state is one periodic motion",
                f"not where the normal load follows the motion: from {low:.1f} to {fold:.1f} Hz an inclined contact "
                "sticks, or its mass rocks off it with several times the amplitude; the motion between the two is "
                f"unstable, largest multiplier {worst:.2f}", "fails", ("stability.png",),
                "One mass on an inclined contact that can open: path of periodic motions and their largest Floquet "
                "multiplier, by event-exact monodromy matrices (1: the slider of a contact that always sticks).")
    row = blades.model_of("soft", 6.0)
    solution, _, coupled = judge(row, 1148.7)
    rng, d, n, first = np.random.default_rng(1), len(coupled.stiffness), len(coupled.kt), []
    sizes = [np.abs(multipliers(solution)).max()]
    for _ in range(3):
        start = State(1e-5 * rng.normal(size=d), 1e-5 * solution.omega * rng.normal(size=d), 1e-5 * rng.normal(size=n))
        other = periodic(coupled, solution.omega, start)
        first.append(harmonics(other, coupled, 1)[0, 1])
        sizes.append(np.abs(multipliers(other)).max())
    spread = np.abs(np.array(first) / first[0] - 1).max()
    yield Claim("Sect. 5", "prescribed normal loads: one response for a frequency",
                f"plane blades at resonance, 6 N, three random starts: amplitudes agree to {spread:.0e}, largest "
                f"multiplier {max(sizes):.6f}", "holds")


def methods(folder: Path) -> Iterator[Claim]:
    """Convergence, from the method map (``benchmarks/paper_maps.py``)."""
    rows = pd.read_csv(folder / "method_map.csv")
    plane = np.where(rows["frequency"] == rows["frequency"].mode()[0], "stiffness", "frequency")
    for name, axis in MAPS.items():
        draw_outcomes(rows.assign(plane=plane), {name: axis}, folder / f"map_load_{name}.png")
    table = count_outcomes(rows.to_dict("records"))
    points = sum(next(iter(table.values())).values())
    others = sum(counts.get("false", 0) for method, counts in table.items() if method != "paper")
    told = "; ".join(f"{m}: {c.get('converged', 0)} right, {c.get('false', 0)} false" for m, c in table.items())
    yield Claim("Abstract", "the method does not suffer convergence problems", f"{points} points, {told}", "fails",
                ("map_load_frequency.png",), "Each method over normal load and frequency, reference blade. Blue: "
                "converged, darker with more iterations; how many, above each map.")
    yield Claim("Eq. 35", "a small step means convergence", f"of {points - table['paper'].get('no convergence', 0)} "
                f"points that the paper's loop accepts, {table['paper'].get('false', 0)} are more than 10 % off, most "
                "of them since a stuck damper never settles from rest; with the damper solved exactly the step still "
                f"deceives the other methods at {others} points", "fails", ("map_load_stiffness.png",),
                "The same over normal load and contact stiffness.")


CHAPTERS = (
    Chapter("Element", "One node-to-node element with the force that it gives (Sect. 2.2 and 3.1). Stiffness 1e6 N/m, "
            "friction limit 10 N. demos/paper_element.py.", (element,)),
    Chapter("Contact", "A flat rigid punch on an elastic block (Sect. 3.2), by 3-D finite elements with unilateral "
            "contact: scenes/punch.toml, demos/paper_contact.py.", (contact,)),
    Chapter("Mass on a vibrating foundation", "A Z-shaped steel plate with the mass and moment of inertia of Table 1 "
            "on a block of steel (Sect. 4), scenes/zmass.toml: pressure by finite elements, then three freedoms with "
            "coupled friction at 40 points, 1e6 N/m in all, integrated in time. "
            "demos/paper_zmass.py, or bladefem run scenes/zmass.toml.", (mass,)),
    Chapter("Blades with underplatform dampers", "scenes/plane.toml: a clamped blade of 150 x 6 x 30 mm with its "
            "platform, plane stress, a flat damper of 60 g to each side, 1 N at the tip, damping ratio 0.002, friction "
            "coefficient 0.3, inter-blade phase 0 (Eq. 32 holds for no other). Soft contact: 1e6 N/m a seat; stiff "
            "contact: 1.44e7 N/m. The damper moves along the row only, as in the paper, unless said otherwise; the "
            "judge is the exact integration of the coupled system in time. demos/paper_blades.py.",
            (blades.finite_elements, blades.accuracy, paper_time.in_time, blades.responses, blades.first_mode,
             blades.normal_motion, blades.optima)),
    Chapter("Reference blade", "A beam with a lumped platform mass, so that anyone can repeat it without finite "
            "elements: 150 x 30 x 6 mm, steel, 0.05 kg at 45 mm; loads are friction limits of a seat.", (reference,)),
    Chapter("Stability of the solutions", "Floquet multipliers of periodic motions, on the path through its folds.",
            (stability, blades.two_motions)),
    Chapter("Where methods fail", "Every method on a grid of points of the reference blade.", (methods,)),
)
