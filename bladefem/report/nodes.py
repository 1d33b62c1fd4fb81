"""What the contact nodes do at each resonance, for the run's folder: CSV, netCDF, ParaView,
picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..data import SEATS, Patch
from ..scene.units import newtons
from ..study.pipeline.case_models import load_cases
from ..study.pipeline.contact_cycle import ContactCycle, contact_cycle
from ..study.pipeline.run_records import SolvedRun
from ..view.contact import save_faces_vtu
from ..view.hysteresis import draw_seat_loops
from ..view.wear import draw_work
from .linear import linear_columns


def cycles_of(result: SolvedRun) -> list[ContactCycle]:
    """The period at the resonance of each curve of a finished run."""
    patches = list(result.contact.problem.patches)
    points = result.scene.contact.points
    cases = {
        (case.load, case.mass): case
        for case in load_cases(result.scene, result.mesh, result.contact)
    }
    return [
        contact_cycle(cases[curve.load, curve.mass], curve, patches, points)
        for curve in result.response.curves
    ]


def node_table(
    patches: Sequence[Patch],
    cycles: Sequence[ContactCycle],
    coefficient: float | None = None,
) -> pd.DataFrame:
    """One row a contact node and resonance: place, element, shares of the period, state, work a
    period and area (SI).

    A wear coefficient [m^3/J] adds the depth worn off in an hour.
    """
    place = np.concatenate([p.points for p in patches])
    names = np.repeat([p.seat for p in patches], [len(p.area) for p in patches])
    area = np.concatenate([p.area for p in patches])
    frames = []
    for c in cycles:
        mass = {} if c.mass is None else {"mass": c.mass}
        wear = {} if coefficient is None else {"wear_per_hour": c.wear(coefficient)}
        frames.append(
            pd.DataFrame(
                {
                    "load": c.load,
                    **mass,
                    "patch": names,
                    "x": place[:, 0],
                    "y": place[:, 1],
                    "z": place[:, 2],
                    "area": area,
                    **{name: getattr(c.elements, name) for name in ("mu", "kt", "kn", "n0")},
                    "stick": c.shares[:, 0],
                    "slip": c.shares[:, 1],
                    "separated": c.shares[:, 2],
                    "state": c.state,
                    "work": c.work,
                    "free_static_force": c.spare,
                    **linear_columns(c),
                    **wear,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def loop_table(cycles: Sequence[ContactCycle]) -> pd.DataFrame:
    """Friction force and relative displacement of each patch in one period at each resonance
    (SI).
    """
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "load": c.load,
                    **({} if c.mass is None else {"mass": c.mass}),
                    "patch": SEATS.get(name, name),
                    "phase": 2 * np.pi * np.arange(len(loop.force)) / len(loop.force),
                    "displacement": loop.displacement,
                    "force": loop.force,
                }
            )
            for c in cycles
            for name, loop in c.loops.items()
        ],
        ignore_index=True,
    )


def wear_table(
    patches: Sequence[Patch],
    cycles: Sequence[ContactCycle],
    coefficient: float,
) -> pd.DataFrame:
    """One row a resonance and face: friction work, and the mean and largest depth worn off in an
    hour (SI).
    """
    cuts = np.cumsum([len(p.area) for p in patches])[:-1]
    rows = []
    for c in cycles:
        for patch, work, depth in zip(
            patches, np.split(c.work, cuts), np.split(c.wear(coefficient), cuts), strict=True
        ):
            rows.append(
                {
                    "load": c.load,
                    **({} if c.mass is None else {"mass": c.mass}),
                    "patch": patch.seat,
                    "frequency": c.frequency,
                    "dissipated": float(work @ patch.area),
                    "wear_volume": float(depth @ patch.area),
                    "mean_wear": float(depth @ patch.area / patch.area.sum()),
                    "largest_wear": float(depth.max()),
                }
            )
    return pd.DataFrame(rows)


def wear_sentence(cycles: Sequence[ContactCycle], coefficient: float) -> str:
    """For the report: what the worst resonance wears off, and by which law."""
    worst = max(cycles, key=lambda c: float(c.wear(coefficient).max()))
    return (
        f"wear: up to {1e6 * worst.wear(coefficient).max():.3g} µm in an hour of steady vibration "
        f"at the resonance under {newtons(worst.load)}, both faces together; depth = "
        f"{coefficient:.3g} m³/J times the friction work an area, while pressure and "
        "motion stay as they are"
    )


def save_cycles_vtu(
    patches: Sequence[Patch],
    cycles: Sequence[ContactCycle],
    file: Path,
    coefficient: float | None = None,
) -> Path:
    """Work and shares of all loads on the faces, and with a wear coefficient [m^3/J] the depth worn
    off in an hour.
    """
    fields: dict[str, np.ndarray] = {}
    for c in cycles:
        at = f"at {newtons(c.load)}" + ("" if c.mass is None else f", {1e3 * c.mass:.6g} g")
        fields |= {f"friction work [J/m^2] {at}": c.work, f"state {at}": c.state}
        fields |= {
            f"share of {name} {at}": c.shares[:, k]
            for k, name in enumerate(("stick", "slip", "separation"))
        }
        if coefficient is not None:
            fields[f"wear in an hour [m] {at}"] = c.wear(coefficient)
    return save_faces_vtu(patches, fields, file)


def draw_wear(
    patches: Sequence[Patch],
    cycle: ContactCycle,
    file: Path,
) -> object:
    """Where a period at the resonance of one load wears the faces."""
    return draw_work(
        patches,
        cycle.work,
        cycle.state,
        file,
        title=f"friction work of a period at the resonance, {newtons(cycle.load)} per seat",
    )


def draw_hysteresis(cycles: Sequence[ContactCycle], file: Path) -> object:
    """Hysteresis of both seats at the resonance of each load."""
    return draw_seat_loops(seat_loops(cycles), file)


def seat_loops(
    cycles: Sequence[ContactCycle],
) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Name of the load -> name of the seat -> (displacement [m], force [N]) of one period."""
    return {
        newtons(c.load, 4)
        + ("" if c.mass is None else f", {1e3 * c.mass:.4g} g")
        + (", its balance" if c.is_march else ""): {
            f"{SEATS.get(name, name)} seat": (loop.displacement, loop.force)
            for name, loop in c.loops.items()
        }
        for c in cycles
    }
