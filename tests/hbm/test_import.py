"""The balance is light to import: no finite elements, no pictures."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
from numba.core import event


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


class CompiledKernels(event.Listener):
    """Names of the kernels of bladefem that numba compiles, but not those that it finds on disk."""

    def __init__(self):
        self.names = []

    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("bladefem"):
            self.names.append(function.__name__)

    def on_end(self, event):
        pass


def test_the_main_job_compiles_nothing_after_the_installation():
    from bladefem.friction.aft import evaluate
    from bladefem.hbm import precompile
    from bladefem.hbm.linear.condensation import condense
    from bladefem.hbm.response import response
    from bladefem.hbm.stability import stability_verdict

    precompile.compile_kernels()
    plane = precompile._plane_model()
    compiled = CompiledKernels()
    with event.install_listener("numba:compile", compiled):
        points = list(response(plane, [0.9, 1.0, 1.2], 3, 64))
        stability_verdict(plane, points[-1])
        free = replace(precompile._free_model(), excitation={1: np.full(1, 3.0)})
        assert any(point.walk is not None for point in response(free, [0.9, 1.0, 1.2], 3, 64))
        assert np.isfinite(condense(plane, 1.0, 3).G).all()
        for precision in ("single", "double"):
            for jacobian in (True, False):
                w = np.full((1, 3, 7), 0.1)
                evaluate(plane.elements, w, 64, jacobian, precision=precision)
    assert compiled.names == []
