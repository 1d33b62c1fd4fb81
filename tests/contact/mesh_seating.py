"""The seating of a damper from its mesh, for tests of meshes and of ranks."""

from bladefem.contact.patch import make_patch
from bladefem.contact.seating import contact_problem, solve_seating
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import flexible


def solve_mesh_seating(mesh, materials, speed, normal=None, comm=None):
    """Pressure maps of "this" and "next" without clearance; `normal` [N] in place of the
    centrifugal load.
    """
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    diameter = 0 if "cyclic" in mesh.pairs else None
    blade = flexible(constrain(assemble(mesh, "blade", materials.blade, comm), "clamp", diameter))
    damper = flexible(constrain(assemble(mesh, "damper", materials.damper, comm), None))
    return solve_seating(contact_problem(mesh, patches, blade, damper), speed, normal)
