"""Blade and damper of a scene as finite elements, each part assembled when first asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from geometry.mesh import Mesh, chosen_whole, counting_sense, cut_face_nodes, spin_axis

from ...errors import InputError, suggestion
from ...io.stage_cache import on_root
from ...scene.fields import value_at
from ...scene.kinds import kind_named
from ...scene.material_table import operating_materials, operating_temperature
from ...scene.part_materials import part_materials
from ...scene.support import area_springs, held_letters
from ...scene.tables import Material, Scene
from ...scene.temperature_file import read_temperatures
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress

# dolfinx is slow to load: the functions below import it when they run
if TYPE_CHECKING:
    from ...fem.body import Body
    from ...fem.constraint import Transformation
    from ...fem.flexibility import Flexibility
    from ...fem.gyroscopic import Spin
    from ...fem.steady_state import SteadyState
    from ...fem.temperature import Temperatures

Result = TypeVar("Result")
# displacements for which the blade at rest is factorised
STATIC_PARTS = ("swell", "thermal_displacement")


@dataclass(frozen=True)
class Bodies:
    """Blade and damper as finite elements, assembled and factorised when first asked for, then
    kept.

    Vibrations use the stiffness under rotation (stress stiffening, spin softening) and thermal
    stress about the linear preload, or about the nonlinear one where ``operation.preload`` says so.
    About a linear preload, seating the damper uses the elastic stiffness at rest, under the whole
    centrifugal load: both are first-order theory, in which displacements grow with the square of
    the speed, and the stiffness under rotation would count the rotation twice. About a nonlinear
    one the blade moves and gives way to contact forces as it does about that state.
    """

    scene: Scene
    mesh: Mesh
    comm: Communicator | None = None
    progress: Progress = without_progress

    @cached_property
    def kept(self) -> dict[str, Any]:
        """What one stage leaves to a later one: under KEPT_MODES fem.all_diameters.KeptPairs."""
        return {}

    @cached_property
    def fits_one_rank(self) -> bool:
        """One rank has memory for the whole bodies (collective)."""
        from ...fem.compat import MPI
        from ...fem.groups import fits_one_rank

        dofs = blade_dofs(self.mesh)
        return fits_one_rank(self.comm or MPI.COMM_WORLD, dofs, cut_dofs(self.mesh))

    @cached_property
    def ranks_of_sector(self) -> int:
        """Ranks that solve a nodal diameter together (collective)."""
        from ...fem.compat import MPI
        from ...fem.groups import group_size

        dofs = blade_dofs(self.mesh)
        return group_size(self.comm or MPI.COMM_WORLD, dofs, cut=cut_dofs(self.mesh))

    @cached_property
    def alone(self) -> Bodies:
        """The bodies on this rank alone."""
        from ...fem.compat import MPI

        if (self.comm or MPI.COMM_WORLD).size == 1:
            return self
        return Bodies(self.scene, self.mesh, MPI.COMM_SELF, self.progress)

    def of_group(self, part: Communicator) -> Bodies:
        """The bodies on a group of ranks; these ones where the group has all ranks."""
        from ...fem.compat import MPI

        if part.size == (self.comm or MPI.COMM_WORLD).size:
            return self
        return self.alone if part.size == 1 else Bodies(self.scene, self.mesh, part, self.progress)

    def heat(self, materials: Iterable[Material]) -> Temperatures | None:
        """Temperatures of the nodes; None where neither the scene gives some nor a material has a
        table.
        """
        from ...fem.temperature import Temperatures

        given = self.scene.temperature
        if given.file:
            return Temperatures(self.temperatures_of_file, given.reference)
        if given.uniform is None and all(material.table is None for material in materials):
            return None
        nodal = np.full(len(self.mesh.points), operating_temperature(self.scene))
        return Temperatures(nodal, given.reference)

    @cached_property
    def temperatures_of_file(self) -> np.ndarray:
        """(n_points,) [K]."""
        from ...fem.temperature_field import mesh_temperatures

        return mesh_temperatures(self.mesh, read_temperatures(self.scene.temperature.file))

    @cached_property
    def still_blade(self) -> Body:
        """The blade at rest."""
        from ...fem.body import assemble
        from ...fem.supports import AreaSpring, supported

        mesh, materials = blade_parts(self.scene, self.mesh)
        heat = self.heat(materials.values())
        body = assemble(mesh, tuple(materials), materials, self.comm, heat=heat)
        support = self.scene.support
        springs = [AreaSpring(*spring) for spring in area_springs(support)]
        return supported(body, support.clamp, springs, held_letters(support))

    @property
    def storage_remarks(self) -> list[str]:
        """What there is to say of where factors are kept; nothing where no blade was assembled."""
        from ...fem.memory import storage_remark

        body = vars(self).get("still_blade")
        return [] if body is None else storage_remark(body.plan)

    @cached_property
    def blade(self) -> Body:
        """The blade, with the stiffness that it has under rotation and heat."""
        return self._blade_about(self.state)

    def blade_at(self, speed: float) -> Body:
        """The blade with its stiffness at a speed [rad/s]."""
        return self._blade_about(self.state_at(speed))

    def _blade_about(self, state: SteadyState | None) -> Body:
        from ...fem.rotation import body_about

        if state is None:
            return self.still_blade
        self._release_still()
        return body_about(self.still_blade, state)

    @cached_property
    def state(self) -> SteadyState | None:
        """What the blade vibrates about; None at rest."""
        return self.state_at(self.scene.operation.speed if self.scene.operation.stiffening else 0.0)

    def state_at(self, speed: float) -> SteadyState | None:
        """The static state at a speed [rad/s]; None at rest."""
        from ...fem.preload import preload
        from ...fem.steady_state import SteadyState
        from ...fem.thermal_strain import has_thermal_strain

        if speed == 0 and not has_thermal_strain(self.still_blade):
            return None
        axis = spin_axis(self.mesh)
        if self.scene.operation.preload == "nonlinear":
            found = preload(self.still_blade, speed, "clamp", axis)
            return SteadyState(found.displacement, speed, axis, large=True)
        u0 = speed**2 * self.swell + self.thermal_displacement
        return SteadyState(u0, speed, axis)

    def steady_parts(self) -> dict[str, Any]:
        """What :attr:`state` was made of, and itself, for bodies of the same mesh elsewhere."""
        made = {"state": self.state}
        return made | {name: vars(self)[name] for name in STATIC_PARTS if name in vars(self)}

    def take_steady_parts(self, made: dict[str, Any]) -> None:
        """Have the state that bodies on another rank have found, in place of a solve."""
        vars(self).update(made)

    @property
    def on_large_state(self) -> bool:
        """Whether the blade stands on the nonlinear preload at the operating speed; without
        stiffening that is the one of the heat alone.
        """
        state = self.state
        return state is not None and state.large and state.speed == self.scene.operation.speed

    @cached_property
    def warm_displacement(self) -> np.ndarray:
        """(n_points, dim) displacement of the blade at rest by its temperatures [m], of the kind of
        its preload.
        """
        if not self.on_large_state:
            return self.thermal_displacement
        warm = self.state_at(0.0)
        return np.zeros_like(self.swell) if warm is None else warm.displacement

    @cached_property
    def seat_swell(self) -> np.ndarray | None:
        """(n_points, dim) displacement of the blade from rest to the operating speed over the
        square of this [m s^2], as seats feel it; None: the linear `swell`.

        At speeds between, as friction passes them, the nonlinear one is taken straight over the
        square of the speed.
        """
        speed = self.scene.operation.speed
        if self.state is None or not self.on_large_state or not speed > 0:
            return None
        return np.asarray((self.state.displacement - self.warm_displacement) / speed**2)

    @property
    def seated(self) -> Flexibility:
        """The blade as it gives way to the damper's steady forces, the same on all blades."""
        return self.factorised(0) if self.on_large_state else self.still

    @cached_property
    def swell(self) -> np.ndarray:
        """(n_points, dim) linear displacement of the blade for unit rotation [m s^2]."""
        from ...fem.linear_preload import unit_speed_displacement

        return unit_speed_displacement(self.still, spin_axis(self.mesh))

    @cached_property
    def thermal_displacement(self) -> np.ndarray:
        """(n_points, dim) linear displacement of the blade by its temperatures [m]."""
        from ...fem.linear_preload import thermal_displacement
        from ...fem.thermal_strain import has_thermal_strain

        if not has_thermal_strain(self.still_blade):
            return np.zeros((len(self.mesh.points), self.mesh.dimension))
        return thermal_displacement(self.still)

    @cached_property
    def damper(self) -> Flexibility:
        """The floating damper."""
        from ...fem.body import assemble
        from ...fem.constraint import constrain
        from ...fem.flexibility import flexible

        material = _damper_material(self.scene, self.mesh)
        body = assemble(self.mesh, "damper", material, self.comm, heat=self.heat([material]))
        return flexible(constrain(body, clamp=None))

    @cached_property
    def frame(self) -> Transformation:
        """What serves every nodal diameter."""
        from ...fem.constraint import transformation, transformation_about

        still = self._still_sector
        if still is None:
            return transformation(self.blade, "clamp", is_wheel(self.mesh))
        return still if self.blade is self.still_blade else transformation_about(still, self.blade)

    @cached_property
    def _still_sector(self) -> Transformation | None:
        """What serves every nodal diameter of the blade at rest; None where no open sector does.

        Rotation changes nothing of it but the stiffness.
        """
        from ...fem.constraint import transformation

        if not is_wheel(self.mesh):
            return None
        found = transformation(self.still_blade, "clamp", True)
        return None if found.opened is None else found

    @cached_property
    def still(self) -> Flexibility:
        """The blade at rest under loads that are the same on all
        blades.
        """
        from ...fem.constraint import at_diameter, in_step
        from ...fem.flexibility import flexible

        sector = self._still_sector
        return flexible(in_step(self.still_blade) if sector is None else at_diameter(sector, 0))

    def _release_still(self) -> None:
        """Give the factors of the blade at rest back where ranks share them: one rank seats the
        damper with its own.
        """
        from ...fem.compat import MPI
        from ...fem.flexibility import discard

        if (self.comm or MPI.COMM_WORLD).size == 1 or not self.fits_one_rank:
            return
        still = vars(self).pop("still", None)
        if still is not None:
            discard(still)

    def factorised(self, diameter: int) -> Flexibility:
        """The blade in one nodal diameter, or clamped at its root;
        under rotation.
        """
        from ...fem.constraint import at_diameter
        from ...fem.flexibility import flexible

        if diameter == 0 and self.blade is self.still_blade:
            return self.still
        return flexible(at_diameter(self.frame, diameter if is_wheel(self.mesh) else None))


