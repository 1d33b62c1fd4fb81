"""Multi-harmonic balance of friction-damped bodies. Begin with ``model``, ``solve``, ``sweep``.

- the problem: ``model``, ``validate_model``, ``parameters`` one of them changed, ``solution`` a
  solved point, ``point_measures``, ``reference_blade`` a ready model
- one point: ``solve``, ``policy`` which way, ``predictor`` where from, ``full_stick``; the work is
  in ``solver`` (Newton, iterations, fallbacks) on ``linear`` (condensed bodies)
- curves: ``response`` at given frequencies, ``sweep`` of a band, ``next_frequency``,
  ``frequency_walk``, ``from_neighbours``, ``checkpoint``, ``parallel`` over ranks,
  ``linear_resonances`` where to look
- peaks: ``peak`` found and followed, ``peak_levels`` and ``next_parameter`` of a search,
  ``optimum`` the lowest peak, ``peak_ripples`` made by sampling, ``truncation_indicator``
- several motions: ``continuation`` round folds, ``branches`` of a band, ``band_path``,
  ``path_maxima``, ``slow_sweep``
- derivatives: ``sensitivity``, ``parameter_derivatives``, ``node_gradients``,
  ``traction_gradient`` and ``history_interval`` for static friction forces
- nonlinear modes: ``nonlinear_modes``, ``mode_path`` with ``mode_newton``, ``mode_arc`` and
  ``mode_detour``, ``mode_equations``
- stability: ``stability`` multipliers, ``flow_map``, ``linearised_flow``, ``closed_contacts``,
  ``other_diameters``
- marches in time: ``ring_march`` all blades of a wave, ``ring_steps``, ``ring_contacts``,
  ``ring_readings``, ``sector_modes``, ``step_forces`` and ``blade_forces`` of a step,
  ``stiffening_layer`` the law of one, ``envelope`` leaps, ``time_model`` for shooting
- ``precompile`` the kernels
"""
