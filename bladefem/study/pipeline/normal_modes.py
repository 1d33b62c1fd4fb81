"""Normal modes without damper: of the clamped blade, and of a wheel's sector in nodal diameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from geometry.mesh import Mesh, sector_of

from ...data import ModeSet
from ...reduction.assemble import folded_diameter
from ...scene.tables import Scene
from ...util.communicator import Communicator
from .bodies import Bodies, blade_dofs, is_wheel, on_one_rank

# dolfinx is slow to load: the functions below import it when they run
if TYPE_CHECKING:
    from ...fem.eigensolver import Eigensolver

# of each nodal diameter, in tables and pictures
MODES_SHOWN = 10
# name of the modes that are kept for the reduction
KEPT_MODES = "modes"


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
        group: ranks in a group; as many as share a sector well when left out, all ranks for few
            nodal diameters.
        reduced: modes that a reduction will need, kept with the bodies where these have the ranks
            that the reduction will have.
    """
    from ...fem.all_diameters import KeptPairs, all_diameters
    from ...fem.compat import MPI
    from ...fem.groups import shared_out, size_for_few

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
    if group is None and not reduced:
        # a reduction wants what its own groups have solved
        size = size_for_few(size, comm.size, len(wanted), blade_dofs(bodies.mesh))
    if size == comm.size:
        # one group: each rank has the results already
        return of_some(comm, wanted)
    return shared_out(comm, wanted, size, of_some, cost_of_diameter(sectors))


def cost_of_diameter(sectors: int) -> Callable[[int], float]:
    """The cost of a nodal diameter: complex pencils take twice that of real ones."""
    return lambda n: 1.0 if 2 * n % sectors == 0 else 2.0


def responding_diameters(scene: Scene, mesh: Mesh) -> list[int] | None:
    """Nodal diameters whose modes a response needs besides those that the scene lists for its
    tables: stresses and errors of a response are those of the diameters that its harmonics excite.
    None where the scene lists none, or all of these.
    """
    listed = scene.model.nodal_diameters
    excited = harmonic_diameters(scene, mesh, 3)
    if not listed or set(excited) <= set(listed):
        return None
    return sorted({*listed, *excited})


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
