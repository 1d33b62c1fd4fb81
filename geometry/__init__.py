"""Parametric shapes of friction-damped blades, drawn and meshed by gmsh.

`geometry.isolated_process.build_isolated` makes the mesh of a scene. A wedge sector: `sector_check`
refuses what cannot be drawn (`seat_room` has the widest seat), `sector_shape` holds what is drawn,
`sector` draws and meshes it; `sizing` and `size_fields` set its element sizes.
"""
