"""A wheel as others install it: one package, typed, with its scenes' commands working from it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built without network, from the packages that are here."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", str(ROOT)]
    options = ["--no-deps", "--no-build-isolation", "-q", "-w", str(folder)]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    zipfile.ZipFile(wheel).extractall(folder)
    return folder


def test_nothing_but_bladefem_goes_into_site_packages(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"bladefem"}
    assert "bladefem/py.typed" in names
    assert {f"bladefem/report/page.{kind}" for kind in ("css", "html", "js", "md")} <= set(names)


def test_no_source_of_the_wheel_asks_for_a_package_called_geometry(installed):
    wanted = re.compile(r'^\s*(from|import) geometry\b|"geometry\.|code=\("geometry"', re.MULTILINE)
    asking = [
        str(file) for file in installed.rglob("*.py") if wanted.search(file.read_text("utf-8"))
    ]
    assert asking == []


def run_from(installed: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command with the installed package alone on the path, in a folder of its own."""
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-m", "bladefem.cli.main", *words]
    return subprocess.run(
        command, cwd=installed, env=environment, capture_output=True, text=True, check=False
    )


def test_check_and_mesh_work_from_the_wheel(installed):
    """The mesh is made in a process of its own, by module name."""
    scene = str(ROOT / "scenes" / "plane.toml")
    reported = run_from(installed, "check", scene)
    assert reported.returncode == 0, reported.stderr
    made = run_from(installed, "mesh", scene, "--set", "mesh.size=8 mm", "-o", "out")
    assert made.returncode == 0, made.stderr
    assert "body blade, cells" in made.stdout


def test_a_numpy_that_dolfinx_was_not_compiled_for_is_named(tmp_path):
    """A stand-in for dolfinx fails as the real one does beside a newer numpy."""
    package = tmp_path / "dolfinx"
    package.mkdir()
    (package / "__init__.py").write_text(
        'raise ImportError("numpy.core.multiarray failed to import")\n'
    )
    code = (
        "import bladefem.errors as e\n"
        "try:\n    import bladefem.fem.compat\n"
        "except e.InputError as error:\n    print(error)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout.startswith("dolfinx cannot be loaded with numpy"), done.stderr
    assert "bladefem[run,debian12]" in done.stdout
