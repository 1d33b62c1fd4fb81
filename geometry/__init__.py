"""Parametric shapes of friction-damped blades, drawn and meshed by gmsh.

`geometry.isolated_process.build_isolated` makes the mesh of a scene.
"""
