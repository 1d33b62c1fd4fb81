"""One gmsh session a build: opened, always closed, never nested, and set so that a mesh can be made
twice the same.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from bladefem.errors import InputError

GMSH_OPTIONS = {
    "General.Terminal": 0,
    # more threads change the mesh from run to run
    "General.NumThreads": 1,
    "Mesh.RandomSeed": 1,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RandomFactor3D": 1e-12,
    # frontal-Delaunay
    "Mesh.Algorithm": 6,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFromPoints": 0,
    # node tags survive the change of order
    "Mesh.Renumber": 0,
    "Mesh.Optimize": 1,
    "Mesh.OptimizeThreshold": 0.35,
    # curving.py moves the mid-side nodes
    "Mesh.SecondOrderLinear": 1,
}


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """The gmsh module with a fresh model, closed on leaving.

    Raises:
        RuntimeError: a session is open already (gmsh has one global state; builds do not nest).
    """
    import gmsh

    if gmsh.isInitialized():
        raise RuntimeError("a gmsh session is already open; geometry builds do not nest")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in GMSH_OPTIONS.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("bladefem")
        yield gmsh
    finally:
        gmsh.finalize()


def gmsh_path(file: str | Path) -> str:
    """The name of a file for gmsh, which takes UTF-8 whatever the locale: in the locale C a name
    with umlauts is a text that has no UTF-8.

    Raises:
        InputError: the file's name is in another encoding.
    """
    try:
        return os.fsencode(file).decode()
    except UnicodeDecodeError as error:
        raise InputError(f"'{file}': expected a path in UTF-8, gmsh takes no other one") from error


@contextmanager
def gmsh_step(
    parameter: str,
    action: str,
    remedy: str = "change this parameter",
) -> Iterator[None]:
    """Turn a failure of gmsh into one sentence that names the parameter to change.

    Raises:
        InputError: whatever gmsh raised inside the block.
    """
    try:
        yield
    except Exception as error:
        # gmsh raises the bare class; anything else is our own mistake
        if type(error) is not Exception:
            raise
        reason = " ".join(str(error).split()) or "no reason given"
        raise InputError(f"{parameter}: gmsh could not {action} ({reason}); {remedy}") from error
