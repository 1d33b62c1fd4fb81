"""The one door to dolfinx, PETSc and SLEPc: versions 0.5 to 0.11 behind names that say what is
wanted.

Debian 12's dolfinx (0.5) switches ``sys.setdlopenflags`` to RTLD_GLOBAL on import and leaves it so,
after which other wheels (h5py, vtk) resolve their symbols against the wrong libraries; it is kept
from doing so here.
"""

from __future__ import annotations

import ctypes
import locale
import logging
import os
import sys
import time
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, NotSolvedError
from ..io.stage_cache import bind_h5py

# before dolfinx, so that users may import h5py after it
bind_h5py()
_setdlopenflags = sys.setdlopenflags
# not even during the import: HDF5's symbols would stay global
sys.setdlopenflags = lambda flags: None
_arguments = sys.argv
# dolfinx hands the command line to its log, and fails at file names that are no UTF-8
sys.argv = _arguments[:1]
try:
    from .petsc_start import start_petsc

    start_petsc()
    import dolfinx
    import dolfinx.fem.petsc
    import ufl
    from mpi4py import MPI
    from petsc4py import PETSc
    from slepc4py import SLEPc as SLEPc
except ModuleNotFoundError:
    raise
except (ImportError, AttributeError, RuntimeError) as error:
    # a compiled module next to a numpy that it was not compiled for
    raise InputError(
        f"dolfinx cannot be loaded with numpy {np.__version__} "
        f"({str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__}); "
        "expected the numpy that it was compiled with, on Debian 12: pip install "
        "'bladefem[run,debian12]'"
    ) from error
finally:
    sys.argv = _arguments

sys.setdlopenflags = _setdlopenflags
# options that PETSc asks for when the program ends
READ_AT_THE_END = ("options_", "malloc_", "memory_view", "objects_dump", "mpidump")

# from this size on a block of memory goes back to the system when it is freed [bytes]: smaller ones
# come and go so often that new pages would cost more than they spare
LARGE_BLOCK = 12_000_000
# options of GNU's mallopt
TRIM_THRESHOLD, MMAP_THRESHOLD, MMAP_MAX = -1, -3, -4
MOST_BLOCKS = 65_536
NO_TRIM = 2**31 - 1


def return_large_blocks() -> None:
    """Have the C library return large blocks that are freed to the system.

    MPI turns that off as it starts. What is freed would then stay in pieces between other blocks,
    into which nothing large fits.
    """
    _set_allocator(MOST_BLOCKS, LARGE_BLOCK)


def _set_allocator(blocks: int, end: int) -> None:
    """Set the number of large blocks that the C library takes apart from its heap, and what may be
    free at the end of that before it shrinks [bytes].
    """
    # GNU only
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(MMAP_MAX, blocks)
        mallopt(MMAP_THRESHOLD, LARGE_BLOCK)
        mallopt(TRIM_THRESHOLD, end)


@contextmanager
def pages_kept(large: bool = False) -> Iterator[None]:
    """What is freed amid the block serves again there, until ``memory.give_back``, or until such a
    block within it ends: the system clears pages that it hands out anew, which is a tenth of the
    processor time of a factorisation.

    Args:
        large: blocks of any size; else those below ``LARGE_BLOCK``.
    """
    _set_allocator(0 if large else MOST_BLOCKS, NO_TRIM)
    try:
        yield
    finally:
        return_large_blocks()


return_large_blocks()

# meshio's word: dolfinx's cell, degree
CELLS = {
    "triangle": ("triangle", 1),
    "triangle6": ("triangle", 2),
    "quad": ("quadrilateral", 1),
    "quad9": ("quadrilateral", 2),
    "tetra": ("tetrahedron", 1),
    "tetra10": ("tetrahedron", 2),
    "hexahedron": ("hexahedron", 1),
    "hexahedron27": ("hexahedron", 2),
}


@contextmanager
def no_error_messages() -> Iterator[None]:
    """PETSc raises its errors without printing them first."""
    try:
        PETSc.Sys.pushErrorHandler("ignore")
    except ValueError:
        PETSc.Sys.pushErrorHandler("return")
    try:
        yield
    finally:
        PETSc.Sys.popErrorHandler()


@contextmanager
def decimal_points() -> Iterator[None]:
    """Numbers are printed with points meanwhile: SCOTCH prints its own and reads them again, and
    fails where the caller's locale has decimal commas.
    """
    if locale.localeconv()["decimal_point"] == ".":
        yield
        return
    before = locale.setlocale(locale.LC_NUMERIC)
    locale.setlocale(locale.LC_NUMERIC, "C")
    try:
        yield
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


# meshes of one rank, and on the communicator of each a vector that keeps PETSc's copy of it
_guards: list[tuple[weakref.ref[Any], PETSc.Vec]] = []


