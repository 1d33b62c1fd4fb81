"""bladefem: friction-damped turbine blades, from geometry to design chart.

The names below are all that a script needs; :mod:`bladefem.balance` has those of the balance alone,
for matrices of one's own. Each is loaded when it is first used, so that importing bladefem is
cheap.
"""

from __future__ import annotations

from .util.cache_folder import provide_cache_folder, provide_kernel_folder
from .util.lazy import lazy_getattr
from .util.processor import use_wide_registers

# before NumPy is loaded
use_wide_registers()
# before numba and dolfinx are loaded
provide_cache_folder()
provide_kernel_folder()

__version__ = "0.1.0"

_WHERE = {
    "Bodies": ".study.pipeline.bodies",
    "InputError": ".errors",
    "NotSolvedError": ".errors",
    "Scene": ".scene.tables",
    "build_mesh": ".study.pipeline.scene_mesh",
    "curve_of": ".study.pipeline.loads",
    "find_modes": ".study.pipeline.normal_modes",
    "load_scene": ".scene.toml",
    "open": ".report.opened:open_run",
    "reduce_sector": ".study.pipeline.reduced_sector",
    "run": ".report.run:report_run",
    "seat_damper": ".study.pipeline.damper_contact",
    "study_loads": ".study.pipeline.loads",
    "vary": ".scene.toml",
}
# a star import must not hide Python's own open
__all__ = sorted(name for name in _WHERE if name != "open")
__getattr__ = lazy_getattr(__name__, _WHERE)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
