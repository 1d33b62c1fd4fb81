"""The linear bodies: packed, condensed to the contact, with and without contact springs.

- NumPy: ``bodies`` at all harmonics, ``condensation`` to the contact, ``woodbury`` contact springs,
  ``mean_motion`` harmonic 0, ``common_basis`` one flexibility for all harmonics, ``circulation``
  unsymmetric stiffness
- compiled: ``packed_bodies`` the arrays that it takes, ``condensation_compiled``,
  ``contact_flexibility``, ``array_copy``, ``row_products``
"""
