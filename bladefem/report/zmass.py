"""The run folder of a scene of kind "z mass": pressure, loops, drift and spectra for each frequency
ratio.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd

from bladefem.damper.loops import PERIODIC, FoundationMotion, Steady, spectrum
from bladefem.damper.zmass import MassOnFoundation
from bladefem.io.stage_cache import on_root, write_results, write_table
from bladefem.scene.tables import Scene
from bladefem.scene.toml import dump_scene
from bladefem.scene.warnings import implausible_values
from bladefem.study.kinds.zmass import (
    Pressed,
    mass_on_foundation,
    mean_load,
    press_mass,
    steady_motions,
)
from bladefem.util.message import warning
from bladefem.util.progress import Progress, without_progress
from bladefem.view import contact, mesh, paper

from ..util.communicator import Communicator
from .datasets import resultants, table_dataset
from .headlines import NOT_DETERMINED, Headline
from .tables import units_of, write_tables
from .write import Page, write_report


@dataclass(frozen=True)
class MassRun:
    """What a run of the mass has; the same on every rank."""

    folder: Path
    pressed: Pressed
    body: MassOnFoundation
    motions: list[tuple[FoundationMotion, Steady]]
    # stage to seconds
    timings: dict[str, float]
    messages: list[str]


def report_zmass(
    scene: Scene,
    folder: str | Path,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> MassRun:
    """Pressure on all ranks, motions and folder on rank 0.

    Raises:
        InputError, NotSolvedError: see ``study.kinds.zmass.press_mass``.
    """
    start = perf_counter()
    pressed = press_mass(scene, folder, comm)
    body = mass_on_foundation(scene, pressed.seat)
    pressure = perf_counter()
    found = on_root(comm, lambda: list(steady_motions(scene, body, progress=progress)))
    timings = {"pressure": pressure - start, "motion": perf_counter() - pressure}
    messages: list[str] = [*map(warning, implausible_values(scene))]
    messages += [warning(f"ratio {d.ratio}: {s.reason}") for d, s in found if s.reason != PERIODIC]
    result = MassRun(Path(folder), pressed, body, found, timings, messages)
    on_root(comm, lambda: _write(scene, result))
    return result


def motion_table(found: Sequence[tuple[FoundationMotion, Steady]]) -> pd.DataFrame:
    """One row a frequency ratio: loops, drift [m/s], turning speed [rad/s], amplitude at the
    foundation's frequency; drift, turning and amplitude NaN where the march does not tell them.
    """
    rows = []
    for drive, result in found:
        frequency, lines = spectrum(result)
        main = lines[np.argmin(abs(frequency - drive.frequency)), -1]
        drift = known_drift(result)
        turning = float(np.abs(result.motion.velocity[:, 2]).max())
        if not result.is_known:
            drift, turning, main = np.full(3, np.nan), np.nan, np.nan
        rows.append(
            {
                "ratio": str(drive.ratio),
                "load frequency [Hz]": float(drive.ratio) * drive.frequency,
                "loops": result.loops,
                "denominator": drive.ratio.denominator,
                "drift x [m/s]": drift[0],
                "drift y [m/s]": drift[1],
                "turning, mean [rad/s]": drift[2],
                "turning, largest [rad/s]": turning,
                "amplitude": main,
                "periodic": result.reason == PERIODIC,
            }
        )
    return pd.DataFrame(rows)


def known_drift(result: Steady) -> np.ndarray:
    """(3,) mean velocity [m/s, m/s, rad/s]; zero where it is less than the period closes to."""
    speed = np.abs(result.motion.velocity).max(axis=0)
    speed[:2] = speed[:2].max()
    return np.where(abs(result.drift) > result.residual * speed, result.drift, 0.0)


def motion_headlines(found: Sequence[tuple[FoundationMotion, Steady]]) -> list[Headline]:
    """The amplitude under each frequency of the load, and how far the mass walks."""
    numbers = []
    for (drive, result), (_, row) in zip(found, motion_table(found).iterrows(), strict=True):
        what = f"amplitude of the mass, load at {row['load frequency [Hz]']:g} Hz"
        where = f"at the foundation's {drive.frequency:g} Hz"
        if not result.is_known:
            numbers.append(Headline(what, NOT_DETERMINED, result.reason, where))
            continue
        walk = float(np.hypot(row["drift x [m/s]"], row["drift y [m/s]"]))
        walks = f"walks {1e3 * walk:.4g} mm/s" if walk else "does not walk"
        loops = "1 loop" if result.loops == 1 else f"{result.loops} loops"
        numbers.append(
            Headline(
                what,
                f"{1e6 * row['amplitude']:.4g} µm",
                f"{result.reason}, to {result.residual:.0e} of velocities and forces"
                if row["periodic"]
                else result.reason,
                f"{where}; {loops}, {walks}",
            )
        )
    return numbers


def draw_motions(
    found: list[tuple[FoundationMotion, Steady]],
    loops: Path,
    spectra: Path,
) -> None:
    """The pictures of Fig. 10 and 11."""
    shown: dict[str, tuple[np.ndarray, np.ndarray, int]] = {}
    lines: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for drive, result in found:
        name = f"load at {float(drive.ratio) * drive.frequency:g} Hz"
        motion = result.relative @ result.axis + result.drift[:2] @ result.axis * result.time
        force = result.motion.force[:, :2] @ result.axis
        shown[name] = (motion - motion.mean(), force, result.loops)
        frequency, amplitude = spectrum(result)
        lines[name] = (frequency, amplitude[:, -1])
    paper.draw_mass_loops(shown, loops)
    paper.draw_mass_spectra(lines, spectra)


def _write(scene: Scene, result: MassRun) -> None:
    folder = result.folder
    seat = result.pressed.seat
    tables: Mapping[str, pd.DataFrame] = {
        "contact/pressure": contact.pressure_summary([seat]),
        "response/motion": motion_table(result.motions),
    }
    for name, table in tables.items():
        write_tables(table, folder / name.split("/")[1], name.split("/")[1])
    points = contact.pressure_points([seat])
    load = mean_load(scene)
    write_table(folder / "pressure_points.csv", points, units_of(points))
    write_results(
        folder / "results.nc",
        {
            "resultants": resultants(tables["contact/pressure"].assign(load=load)),
            "nodes": table_dataset(points, "node"),
            "motion": table_dataset(tables["response/motion"], "case"),
        },
        dump_scene(scene),
    )
    contact.save_pressure_vtu({load: [seat]}, folder / "pressure.vtu")
    names = ("mesh/mesh", "contact/pressure_on_the_footprint", "response/loops", "response/spectra")
    figures = {name: folder / f"{name.split('/')[1]}.png" for name in names}
    mesh.draw_mesh(result.pressed.mesh, figures["mesh/mesh"], title=scene.title)
    paper.draw_footprint(seat, result.body.footprint, figures["contact/pressure_on_the_footprint"])
    draw_motions(result.motions, figures["response/loops"], figures["response/spectra"])
    mesh.save_vtu(result.pressed.mesh, folder / "mesh.vtu")
    page = Page(numbers=motion_headlines(result.motions))
    write_report(folder, scene, tables, figures, result.messages, result.timings, page=page)