def on_one_rank(bodies: Bodies, compute: Callable[[Bodies], Result]) -> Result:
    """What several ranks would not do faster: rank 0 computes it with the factorisations that it
    has, or all ranks together where one has no memory for the bodies.
    """
    if not bodies.fits_one_rank:
        return compute(bodies)
    return on_root(bodies.comm, lambda: compute(bodies.alone))


def blade_dofs(mesh: Mesh) -> int:
    """Displacements of the blade's nodes."""
    return mesh.dimension * len(np.unique(mesh.bodies["blade"]))


def cut_dofs(mesh: Mesh) -> int:
    """Displacements of the nodes of both cut faces."""
    return mesh.dimension * cut_face_nodes(mesh)


def rotation_of(bodies: Bodies) -> Spin:
    """The frame of the bodies as it turns: in the sense in which the sectors are counted, so that
    a blade meets a load at rest in space later than the next one does.
    """
    from ...fem.gyroscopic import Spin

    speed = counting_sense(bodies.mesh) * bodies.scene.operation.speed
    return Spin(spin_axis(bodies.mesh), speed)


def is_wheel(mesh: Mesh) -> bool:
    """The blade is a sector of a wheel with elastic disc: it has cut faces."""
    return "cyclic" in mesh.pairs


def blade_parts(scene: Scene, mesh: Mesh) -> tuple[Mesh, dict[str, Material]]:
    """The mesh with the volumes of other materials as bodies next to the rest of the blade, and the
    material of each.

    Raises:
        InputError: a volume with a material that the mesh does not have, or that shares cells with
            another one.
    """
    given = part_materials(scene)
    if not given:
        return mesh, {"blade": scene.material.blade}
    cells = mesh.bodies["blade"]
    owner = np.zeros(len(mesh.bodies["blade"]), int)
    for i, name in enumerate(given, 1):
        if name not in mesh.parts:
            raise InputError(
                f"imported.materials: the mesh has no volume '{name}'{suggestion(name, mesh.parts)}"
            )
        if owner[mesh.parts[name]].any():
            raise InputError(
                f"imported.materials: volume '{name}' shares cells with another one, expected "
                "separate ones"
            )
        owner[mesh.parts[name]] = i
    names = [("blade", scene.material.blade), *given.items()]
    some = [(i, name) for i, (name, _) in enumerate(names) if (owner == i).any()]
    rows = {f"blade, {name}": ("blade", owner == i) for i, name in some}
    bodies = {name: cells[chosen] for name, (_, chosen) in rows.items()}
    whole = {**mesh.whole, **chosen_whole(mesh, rows)}
    return replace(mesh, bodies={**mesh.bodies, **bodies}, whole=whole), {
        f"blade, {name}": names[i][1] for i, name in some
    }


def _damper_material(scene: Scene, mesh: Mesh) -> Material:
    """The damper's material, its density set by the given mass where there is one."""
    from ...fem.loads import body_volume

    given = value_at(scene, kind_named(scene.kind).damper_mass)
    if given is None:
        return scene.material.damper
    # constants, lest a table of densities overrule the mass
    return replace(operating_materials(scene)[1], rho=given / body_volume(mesh, "damper"))
