"""What importing and compiling must not leave behind, and a dead build that has to be named."""

import ctypes
import gc
import logging
import os
import shutil
import subprocess
import sys

import pytest
from resident import needs_readings, resident_memory
from structured import box

from bladefem.errors import NotSolvedError
from bladefem.fem import compat
from bladefem.fem.body import assemble
from bladefem.scene.tables import Material

CHILD = """
import sys
flags = sys.getdlopenflags()
import bladefem.fem.compat
assert sys.getdlopenflags() == flags, "dlopen flags changed"
import h5py
h5py.File("x", "w", driver="core", backing_store=False)["a"] = [1.0]
"""


def test_import_leaves_the_loader_alone():
    """dolfinx 0.5 sets RTLD_GLOBAL for good, after which h5py finds the wrong HDF5."""
    clean = {
        k: v
        for k, v in os.environ.items()
        if not k.startswith(("OMPI_", "PMIX_", "PRTE_", "ORTE_")) or k.startswith("OMPI_ALLOW")
    }
    done = subprocess.run([sys.executable, "-c", CHILD], capture_output=True, text=True, env=clean)
    assert done.returncode == 0, done.stderr


def test_a_dead_build_is_named(monkeypatch, tmp_path):
    (tmp_path / "libffcx_forms_1.c").write_text("")
    (tmp_path / "libffcx_forms_2.c").write_text("")
    (tmp_path / "libffcx_forms_2.c.cached").write_text("")
    name = "get_parameters" if hasattr(compat.dolfinx.jit, "get_parameters") else "get_options"
    monkeypatch.setattr(compat.dolfinx.jit, name, lambda: {"cache_dir": tmp_path})

    def build():
        raise TimeoutError("JIT compilation timed out, probably due to a failed previous compile.")

    with pytest.raises(
        NotSolvedError, match=r"never finished; .* libffcx|never finished; delete .*forms_1\.c$"
    ):
        compat._wait_for_build(build, patience=2)


def test_other_errors_pass():
    def build():
        raise RuntimeError("something else")

    with pytest.raises(RuntimeError, match="something else"):
        compat._wait_for_build(build)


def test_compiling_is_silent_and_leaves_logging_alone(caplog):
    root = logging.getLogger()
    before = root.level, list(root.handlers)

    def build():
        logging.getLogger().info("building 'libffcx'")
        logging.getLogger().setLevel(logging.DEBUG)
        return 1

    assert compat._wait_for_build(build) == 1
    assert (root.level, list(root.handlers)) == before
    assert not caplog.records


def kept_memory():
    """Of this process [bytes], with what it could give back given back."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return resident_memory()


@needs_readings
def test_matrices_that_are_dropped_are_freed():
    """Each of the four left its matrices behind, 12 bytes an entry."""
    mesh = box((12, 12, 12), (1.0, 1.0, 1.0))
    size = 12 * assemble(mesh, "blade", Material(), compat.MPI.COMM_SELF).K.getInfo()["nz_used"]
    before = kept_memory()
    for _ in range(4):
        assemble(mesh, "blade", Material(), compat.MPI.COMM_SELF)
    assert kept_memory() - before < 1.5 * size


def test_decimal_commas_of_the_callers_locale(tmp_path):
    """SCOTCH ends with an error where numbers are printed with commas."""
    made = tmp_path / "de_DE.UTF-8"
    define = shutil.which("localedef")
    if not define or subprocess.run([define, "-i", "de_DE", "-f", "UTF-8", made]).returncode:
        pytest.skip("no German locale can be made here")
    code = (
        "import locale; locale.setlocale(locale.LC_ALL, 'de_DE.UTF-8');"
        "import numpy as np; from bladefem.fem.compat import MPI, build_mesh;"
        "build_mesh(MPI.COMM_SELF, 'triangle', np.array([[0, 1, 2]]), np.eye(3)[:, :2]);"
        "assert locale.localeconv()['decimal_point'] == ','"
    )
    environment = {**os.environ, "LOCPATH": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, timeout=120)
