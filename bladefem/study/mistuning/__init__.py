"""Scenes of mistuned wheels: from one sector and a pattern to the response of every blade.

- ``stage`` what a scene asks for, ``validate`` what is refused, ``whole_wheel`` the model,
  ``engine_orders`` their common period
- one pattern: ``pattern_response``, ``peak_choice`` harmonics and samples of its peak,
  ``pattern_sentences``, ``sector_comparison`` with the response of one sector
- many wheels: ``drawn_wheels``, ``law_level`` by the law of one damper, ``scatter_use`` endurance
- another blade: ``blade_material`` of the same shape, ``other_blades`` of another
- stress: ``blade_stress`` motion of one blade, ``own_stress`` and ``odd_blade`` of another shape,
  ``deciding_blades`` which blades decide, ``wheel_utilisation``
"""
