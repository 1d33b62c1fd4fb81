"""A blade of a CAD system, for examples and tests: the parametric sector without its damper, as a
STEP file in millimetres whose faces have no names.
"""

from __future__ import annotations

from pathlib import Path

from .parameters import Aerofoil, Disc, MeshSize, Platform, Root, Shank, Shroud, Wedge
from .sector import blade_solid
from .sector_check import NO_SHROUD, PLAIN
from .sector_shape import sector_shape
from .session import gmsh_session


def write_blade_step(
    file: str | Path,
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    root: Root = PLAIN,
    shroud: Shroud = NO_SHROUD,
) -> Path:
    """Write one sector of the wheel, from bore to tip, as ``wedge_sector`` draws it: with its
    fillet; returns the file.

    Args:
        wedge: its angle is that of the platform's inclined undersides.

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    shape = sector_shape(aerofoil, platform, shank, disc, wedge, MeshSize(), root, shroud)
    file = Path(file)
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        blade = blade_solid(gmsh, shape)
        gmsh.model.occ.dilate([(3, blade)], 0, 0, 0, 1e3, 1e3, 1e3)
        gmsh.model.occ.remove([e for e in gmsh.model.occ.getEntities(3) if e != (3, blade)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
    return file
