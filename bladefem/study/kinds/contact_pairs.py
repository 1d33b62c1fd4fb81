"""The verification pairs, Hertz and flat punch: pressure under each load, and its closed form
next to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.mesh import Mesh

from ...data import PressureMap
from ...errors import InputError
from ...io.stage_cache import cached_stage
from ...scene.tables import Scene
from ...util.communicator import Communicator
from ..pipeline.stage_inputs import stage_key
from .hertz import hertz_pressure, hertz_radius, press_pair, second_moment_radius
from .punch import Indented, indent_punch, johnson_approach, johnson_pressure

# of the punch's radius: further out its pressure grows without bound
COMPARED_RADIUS_SHARE = 0.8


@dataclass(frozen=True)
class PairState:
    """One load; numbers that have no closed form are None."""

    # on the whole pair [N], in the plane on a metre of it
    load: float
    # of the meshed quarter (half, in the plane)
    seat: PressureMap
    # (n,) closed form at the nodes [Pa]; inf at the edge of a punch
    exact: np.ndarray
    # of the contact, computed and closed form [m]
    radius: tuple[float, float]
    # of the far faces (block: of a half space) [m]
    approach: tuple[float, float | None]
    # of the pressure, L2 over the contact, relative
    error: float


def solve_pair(
    scene: Scene,
    folder: str | Path | None = None,
    comm: Communicator | None = None,
) -> tuple[Mesh, list[PairState]]:
    """Mesh and states of a scene of kind "hertz" or "punch", on all ranks of a communicator.

    Raises:
        InputError: another kind of scene, or a load whose contact does not fit the mesh.
            NotSolvedError: the contact iteration stopped.
    """
    kinds: dict[str, Callable[[Scene, Communicator | None], tuple[Mesh, list[PairState]]]] = {
        "hertz": _hertz,
        "punch": _punch,
    }
    if scene.kind not in kinds:
        raise InputError(f"kind = '{scene.kind}': expected {' or '.join(kinds)}")
    return cached_stage(
        folder,
        "pressure",
        stage_key("pair pressure", scene),
        lambda: kinds[scene.kind](scene, comm),
        comm,
    )[0]


def node_radii(seat: PressureMap, dimension: int) -> np.ndarray:
    """(n,) distance of the nodes from the axis [m]."""
    return np.linalg.norm(seat.patch.points[:, : dimension - 1], axis=1)


def _hertz(scene: Scene, comm: Communicator | None) -> tuple[Mesh, list[PairState]]:
    found = press_pair(scene, comm)
    states = []
    for load, seat in found.maps.items():
        exact = hertz_pressure(scene, load, node_radii(seat, found.mesh.dimension))
        a = hertz_radius(scene, load)
        spaces = a**2 / scene.hertz.radius if found.mesh.dimension == 3 else None
        states.append(
            PairState(
                load,
                seat,
                exact,
                (second_moment_radius(scene, seat), a),
                (found.approach[load], spaces),
                _difference(seat, exact),
            )
        )
    return found.mesh, states


def _punch(scene: Scene, comm: Communicator | None) -> tuple[Mesh, list[PairState]]:
    found = indent_punch(scene, comm)
    loads = scene.study.loads or (found.total,)
    given = scene.punch.interference
    if given is not None:
        loads = (found.total * given / found.approach,)
    return found.mesh, [_punched(scene, found, load) for load in loads]


def _punched(
    scene: Scene,
    found: Indented,
    load: float,
) -> PairState:
    """A rigid flat punch presses in proportion to its load."""
    a = scene.punch.radius
    block = scene.material.blade
    solid = found.mesh.dimension == 3
    factor = load / found.total
    seat = PressureMap(
        found.patch, factor * found.force, np.zeros_like(found.force), found.complementarity
    )
    with np.errstate(divide="ignore"):
        exact = johnson_pressure(np.minimum(found.radius, a), a, load, not solid)
    space = johnson_approach(a, load, block.E, block.nu) if solid else None
    return PairState(
        load,
        seat,
        exact,
        (a, a),
        (factor * found.approach, space),
        _difference(seat, exact, found.radius < COMPARED_RADIUS_SHARE * a),
    )


def _difference(
    seat: PressureMap,
    exact: np.ndarray,
    where: np.ndarray | slice = slice(None),
) -> float:
    area = seat.patch.area[where]
    p = seat.pressure[where]
    q = exact[where]
    return float(np.sqrt(area @ (p - q) ** 2 / (area @ q**2)))
