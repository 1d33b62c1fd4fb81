"""What commands leave in their folders: tables, pictures, sentences and pages.

- a run: ``run`` all of it, ``run_tables``, ``run_pictures``, ``run_messages``, ``run_files``;
  ``opened`` a folder read again
- other commands: ``modes``, ``study``, ``study_map``, ``chart``, ``backbone``, ``measured``,
  ``pair`` and ``zmass`` for verification
- pages: ``write`` HTML and Markdown, ``library`` of pages with script, ``pdf``, ``captions``
- tables: ``tables`` for people, ``page_tables`` on a page, ``datasets`` for netCDF
- sentences: ``headlines`` with their errors, ``statements`` the answer, ``next_steps``
- drawn wheels: ``scatter_tables``, ``scatter_sentences``, ``scatter_pictures``
- parts of them: ``response_points`` and ``response_arrays`` of curves, ``resonance_table``,
  ``best_load`` and ``best_value``, ``damping`` the equivalent ratio, ``influences``, ``linear`` the
  best linear element, ``nodes``, ``pressure``, ``mode_table``, ``fatigue``, ``flow``, ``wheel`` one
  pattern of deviations
"""
