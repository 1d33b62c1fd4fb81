"""Claims about the mass on its vibrating foundation (the paper's Sect. 4, Fig. 7-11, Table 1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np

from bladefem.damper.loops import FoundationMotion, Steady, ratio_table, spectrum, steady
from bladefem.damper.zmass import MassOnFoundation
from bladefem.data import PressureMap
from bladefem.friction.equivalent_linear import from_series, linear_force
from bladefem.report.zmass import draw_motions
from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene, vary
from bladefem.study.kinds.zmass import mass_on_foundation, press_mass, steady_motions
from bladefem.view.mesh import draw_mesh
from bladefem.view.paper import draw_footprint

from .claim import Claim, verdict

SCENE = Path(__file__).parents[2] / "scenes/zmass.toml"
RATIOS = [
    Fraction(r) for r in "0 1/5 1/4 1/3 2/5 1/2 3/5 2/3 3/4 4/5 1 6/5 4/3 3/2 2 5/2 3 4 5 6".split()
]
# of the foundation [m]; the first is Table 1's
STROKES = (5e-3, 2e-3, 1.2e-3, 0.8e-3)
MICRO = 1e6
MILLI = 1e3


def mass(folder: Path) -> Iterator[Claim]:
    """All of Sect. 4."""
    scene = load_scene(SCENE)
    pressed = press_mass(scene)
    body = mass_on_foundation(scene, pressed.seat)
    draw_mesh(pressed.mesh, folder / "fig_7.png", title="Z-shaped mass on an elastic block")
    draw_footprint(pressed.seat, body.footprint, folder / "fig_8.png")
    yield _table_1(scene, body)
    yield _proportional(scene, pressed.seat)
    yield from _undisturbed(scene, pressed.seat)
    found = list(steady_motions(scene, body, 4000))
    draw_motions(found, folder / "fig_10.png", folder / "fig_11.png")
    results = {str(drive.ratio): result for drive, result in found}
    counts = [result.loops for result in results.values()]
    yield Claim(
        "Fig. 10",
        "1, 4, 2, 1 loops at 0, 25, 50, 200 Hz",
        f"{', '.join(map(str, counts))} loops",
        verdict(counts == [1, 4, 2, 1]),
        ("fig_10.png",),
        "Friction force over the displacement of the foundation relative to the mass, its drift "
        "taken out.",
    )
    yield _ratios(body)
    yield _lag(body)
    yield from _spectra(results)
    yield _drift(scene, pressed.seat, results)
    yield _coupled(scene)


def _table_1(scene: Scene, body: MassOnFoundation) -> Claim:
    base = scene.foundation
    rows = (
        ("m", 35.0, MILLI * body.mass, "g"),
        ("I", 14.68, MICRO * body.inertia, "kg mm²"),
        ("μ", 0.3, body.mu, ""),
        ("P_0", 50.0, scene.study.loads[0], "N"),
        ("P_1", 30.0, base.pulsation, "N"),
        ("x_0", 5.0, MILLI * base.amplitude[0], "mm"),
        ("f_b", 100.0, base.frequency, "Hz"),
    )
    paper, ours = (
        ", ".join(f"{row[0]} = {row[k]:.4g} {row[3]}".rstrip() for row in rows) for k in (1, 2)
    )
    ratios = ", ".join(f"{float(r) * base.frequency:g}" for r in base.ratios)
    return Claim(
        "Fig. 7, Table 1",
        f"{paper}, f_p = 0, 25, 50, 200 Hz",
        f"{ours}, f_p = {ratios} Hz",
        verdict(all(abs(row[2] / row[1] - 1) < 1e-3 for row in rows)),
        ("fig_7.png",),
        f"The Z, {MILLI * scene.z_mass.width:.4g} mm wide and {MILLI * scene.z_mass.thickness:.4g} "
        "mm thick, sizes that give Table 1's mass and moment of inertia, seen with x upwards; in "
        "its mesh the Z is the damper, the block the blade.",
    )


def _proportional(scene: Scene, seat: PressureMap) -> Claim:
    more = press_mass(vary(scene, study__loads=(80.0,))).seat
    mean = seat.force.sum() / seat.patch.area.sum()
    change = np.abs(more.force / 80 - seat.force / 50).max() * len(seat.force)
    return Claim(
        "Fig. 8, 9, Eq. 27",
        "the pressure under the Z keeps its shape and follows the load",
        f"{seat.pressure.min() / mean:.2f} to {seat.pressure.max() / mean:.2f} of the mean on an "
        "elastic foundation of steel, highest at the edges; shares at 50 N and 80 N differ by "
        f"{change:.0e}",
        verdict(change < 1e-9),
        ("fig_8.png",),
        "Left, Fig. 8: contact pressure under a uniformly loaded top. Right, Fig. 9: the 40 "
        "contact points.",
    )


def _undisturbed(scene: Scene, seat: PressureMap) -> Iterator[Claim]:
    """Sect. 4.1: what tangential forces do to the pressure."""
    arm = scene.contact.mu * scene.z_mass.thickness / 2
    area = seat.patch.area
    reach = np.abs(seat.patch.points[:, :2]).max(axis=0)
    edge = arm * reach * area.sum() / (area @ seat.patch.points[:, :2] ** 2)
    yield Claim(
        "Sect. 4.1",
        "the plate is thin: bending by its inertia does not change the pressure",
        f"friction at its base turns it by at most μ P h / 2, {100 * (arm / reach).max():.1f} % of "
        f"P L / 2, which would lift it; at the edges this adds or takes {100 * edge.max():.1f} % "
        "of the mean pressure",
        verdict(edge.max() < 0.02, edge.max() < 0.2),
    )
    one = scene.material.blade
    other = scene.material.damper
    yield Claim(
        "Sect. 4.1",
        "equal materials: tangential traction does not disturb the pressure",
        "true of two half spaces, whose normal displacements are then equal and opposite "
        "(Dundurs' second constant is zero); the plate, "
        f"{scene.z_mass.thickness / scene.z_mass.width:.2f} of its width thick, is none: taken "
        "over, not tested here",
        verdict(False, (one.E, one.nu) == (other.E, other.nu)),
    )


def _ratios(body: MassOnFoundation) -> Claim:
    """Open loops against the denominator, for the pressure of the finite elements and for equal
    loads.
    """
    rows = ratio_table(body, RATIOS, 1000)
    kept = sum(bool(row["rule"]) for row in rows)
    broken, even = ({x: _exceptions(b, x) for x in STROKES} for b in (body, MassOnFoundation()))
    reported = "; ".join(f"{MILLI * x:g} mm {', '.join(broken[x]) or 'none'}" for x in STROKES[1:])
    apart = "; ".join(
        f"{MILLI * x:g} mm {', '.join(r for r in even[x] if r not in broken[x])}"
        for x in STROKES
        if set(even[x]) - set(broken[x])
    )
    return Claim(
        "Sect. 4.2",
        "open loops = denominator of the reduced frequency ratio",
        f"{kept} of {len(rows)} ratios at Table 1, where inertia is 4.6 times the friction limit; "
        f"exceptions with smaller strokes, where the mass sticks part of the time: {reported}. They "
        "depend on the pressure: with the same load on all of 40 points other exceptions are "
        f"{apart}",
        verdict(kept == len(rows) and not any(broken.values()), kept == len(rows)),
    )


def _exceptions(body: MassOnFoundation, stroke: float) -> list[str]:
    """Ratios that break the rule, with their loops."""
    counts = {
        r: steady(body, FoundationMotion(r, amplitude=(stroke, 0.0)), 1000, most=60).loops
        for r in RATIOS[1:]
    }
    return [f"{r} ({loops})" for r, loops in counts.items() if loops != r.denominator]


def _lag(body: MassOnFoundation) -> Claim:
    """The load's phase behind the foundation, load at twice its frequency."""
    lags = (0.0, 0.25, 0.5, 0.75)
    found = [steady(body, FoundationMotion(Fraction(2), lag=lag), 2000) for lag in lags]
    works = [MILLI * _work(result) for result in found]
    swing = max(works) / min(works) - 1
    return Claim(
        "Sect. 4.2",
        "the loop's shape depends on the phase lag between motion and load",
        f"load at 200 Hz, 0, 90, 180, 270° behind: {', '.join(f'{w:.1f}' for w in works)} mJ of "
        f"friction work a cycle, {', '.join(str(result.loops) for result in found)} loops",
        verdict(swing > 0.05),
    )


