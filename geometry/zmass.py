"""The Z-shaped mass: two bars along x and a diagonal between them, one plate standing on the plane z = 0."""

from __future__ import annotations

import numpy as np

from bladefem.errors import InputError

from .draw import centres, prism, set_background
from .extract import Groups
from .finish import complete, mesh_model
from .mesh import Mesh
from .parameters import MeshSize, ZMass
from .session import attempt, gmsh_session

__all__ = ["z_corners", "z_mass"]


def z_corners(z: ZMass) -> np.ndarray:
    """Corners (10, 2) [m] of the Z round its centre, anticlockwise; the diagonal is ``bar`` wide along x."""
    w, h, b = z.width / 2, z.height / 2, z.bar
    half = np.array([[-w, -h], [w, -h], [w, b - h], [b - w, b - h], [w, h - b]])
    return np.vstack([half, -half])


def z_mass(z: ZMass, size: MeshSize) -> Mesh:
    """Body "damper" with the faces "footprint" (z = 0) and "top".

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    limit = 0.95 * min(z.height / 2, z.width)
    if not z.bar <= limit:
        raise InputError(f"z_mass.bar = {z.bar:.4g} m: expected at most {limit:.4g} m "
                         "(95 % of z_mass.width and of half of z_mass.height)")
    base = size.size or min(z.thickness / 2, z.bar / 3)
    contact = size.contact_size or base
    with gmsh_session() as gmsh:
        body = prism(gmsh, z_corners(z), 0.0, z.thickness)
        gmsh.model.occ.synchronize()
        heights = {tag: centre[2] for tag, centre in centres(gmsh, body).items()}
        faces = {"footprint": [min(heights, key=heights.get)], "top": [max(heights, key=heights.get)]}
        set_background(gmsh, min(base, contact) / 2,
                       MathEval=[{"F": f"{contact} + {base - contact} * z / {z.thickness}"}])
        with attempt("mesh.size", "mesh this geometry"):
            mesh = mesh_model(gmsh, Groups({"damper": [body]}, faces), 3, size)
    return complete(mesh, {}, base)
