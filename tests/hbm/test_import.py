"""The balance is light to import: no finite elements, no pictures."""

import subprocess
import sys


def test_import_brings_neither_dolfinx_nor_pictures():
    code = ("import sys, bladefem.hbm.api, bladefem.hbm.peak, bladefem.hbm.follow; "
            "heavy = ('dolfinx', 'petsc4py', 'gmsh', 'matplotlib', 'pyvista', 'pandas'); "
            "print([m for m in heavy if m in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_installation_can_compile_the_kernels_ahead():
    from bladefem.friction import disc_batch, events, jenkins
    from bladefem.hbm import compiled, small, warm
    warm.compile_kernels()
    for kernel in (compiled.compiled_newton, small._points, jenkins.jenkins_batch, events._batch,
                   disc_batch.disc_batch):
        assert kernel.signatures