def _work(result: Steady) -> float:
    """Friction work in a cycle of the foundation [J]."""
    rate = np.gradient(result.base[:, 0], result.motion.dt) - result.motion.velocity[:, 0]
    cycles = len(result.time) * result.motion.dt * 100.0
    return float(abs(result.motion.force[:, 0] @ rate) * result.motion.dt / cycles)


def _spectra(results: Mapping[str, Steady]) -> Iterator[Claim]:
    """Fig. 11: where the energy goes."""
    leak = {}
    round_ = {}
    for name in ("0", "2"):
        frequency, lines = spectrum(results[name])
        main = lines[np.argmin(abs(frequency - 100.0)), 0]
        leak[name] = 100 * lines[np.argmin(abs(frequency - 300.0)), 0] / main
        round_[name] = 100 * _beside_ellipse(results[name])
    yield Claim(
        "Fig. 11a, b",
        "the nearer the loop is to an ellipse, the less leaks to other frequencies",
        f"0 Hz: {round_['0']:.1f} % of the friction force outside the nearest ellipse, third line "
        f"{leak['0']:.1f} % of the first; 200 Hz: {round_['2']:.1f} % and {leak['2']:.1f} %",
        verdict((leak["0"] < leak["2"]) == (round_["0"] < round_["2"])),
    )
    lines = spectrum(results["1/2"])[1][:, 0]
    yield Claim(
        "Fig. 11c, d",
        "more loops spread the response over more frequencies",
        f"at 50 Hz load a line of {MILLI * lines[0]:.3f} mm at 50 Hz beside {MILLI * lines[1]:.3f} "
        "mm at 100 Hz",
        verdict(lines[0] > 0.1 * lines[1]),
        ("fig_11.png",),
        "Amplitude spectra of the displacement without its drift.",
    )


