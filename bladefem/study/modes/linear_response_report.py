"""Linear forced response for a report: curve of amplitude and phase, every resonance, stresses of
all states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ...data import ModeSet
from ...errors import InputError, suggestion
from ...hbm.model import Damping
from ...hbm.parallel import share_work
from ...scene.fields import convert_value, field_at, split_values
from ...scene.units import parse
from ..pipeline.bodies import Bodies
from ..pipeline.ports import blade_ports
from .linear_response import (
    Forced,
    displacement_at,
    excitation_load,
    find_linear_peak,
    half_widths,
    linear_response,
    pressure_load,
    probe_response,
    steady_state,
)

if TYPE_CHECKING:
    from ...fem.body import Body

# resonances
MAX_RESONANCES = 5
# points across each resonance
POINTS_PER_RESONANCE = 41
# points over the whole band
POINTS_OVER_BAND = 500
# half-widths of a resonance that are drawn closely
DENSE_HALF_WIDTHS = 12.0
# displacement [m] that the stresses of a mode are given for
REPORTED_DISPLACEMENT = 1e-3

Fields = dict[str, dict[str, np.ndarray]]


@dataclass(frozen=True)
class ForcedResponseAnswer:
    """SI columns; complex amplitudes e^{j w t}."""

    response: Forced
    # frequency [Hz], amplitude [m], phase [rad] of the excited nodes along the excitation
    points: pd.DataFrame
    # mode, natural [Hz], frequency [Hz], amplitude [m], phase [rad], largest [m] anywhere,
    # peaked: the amplitude has a maximum there; else the natural frequency is taken
    resonances: pd.DataFrame
    # (resonances, n_points, 3) complex displacement [m] at each
    shapes: np.ndarray = field(repr=False)


def forced_response_answer(
    bodies: Bodies,
    loads: Sequence[tuple[str, float]] = (),
    damping: Damping | None = None,
    count: int = MAX_RESONANCES,
) -> ForcedResponseAnswer:
    """Response to the engine order over the band of the first modes; collective.

    Args:
        loads: pressure waves as names of faces and amplitudes [Pa]; "excitation" is the scene's
            force, and it alone acts when nothing is given. All are in phase on one blade.
        damping: modal, structural or Rayleigh; the scene's modal damping when left out.
        count: resonances.

    Raises:
        InputError: no such face, no load at all, no damping.
    """
    excitation = bodies.scene.excitation
    parts = [
        excitation_load(bodies) if face == "excitation" else pressure_load(bodies, face, value)
        for face, value in loads or [("excitation", 0.0)]
    ]
    damping = damping or Damping(ratio=bodies.scene.operation.damping)
    if not any(getattr(damping, f.name) for f in fields(damping)):
        raise InputError("operation.damping = 0: expected some damping for a forced response")
    found = linear_response(bodies, np.sum(parts, axis=0), damping)
    ports = blade_ports(bodies.mesh, [], excitation)
    vector = ports.matrix[:, ports.names["probe"]].toarray()[:, 0]
    count = min(count, len(found.omega))
    natural = found.waves[:count] / (2 * np.pi)
    best = np.array([find_linear_peak(found, vector, mode)[0] for mode in range(1, count + 1)])
    peaked = abs(best / natural - 1) < np.maximum(4 * half_widths(found)[:count], 1e-6)
    best = np.where(peaked, best, natural)
    seen = probe_response(found, vector, best)
    shapes = np.stack([displacement_at(found, f) for f in best]).astype(complex)
    resonances = pd.DataFrame(
        {
            "mode": np.arange(1, count + 1),
            "natural": natural,
            "frequency": best,
            "amplitude": abs(seen),
            "phase": np.angle(seen),
            "largest": [np.linalg.norm(u, axis=1).max() for u in shapes],
            "peaked": peaked,
        }
    )
    return ForcedResponseAnswer(found, _response_curve(found, vector, count), resonances, shapes)


def read_loads(text: str) -> list[tuple[str, float]]:
    """Loads from a text such as "excitation, pressure_side=500 Pa"; empty: the scene's excitation.

    Raises:
        InputError: no face, no pressure.
    """
    out = []
    for item in split_values(text):
        name, equals, value = (part.strip() for part in item.partition("="))
        if name == "excitation" and not equals:
            out.append((name, 0.0))
        elif not name or not value:
            raise InputError(
                f"forced = {text}: expected 'excitation' or face=pressure, such as "
                "pressure_side='500 Pa'"
            )
        else:
            out.append((name, parse(value, "Pa", f"forced, {name}")))
    return out


def read_damping(text: str) -> Damping:
    """Damping from a text such as "ratio=0.1 %, structural=0.2 %" or "mass=20 1/s, stiffness=1e-7
    s"; they add.

    Raises:
        InputError: another word, one given twice, another unit, a negative number, a ratio beyond
            that of operation.damping.
    """
    units = {"ratio": "1", "structural": "1", "mass": "1/s", "stiffness": "s"}
    values = {}
    for item in text.split(","):
        name, _, value = (part.strip() for part in item.partition("="))
        if name not in units:
            raise InputError(f"--damping {text}: '{name}' is unknown{suggestion(name, units)}")
        if name in values:
            raise InputError(f"--damping {text}: {name} is given twice, expected each once")
        values[name] = parse(value, units[name], f"--damping {name}")
    if "ratio" in values:
        convert_value(
            values["ratio"], field_at("operation.damping")._replace(name="--damping ratio")
        )
    return Damping(**values)


# name of the static state, without and with thermal strain
STATIC_STATES = {False: "rotation", True: "rotation and heat"}


def stress_states(
    bodies: Bodies,
    modes: ModeSet,
    count: int,
    found: ForcedResponseAnswer | None = None,
) -> dict[str, np.ndarray]:
    """Displacements (n_points, 3) [m] by name: of rotation and heat, of modes scaled to 1 mm, of
    resonances.
    """
    from ...fem.thermal_strain import has_thermal_strain

    states = {}
    heated = has_thermal_strain(bodies.still_blade)
    if bodies.scene.operation.speed > 0 or heated:
        u0 = steady_state(bodies).displacement
        states[STATIC_STATES[heated]] = np.pad(u0, ((0, 0), (0, 3 - u0.shape[1])))
    for i, shape in enumerate(modes.shapes[:count]):
        largest = max(np.linalg.norm(shape, axis=1).max(), 1e-300)
        # it swings to both sides
        states[f"mode {i + 1} for 1 mm"] = REPORTED_DISPLACEMENT / largest * shape.astype(complex)
    for i, shape in enumerate(() if found is None else found.shapes):
        states[f"resonance {i + 1}"] = shape
    return states


def stress_table(
    bodies: Bodies, states: dict[str, np.ndarray]
) -> tuple[pd.DataFrame, Fields, Fields]:
    """Extremes of each state; its stresses [Pa] at the nodes (n_points,), and the largest at the
    Gauss points of each cell of all bodies (nc,), 0 outside the blade. Ranks share out the states;
    collective.

    Returns:
        columns state, largest [m], von_mises [Pa] at the nodes and where x, y, z [m],
        von_mises_gauss [Pa] at the Gauss points, principal [Pa] the largest, pressing [Pa] the
        smallest principal stress; of harmonic motion the extremes in a period.
    """
    # all ranks assemble it, those without a state too
    body = bodies.still_blade
    # of the static state; the others are small motions about it
    large = bodies.on_large_state
    found = share_work(
        lambda name: _state_stress(body, name, states[name], large), list(states), bodies.comm
    )
    rows = [row for row, _, _ in found]
    fields = {row["state"]: at_nodes for row, at_nodes, _ in found}
    cells = {
        row["state"]: {"von Mises at Gauss points": _of_all_bodies(bodies, inside)}
        for row, _, inside in found
    }
    return pd.DataFrame(rows), fields, cells


def _state_stress(
    body: Body,
    name: str,
    u: np.ndarray,
    large: bool,
) -> tuple[dict[str, Any], dict[str, np.ndarray], np.ndarray]:
    """A row of the table, fields at the nodes, and von Mises stresses [Pa] in the cells (nc,).

    Args:
        large: the static state is one of large displacements.
    """
    from ...fem.stress import gauss_and_nodal_stress, principal_stresses, von_mises

    heated = name == STATIC_STATES[True]
    large = large and name in STATIC_STATES.values()
    at_points, stress = gauss_and_nodal_stress(body, u, large=large, heated=heated)
    size = von_mises(stress)
    sides = principal_stresses(stress)
    inside = von_mises(at_points.stress).max(1)
    worst = size.argmax()
    fields = {"von Mises": size, "largest principal": sides[:, 0]}
    # motion swings to both sides: its smallest is minus the largest
    if np.iscomplexobj(stress):
        low = -sides[:, 0].max()
    else:
        fields["smallest principal"] = sides[:, 2]
        low = sides[:, 2].min()
    row = {
        "state": name,
        "largest": np.linalg.norm(u, axis=1).max(),
        "von_mises": size[worst],
        **dict(zip("xyz", body.mesh.points[worst], strict=True)),
        "von_mises_gauss": inside.max(),
        "principal": sides[:, 0].max(),
        "pressing": low,
    }
    return row, fields, inside


def _of_all_bodies(bodies: Bodies, values: np.ndarray) -> np.ndarray:
    """Values in the blade's cells (nc of the blade,) as values in all cells of the mesh."""
    sizes = {name: len(bodies.mesh.bodies[name]) for name in bodies.still_blade.material}
    parts = dict(zip(sizes, np.split(values, np.cumsum(list(sizes.values()))[:-1]), strict=True))
    return np.concatenate(
        [parts.get(name, np.zeros(len(cells))) for name, cells in bodies.mesh.bodies.items()]
    )


def _response_curve(
    found: Forced,
    vector: np.ndarray,
    count: int,
) -> pd.DataFrame:
    """Points over the band, close together at the resonances."""
    f = found.waves[:count] / (2 * np.pi)
    width = half_widths(found)[:count]
    near = (
        f
        + np.outer(
            np.sinh(np.linspace(-4, 4, POINTS_PER_RESONANCE)) / np.sinh(4),
            DENSE_HALF_WIDTHS * width * f,
        )
    ).ravel()
    band = 0.6 * f[0], 1.15 * f[-1]
    every = np.unique(np.concatenate([np.geomspace(*band, POINTS_OVER_BAND), near]))
    every = every[(every >= band[0]) & (every <= band[1])]
    seen = probe_response(found, vector, every)
    return pd.DataFrame({"frequency": every, "amplitude": abs(seen), "phase": np.angle(seen)})
