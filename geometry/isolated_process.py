"""A build in a process of its own: gmsh may crash there without taking the session, or the other
ranks, with it.

    python -m geometry.isolated_process JOB ANSWER

reads a pickled scene from the file JOB, and writes a Mesh or the reason of a refusal to the file
ANSWER.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from bladefem.errors import InputError
from bladefem.scene.kinds import kind_named

from .builders import build_here
from .mesh import Mesh

if TYPE_CHECKING:
    from bladefem.scene.tables import Scene

# seconds; the largest meshes that are accepted take a tenth of it
TIME_LIMIT_SECONDS = 900
# element size of the second try
SECOND_TRY_SIZE = 0.9
ROOT = Path(__file__).parents[1]
# a child that saw these would join the ranks
MPI_VARIABLES = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "ORTE_", "HYDRA_", "MPI_")


def build_isolated(scene: Scene) -> Mesh:
    """The mesh of a scene, made in a child process; after a crash with the other algorithm and
    smaller elements, which is noted in its report.

    Raises:
        InputError: a parameter has to change; also when every try crashed or took longer than
            TIME_LIMIT_SECONDS.
        RuntimeError: the child failed in another way; the message holds its last words.
    """
    kind_named(scene.kind)
    failure = ""
    for size in _mesh_attempts(scene.mesh):
        answer = _ask_child(SimpleNamespace(**vars(scene) | {"mesh": size}))
        if isinstance(answer, Mesh):
            return _with_note(answer, scene.mesh, size, failure) if failure else answer
        if isinstance(answer, Exception):
            raise answer
        failure = answer
    raise InputError(
        f"mesh.size: gmsh {failure} on this scene of kind '{scene.kind}' with both algorithms, "
        "expected a geometry that it can mesh; change mesh.size, or the parameter that was "
        "changed last"
    )


def _mesh_attempts(size: Any) -> list[Any]:
    """Mesh settings to try one after the other."""
    other = "delaunay" if size.algorithm == "hxt" else "hxt"
    smaller = {"size": SECOND_TRY_SIZE * size.size} if size.size else {}
    return [size, replace(size, algorithm=other, **smaller)]


def _with_note(mesh: Mesh, asked: Any, used: Any, failure: str) -> Mesh:
    """The mesh with a note on the settings that it was made with in place of those asked for."""
    smaller = f" and elements {used.size / asked.size:.2g} times as large" if asked.size else ""
    note = (
        f"gmsh {failure} with mesh.algorithm = {asked.algorithm!r}: meshed with "
        f"{used.algorithm!r}{smaller}"
    )
    return replace(mesh, report={**mesh.report, "notes": (*mesh.report.get("notes", ()), note)})


def _ask_child(scene: SimpleNamespace) -> Mesh | Exception | str:
    """The child's answer; a word when it died or did not end."""
    with tempfile.TemporaryDirectory(prefix="bladefem-") as folder:
        job = Path(folder, "job")
        answer = Path(folder, "answer")
        job.write_bytes(pickle.dumps(scene))
        try:
            done = subprocess.run(
                [sys.executable, "-m", "geometry.isolated_process", job, answer],
                env=_child_environment(),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=TIME_LIMIT_SECONDS,
            )
        except subprocess.TimeoutExpired:
            return f"did not end in {TIME_LIMIT_SECONDS} s"
        if done.returncode < 0:
            return f"crashed (signal {-done.returncode})"
        if done.returncode:
            raise RuntimeError(
                f"the process that builds the mesh failed: {done.stderr.strip()[-1000:]}"
            )
        return pickle.loads(answer.read_bytes())


def _child_environment() -> dict[str, str]:
    """This process's environment without what belongs to MPI_VARIABLES, the project's folder first
    on the path.
    """
    clean = {
        name: value for name, value in os.environ.items() if not name.startswith(MPI_VARIABLES)
    }
    path = [str(ROOT), *filter(None, [clean.get("PYTHONPATH")])]
    return clean | {"PYTHONPATH": os.pathsep.join(path)}


def run_child(job: str, answer: str) -> None:
    """The child."""
    scene = pickle.loads(Path(job).read_bytes())
    try:
        result: Mesh | InputError = build_here(scene)
    except InputError as error:
        # without its cause, which need not be picklable
        result = InputError(str(error))
    Path(answer).write_bytes(pickle.dumps(result, protocol=pickle.HIGHEST_PROTOCOL))


if __name__ == "__main__":
    run_child(*sys.argv[1:])
