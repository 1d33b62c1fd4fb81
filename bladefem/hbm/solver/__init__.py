"""Solving one point.

- ``residual`` the balance, ``balance_2d`` in one call, ``walking`` dampers that walk
- ``newton`` its loop, ``dense_system`` and ``dense_lu``; ``newton_compiled`` and
  ``point_compiled`` small models
- large patches: ``newton_krylov``, ``krylov`` the iterations, ``deflation`` their second level
- ``fallback`` when Newton fails, ``arclength`` round folds
"""
