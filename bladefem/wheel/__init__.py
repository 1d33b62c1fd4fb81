"""The whole wheel: N sectors that are not alike, each with its damper, in one balance. Begin with
``model`` and ``solve``.

- the problem: ``model``, ``pattern_file`` deviations from a file, ``scatter`` drawn ones,
  ``lumped`` a wheel of few masses, ``aerodynamics`` influence of the flow
- the linear wheel: ``by_diameter`` tuned, ``flexibility`` mistuned, ``partition`` over ranks
- a point: ``solve``, ``contact_forces``, ``newton``; preconditioners ``preconditioner`` harmonic by
  harmonic, ``coupled_preconditioner`` and ``wave_preconditioner`` with all; ``walking`` dampers,
  ``one_body`` small wheels, ``tuned`` where it starts
- peaks: ``resonance`` over a band, ``local_peak`` again round known ones, ``pattern_peak``
- many wheels: ``statistics``; by the law of one damper ``damper_law``, ``damper_balance``,
  ``law_kernel``, ``law_response`` of a ``family``
"""
