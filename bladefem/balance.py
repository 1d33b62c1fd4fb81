"""The balance alone: from matrices and friction elements to responses, without finite elements.

``body_from_matrices`` takes NumPy arrays, ``read_matrices`` files of other codes. All names come
from :mod:`bladefem.hbm` and what it builds on; each is loaded when it is first used.
"""

from __future__ import annotations

from .util.lazy import lazy_getattr

_WHERE = {
    # nouns: what is balanced, how, and what comes out
    "Damping": ".hbm.model",
    "Elements": ".data",
    "Options": ".hbm.solver.newton",
    "ReducedModel": ".hbm.model",
    "RigidBody": ".data",
    "Solution": ".hbm.solution",
    "body_from_matrices": ".reduction.matrices:port_model_from_matrices",
    "read_matrices": ".reduction.matrices",
    # one frequency, a curve, a peak, a branch
    "find_branches": ".hbm.branches",
    "find_peak": ".hbm.peak",
    "follow": ".hbm.continuation",
    "free": ".hbm.solve:free_response",
    "local_maxima": ".hbm.next_frequency",
    "response": ".hbm.response",
    "size": ".hbm.solution",
    "solve": ".hbm.solve",
    "stuck": ".hbm.solve:stuck_response",
    "sweep": ".hbm.sweep",
    "track_peak": ".hbm.peak",
    # parameters
    "history_interval": ".hbm.history_interval",
    "node_gradients": ".hbm.node_gradients",
    "optimum": ".hbm.optimum",
    "sensitivities": ".hbm.sensitivity",
    "vary": ".hbm.parameters",
    # on disk and over ranks
    "recorded": ".hbm.checkpoint:response_with_checkpoints",
    "shared": ".hbm.parallel:share_work",
    "shared_response": ".hbm.parallel",
}
__all__ = sorted(_WHERE)
__getattr__ = lazy_getattr("bladefem", _WHERE)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