def _beside_ellipse(result: Steady) -> float:
    """Part of the friction force, in the mean square root, that the best linear force leaves
    [1].
    """
    motion = result.relative[:, 0] + result.drift[0] * result.time
    force = result.motion.force[:, 0]
    left = force - linear_force(from_series(motion, force, 1.0), motion, 1.0)
    return float(np.linalg.norm(left) / np.linalg.norm(force))


def _drift(scene: Scene, seat: PressureMap, results: Mapping[str, Steady]) -> Claim:
    every = steady(
        mass_on_foundation(vary(scene, contact__points=None), seat),
        FoundationMotion(Fraction(1, 2)),
        2000,
    )
    repeats = all(result.reason == "periodic" for result in results.values())
    still = [name for name, result in results.items() if abs(result.drift[0]) < 1e-6]
    return Claim(
        "Sect. 4.2",
        "the response is periodic",
        f"velocity and force are; the mass drifts at {results['1/2'].drift[0]:.4f} m/s at 50 Hz "
        f"({every.drift[0]:.4f} m/s with all {len(seat.force)} contact nodes) and at "
        f"{MILLI * results['1/4'].drift[0]:.2f} mm/s at 25 Hz; no drift only for even numerators",
        verdict(repeats and len(still) == len(results), repeats),
    )


def _coupled(scene: Scene) -> Claim:
    bent = vary(
        scene,
        foundation__skew=(0.5, 0.3),
        foundation__amplitude=(0.005, 0.003),
        foundation__ratios=(0.0, 0.5),
    )
    turned = [
        result
        for _, result in steady_motions(bent, mass_on_foundation(bent, press_mass(bent).seat), 1000)
    ]
    spin = max(np.abs(r.motion.velocity[:, 2]).max() for r in turned)
    return Claim(
        "Eq. 28, 29",
        "three degrees of freedom, the two directions of friction coupled",
        "the symmetric pressure never uses them; top load skewed by 0.5 and 0.3, elliptic motion "
        f"5 mm by 3 mm: the mass turns at up to {spin:.1f} rad/s, at 50 Hz it drifts at "
        f"{turned[1].drift[0]:.3f}, {turned[1].drift[1]:.3f} m/s, and under constant load it keeps "
        f"turning by {turned[0].drift[2]:+.2f} rad/s on average, so that nothing repeats exactly. "
        "Eq. 29 limits each axis by itself: on a circle it loses half of the work; here the force "
        "stays on Coulomb's circle",
        verdict(False, spin > 0.1 and np.abs(turned[1].drift[1]) > 1e-3),
    )
