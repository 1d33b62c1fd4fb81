"""The balance is light to import: no finite elements, no pictures."""

import subprocess
import sys


def test_import_brings_neither_dolfinx_nor_pictures():
    code = ("import sys, bladefem.hbm.api, bladefem.hbm.peak, bladefem.hbm.follow; "
            "heavy = ('dolfinx', 'petsc4py', 'gmsh', 'matplotlib', 'pyvista', 'pandas'); "
            "print([m for m in heavy if m in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
