"""Blade and damper reduced to their ports, in each nodal diameter."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.mesh import sector_of

from ...data import Patch, PortModel, SectorSpan
from ...hbm.parallel import share_work
from ...hbm.parameters import scale_density
from ...io.stage_cache import on_root
from ...util.arrays import RealOrComplex
from ...util.communicator import Communicator
from .bodies import Bodies, is_wheel, on_one_rank, rotation_of
from .normal_modes import KEPT_MODES, cost_of_diameter, eigensolver
from .ports import Ports, blade_ports, damper_ports

if TYPE_CHECKING:
    from ...fem.ports import PortReduction

# of the elastic damper, its six rigid ones included
DAMPER_MODES = 16


@dataclass(frozen=True)
class DamperSpin:
    """What the rotation of the frame does to the resonance of the mode studied through the damper,
    all contacts sticking [1].
    """

    # share of its frequency by which Coriolis forces move it, up or down
    coriolis: float
    # share by which they change the amplitude of a response with friction, up or down, roughly
    amplitude: float
    # shares by which spin softening lowers the frequency and changes the amplitude, roughly;
    # responses leave it out
    softening: float
    softening_amplitude: float


@dataclass(frozen=True)
class Reduced:
    """Blade and damper seen from their ports, before they are joined for an engine order."""

    # nodal diameter to the blade's side; key 0 alone for blades clamped at the root
    sector: dict[int, PortModel]
    # floating: rigid modes have omega = 0
    damper: PortModel
    # contact rows of the patch "next"
    following: slice
    # 0 for a row of blades without a wheel
    sectors: int
    # of the damper [kg]
    mass: float
    # nodal diameter to (m, m) Coriolis forces as damping of the modes [1/s], where there are some:
    # `coriolis.with_coriolis` puts them in, those of the damper `damper_coriolis`
    coriolis: dict[int, RealOrComplex] = field(default_factory=dict)
    # (k, k) the same of the damper's modes; None where there are none
    damper_coriolis: np.ndarray | None = None
    # what the rotation does through the damper; None where it was not asked for
    damper_spin: DamperSpin | None = None
    # what their modes span, for the other nodal diameters; None where nobody asked, or where ranks
    # share the diameters out
    span: SectorSpan | None = None


def with_damper_mass(reduced: Reduced, mass: float | None) -> Reduced:
    """The reduced sector with a damper of another density: its mass [kg] scales, its flexibility
    stays; Coriolis forces of modes of mass 1 do not depend on it.
    """
    if mass is None:
        return reduced
    damper = scale_density(reduced.damper, mass / reduced.mass)
    return replace(reduced, damper=damper, mass=mass)


def reduce_sector(
    bodies: Bodies,
    patches: list[Patch],
    diameters: Sequence[int],
    modes: int,
    readings: np.ndarray | None = None,
    spanned: bool = False,
) -> Reduced:
    """Blade side in each nodal diameter and damper side, at the contact, load and probe ports.

    Args:
        patches: "this" and "next".
        modes: modes kept in each nodal diameter.
        readings: (n_points*dim, q) columns of the port "blade", where blades are to be mistuned.
        spanned: also what the modes of a wheel span, see `Reduced.span`.
    """
    from ...fem.ports import port_model

    scene = bodies.scene
    mesh = bodies.mesh
    ports = blade_ports(mesh, patches, scene.excitation, readings)
    other = damper_ports(mesh, patches)
    span = None
    if is_wheel(mesh):
        sector, span = _reduced_diameters(bodies, ports, modes, diameters, spanned)
    else:

        def blade_model(some: Bodies) -> PortModel:
            flex = some.factorised(0)
            return port_model(flex.con, _blade_reduction(some, ports, modes), flex)

        sector = {0: on_one_rank(bodies, blade_model)}

    floating, damper_mass = on_one_rank(bodies, partial(_reduced_damper, ports=other))
    first = len(patches[0].area) * mesh.dimension
    return Reduced(
        {n: replace(body, damping=None) for n, body in sector.items()},
        replace(floating, damping=None),
        slice(first, first + len(patches[1].area) * mesh.dimension),
        sector_of(mesh).count if is_wheel(mesh) else 0,
        damper_mass,
        {n: body.damping for n, body in sector.items() if body.damping is not None},
        damper_coriolis=floating.damping,
        span=span,
    )


def _blade_reduction(bodies: Bodies, ports: Ports, modes: int) -> PortReduction:
    """The blade side's reduction to its ports, as the scene has it."""
    from ...fem.ports import PortReduction

    return PortReduction(
        ports.matrix,
        ports.names,
        modes,
        kind=bodies.scene.model.reduction,
        solver=eigensolver(bodies.scene),
        spin=rotation_of(bodies),
    )


