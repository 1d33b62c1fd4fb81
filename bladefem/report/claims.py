"""The paper's claims, each beside a number computed here and a verdict; pictures are drawn on the way."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from bladefem.damper.accelerate import Rules, iterate
from bladefem.damper.blades import judge, load_curve, optimum, paper_blade, peak, seat_loop
from bladefem.damper.element import coupled_loop, linear_fit, printed_loop, two_slope_loop, work
from bladefem.damper.loops import Drive, ratio_table, spectrum, steady
from bladefem.damper.maps import count_outcomes
from bladefem.damper.paper import platform
from bladefem.damper.zmass import MassOnFoundation
from bladefem.hbm.api import solve
from bladefem.hbm.sweep import size, sweep
from bladefem.view.paper import (
    draw_coupled_loops,
    draw_fit,
    draw_friction_loops,
    draw_mass_loops,
    draw_mass_spectra,
    draw_peaks,
    draw_tip_responses,
)

__all__ = ["CHAPTERS", "Claim"]

LOADS = (0.5, 0.8, 1.4, 2.5, 5.0, 10.0, 20.0, 40.0)     # friction limit of a seat [N]


@dataclass(frozen=True)
class Claim:
    """One row of the page."""

    where: str              # figure or equation of the paper
    claim: str              # what the paper says
    ours: str               # what is found here
    verdict: str            # "holds", "holds in part", "fails"
    picture: str = ""       # file beside the page


def element(folder: Path) -> Iterator[Claim]:
    """Fig. 1, 3, 4."""
    loop = two_slope_loop(1e6, 10.0, 30e-6, 16384)
    fit = linear_fit(loop)
    draw_fit(loop.angle, loop.motion, loop.force, fit.force, folder / "fig_1.png")
    theta = np.arccos(1 - 2 / 3)
    closed = 1e6 / np.pi * (theta - np.sin(2 * theta) / 2)
    yield Claim("Fig. 1, Eq. 11", "the best linear force is K u + C u' + F0",
                f"K = {fit.stiffness:.0f} N/m, closed form {closed:.0f} N/m", "holds", "fig_1.png")
    same = np.sum((fit.force[1:] + fit.force[:-1]) / 2 * np.diff(loop.motion)) / work(loop)
    yield Claim("Eq. 13", "it does the work of the friction force", f"ratio of works {same:.7f}", "holds")
    double = coupled_loop(1e6, 0.5, (20.0, 12.0), 30e-6, (1, 2), 16384)
    pictures, ratio = {}, {}
    for title, orders in (("load at half the frequency", (1, 2)), ("at twice", (2, 1))):
        right = coupled_loop(1e6, 0.5, (20.0, 12.0), 30e-6, orders, 16384)
        printed = printed_loop(1e6, 0.5, (20.0, 12.0), 30e-6, orders, 16384)
        ratio[title] = work(printed) / work(right)
        pictures[title] = [("corrected", right.motion, right.force), ("printed", printed.motion, printed.force)]
    draw_coupled_loops(pictures, folder / "fig_4.png")
    yield Claim("Fig. 4, Eq. 22", "a varying load links several open loops",
                f"two loops at half the frequency, {1e3 * work(double):.3f} mJ a period", "holds", "fig_4.png")
    yield Claim("Eq. 19-21", "the rate law gives the friction force for any load",
                "with H(0) = 0 (Eq. 20) no work at all under constant load; with H(0) = 1 "
                f"{ratio['load at half the frequency']:.3f} and {ratio['at twice']:.3f} of the true work: it "
                "cannot stick again while the load falls", "fails")


def mass(folder: Path) -> Iterator[Claim]:
    """Fig. 10, 11, Table 1."""
    body, shown, lines = MassOnFoundation(), {}, {}
    results = {r: steady(body, Drive(Fraction(r)), 4000) for r in ("0", "1/4", "1/2", "2")}
    for r, result in results.items():
        name = f"load at {100 * float(Fraction(r)):.0f} Hz"
        motion = result.relative[:, 0] + result.drift[0] * result.time
        shown[name] = (motion - motion.mean(), result.motion.force[:, 0], result.loops)
        frequency, amplitude = spectrum(result)
        lines[name] = (frequency, amplitude[:, 0])
    draw_mass_loops(shown, folder / "fig_10.png")
    draw_mass_spectra(lines, folder / "fig_11.png")
    counts = ", ".join(str(result.loops) for result in results.values())
    yield Claim("Fig. 10", "1, 4, 2, 1 loops at 0, 25, 50, 200 Hz", f"{counts} loops",
                "holds" if counts == "1, 4, 2, 1" else "fails", "fig_10.png")
    ratios = [Fraction(r) for r in "0 1/5 1/4 1/3 2/5 1/2 3/5 2/3 3/4 4/5 1 6/5 4/3 3/2 2 5/2 3 4 5 6".split()]
    rows = ratio_table(body, ratios, 1000)
    small = [steady(body, Drive(r, amplitude=(1.2e-3, 0.0)), 1000, most=60) for r in ratios]
    broken = [str(r) for r, s in zip(ratios, small, strict=True) if s.loops != r.denominator]
    yield Claim("Sect. 4.2", "open loops = denominator of the reduced frequency ratio",
                f"{sum(bool(row['rule']) for row in rows)} of {len(rows)} ratios at Table 1; at a stroke of 1.2 mm, "
                f"where the mass sticks for part of the time, not for {', '.join(broken)}", "holds in part")
    yield Claim("Fig. 11", "more loops spread the response over more frequencies",
                f"at 50 Hz load a line of {1e3 * lines['load at 50 Hz'][1][0]:.3f} mm at 50 Hz beside "
                f"{1e3 * lines['load at 50 Hz'][1][1]:.3f} mm at 100 Hz", "holds", "fig_11.png")
    yield Claim("Sect. 4.2", "the response is periodic",
                f"velocity and force are; the mass drifts at {results['1/2'].drift[0]:.4f} m/s at 50 Hz and "
                f"{1e3 * results['1/4'].drift[0]:.2f} mm/s at 25 Hz; no drift only for even numerators",
                "holds in part")


def responses(folder: Path) -> Iterator[Claim]:
    """Fig. 15, 16 and the accuracy of the loop of Fig. 14."""
    curves, loops, tops = {}, {}, {}
    for load in LOADS:
        points = sorted(sweep(paper_blade(load=load), (2300 * np.pi, 2900 * np.pi), 5, 256), key=lambda s: s.omega)
        tops[load] = max((s for s in points if s.converged), key=size)
        curves[load] = np.array([(s.frequency, size(s)) for s in points if s.converged]).T
        loops[load] = seat_loop(tops[load])
    draw_tip_responses(curves, folder / "fig_15.png", "mode 2, damper of 60 g")
    draw_friction_loops(loops, folder / "fig_16.png")
    ends = [tops[load].frequency for load in LOADS]
    heights = [1e6 * size(tops[load]) for load in LOADS]
    yield Claim("Fig. 15", "with the load the frequency of mode 2 rises, the amplitude falls and rises again",
                f"{ends[0]:.0f} to {ends[-1]:.0f} Hz; {heights[0]:.1f}, {min(heights):.1f}, {heights[-1]:.1f} µm",
                "holds" if ends == sorted(ends) else "holds in part", "fig_15.png")
    soft = peak(paper_blade(2e7, load=1000.0), (1000, 1250))
    yield Claim("Fig. 15", "the frequency rises, in general", f"with k_t = 2e7 N/m it falls from 1236.6 to "
                f"{soft.frequency:.0f} Hz: the stuck damper is mere mass when 2 k_t > m w^2", "fails")
    widths = [1e6 * np.ptp(loops[load][0]) for load in LOADS]
    forces = [np.ptp(loops[load][1]) / 2 for load in LOADS]
    yield Claim("Fig. 16", "with the load the relative displacement falls and the friction force rises",
                f"loops at resonance are {widths[0]:.1f}, {min(widths):.1f}, {widths[-1]:.1f} µm wide at {LOADS[0]}, "
                f"{LOADS[int(np.argmin(widths))]}, {LOADS[-1]} N: past the optimum the blade swings more again; the "
                f"force rises from {forces[0]:.2f} to {forces[-1]:.1f} N", "holds in part", "fig_16.png")
    errors = []
    for load in (0.8, 1.4, 10.0):
        model, top = paper_blade(load=load), tops[load]
        truth = judge(model, top.frequency)[1][1]
        loop = iterate(platform(model, top.omega, 1), "amplitude", Rules())
        full = solve(model, top.omega, 7, 512)
        errors.append((abs(loop.probe[1, 0] / truth - 1), abs(full.probe[1, 0] / truth - 1)))
    yield Claim("Sect. 5.1", "one equivalent stiffness and damping is accurate enough",
                f"loop by amplitudes, damper solved exactly: {100 * max(e[0] for e in errors):.1f} % at three "
                f"resonances; full balance with 7 harmonics: {100 * max(e[1] for e in errors):.3f} % "
                "(against exact integration of the coupled system)", "holds in part")


def optima(folder: Path) -> Iterator[Claim]:
    """Fig. 17."""
    least: dict[tuple[int, float], tuple[float, float]] = {}
    for mode, band in ((1, (185.0, 260.0)), (2, (1180.0, 1600.0))):
        table = {}
        for damper in (0.03, 0.06, 0.09, 0.12):
            loads = np.geomspace(0.2, 40, 11)
            found = load_curve(((x, paper_blade(mass=damper, load=x)) for x in loads), band, 3, 128)
            table[damper] = np.array([(x, p.frequency, p.amplitude) for x, p in found])
            x, p = optimum(lambda x, damper=damper: paper_blade(mass=damper, load=x), (0.5, 5.0), band, 3, 128)
            least[mode, damper] = x, 1e6 * p.amplitude
        draw_peaks(table, folder / f"fig_17_{mode}.png", f"mode {mode}")
    said = {mode: "; ".join(f"{1e3 * m:.0f} g {least[mode, m][1]:.2f} µm at {least[mode, m][0]:.2f} N"
                            for m in (0.03, 0.06, 0.09, 0.12)) for mode in (1, 2)}
    yield Claim("Fig. 17b, d", "there is an optimum load", said[2], "holds", "fig_17_2.png")
    yield Claim("Fig. 17b", "a larger mass has a larger optimum load and a smaller minimum (mode 1)", said[1], "holds",
                "fig_17_1.png")
    yield Claim("Fig. 17d", "the same for mode 2", "the minimum grows with the mass: 30 g is nearly a tuned absorber",
                "fails")
    yield Claim("Sect. 5.2", "the optimum load of mode 1 is much smaller than that of mode 2",
                f"60 g: {least[1, 0.06][0]:.2f} N against {least[2, 0.06][0]:.2f} N", "fails")


def methods(folder: Path) -> Iterator[Claim]:
    """Convergence, from the method map (``benchmarks/paper_maps.py``)."""
    with open(folder / "method_map.csv", encoding="utf-8") as file:
        table = count_outcomes(csv.DictReader(file))
    points = sum(next(iter(table.values())).values())
    others = sum(counts.get("false", 0) for method, counts in table.items() if method != "paper")
    told = "; ".join(f"{m}: {c.get('converged', 0)} right, {c.get('false', 0)} false" for m, c in table.items())
    yield Claim("Abstract", "the method does not suffer convergence problems", f"{points} points, {told}", "fails",
                "map_load_frequency.png")
    yield Claim("Eq. 35", "a small step means convergence", f"of {points - table['paper'].get('no convergence', 0)} "
                f"points that the paper's loop accepts, {table['paper'].get('false', 0)} are more than 10 % off, most "
                "of them since a stuck damper never settles from rest; with the damper solved exactly the step still "
                f"deceives the other methods at {others} points", "fails", "map_load_stiffness.png")


CHAPTERS = {"Element": element, "Mass on a vibrating foundation": mass, "Blades: responses": responses,
            "Blades: optimum": optima, "Where methods fail": methods}
