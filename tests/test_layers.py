"""The straight line of layers, the two borders, and what an import may load."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted([*ROOT.glob("bladefem/**/*.py"), *ROOT.glob("geometry/**/*.py")])

# From left to right; a layer imports only from itself and its left.
LAYERS = [
    "errors",
    "util",
    "geometry",
    "scene",
    "data",
    "io",
    "fem",
    "contact",
    "reduction",
    "friction",
    "time",
    "hbm",
    "balance",
    "damper",
    "wheel",
    "study",
    "view",
    "report",
    "cli",
]
# Each foreign library has one home.
HOMES = {
    "gmsh": "geometry",
    "dolfinx": "fem",
    "ufl": "fem",
    "basix": "fem",
    "petsc4py": "fem",
    "slepc4py": "fem",
    "matplotlib": "view",
    "pyvista": "view",
    "vtk": "view",
    "tqdm": "util",
    "argparse": "cli",
}
# The public names are loaded where they are used first; nothing of bladefem imports its own front
# door.
FRONT = ROOT / "bladefem" / "__init__.py"


def layer_of(module: str) -> str:
    """Layer of a dotted module name."""
    first, _, rest = module.partition(".")
    name = "geometry" if first == "geometry" else rest.partition(".")[0]
    return name


def module_of(path: Path) -> str:
    """Dotted name of a file; a package is its ``__init__``."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def imports(path: Path) -> Iterator[str]:
    """Absolute names of all modules that a file imports, also inside functions."""
    package = module_of(path).split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            base = [*base, *(node.module.split(".") if node.module else [])]
            # "from . import solve": the name may be a module
            yield from (
                (".".join([*base, alias.name]) for alias in node.names)
                if len(base) == 1
                else [".".join(base)]
            )


@pytest.mark.parametrize("path", [p for p in FILES if p != FRONT], ids=module_of)
def test_layers_import_only_from_their_left(path):
    here = layer_of(module_of(path))
    # geometry draws whole scenes: it may read their nouns
    allowed = LAYERS[: LAYERS.index(here) + 1] + (["scene"] if here == "geometry" else [])
    for module in imports(path):
        if module.partition(".")[0] in ("bladefem", "geometry"):
            assert layer_of(module) in allowed, (
                f"{module_of(path)} ({here}) imports {module} to its right"
            )


@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_each_library_has_one_home(path):
    here = layer_of(module_of(path))
    for module in imports(path):
        home = HOMES.get(module.partition(".")[0])
        assert home is None or home == here, (
            f"{module_of(path)} imports {module}, which only {home} knows"
        )


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
    ],
)
def test_an_import_loads_no_more_than_it_needs(module, absent):
    code = f"import sys, {module}; print([m for m in {absent} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=dict(os.environ)
    )
    assert done.stdout == "[]\n", done.stdout + done.stderr
