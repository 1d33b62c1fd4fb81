"""Pictures, from plain arrays and tables. Their look is in ``style``.

- bodies: ``mesh``, ``look`` at a file, ``parts`` and ``root_and_shroud`` as labelled drawings
  (``dimensions``), ``pairs``; ``skin`` the outside of a mesh
- modes: ``modes``, ``speed`` Campbell and interference diagrams, ``convergence``, ``forced``
- contacts: ``contact`` pressure, ``wear`` friction work, ``hysteresis``, ``indentation``
- responses: ``response``, ``optimum``, ``motion``, ``backbone``, ``fatigue``, ``influence``,
  ``measured``, ``wheel``, ``lower_motion`` the marks of those
- studies and methods: ``study``, ``study_map``, ``chart``, ``accuracy``, ``paper``
- pages with script: ``live_curves``, ``live_shapes``, ``live_wheel``
- ``labels`` next to points
"""
