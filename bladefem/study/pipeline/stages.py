"""The stages from a scene to what the balance needs: mesh, modes, seated damper, reduced sector."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from geometry.mesh import Mesh, sector_of

from ...contact.interface_elements import pair_ratio, with_interface_law
from ...contact.patch import make_patch, normal_ports, port_matrix
from ...contact.seating import ContactProblem
from ...data import ModeSet, Patch, PortModel, SectorSpan
from ...errors import InputError
from ...io.stage_cache import on_root
from ...reduction.assemble import folded_diameter
from ...scene.kinds import kind_named
from ...scene.material_table import operating_materials
from ...scene.tables import Scene
from ...util.arrays import RealOrComplex
from ...util.communicator import Communicator
from .bodies import Bodies, is_wheel, on_one_rank, rotation_of
from .ports import Ports, blade_ports, damper_ports

# dolfinx is slow to load: the functions below import it when they run
if TYPE_CHECKING:
    from ...fem.eigensolver import Eigensolver

Result = TypeVar("Result")
# of each nodal diameter, in tables and pictures
MODES_SHOWN = 10
# name of the modes that are kept for the reduction
KEPT_MODES = "modes"
# of the elastic damper, its six rigid ones included
DAMPER_MODES = 16


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
    # `coriolis.with_coriolis` puts them in
    coriolis: dict[int, RealOrComplex] = field(default_factory=dict)
    # what their modes span, for the other nodal diameters; None where nobody asked, or where ranks
    # share the diameters out
    span: SectorSpan | None = None


def with_damper_mass(reduced: Reduced, mass: float | None) -> Reduced:
    """The same with a damper of another density: its mass [kg] scales, its flexibility stays."""
    if mass is None:
        return reduced
    root = (mass / reduced.mass) ** 0.5
    damper = replace(
        reduced.damper, omega=reduced.damper.omega / root, shapes=reduced.damper.shapes / root
    )
    return replace(reduced, damper=damper, mass=mass)


def build_mesh(scene: Scene, comm: Communicator | None = None) -> Mesh:
    """The scene's mesh, drawn on rank 0 and the same on every rank.

    Raises:
        InputError: a parameter has to change; the message names it.

    >>> import bladefem
    >>> mesh = bladefem.build_mesh(bladefem.load_scene("scenes/plane.toml", ["mesh.size=8 mm"]))
    >>> mesh.cell_type, sorted(mesh.bodies)
    ('triangle6', ['blade', 'damper'])
    """

    def draw() -> Mesh:
        from geometry.isolated_process import build_isolated

        return build_isolated(scene)

    return on_root(comm, draw)


def contact_patches(mesh: Mesh) -> list[Patch]:
    """The patches of the damper: "this" on this blade's seat, "next" on the next blade's.

    Raises:
        InputError: the mesh has no such pairs of faces.
    """
    missing = [name for name in ("this", "next") if name not in mesh.pairs]
    if missing:
        raise InputError(
            f"the mesh has no contact pair '{missing[0]}': faces seat_right and damper_left "
            "(this), seat_left and damper_right (next) with matching nodes were expected"
        )
    return [make_patch(mesh, name) for name in ("this", "next")]


def find_modes(
    bodies: Bodies,
    diameters: Sequence[int] | None = None,
    count: int = MODES_SHOWN,
    reduced: int = 0,
) -> list[ModeSet]:
    """Normal modes without damper: of the clamped blade, or of the sector in each nodal diameter.

    Args:
        diameters: nodal diameters; ``scene.model.nodal_diameters``, or all that the first harmonics
            of the engine order fall into, when left out.
        count: modes of each nodal diameter.
        reduced: modes that a reduction of the wheel will need; they are solved at once and kept
            with the bodies.

    >>> import bladefem
    >>> scene = bladefem.load_scene("scenes/plane.toml", ["mesh.size=8 mm"])
    >>> bodies = bladefem.Bodies(scene, bladefem.build_mesh(scene))
    >>> (modes,) = bladefem.find_modes(bodies, count=2)
    >>> [f"{f / 1000:.1f} kHz" for f in modes.frequencies]
    ['0.2 kHz', '1.1 kHz']
    """
    from ...fem.modes import modes

    if not is_wheel(bodies.mesh):

        def of_blade(some: Bodies) -> list[ModeSet]:
            flex = some.factorised(0)
            return [modes(flex.con, count, flex, solver=eigensolver(some.scene))]

        return on_one_rank(bodies, of_blade)
    wanted = (
        diameters
        or bodies.scene.model.nodal_diameters
        or harmonic_diameters(bodies.scene, bodies.mesh, 3)
    )
    return wheel_modes(bodies, count, wanted, reduced=reduced)


def eigensolver(scene: Scene) -> Eigensolver:
    """The eigensolver that the scene asks for."""
    from ...fem.eigensolver import Eigensolver

    return Eigensolver(scene.solver.eigensolver, scene.solver.vectors, scene.solver.petsc)


def excited_modes(
    scene: Scene,
    mesh: Mesh,
    modes: Sequence[ModeSet],
) -> ModeSet:
    """The modes of the nodal diameter that the engine order excites, or of the nearest one that is
    there.
    """
    if modes[0].nodal_diameter is None or mesh.sector is None:
        return modes[0]
    wanted, _ = folded_diameter(1, scene.excitation.engine_order, mesh.sector.count)
    return min(modes, key=lambda m: abs((m.nodal_diameter or 0) - wanted))


def wheel_modes(
    bodies: Bodies,
    count: int,
    diameters: Sequence[int] | None = None,
    direct: bool = False,
    group: int | None = None,
    reduced: int = 0,
) -> list[ModeSet]:
    """Normal modes of a wheel in several nodal diameters, which groups of ranks share out.

    Args:
        diameters: 0 to N/2 when left out.
        direct: solve every nodal diameter from scratch.
        group: ranks in a group; as many as share a sector well when left out.
        reduced: modes that a reduction will need, kept with the bodies where these have the ranks
            that the reduction will have.
    """
    from ...fem.all_diameters import KeptPairs, all_diameters
    from ...fem.compat import MPI
    from ...fem.groups import shared_out

    comm = bodies.comm or MPI.COMM_WORLD
    sectors = sector_of(bodies.mesh).count
    wanted = list(range(sectors // 2 + 1)) if diameters is None else list(diameters)
    solver = eigensolver(bodies.scene)

    def of_some(part: Communicator, some: list[int]) -> list[ModeSet]:
        mine = bodies.of_group(part)
        kept = KeptPairs(reduced) if reduced and part.size in (1, comm.size) else None
        found = all_diameters(
            mine.frame, count, some, direct, progress=bodies.progress, solver=solver, kept=kept
        )
        mine.kept[KEPT_MODES] = kept
        return found

    size = group or bodies.ranks_of_sector
    if size == comm.size:
        # one group: each rank has the results already
        return of_some(comm, wanted)
    return shared_out(comm, wanted, size, of_some, _real_or_complex(sectors))


def _real_or_complex(sectors: int) -> Callable[[int], float]:
    """The cost of a nodal diameter: complex pencils take twice that of real ones."""
    return lambda n: 1.0 if 2 * n % sectors == 0 else 2.0


def seat_damper(bodies: Bodies, patches: list[Patch]) -> ContactProblem:
    """The contact problem of the damper between two platforms, with the scene's interface layer:
    after it, each load state costs milliseconds.

    Returns:
        contact.seating.ContactProblem, for :func:`bladefem.contact.seating.solve_seating`.
    """
    return on_layer(bodies.scene, condense_contact(bodies, patches))


def on_layer(scene: Scene, problem: ContactProblem) -> ContactProblem:
    """A contact problem with the scene's interface layer between its faces."""
    ratio = pair_ratio(*operating_materials(scene))
    return with_interface_law(problem, scene.contact, ratio)


