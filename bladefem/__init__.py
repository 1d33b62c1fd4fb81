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
}
__all__ = sorted(_WHERE)


def __getattr__(name: str) -> object:
    if name in _WHERE:
        return getattr(import_module(f".{_WHERE[name]}", __name__), name)
    raise AttributeError(f"module 'bladefem' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
