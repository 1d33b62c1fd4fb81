"""The whole wheel: N sectors that are not alike, each with its damper, in one balance. Begin with
``model`` and ``solve``.

- the problem: ``model``, ``pattern_file`` deviations from a file, ``scatter`` drawn ones,
  ``lumped`` a wheel of few masses, ``aerodynamics`` influence of the flow
- the linear wheel: ``by_diameter`` tuned, ``flexibility`` mistuned, ``partition`` over ranks,
  ``linear_motion`` with all contacts sticking or none
- a point: ``solve`` the attempts, ``solution`` what they give, ``check_point`` what is refused,
  ``first_motions`` and ``tuned`` where they start, ``load_homotopy`` the last of them,
  ``walking_search`` which dampers walk, ``walking`` how; ``one_body`` small wheels
- its equations: ``contact_forces``, ``newton``; preconditioners ``preconditioner`` harmonic by
  harmonic, ``coupled_preconditioner`` and ``wave_preconditioner`` with all
- peaks: ``resonance`` over a band, ``local_peak`` again round known ones, ``pattern_peak``
- many wheels: ``statistics``; by the law of one damper ``damper_law``, ``damper_balance``,
  ``law_kernel``, ``law_response`` of a ``family``
"""
