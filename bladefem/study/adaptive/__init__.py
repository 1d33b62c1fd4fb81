"""Settings of the balance chosen by error indicators.

- what is chosen: ``settings``; from which models: ``family``
- errors: ``indicators`` of a point, ``peak_errors`` of a resonance, ``contact_mesh`` of the contact
  mesh, ``layer_change`` of a layer that stiffens with pressure, ``changed_peak`` of another model
- curves: ``band_sweep`` with given settings, ``checked_curve`` with errors at some of its points,
  ``check_points`` which of them are looked at, ``flank_checks`` what those beside the resonance
  ask for
- choices: ``resonance_choice`` at a peak and ``resonance_curve`` of a whole curve, as runs and
  charts use them, from a ``rough_curve``; ``point_choice`` at one frequency, ``frequency_list``
  along given ones
- special cases: ``branch_choice`` peaks on folds, ``followed_settings`` curves round them,
  ``choice_in_time`` and ``stiff_layer`` where contacts lift off, ``cheaper_settings`` poorer
  settings that serve as well
"""
