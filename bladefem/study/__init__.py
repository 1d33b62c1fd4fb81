"""Studies of a scene: what a command computes, from the mesh to the sentences of a report.

Packages, each with a map of its modules:

- ``pipeline``: a run stage by stage: mesh, modes, contact, reduced model, responses
- ``stability``: which motion the blade keeps to, by verdicts and by marches in time
- ``adaptive``: harmonics, samples, modes and contact points by estimated errors
- ``modes``: surveys, Campbell tables, mesh convergence, linear responses
- ``mistuning``: wheels whose blades differ
- ``chart``: speed against accuracy of the methods
- ``kinds``: the verification scenes Hertz, punch and Z-mass

Modules:

- a run taken further: ``backbone`` nonlinear modes, ``influences`` what the best load depends on,
  ``fatigue`` use of the material's endurance, ``scatter_plan`` values of scattered inputs
- fits to measurements: ``contact_identification`` from responses, of a scene by
  ``measured_responses`` with the models of ``measured_models``; ``loop_identification`` from
  hysteresis loops, ``joint_identification`` from damping over amplitude
- what a fit knows: ``fit_intervals`` 95 % intervals, ``fit_truncation`` what its model leaves out
"""
