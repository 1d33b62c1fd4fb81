"""Finite elements of elastic bodies on dolfinx, PETSc and SLEPc, on any number of ranks. Begin with
``body``, ``constraint``, ``modes``, ``ports``.

- other packages: ``compat`` dolfinx, ``petsc_start``, ``mumps``, ``schur`` and ``ordering`` of its
  factors, ``linalg`` and ``distributed`` matrices, ``memory`` what a solve takes
- cells: ``shape_functions``, ``cell_functions``, ``cubic_functions``, ``mixed_cells``,
  ``refinement``, ``elasticity``
- faces: ``face_elements``, ``surface``, ``face_overlap``, ``face_values``
- bodies: ``body``, ``mass``, ``loads``, ``supports``, ``gyroscopic``, ``temperature``,
  ``temperature_field``, ``thermal_strain``
- vibrations about rotation and heat: ``rotation``, ``steady_state`` its record, ``linear_preload``
  or ``preload``, ``rotating_forms`` the potential and its derivatives
- cyclic symmetry: ``constraint``, ``cut_faces``, ``cyclic_schur``, ``open_sector``,
  ``open_matrix``; over ranks ``groups``, ``subdomains``, ``separators``
- modes: ``modes``, ``eigensolver``, ``lanczos``, ``all_diameters`` with ``diameter_space`` and
  ``mode_count``, ``stiffness_error`` of the mesh
- reduction: ``ports``, ``flexibility``, ``held_part``, ``readings``
- motion and stress: ``forced_motion``, ``cut_sector``, ``stress``, ``alternating_stress``,
  ``stress_error``
"""
