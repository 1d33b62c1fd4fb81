"""Studies of the modes, without friction.

- ``survey`` all nodal diameters of a scene, ``comparison`` MAC and names, ``clamped_aerofoil``,
  ``effective_mass``, ``stress`` of a mode
- speed: ``campbell`` tables, ``crossings`` with engine orders, ``speed_model`` small matrices for
  any speed
- mesh: ``mesh_convergence``, ``frequency_error`` what it says, ``mesh_transfer`` of fields
- ``linear_response`` to one engine order, ``linear_response_report`` its tables
"""
