"""bladefem: friction-damped turbine blades, from geometry to design chart.

The names below are all that a script needs; each is loaded when it is first used, so that importing bladefem is cheap.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"

_WHERE = {
    "InputError": "errors",
    "NotSolvedError": "errors",
    "Bodies": "study.stages",
    "Scene": "scene",
    "load_scene": "scene_file",
    "build_mesh": "study.stages",
    "find_modes": "study.stages",
    "seat_damper": "study.stages",
    "reduce_sector": "study.stages",
    "study_loads": "study.loads",
    "run": "report.run",
    # the balance alone, for matrices of one's own
    "Elements": "data",
    "RigidBody": "data",
    "body_from_matrices": "reduction.matrices:port_model_from_matrices",
    "read_matrices": "reduction.matrices",
    "Damping": "hbm.model",
    "ReducedModel": "hbm.model",
    "Options": "hbm.newton",
    "free": "hbm.api",
    "solve": "hbm.api",
    "stuck": "hbm.api",
    "local_maxima": "hbm.sweep",
    "response": "hbm.sweep",
    "size": "hbm.sweep",
    "sweep": "hbm.sweep",
    "recorded": "hbm.record",
    "shared": "hbm.share",
    "shared_response": "hbm.share",
    "follow": "hbm.follow",
    "find_peak": "hbm.peak",
    "track_peak": "hbm.peak",
    "optimum": "hbm.optimum",
    "sensitivities": "hbm.sensitivity",
    "node_gradients": "hbm.gradient",
    "vary": "hbm.vary",
}
__all__ = sorted(_WHERE)


def __getattr__(name: str) -> object:
    if name in _WHERE:
        module, _, other = _WHERE[name].partition(":")
        return getattr(import_module(f".{module}", __name__), other or name)
    raise AttributeError(f"module 'bladefem' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
