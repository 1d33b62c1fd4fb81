"""Parametric shapes of friction-damped blades, drawn and meshed by gmsh; `build` makes the mesh of
a scene.
"""

from .builders import build

__all__ = ["build"]
