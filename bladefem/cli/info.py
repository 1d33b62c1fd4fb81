"""What this installation is made of."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any


def installation_facts() -> list[tuple[str, str]]:
    """Rows of name and value: versions, solvers, BLAS, MPI, threads."""
    from ..io.stage_cache import library_versions

    rows = [
        ("python", platform.python_version()),
        ("system", _system_text()),
        *library_versions().items(),
    ]
    rows += _solver_versions()
    rows += [
        (
            "BLAS",
            ", ".join(_loaded_libraries("openblas", "blis", "mkl", "refblas", "libblas"))
            or "unknown",
        ),
        ("cores", str(os.cpu_count())),
        ("OMP_NUM_THREADS", os.environ.get("OMP_NUM_THREADS", "not set")),
    ]
    return rows


def _system_text() -> str:
    try:
        return platform.freedesktop_os_release().get("PRETTY_NAME", platform.platform())
    except OSError:
        return platform.platform()


def _solver_versions() -> list[tuple[str, str]]:
    """PETSc, MUMPS and MPI as they answer themselves."""
    try:
        from ..fem.compat import MPI, PETSc
    except ImportError as error:
        return [("PETSc", f"absent ({error})")]
    implementation, version = MPI.get_vendor()
    return [
        ("PETSc", ".".join(map(str, PETSc.Sys.getVersion()))),
        ("PETSc scalars", str(PETSc.ScalarType.__name__)),
        ("MUMPS", _mumps_check(PETSc)),
        ("MPI", f"{implementation} {'.'.join(map(str, version))}"),
    ]


def _mumps_check(PETSc: Any) -> str:
    """Whether a factorisation with MUMPS works, and which ordering it chose."""
    try:
        size = 2000
        matrix = PETSc.Mat().createAIJ([size, size], nnz=3, comm=PETSc.COMM_SELF)
        for i in range(size):
            matrix[i, i] = 2.0
            matrix[i, (i + 1) % size] = -0.5
        matrix.assemble()
        solver = PETSc.PC().create(PETSc.COMM_SELF)
        solver.setOperators(matrix)
        solver.setType("lu")
        solver.setFactorSolverType("mumps")
        solver.setUp()
        ordering = solver.getFactorMatrix().getMumpsInfog(7)
    except Exception as error:
        # PETSc raises its own error classes for a missing solver
        return f"absent ({str(error).splitlines()[-1]})"
    names = {0: "AMD", 2: "AMF", 3: "SCOTCH", 4: "PORD", 5: "METIS", 6: "QAMD"}
    return f"present (ordering {names.get(ordering, ordering)})"


def _loaded_libraries(*words: str) -> list[str]:
    """Shared libraries of this process whose name holds one of the words."""
    try:
        lines = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    files = {os.path.realpath(line.split()[-1]) for line in lines if len(line.split()) > 5}
    return sorted(f for f in files if any(word in Path(f).name.lower() for word in words))
