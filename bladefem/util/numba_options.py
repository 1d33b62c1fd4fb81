"""How kernels are compiled by numba.

Numba makes two wrappers next to each function: one that Python calls, and one for C that nobody
here calls. Without them a kernel takes a tenth less time to compile.

Kernels that neither make nor return arrays say ``_nrt=False``: no references to those that they
are given are counted. A count is raised and lowered at each slice and call by an instruction that
locks memory; these took a quarter of a march in time. A kernel that makes arrays and is called by
one of them says ``_nrt=True``, else it takes over what its caller says.
"""

from __future__ import annotations

from typing import Any

from .compile_notice import announce_compilation

# kernels that Python calls
KERNEL: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# kernels that only other kernels call
INNER_KERNEL: dict[str, Any] = {**KERNEL, "no_cpython_wrapper": True}

# every module with kernels comes here before it is compiled
announce_compilation()
