"""The damper of a wedge mesh condensed onto its seats, with and without friction."""

import numpy as np
from wedge import wedge_mesh

from bladefem.contact.frictional_seating import frictional_problem
from bladefem.contact.patch import make_patch
from bladefem.contact.seating import contact_problem
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import flexible
from bladefem.scene.tables import Material

ALPHA = np.radians(40)
# [rad/s]
SPEED = 800.0


def condensed(mesh, rigid=False, prop=1.0, clearance=0.0):
    """The frictionless contact problem of a damper that is rigid or not."""
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    blade = flexible(constrain(assemble(mesh, "blade", Material()), "clamp"))
    body = assemble(mesh, "damper", Material())
    return contact_problem(
        mesh, patches, blade, body if rigid else flexible(constrain(body, None), prop), clearance
    )


def condensed_both_ways(dimension):
    """The contact problems of one wedge with friction and without."""
    mesh = wedge_mesh(ALPHA, dimension=dimension)
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    blade = flexible(constrain(assemble(mesh, "blade", Material()), "clamp"))
    damper = flexible(constrain(assemble(mesh, "damper", Material()), None))
    rough = frictional_problem(mesh, patches, blade, damper)
    return rough, contact_problem(mesh, patches, blade, damper)
