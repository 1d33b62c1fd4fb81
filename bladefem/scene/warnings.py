"""What is allowed in a scene and yet improbable: a slip of the pen, most often of a unit."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

from .fields import display_value, field_at, value_at
from .kinds import kind_named
from .part_materials import part_materials
from .tables import Material, Scene
from .units import show
from .validate_contact import is_frictionless, self_locking

# Young's modulus [Pa]: plastics to diamond
MODULUS_RANGE = (1e9, 1e12)
# density [kg/m^3]: foam to osmium
DENSITY_RANGE = (500.0, 25000.0)
# mass of an underplatform damper [kg]: small turbines to the last stages of large ones
DAMPER_MASS_RANGE = (1e-4, 1.0)
# [m/s] beyond which no disc holds
MAX_RIM_SPEED = 900.0


def implausible_values(scene: Scene) -> list[str]:
    """One sentence for each value that is unlikely to be meant."""
    said = [*_doubtful_materials(scene), *_doubtful_masses(scene), *_doubtful_mesh(scene)]
    said += [*_unused_stiffnesses(scene), *_unused_solver_fields(scene), *_unused_phase(scene)]
    said += [*_unused_diameters(scene), *_unread_fields(scene), *_unused_angles(scene)]
    if "operation" in kind_named(scene.kind).tables:
        said += [*_doubtful_speed(scene), *_doubtful_damping(scene), *_unsoftened_row(scene)]
    if scene.contact.history == "frictionless" and (locked := self_locking(scene)):
        said.append(f"{locked}, which a seating without friction does not know")
    if is_frictionless(scene):
        said.append(
            "contact.mu = 0: the seats dissipate nothing, the damper adds its mass and the "
            "stiffness of its closed contacts alone, and no best load is sought"
        )
    return said


def _doubtful_materials(scene: Scene) -> Iterator[str]:
    named = {"material.blade": scene.material.blade, "material.damper": scene.material.damper}
    named |= {f"imported.materials, {name}": one for name, one in part_materials(scene).items()}
    for name, material in named.items():
        yield from _doubtful_material(name, material)


def _doubtful_material(name: str, material: Material) -> Iterator[str]:
    if not MODULUS_RANGE[0] <= material.E <= MODULUS_RANGE[1]:
        yield f"{name}.E = {show(material.E, 'Pa')}: solids for machines have 1 to 1000 GPa"
    if not DENSITY_RANGE[0] <= material.rho <= DENSITY_RANGE[1]:
        yield (
            f"{name}.rho = {show(material.rho, 'kg/m^3')}: solids for machines have 500 to 25000 "
            "kg/m^3"
        )


def _unused_angles(scene: Scene) -> Iterator[str]:
    """A crystal's directions in a body that is alike in all of them."""
    for name in ("blade", "damper"):
        material = getattr(scene.material, name)
        crystal = material.G is not None or material.orthotropic is not None
        if any(material.angles) and not (crystal or material.table or material.expansion_axes):
            yield (
                f"material.{name}.angles is not used: without material.{name}.G or orthotropic the "
                "body is alike in all directions"
            )


def _doubtful_masses(scene: Scene) -> Iterator[str]:
    """Doubtful masses of the damper, as the scene gives it and as the study varies it."""
    field = kind_named(scene.kind).damper_mass
    given = None if field is None else value_at(scene, field)
    named = {} if field is None or given is None else {field: (given,)}
    for name, masses in {**named, "study.masses": scene.study.masses or ()}.items():
        outside = [m for m in masses if not DAMPER_MASS_RANGE[0] <= m <= DAMPER_MASS_RANGE[1]]
        if outside:
            yield (
                f"{name} = {', '.join(show(mass, 'kg') for mass in outside)}: underplatform "
                "dampers have 0.1 g to 1 kg"
            )


def _unused_stiffnesses(scene: Scene) -> Iterator[str]:
    """Stiffnesses per unit area in whose place that of the whole seat is taken."""
    contact = scene.contact
    tables = {"contact": contact, "contact.left": contact.left, "contact.right": contact.right}
    for name, table in tables.items():
        for total, areal in (("kt", "kt_area"), ("kn", "kn_area")):
            whole, per_area = getattr(table, total), getattr(table, areal)
            if whole is not None and per_area is not None:
                yield (
                    f"{name}.{areal} = {show(per_area, 'N/m^3')} is not used: {name}.{total} = "
                    f"{show(whole, 'N/m')}, the stiffness of the whole seat, takes its place"
                )


