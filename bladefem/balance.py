"""The balance alone: from matrices and friction elements to responses, without finite elements.

``body_from_matrices`` takes NumPy arrays, ``read_matrices`` files of other codes. All names come from
:mod:`bladefem.hbm` and what it stands on; each is loaded when it is first used.
"""

from __future__ import annotations

from .lazy import loader

_WHERE = {
    # nouns: what is balanced, how, and what comes out
    "Damping": ".hbm.model",
    "Elements": ".data",
    "Options": ".hbm.newton",
    "ReducedModel": ".hbm.model",
    "RigidBody": ".data",
    "Solution": ".hbm.solution",
    "body_from_matrices": ".reduction.matrices:port_model_from_matrices",
    "read_matrices": ".reduction.matrices",
    # one frequency, a curve, a peak, a branch
    "find_peak": ".hbm.peak",
    "follow": ".hbm.follow",
    "free": ".hbm.api",
    "local_maxima": ".hbm.sweep",
    "response": ".hbm.sweep",
    "size": ".hbm.sweep",
    "solve": ".hbm.api",
    "stuck": ".hbm.api",
    "sweep": ".hbm.sweep",
    "track_peak": ".hbm.peak",
    # parameters
    "node_gradients": ".hbm.gradient",
    "optimum": ".hbm.optimum",
    "sensitivities": ".hbm.sensitivity",
    "vary": ".hbm.vary",
    # on disk and over ranks
    "recorded": ".hbm.record",
    "shared": ".hbm.share",
    "shared_response": ".hbm.share",
}
__all__ = sorted(_WHERE)
__getattr__ = loader("bladefem", _WHERE)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
