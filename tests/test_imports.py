"""What an import may load: users of the balance, of scenes or of tables need no finite elements.

Which package may import which is a contract in pyproject.toml, checked by ``./run lint``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("bladefem", ["gmsh", "dolfinx", "numpy", "matplotlib"]),
        ("bladefem.hbm", ["gmsh", "dolfinx", "petsc4py"]),
        ("geometry.parameters, geometry.mesh, geometry.quantity", ["gmsh", "dolfinx"]),
        ("bladefem.scene.toml", ["gmsh", "dolfinx", "scipy"]),
        ("bladefem.cli.main", ["gmsh", "dolfinx", "mpi4py"]),
        ("bladefem.io.stage_cache", ["dolfinx", "mpi4py", "h5py"]),
        ("bladefem.friction", ["dolfinx", "gmsh"]),
        ("bladefem.report.run, bladefem.study.fit_intervals", ["scipy.stats"]),
    ],
)
def test_an_import_loads_no_more_than_it_needs(module, absent):
    code = f"import sys, {module}; print([m for m in {absent} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=dict(os.environ)
    )
    assert done.stdout == "[]\n", done.stdout + done.stderr
