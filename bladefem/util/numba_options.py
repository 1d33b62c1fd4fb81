"""How kernels are compiled by numba.

Numba makes two wrappers next to each function: one that Python calls, and one for C that nobody
here calls. Without them a kernel takes a tenth less time to compile.
"""

from __future__ import annotations

from typing import Any

# kernels that Python calls
KERNEL: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# kernels that only other kernels call
INNER_KERNEL: dict[str, Any] = {**KERNEL, "no_cpython_wrapper": True}