def condense_contact(bodies: Bodies, patches: list[Patch]) -> ContactProblem:
    """The contact problem of rigid faces: all that takes finite elements."""
    from ...contact.frictional_seating import hold_axially
    from ...contact.seating import contact_problem

    gap = seat_clearance(bodies, patches) + _thermal_gap(bodies, patches)
    problem = contact_problem(bodies.mesh, patches, bodies.still, bodies.damper, gap)
    return hold_axially(problem) if bodies.scene.damper.axial == "held" else problem


def _thermal_gap(bodies: Bodies, patches: list[Patch]) -> np.ndarray:
    """(n,) gap of the seats that the thermal strains of blade and damper open [m]."""
    from ...fem.rotation import has_thermal_strain, thermal_displacement

    mesh = bodies.mesh
    ports = normal_ports(patches, mesh)
    if not has_thermal_strain(bodies.still_blade):
        return np.zeros(len(ports))
    blade, damper = (
        port_matrix(patches, mesh, side)[:, ports].T @ moved.ravel()
        for side, moved in (
            ("blade", bodies.thermal_displacement),
            ("damper", thermal_displacement(bodies.damper)),
        )
    )
    return np.asarray(damper - blade)


def seat_clearance(bodies: Bodies, patches: list[Patch]) -> np.ndarray:
    """(n,) gap of the seats in addition to that of the mesh: their shape, and the clearance [m]."""
    from ...contact.face_profile import seat_gap

    scene = bodies.scene
    gap = np.concatenate([seat_gap(patch, bodies.mesh, scene.contact) for patch in patches])
    return gap if kind_named(scene.kind).clearance_is_meshed else gap + scene.damper.clearance