def build_mesh(
    comm: MPI.Comm,
    cell_type: str,
    cells: np.ndarray,
    points: np.ndarray,
    cut: bool = True,
) -> tuple[Any, np.ndarray]:
    """A distributed dolfinx mesh, and for each cell of this rank the row of ``cells`` that it came
    from.

    Args:
        cells: (nc, k) numbers into points, gmsh's order in the element, the same on every rank.
        points: (n, gdim) [m], the same on every rank.
        cut: cells go to ranks so that few nodes are shared; else in their order, as cells without
            common faces must: the partitioner of dolfinx 0.5 does not end on these.
    """
    free_dropped_matrices()
    shape, degree = CELLS[cell_type]
    permutation = dolfinx.cpp.io.perm_gmsh(dolfinx.cpp.mesh.to_type(shape), cells.shape[1])
    mine = np.array_split(cells[:, permutation], comm.size)[comm.rank].astype(np.int64)
    x = np.array_split(points, comm.size)[comm.rank]
    gdim = points.shape[1]
    how = {} if cut or comm.size == 1 else {"partitioner": _stay(len(mine), comm.rank)}
    if hasattr(ufl, "VectorElement"):
        domain = ufl.Mesh(
            ufl.VectorElement("Lagrange", ufl.Cell(shape, geometric_dimension=gdim), degree)
        )
        with decimal_points():
            mesh = dolfinx.mesh.create_mesh(comm, mine, x, domain, **how)
    else:
        import basix.ufl

        domain = ufl.Mesh(basix.ufl.element("Lagrange", shape, degree, shape=(gdim,)))
        x = np.ascontiguousarray(x)
        with decimal_points():
            mesh = dolfinx.mesh.create_mesh(comm, cells=mine, x=x, e=domain, **how)
    if comm.size == 1:
        _guards.append((weakref.ref(mesh), PETSc.Vec().createMPI(1, comm=mesh.comm)))
    return mesh, np.asarray(mesh.topology.original_cell_index)


def free_dropped_matrices() -> None:
    """Free the matrices on the meshes of one rank that nobody has any more.

    PETSc keeps what Python drops until its communicator is cleaned up, which is collective, and
    every mesh of dolfinx has a communicator of its own: runs one after the other in one process
    left 60 to 70 MB each for 7000 degrees of freedom. Meshes of several ranks are left alone, since
    ranks drop at different times, and so is what outlives its mesh.
    """
    clean = getattr(PETSc, "garbage_cleanup", None)
    if clean is None:
        # before 3.18 what is dropped is freed
        _guards.clear()
        return
    clean(PETSc.COMM_SELF)
    if MPI.COMM_WORLD.size == 1:
        clean(PETSc.COMM_WORLD)
    alive = []
    for mesh, guard in _guards:
        clean(guard.comm)
        if mesh() is None:
            guard.destroy()
        else:
            alive.append((mesh, guard))
    _guards[:] = alive


def _stay(count: int, rank: int) -> Callable[..., Any]:
    """A partitioner that leaves this rank's cells where they are."""
    where = np.full((count, 1), rank, np.int32)

    def destinations(*_: Any) -> Any:
        make = getattr(dolfinx.graph, "adjacencylist", None) or dolfinx.graph.create_adjacencylist
        made = make(where)
        return getattr(made, "_cpp_object", made)

    return destinations


def vector_space(mesh: Any, degree: int) -> Any:
    """Continuous Lagrange vectors with as many components as the space has dimensions."""
    gdim = mesh.geometry.dim
    if hasattr(dolfinx.fem, "functionspace"):
        return _wait_for_build(
            lambda: dolfinx.fem.functionspace(mesh, ("Lagrange", degree, (gdim,)))
        )
    return _wait_for_build(
        lambda: dolfinx.fem.VectorFunctionSpace(mesh, ("Lagrange", degree), dim=gdim)
    )


def scalar_space(mesh: Any) -> Any:
    """One value a cell."""
    make = getattr(dolfinx.fem, "functionspace", None) or dolfinx.fem.FunctionSpace
    return _wait_for_build(lambda: make(mesh, ("DG", 0)))


def quadrature_space(mesh: Any, degree: int) -> tuple[Any, np.ndarray]:
    """One value a quadrature point of each cell, and the points (q, tdim) in the unit cell."""
    import basix

    name = mesh.topology.cell_type.name
    points, _ = basix.make_quadrature(getattr(basix.CellType, name), degree)
    if hasattr(ufl, "VectorElement"):
        element = ufl.FiniteElement("Quadrature", mesh.ufl_cell(), degree, quad_scheme="default")
    else:
        import basix.ufl

        element = basix.ufl.quadrature_element(name, degree=degree)
    make = getattr(dolfinx.fem, "functionspace", None) or dolfinx.fem.FunctionSpace
    return _wait_for_build(lambda: make(mesh, element)), np.asarray(points)


def cell_dofs(space: Any) -> np.ndarray:
    """(cells of this rank with ghosts, k) local block numbers of each cell's nodes."""
    table = space.dofmap.list
    index_map = space.mesh.topology.index_map(space.mesh.topology.dim)
    rows = index_map.size_local + index_map.num_ghosts
    # a rank may have no cells, and then no width either
    width = space.dofmap.dof_layout.num_dofs
    return np.asarray(getattr(table, "array", table)).reshape(rows, width)


