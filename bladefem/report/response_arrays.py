"""Responses of a run as labelled arrays: over load, frequency, harmonic and contact node.

Curves have their own frequencies; in a common array a point that a curve does not have is NaN, so
that ``data.sel(load=80).dropna("frequency")`` is that curve again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..data import SEATS
from ..hbm.stability import STABLE, UNIQUE, UNKNOWN, UNSTABLE
from ..study.pipeline.contact_cycle import ContactCycle
from ..study.pipeline.curve import Curve
from ..study.pipeline.linear_limits import Limit
from .response_points import LINEAR
from .tables import units_of

if TYPE_CHECKING:
    import xarray as xr

LOAD_ATTRIBUTES = {
    "units": "N",
    "long_name": "static normal force on each seat; 0 no damper, inf full stick",
}
# of the response table: name to long name
CURVE_MEANINGS = {
    "amplitude": "amplitude of the motion at the probe",
    "phase": "phase of the first harmonic at the probe",
    "converged": "whether the point was solved; NaN where the curve has no point",
    "residual": "relative residual of the balance",
    "dissipated": "friction work of a period",
    "estimated_error": "estimated relative error of the first harmonic",
    "slipping": "elements that slip or lift off",
    "drift": "speed at which the damper walks",
}
STABILITY_MEANINGS = {
    "verdict": "verdict on the stability of the motion",
    "multiplier": "largest modulus of the Floquet multipliers; NaN where it was not computed",
}
# verdicts on the motion of a point, by their numbers, as CF conventions have flags (section 3.5)
NOT_JUDGED = "not_judged"
FLAGS = (
    NOT_JUDGED,
    UNIQUE,
    STABLE,
    UNSTABLE,
    "unstable_fold",
    "unstable_period_doubling",
    "unstable_torus",
)
# number in the file where a curve has no point; xarray makes it NaN
NO_POINT = -1


def curve_arrays(points: pd.DataFrame) -> xr.Dataset:
    """Response points over (load, frequency), over (mass, load, frequency) with several masses.

    Args:
        points: one row a response point, SI columns; the linear limits have no mass.
    """
    names = {name: text for name, text in CURVE_MEANINGS.items() if name in points}
    return _over_frequency(points.astype({"converged": float}), names)


def stability_arrays(points: pd.DataFrame) -> xr.Dataset:
    """Verdicts and multipliers of response points, over the dimensions of ``curve_arrays``.

    Args:
        points: as there.
    """
    judged = points.assign(
        verdict=_flag_numbers(points),
        multiplier=points["multiplier"] if "multiplier" in points else np.nan,
    )
    data = _over_frequency(judged, STABILITY_MEANINGS)
    data["verdict"].attrs |= {
        "flag_values": np.arange(len(FLAGS), dtype=np.int8),
        "flag_meanings": " ".join(FLAGS),
    }
    data["verdict"].encoding |= {"dtype": "int8", "_FillValue": np.int8(NO_POINT)}
    return data


def _over_frequency(points: pd.DataFrame, names: Mapping[str, str]) -> xr.Dataset:
    """Columns of a response table over (mass,) load and frequency.

    Args:
        names: of the columns, to long names.
    """
    if "mass" in points:
        points = _for_each_mass(points)
    keys = [name for name in ("mass", "load", "frequency") if name in points]
    units = units_of(points)
    data = points[[*keys, *names]].drop_duplicates(keys).set_index(keys).to_xarray()
    for name, long_name in names.items():
        data[name].attrs |= {"units": units.get(name, "1"), "long_name": long_name}
    data["load"].attrs |= LOAD_ATTRIBUTES
    data["frequency"].attrs |= {"units": "Hz", "long_name": "excitation frequency"}
    return _with_mass_units(data)


def _flag_numbers(points: pd.DataFrame) -> list[float]:
    """Places in FLAGS of the verdicts of a table; a linear motion is the only one."""
    nothing = pd.Series("", index=points.index)
    verdicts = points.get("stability", nothing).fillna("")
    kinds = points.get("bifurcation", nothing).fillna("")
    linear = points.get("method", nothing) == LINEAR
    return [
        float(FLAGS.index(UNIQUE if is_linear else _flag(verdict, kind)))
        for verdict, kind, is_linear in zip(verdicts, kinds, linear, strict=True)
    ]


def _flag(verdict: str, kind: str) -> str:
    if verdict in ("", UNKNOWN):
        return NOT_JUDGED
    return "_".join([verdict, *kind.split()]) if verdict == UNSTABLE else verdict


def _for_each_mass(points: pd.DataFrame) -> pd.DataFrame:
    """Without damper there is no mass: that response is repeated for each."""
    masses = points["mass"].dropna().unique()
    limits = points[points["mass"].isna()]
    return pd.concat(
        [points[points["mass"].notna()], *(limits.assign(mass=mass) for mass in masses)],
        ignore_index=True,
    )


def resonance_arrays(curves: Sequence[Curve], limits: Sequence[Limit] = ()) -> xr.Dataset:
    """Harmonics of the balance's motion at the probe at each resonance, over (load, harmonic).

    Harmonics beyond those of a curve's own balance are NaN; the linear limits have the first one.
    """
    import xarray as xr

    most = max(curve.settings.harmonics for curve in curves)
    parts = []
    for curve in curves:
        probe = np.full(most + 1, np.nan + 0j)
        probe[: len(curve.peak.probe)] = curve.peak.probe[:, 0]
        parts.append(_one_resonance(curve.load, curve.mass, curve.peak.frequency, probe))
    masses = dict.fromkeys(curve.mass for curve in curves)
    for limit in limits:
        probe = np.full(most + 1, np.nan + 0j)
        # the highest point of all may be that of another mode
        probe[1] = limit.first[np.argmin(abs(limit.frequency - limit.peak_frequency))]
        own = masses if limit.mass is None else [limit.mass]
        parts += [_one_resonance(limit.load, m, limit.peak_frequency, probe) for m in own]
    data = xr.combine_by_coords(parts)
    data["motion"].attrs |= {"units": "m", "long_name": "complex amplitude at the probe"}
    data["frequency"].attrs |= {"units": "Hz", "long_name": "frequency of the motion"}
    data["load"].attrs |= LOAD_ATTRIBUTES
    return _with_mass_units(data)


def _one_resonance(
    load: float,
    mass: float | None,
    frequency: float,
    probe: np.ndarray,
) -> xr.Dataset:
    import xarray as xr

    data = xr.Dataset(
        {"motion": (("load", "harmonic"), probe[None]), "frequency": ("load", [frequency])},
        {"load": [load], "harmonic": np.arange(len(probe))},
    )
    return data if mass is None else data.expand_dims(mass=[mass])


def node_arrays(table: pd.DataFrame) -> xr.Dataset:
    """What each contact node does in a period at each resonance, over (load, node).

    Args:
        table: one row a node and resonance, nodes in the same order in each (``nodes.node_table``).
    """
    keys = [name for name in ("mass", "load") if name in table]
    table = table.assign(node=table.groupby(keys, sort=False).cumcount())
    fixed = [name for name in ("patch", "x", "y", "z", "area") if name in table]
    units = units_of(table)
    data = table.drop(columns=fixed).set_index([*keys, "node"]).to_xarray()
    one = table.drop_duplicates("node")
    for name in fixed:
        values = one[name].to_numpy(dtype=str if name == "patch" else float)
        data = data.assign_coords({name: ("node", values)})
    for name in data.variables:
        if name not in ("load", "patch", "node"):
            data[name].attrs |= {"units": units.get(str(name), "1")}
    data["load"].attrs |= LOAD_ATTRIBUTES
    return _with_mass_units(data)


def loop_arrays(cycles: Sequence[ContactCycle]) -> xr.Dataset:
    """Hysteresis of each seat in a period at each resonance, over (load, seat, phase).

    Args:
        cycles: one for each load (and mass).
    """
    import xarray as xr

    parts = []
    for cycle in cycles:
        seats = [SEATS.get(name, name) for name in cycle.loops]
        force = np.stack([loop.force for loop in cycle.loops.values()])
        displacement = np.stack([loop.displacement for loop in cycle.loops.values()])
        phase = 2 * np.pi * np.arange(force.shape[1]) / force.shape[1]
        part = xr.Dataset(
            {
                "displacement": (("load", "seat", "phase"), displacement[None]),
                "force": (("load", "seat", "phase"), force[None]),
            },
            {"load": [cycle.load], "seat": seats, "phase": phase},
        )
        parts.append(part if cycle.mass is None else part.expand_dims(mass=[cycle.mass]))
    data = xr.combine_by_coords(parts)
    data["displacement"].attrs |= {"units": "m", "long_name": "relative displacement of the seat"}
    data["force"].attrs |= {"units": "N", "long_name": "friction force of the seat"}
    data["phase"].attrs |= {"units": "rad", "long_name": "phase of the period"}
    data["load"].attrs |= LOAD_ATTRIBUTES
    return _with_mass_units(data)


def _with_mass_units(data: xr.Dataset) -> xr.Dataset:
    if "mass" in data.coords:
        data["mass"].attrs |= {"units": "kg", "long_name": "mass of the damper"}
    return data
