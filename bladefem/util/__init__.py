"""Progress bars, names that load on first use, ``script_help`` of the demos, ``compile_notice`` of
kernels, ``first_rank`` of what one of several processes prints, ``nodal_diameter`` of an
engine order."""
