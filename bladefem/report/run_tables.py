"""Tables of a run's report: mesh, modes, stresses, contact, responses, wheel."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pandas as pd

from geometry.quality import quality_rows

from ..hbm.stability import UNIQUE
from ..scene.aerodynamics import has_flow
from ..study.modes.comparison import family_table
from ..study.modes.stress import Strength
from ..study.modes.survey import excited_set
from ..study.pipeline.contact_cycle import ContactCycle
from ..study.pipeline.design_table import design_table
from ..study.pipeline.run_records import SolvedRun
from .best_load import best_load_table
from .damping import damping_column
from .fatigue import utilisation_table
from .flow import flow_tables
from .influences import influence_table
from .mode_table import mode_table
from .nodes import wear_table
from .pressure import pressure_table
from .resonance_table import resonance_table
from .response_points import linear_points, points_of
from .wheel import blade_table, pattern_table


def run_tables(result: SolvedRun, cycles: list[ContactCycle]) -> dict[str, pd.DataFrame]:
    """All tables, "section/name", SI columns.

    Args:
        cycles: of each load's resonance, for the wear.
    """
    patches = list(result.contact.problem.patches)
    coefficient = result.scene.contact.wear_coefficient
    tables = {**_study_tables(result), **flow_tables(result), **_wheel_tables(result)}
    if coefficient is not None:
        tables["contact/wear"] = wear_table(patches, cycles, coefficient)
    return tables


def _wheel_tables(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """Tables of the whole wheel, where blades differ."""
    if result.wheel is None:
        return {}
    return {
        "wheel/whole_wheel": pattern_table(result.wheel),
        "wheel/blades": blade_table(result.wheel),
    }


def _study_tables(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """Tables of every study: mesh, modes, contact and responses."""
    curves = result.response.curves
    points = _joined([*map(points_of, curves), *map(linear_points, result.response.limits)])
    return {
        "mesh/quality": pd.DataFrame(quality_rows(result.mesh), columns=["what", "value"]),
        "modes/modes": family_table(excited_set(result), result.mesh, result.clamped),
        "modes/nodal_diameters": _frequencies(result),
        "modes/stresses": _stresses(result.strength),
        **utilisation_table(result),
        "contact/pressure": pressure_table(result.contact.maps),
        **_own_load(result),
        **_best_load(result),
        **_damper_masses(result),
        "response/summary": _summary(result, points),
        **resonance_table(curves),
        "response/points": points,
    }


def _frequencies(result: SolvedRun) -> pd.DataFrame:
    """Natural frequencies; a single blade has no nodal diameters."""
    table = mode_table(result.modes, result.mesh, result.clamped)
    single = excited_set(result).nodal_diameter is None
    return table.drop(columns="nodal_diameter") if single else table


def _joined(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """Response points of all curves; the linear limits have one motion each."""
    points = pd.concat(parts, ignore_index=True)
    return points.fillna({"stability": UNIQUE}) if "stability" in points else points


def _summary(result: SolvedRun, points: pd.DataFrame) -> pd.DataFrame:
    """The design table with stresses at each resonance: of the whole motion where that was
    computed, and of the excited mode alone, in proportion to the amplitude.
    """
    table = pd.DataFrame(design_table(result.response.curves, result.response.limits))
    place = table.columns.get_loc("reduction") + 1
    mode_alone = result.strength.alternating * table["peak_amplitude"].to_numpy()
    table.insert(place, "mode_stress", mode_alone)
    if result.damped:
        table.insert(place, "stress_error", _stress_errors(result, len(table)))
        table.insert(place, "alternating_stress", _alternating(result, len(table)))
    # of a blade with a flow the damping without damper is not the scene's
    if not has_flow(result.scene):
        ratios = damping_column(table, points, result.scene.operation.damping)
        if np.isfinite(ratios).any():
            table.insert(place, "equivalent_damping", ratios)
    return table


def _stress_errors(result: SolvedRun, rows: int) -> np.ndarray:
    """(rows,) estimated relative error by the mesh of the stress in the design table; NaN where the
    stress of the whole motion was not computed.
    """
    errors = np.full(rows, np.nan)
    for number, found in (result.damped or {}).items():
        errors[1 + number] = found.mesh_error
    return errors


def _alternating(result: SolvedRun, rows: int) -> np.ndarray:
    """(rows,) alternating stress [Pa] of the whole motion, in proportion to the amplitude where a
    march contradicts it; NaN where it was not computed.
    """
    stress = np.full(rows, np.nan)
    for number, found in (result.damped or {}).items():
        stress[1 + number] = result.response.curves[number].over_balance * found.largest
    return stress


def _stresses(found: Strength) -> pd.DataFrame:
    """Where the blade is stressed most, by rotation and by the mode studied."""
    rows = [
        ("rotation", found.steady, found.steady_at),
        (f"mode {found.mode}, 1 mm at the probe", 1e-3 * found.alternating, found.alternating_at),
    ]
    return pd.DataFrame(
        [
            {"state": name, "von_mises_gauss": size, **dict(zip("xyz", place, strict=True))}
            for name, size, place in rows
            if size > 0
        ]
    )


def _own_load(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """The load that the damper's own mass makes at the operating speed, where it makes any."""
    own = result.contact.own
    return (
        {}
        if own is None
        else {
            "contact/own_load": pd.DataFrame(
                {
                    "mass": [result.contact.problem.mass],
                    "speed": [result.scene.operation.speed],
                    "load": [own],
                }
            )
        }
    )


def _best_load(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """What the exact search for the best load found, where there was one."""
    best = result.response.best
    if not best:
        return {}
    found = {"response/best_load": best_load_table(best, result.response.curves)}
    if result.response.influences:
        lowest = result.response.best_found
        assert lowest is not None
        found["response/influences"] = influence_table(result.response.influences, lowest)
    return found


def _damper_masses(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """The damper that makes each load, where friction takes part in the seating."""
    masses = result.contact.masses
    return {"contact/damper_mass": pd.DataFrame(map(asdict, masses))} if masses else {}
