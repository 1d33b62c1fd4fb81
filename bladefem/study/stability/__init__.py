"""Which motion the blade keeps to: verdicts on a curve, and what marches in time make of it. Begin
with ``judged_resonance``, which decides.

- balances: ``verdicts`` stability of the points of a curve, ``highest_stable`` its highest lasting
  motion, ``finer_contacts`` verdicts with more contact points
- marches in time: ``march_from_motion`` from an unstable one, exactly by ``exact_march`` or by
  ``march_by_steps``; ``kept_band`` what they find; ``flank_motions`` beside a resonance,
  ``strong_drive`` after a strong excitation, ``lower_motion`` another one far below,
  ``error_in_time`` the error of a balance, ``resonance_in_time`` where balances fail:
  ``uphill_climb`` from frequency to frequency, ``settled_march`` at one of them
"""