def _unused_solver_fields(scene: Scene) -> Iterator[str]:
    """Fields of SLEPc beside the other eigensolver."""
    solver = scene.solver
    if solver.eigensolver == "slepc":
        return
    options = [word for word in solver.petsc.split() if word.startswith(("-eps_", "-st_"))]
    given = {"vectors": solver.vectors, "petsc": " ".join(options)}
    for name, value in given.items():
        if value:
            yield (
                f"solver.{name} = {value} is not used: it is SLEPc's, and solver.eigensolver = "
                f"{solver.eigensolver}"
            )


def _unused_phase(scene: Scene) -> Iterator[str]:
    """The phase between plane blades, on a wheel."""
    sectors = kind_named(scene.kind).sectors
    if scene.excitation.phase and sectors is not None and value_at(scene, sectors):
        yield (
            f"excitation.phase = {show(scene.excitation.phase, 'rad')} is not used: on a wheel "
            f"excitation.engine_order = {scene.excitation.engine_order} and {sectors} = "
            f"{value_at(scene, sectors)} give the phase between blades"
        )


def _unused_diameters(scene: Scene) -> Iterator[str]:
    """Nodal diameters of what is no wheel."""
    sectors = kind_named(scene.kind).sectors
    listed = scene.model.nodal_diameters
    if listed and (sectors is None or not value_at(scene, sectors)):
        yield (
            f"model.nodal_diameters = {', '.join(map(str, listed))} is not used: this scene has a "
            "single blade, no wheel"
        )


def _unread_fields(scene: Scene) -> Iterator[str]:
    """What this kind's tables have and it does not read."""
    for name in kind_named(scene.kind).unread(scene):
        field = field_at(name)
        value = value_at(scene, name)
        if value != field.default:
            yield (
                f"{name} = {display_value(value, field)} is not used: it changes nothing in a "
                f"scene of kind '{scene.kind}' such as this"
            )


def _doubtful_speed(scene: Scene) -> Iterator[str]:
    radii = kind_named(scene.kind).radii
    for name, radius in radii(scene).items() if radii is not None else ():
        speed = scene.operation.speed * radius
        if speed > MAX_RIM_SPEED:
            yield (
                f"operation.speed = {show(scene.operation.speed, 'rad/s')}: the {name} at "
                f"{show(radius, 'm')} moves with {speed:.0f} m/s, more than the "
                f"{MAX_RIM_SPEED:.0f} m/s that wheels withstand"
            )
            return


def _unsoftened_row(scene: Scene) -> Iterator[str]:
    """An endless row is pulled along its blades alone, wherever they stand: what softens blades of
    a wheel that move in its plane is not there.
    """
    operation = scene.operation
    if kind_named(scene.kind).is_plane and operation.stiffening and operation.speed > 0:
        turns = show(operation.speed / (2 * pi), "Hz")
        yield (
            f"operation.speed = {show(operation.speed, 'rad/s')}: a row of plane blades is "
            "stiffened by rotation without spin softening; the square of a frequency of a wheel's "
            f"blade that moves in its plane is lower by up to ({turns})^2"
        )


def _doubtful_damping(scene: Scene) -> Iterator[str]:
    if scene.operation.damping == 0:
        yield "operation.damping = 0: enough for modes, responses need more than 0"
    if scene.excitation.force == 0:
        yield "excitation.force = 0 N: enough for modes, responses need more than 0 N"


def _doubtful_mesh(scene: Scene) -> Iterator[str]:
    parts = kind_named(scene.kind).thin_parts
    if parts is None or scene.mesh.size is None:
        return
    size = scene.mesh.size * scene.mesh.scale
    name, thinnest = min(parts(scene).items(), key=lambda part: part[1])
    if size > thinnest:
        yield (
            f"mesh.size = {show(size, 'm')}: larger than the thinnest part, {name} with "
            f"{show(thinnest, 'm')}"
        )
