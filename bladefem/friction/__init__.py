"""Friction elements: contact forces of periodic motion, and of one step in time. Begin with
``aft``.

- forces of all elements: ``aft``; the kernels that it calls are ``kernel_1d``, ``kernel_1d_exact``
  without samples (``roots``), ``walking_1d`` for dampers that walk, and in ``simd`` those with two
  tangents, which ``coulomb_2d_plain`` defines plainly on ``coulomb_2d``
- other laws: ``law`` one's own, ``law_table``, ``periodic_law`` their periodic states
- time: ``time_step``
- shared: ``fourier`` coefficients, ``trigonometric_tables``, ``states`` of a contact
- what follows: ``energy`` static forces of stuck nodes, ``equivalent_linear`` the best linear
  element, ``closed_form`` one element's
"""