def _reduced_damper(bodies: Bodies, ports: Ports) -> tuple[PortModel, float]:
    """The floating damper at its ports, and its mass [kg]."""
    from ...fem.loads import body_mass
    from ...fem.ports import PortReduction, port_model

    flex = bodies.damper
    solver = eigensolver(bodies.scene)
    wanted = PortReduction(
        ports.matrix, ports.names, DAMPER_MODES, solver=solver, spin=rotation_of(bodies)
    )
    return port_model(flex.con, wanted, flex), body_mass(flex.con.body)


def _reduced_diameters(
    bodies: Bodies,
    ports: Ports,
    modes: int,
    diameters: Sequence[int],
    spanned: bool,
) -> tuple[dict[int, PortModel], SectorSpan | None]:
    """The blade side in each nodal diameter, which groups of ranks share out; and what the modes
    span, where it is asked for and one rank can have them all, or all ranks share each.
    """
    from ...fem.all_diameters import Eigenpairs
    from ...fem.compat import MPI
    from ...fem.diameter_space import sector_span
    from ...fem.groups import shared_out
    from ...fem.ports import port_models

    comm = bodies.comm or MPI.COMM_WORLD

    spanned = spanned and bodies.scene.model.reduction == "rubin"
    blocks: dict[int, np.ndarray] = {}

    def keep_vectors(pairs: Eigenpairs) -> None:
        blocks[pairs.nodal_diameter] = pairs.X[:, :modes].copy(order="F")

    wanted = sorted(set(diameters))
    size = bodies.ranks_of_sector
    interior = _interior_of_ranks(bodies, ports, len(wanted))

    def solved(some_bodies: Bodies, some: Sequence[int]) -> dict[int, PortModel]:
        steps = port_models(
            some_bodies.frame,
            _blade_reduction(some_bodies, ports, modes),
            some,
            kept=some_bodies.kept.pop(KEPT_MODES, None),
            seen=keep_vectors if spanned else None,
            interior=interior,
        )
        return dict(bodies.progress(steps, "nodal diameters", len(some)))

    if size == comm.size:
        whole = solved(bodies, wanted)
        every = [block for _, block in sorted(blocks.items())]
        return whole, sector_span(bodies.frame, every, ports.matrix) if spanned else None

    def of_some(part: Communicator, some: list[int]) -> list[PortModel]:
        models = solved(bodies.of_group(part), some)
        return [models[n] for n in some]

    cost = cost_of_diameter(sector_of(bodies.mesh).count)
    models = shared_out(comm, wanted, size, of_some, cost)
    span = _span_of_ranks(bodies, blocks, wanted, ports) if spanned and size == 1 else None
    return dict(zip(wanted, models, strict=True)), span


def _interior_of_ranks(
    bodies: Bodies, ports: Ports, diameters: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """`fem.ports.interior_flexibility` of ranks that each have the sector for themselves, a part of
    the ports by each (collective); None without an open sector, and where not every rank reduces
    one of so many nodal diameters by static solves.
    """
    ranks = bodies.comm.size if bodies.comm else 1
    static = bodies.scene.model.reduction == "rubin"
    if not static or bodies.ranks_of_sector > 1 or not 1 < ranks <= diameters:
        return None
    from ...fem.ports import interior_flexibility

    def eliminate(_: int) -> None:
        if bodies.alone.frame.opened is not None:
            bodies.alone.frame.opened.elimination.core()

    # a rank that fails is heard of by the others
    share_work(eliminate, range(ranks), bodies.comm)
    opened = bodies.alone.frame.opened
    if opened is None:
        return None

    def deal(work: Callable[[int], Any], items: Sequence[int]) -> Iterable[tuple[int, Any]]:
        return zip(items, share_work(work, items, bodies.comm), strict=True)

    return interior_flexibility(opened, ports.matrix, deal=deal)


def _span_of_ranks(
    bodies: Bodies,
    blocks: dict[int, np.ndarray],
    wanted: Sequence[int],
    ports: Ports,
) -> SectorSpan:
    """What the modes span of which each rank has those of its own nodal diameters (collective).

    Args:
        blocks: nodal diameter to vectors; emptied.
    """
    from ...fem.compat import MPI
    from ...fem.diameter_space import sector_span

    comm = bodies.comm or MPI.COMM_WORLD
    every: list[np.ndarray] = []
    # one by one: a message has a largest size
    for n in wanted:
        found = comm.gather(blocks.pop(n, None), 0) or []
        every += [block for block in found if block is not None]
    return on_root(comm, lambda: sector_span(bodies.alone.frame, every, ports.matrix))
