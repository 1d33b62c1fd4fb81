"""Solving one point.

- ``residual`` the balance, ``balance_residual`` and ``law_evaluation`` compiled, ``balance_2d`` in
  one call, ``walking`` dampers that walk
- ``newton`` its loop, ``dense_system`` and ``dense_lu``
- small models: ``small_balance``, ``newton_compiled``, ``point_compiled``, ``path_compiled`` with
  ``frequency_rate``
- large patches: ``newton_krylov``, ``krylov`` the iterations, ``deflation`` their second level
- ``fallback`` when Newton fails, ``arclength`` round folds
"""