def compile_form(form: Any) -> Any:
    """Compile a form, see ``_wait_for_build``."""
    return _wait_for_build(lambda: dolfinx.fem.form(form))


def _wait_for_build(build: Callable[[], Any], patience: int = 12) -> Any:
    """Run what may compile; a build by another process is waited for, a dead one is named.

    Raises:
        NotSolvedError: the form compiler's cache holds a build that never finished.
    """
    for _ in range(patience):
        try:
            with _quiet_logger():
                return build()
        except (TimeoutError, RuntimeError) as error:
            if "timed out" not in str(error):
                raise
            if not _unfinished_builds(120.0):
                break
    stale = ", ".join(map(str, _unfinished_builds(np.inf))) or "none found"
    raise NotSolvedError(
        "the form compiler's cache holds a build that never finished; delete these files and "
        f"start again: {stale}"
    )


def _unfinished_builds(age: float) -> list[Path]:
    """C files without the mark of a finished build, not older than ``age`` seconds."""
    options = getattr(dolfinx.jit, "get_parameters", None) or dolfinx.jit.get_options
    folder = Path(options()["cache_dir"])
    return [
        c
        for c in folder.glob("*.c")
        if not c.with_suffix(".c.cached").exists() and time.time() - c.stat().st_mtime <= age
    ]


@contextmanager
def _quiet_logger() -> Iterator[None]:
    """ffcx and its compiler write to the root logger (and lower its level) in dolfinx 0.5; it warns
    of many points.
    """
    root = logging.getLogger()
    level = root.level
    handlers = list(root.handlers)
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Number of integration points")
            yield
    finally:
        logging.disable(logging.NOTSET)
        root.setLevel(level)
        root.handlers[:] = handlers


def assemble_matrix(form: Any) -> PETSc.Mat:
    """Assembled matrix of a bilinear form, block size of its space kept."""
    matrix = dolfinx.fem.petsc.assemble_matrix(compile_form(form))
    matrix.assemble()
    return matrix


def one_component(space: Any, degree: int) -> Any:
    """The space of one component of a vector space; None where its nodes are numbered otherwise."""
    make = getattr(dolfinx.fem, "functionspace", None) or dolfinx.fem.FunctionSpace
    scalar = _wait_for_build(lambda: make(space.mesh, ("Lagrange", degree)))
    one, all_of_them = scalar.dofmap.index_map, space.dofmap.index_map
    same = (
        np.array_equal(cell_dofs(scalar), cell_dofs(space))
        and one.local_range == all_of_them.local_range
        and np.array_equal(one.ghosts, all_of_them.ghosts)
    )
    return scalar if space.mesh.comm.allreduce(same, MPI.LAND) else None


def repeat_components(matrix: PETSc.Mat, dim: int) -> PETSc.Mat:
    """The Kronecker product with the identity (dim, dim); the given matrix is destroyed."""
    starts, columns, values = matrix.getValuesCSR()
    (rows, size), _ = matrix.sizes
    counts = np.repeat(np.diff(starts), dim)
    entry = np.repeat(starts[:-1], dim)
    ends = np.concatenate([[0], np.cumsum(counts)])
    source = np.arange(ends[-1]) + np.repeat(entry - ends[:-1], counts)
    component = np.repeat(np.tile(np.arange(dim), rows), counts)
    out = PETSc.Mat().createAIJ(
        ((dim * rows, dim * size),) * 2,
        bsize=dim,
        csr=(
            ends.astype(PETSc.IntType),
            (dim * columns[source] + component).astype(PETSc.IntType),
            values[source],
        ),
        comm=matrix.comm,
    )
    out.assemble()
    matrix.destroy()
    return out


def shared_matrix(
    shape: tuple[int, int],
    starts: np.ndarray,
    columns: np.ndarray,
    values: np.ndarray,
) -> PETSc.Mat:
    """A PETSc matrix of this rank alone on the memory of a sparse one, which must not change."""
    csr = (starts.astype(PETSc.IntType, copy=False), columns.astype(PETSc.IntType, copy=False))
    out = PETSc.Mat().createAIJWithArrays(shape, (*csr, values), comm=MPI.COMM_SELF)
    out.assemble()
    return out


def assemble_vector(form: Any) -> PETSc.Vec:
    """Assembled vector of a linear form, shares of neighbouring ranks added."""
    vector = dolfinx.fem.petsc.assemble_vector(compile_form(form))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def unused_options() -> list[str]:
    """Names in PETSc's database, without their dashes, that nothing has asked for, of those that
    did not come from the environment or are read at the program's end.
    """
    outside = {word.lstrip("-") for word in os.environ.get("PETSC_OPTIONS", "").split()}
    return sorted(
        name
        for name in PETSc.Options().getAll()
        if not (option_used(name) or name in outside or name.startswith(READ_AT_THE_END))
    )


def option_used(name: str) -> bool:
    """Whether something asked PETSc's database for an option, given without its dash; petsc4py has
    no call for that.
    """
    used = ctypes.c_int(0)
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, name.encode(), ctypes.byref(used))
    return bool(used.value)
