"""From a scene to forced responses, stage by stage. Begin with ``pipeline``, then
``response_stage`` and ``loads``.

- the run: ``pipeline`` order of the stages, ``stage_runner`` computes or reads one,
  ``stage_inputs`` what each depends on, ``run_records`` what they leave, ``preflight`` and
  ``validate_mesh`` what is refused before
- bodies: ``scene_mesh``, ``bodies`` finite elements, ``normal_modes``, ``ports``,
  ``reduced_sector``, ``coriolis``, ``damper_coriolis``
- the damper on its seats: ``damper_contact`` the contact problem, ``seated_loads`` the stage,
  ``history`` with friction, ``state_check`` the paper's table of states, ``liftoff`` light loads
- models: ``assemble_model`` one load case, ``case_models`` its family from poor to rich,
  ``changed_cases`` another contact parameter, ``joined_contacts`` fewer contact points
- responses: ``response_stage`` the stage, ``loads`` a curve a load, ``curve`` its record,
  ``resonance_list`` all maxima, ``linear_limits``, ``load_interval``,
  ``shared_accuracy`` one accuracy for all errors, ``body_mesh`` the error by the mesh
- the best load: ``best_load`` its record, ``best_load_search`` with ``load_variation``,
  ``kept_best_load`` where the blade keeps to other motions
- verdicts in the other nodal diameters: ``other_diameters``
- at the resonance: ``contact_cycle`` stick and slip, ``damped_motion`` motion and stress of all
  nodes, ``utilisation`` of the endurance
- flutter: ``flow`` damping of each wave, ``flutter`` limit cycles
- words: ``response_remarks`` all of a run, ``motion_warnings`` and ``accuracy_warnings`` with
  ``load_remarks`` one warning a reason, ``stability_remarks``, ``best_load_remarks``
- tables: ``design_table``
"""
