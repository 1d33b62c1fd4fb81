"""The 2-D Coulomb kernel written for vectors of lanes; the plain law is one folder up.

``kernel_2d`` is the kernel, ``periodic_state`` its fixed point, ``derivative_rows`` its derivative;
they are built from ``time_kernels`` along time and ``row_kernels`` along rows of the derivative,
with the lanes of ``codegen``. ``node_steps`` are steps in time, eight nodes at once.
"""
