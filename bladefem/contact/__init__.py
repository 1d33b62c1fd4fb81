"""Static contact of the damper on its seats. Begin with ``patch`` and ``seating``.

- the faces: ``patch`` of faces that match, ``mortar`` of others, ``face_profile`` crowns and edges
- the seating: ``condensed_bodies`` what finite elements give to it, ``seating`` without friction,
  ``complementarity`` its solver, ``frictional_seating`` after a history of speeds, ``state_table``
  the paper's table, ``admissible_load`` bounds over all histories
- the layer between the faces: ``interface_law``, ``rough_layer`` of ground faces,
  ``equivalent_layer`` its springs in one vibration, ``numerical_stiffness`` of stiff ones
- the friction elements: ``interface_elements``, ``joined_points`` fewer of them
- what a map tells: ``resultants``, ``peak_pressure`` whether it can be believed
- closed forms and small steps to judge by: ``hertz``, ``partial_slip``
- ``as_array`` arrays of callers
"""
