"""Claims about the blades (the paper's Sect. 5) from 2-D finite elements of the shipped plane
scene: the model itself.

Fig. 14 is in ``paper_loop``, Fig. 15 and 16 in ``paper_response``, Fig. 17 in ``paper_optima``, the
judge in time in ``paper_time``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np

from bladefem.contact.seating import solve_seating as seat
from bladefem.friction.fourier import synthesis
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.solution import size
from bladefem.hbm.sweep import sweep
from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene, vary
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import find_modes
from bladefem.view.contact import draw_pressure
from bladefem.view.mesh import draw_mesh
from bladefem.view.modes import draw_mode_sheet
from bladefem.view.paper import draw_tip_responses
from verification.paper.blades import Peak, peak
from verification.paper.plane_row import Row, paper_model, row_of_blades, whole_model

from .claim import Claim, verdict

# normal load of a seat [N]
LOADS = (1.0, 2.0, 4.0, 6.0, 10.0, 20.0, 50.0, 200.0)
# of a damper [kg]
MASSES = (0.03, 0.06, 0.09, 0.12)
# contact.kt_area of the scene over a seat [N/m]
STIFF = 40e9 * 0.012 * 0.03
SCENES = {"soft": "contact.kt=1e6 N/m", "stiff": f"contact.kt={STIFF} N/m"}
# [Hz]
BANDS = {
    ("soft", 2): (950.0, 1500.0),
    ("stiff", 2): (850.0, 1250.0),
    ("soft", 1): (205.0, 230.0),
    ("stiff", 1): (205.0, 230.0),
}


@lru_cache(maxsize=4)
def row_and_scene(contact: str) -> tuple[Row, Scene]:
    """The row of blades with "soft" (1e6 N/m a seat) or "stiff" contact (the scene's own)."""
    scene = load_scene(Path(__file__).parents[2] / "scenes/plane.toml", [SCENES[contact]])
    return row_of_blades(scene), scene


def model_of(contact: str, load: float, mass: float | None = None) -> ReducedModel:
    """The paper's model under a normal load of a seat [N]."""
    row, scene = row_and_scene(contact)
    return paper_model(scene, row, load, mass)


@lru_cache(maxsize=len(LOADS))
def top_of(load: float) -> Peak:
    """Resonance of mode 2, soft contact, damper of the scene, full balance with 3 harmonics."""
    return peak(model_of("soft", load), BANDS["soft", 2])


def dips(values: list[float]) -> bool:
    """Whether values fall to a least one inside the list and rise again."""
    best = int(np.argmin(values))
    steps = np.diff(values)
    return 0 < best < len(values) - 1 and bool(
        (steps[:best] < 0).all() and (steps[best:] > 0).all()
    )


def finite_elements(folder: Path) -> Iterator[Claim]:
    """Fig. 12 and the normal loads of the contact points."""
    row, scene = row_and_scene("soft")
    draw_mesh(row.mesh, folder / "fig_12_mesh.png", title="plane blades, plane stress")
    modes = find_modes(Bodies(scene, row.mesh))[0]
    draw_mode_sheet(row.mesh, modes, folder / "fig_12_modes.png")
    body = model_of("soft", 1.0).side(0)
    ratio = np.abs(body.shapes[0] / body.shapes[body.ports["probe"]][0])
    yield Claim(
        "Fig. 12",
        "the platform is where both of the first two modes move it",
        f"platform over tip: {ratio[0]:.3f} in mode 1 ({modes.frequencies[0]:.1f} Hz), "
        f"{ratio[1]:.3f} in mode 2 ({modes.frequencies[1]:.1f} Hz)",
        verdict(ratio[:2].min() > 0.05, ratio[:2].max() > 0.05),
        ("fig_12_mesh.png", "fig_12_modes.png"),
        "Blade with platform and flat damper, clamped at its root; first modes of the blade "
        "without damper.",
    )
    maps, more = (seat(row.problem, 0.0, normal=load, bedded=True) for load in (30.0, 60.0))
    draw_pressure(maps, folder / "fig_13.png", title="normal load 30 N on each seat")
    pressed = sum(int((m.force > 0).sum()) for m in maps)
    edge = maps[0].force > 0
    width = 1e3 * maps[0].patch.area[edge].sum() / scene.plane.depth
    change = (
        max(np.abs(b.force / 2 - a.force).max() for a, b in zip(maps, more, strict=True)) / 30.0
    )
    yield Claim(
        "Sect. 5.1",
        "contact points carry the distributed normal load",
        f"the damper bends: {pressed} of {sum(len(m.force) for m in maps)} points press, "
        f"{width:.1f} of {1e3 * scene.plane.seat_width:g} mm, and lean to the edge of the "
        f"platform; shares at 30 N and 60 N differ by {change:.0g}",
        verdict(change < 1e-6, change < 0.02),
        ("fig_13.png",),
        "Quasi-static contact of the two seats of Fig. 13; points outside the pressed part carry "
        "nothing at any load, so that full stick of the whole seat is never reached.",
    )


def phases() -> Claim:
    """Eq. 32: the inter-blade phase."""
    row, scene = row_and_scene("soft")
    reported = []
    heights = []
    for phase, name in ((0.0, "0"), (np.pi / 2, "90°"), (np.pi, "180°")):
        turned = vary(scene, excitation__phase=phase)
        found = [peak(paper_model(turned, row, load), BANDS["soft", 2]) for load in (6.0, 200.0)]
        heights.append([p.amplitude for p in found])
        reported.append(
            f"{name}: "
            + ", ".join(f"{p.frequency:.1f} Hz {1e6 * p.amplitude:.1f} µm" for p in found)
        )
    apart = np.ptp(heights, axis=0) / np.min(heights, axis=0)
    return Claim(
        "Eq. 32",
        "the forces on both sides of the damper follow from one blade alone",
        "for inter-blade phase 0 only. Resonances at 6 and 200 N by phase: " + "; ".join(reported),
        verdict(apart.max() < 0.02, True),
    )


def first_mode(folder: Path) -> Iterator[Claim]:
    """Fig. 15 for mode 1."""
    curves = {}
    tops = []
    for load in LOADS:
        points = [
            s
            for s in sweep(
                model_of("soft", load), (2 * np.pi * 212, 2 * np.pi * 226), 5, 256, curve=0.01
            )
            if s.converged
        ]
        points.sort(key=lambda s: s.omega)
        curves[load] = np.array([(s.frequency, size(s)) for s in points]).T
        tops.append(max(points, key=size))
    draw_tip_responses(
        curves,
        folder / "fig_15_mode_1.png",
        "mode 1, damper of 60 g, 1e6 N/m a seat",
    )
    heights = [1e6 * size(s) for s in tops]
    rises = tops[-1].frequency > tops[0].frequency
    yield Claim(
        "Fig. 17a, b",
        "mode 1 behaves in the same way",
        f"{heights[0]:.0f}, {min(heights):.0f}, {heights[-1]:.0f} µm at {LOADS[0]:g}, "
        f"{LOADS[int(np.argmin(heights))]:g}, {LOADS[-1]:g} N; the frequency goes from "
        f"{tops[0].frequency:.2f} to {tops[-1].frequency:.2f} Hz: so far below its own resonance "
        "on the springs the damper is mass",
        verdict(dips(heights) and rises, dips(heights) or rises),
        ("fig_15_mode_1.png",),
        "Responses round mode 1, full balance with 5 harmonics.",
    )
    yield phases()


def normal_motion(_: Path) -> Iterator[Claim]:
    """Fig. 13: what the damper's motion along its normal and its turning change, where the same
    contact layer seats the damper and carries the motion.
    """
    for contact in SCENES:
        row, scene = row_and_scene(contact)
        lines = []
        changes = []
        for load in (4.0, 20.0, 100.0):
            rigid = peak(model_of(contact, load), BANDS[contact, 2], 5)
            plain = peak(paper_model(scene, row, load, layer=True), BANDS[contact, 2], 5)
            model = whole_model(scene, row, load)
            full = peak(model, BANDS[contact, 2], 5)
            changes.append(abs(full.amplitude / plain.amplitude - 1))
            lines.append(
                f"{load:g} N: {1e6 * plain.amplitude:.2f} µm, with it {1e6 * full.amplitude:.2f} "
                f"µm (load varies by {100 * _variation(full, model):.0f} %; seated on rigid faces, "
                f"as in the paper, {1e6 * rigid.amplitude:.2f} µm without it)"
            )
        bounce = np.sqrt(model.elements.kn.sum() / row.reduced.mass) / 2 / np.pi
        yield Claim(
            "Fig. 13, Sect. 5.1",
            f"the damper's normal motion does not matter ({contact} contact, it bounces at "
            f"{bounce:.0f} Hz)",
            "; ".join(lines),
            verdict(max(changes) < 0.05, np.median(changes) < 0.05),
        )


def _variation(top: Peak, model: ReducedModel) -> float:
    """Largest half range of the whole normal force of a seat over its static value."""
    half = len(model.elements.n0) // 2
    force = top.solution.f[:, 0] @ synthesis(top.solution.harmonics, 256).T
    seats = np.array([force[:half].sum(axis=0), force[half:].sum(axis=0)])
    return float(np.ptp(seats, axis=1).max() / 2 / seats.mean())
