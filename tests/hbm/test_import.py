"""The balance is light to import: no finite elements, no pictures."""

import subprocess
import sys


def test_import_brings_neither_dolfinx_nor_pictures():
    code = (
        "import sys, bladefem.hbm.solve, bladefem.hbm.peak, bladefem.hbm.continuation; heavy = "
        "('dolfinx', 'petsc4py', 'gmsh', 'matplotlib', 'pyvista', 'pandas'); print([m for m in "
        "heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_installation_can_compile_the_kernels_ahead():
    from bladefem.friction import kernel_1d as jenkins
    from bladefem.friction import kernel_1d_exact as events
    from bladefem.friction.simd import kernel_2d as disc_batch
    from bladefem.hbm import precompile as warm
    from bladefem.hbm.solver import newton_compiled as compiled
    from bladefem.hbm.solver import point_compiled as small

    warm.compile_kernels()
    for kernel in (
        compiled.compiled_newton,
        small._compiled_points,
        jenkins.jenkins_batch,
        events.exact_batch,
        disc_batch.disc_batch,
    ):
        assert kernel.signatures