def harmonic_diameters(
    scene: Scene,
    mesh: Mesh,
    harmonics: int,
) -> list[int]:
    """Nodal diameters that harmonics 0..H of the engine order fall into, sorted; [0] for blades
    without a wheel.
    """
    if not is_wheel(mesh):
        return [0]
    order = scene.excitation.engine_order
    count = sector_of(mesh).count
    return sorted({folded_diameter(h, order, count)[0] for h in range(harmonics + 1)})


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
    solver = eigensolver(scene)
    span = None
    if is_wheel(mesh):
        sector, span = _reduced_diameters(bodies, ports, modes, diameters, spanned)
    else:
        kind = scene.model.reduction

        def blade_model(some: Bodies) -> PortModel:
            flex = some.factorised(0)
            return port_model(
                flex.con,
                ports.matrix,
                ports.names,
                modes,
                kind=kind,
                flex=flex,
                solver=solver,
                spin=rotation_of(some),
            )

        sector = {0: on_one_rank(bodies, blade_model)}

    floating, damper_mass = on_one_rank(bodies, partial(_reduced_damper, ports=other))
    first = len(patches[0].area) * mesh.dimension
    return Reduced(
        {n: replace(body, damping=None) for n, body in sector.items()},
        floating,
        slice(first, first + len(patches[1].area) * mesh.dimension),
        sector_of(mesh).count if is_wheel(mesh) else 0,
        damper_mass,
        {n: body.damping for n, body in sector.items() if body.damping is not None},
        span,
    )


def _reduced_damper(bodies: Bodies, ports: Ports) -> tuple[PortModel, float]:
    """The floating damper at its ports, and its mass [kg]."""
    from ...fem.loads import body_mass
    from ...fem.ports import port_model

    flex = bodies.damper
    solver = eigensolver(bodies.scene)
    model = port_model(flex.con, ports.matrix, ports.names, DAMPER_MODES, flex=flex, solver=solver)
    return model, body_mass(flex.con.body)


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
    from ...fem.all_diameters import Eigenpairs, sector_span
    from ...fem.compat import MPI
    from ...fem.groups import shared_out
    from ...fem.ports import port_models

    scene = bodies.scene
    solver = eigensolver(scene)
    comm = bodies.comm or MPI.COMM_WORLD

    spanned = spanned and scene.model.reduction == "rubin"
    blocks: dict[int, np.ndarray] = {}

    def keep_vectors(pairs: Eigenpairs) -> None:
        blocks[pairs.nodal_diameter] = pairs.X[:, :modes].copy(order="F")

    seen = keep_vectors if spanned else None

    def solved(some_bodies: Bodies, some: Sequence[int]) -> dict[int, PortModel]:
        steps = port_models(
            some_bodies.frame,
            ports.matrix,
            ports.names,
            modes,
            some,
            kind=scene.model.reduction,
            solver=solver,
            kept=some_bodies.kept.pop(KEPT_MODES, None),
            spin=rotation_of(some_bodies),
            seen=seen,
        )
        return dict(bodies.progress(steps, "nodal diameters", len(some)))

    wanted = sorted(set(diameters))
    size = bodies.ranks_of_sector
    if size == comm.size:
        whole = solved(bodies, wanted)
        every = [block for _, block in sorted(blocks.items())]
        return whole, sector_span(bodies.frame, every, ports.matrix) if spanned else None

    def of_some(part: Communicator, some: list[int]) -> list[PortModel]:
        models = solved(bodies.of_group(part), some)
        return [models[n] for n in some]

    cost = _real_or_complex(sector_of(bodies.mesh).count)
    models = shared_out(comm, wanted, size, of_some, cost)
    span = _span_of_ranks(bodies, blocks, wanted, ports) if spanned and size == 1 else None
    return dict(zip(wanted, models, strict=True)), span


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
    from ...fem.all_diameters import sector_span
    from ...fem.compat import MPI

    comm = bodies.comm or MPI.COMM_WORLD
    every: list[np.ndarray] = []
    # one by one: a message has a largest size
    for n in wanted:
        found = comm.gather(blocks.pop(n, None), 0) or []
        every += [block for block in found if block is not None]
    return on_root(comm, lambda: sector_span(bodies.alone.frame, every, ports.matrix))
