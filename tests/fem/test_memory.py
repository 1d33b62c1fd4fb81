"""The estimate of memory and its refusal."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from resident import needs_readings, resident_memory
from structured import box, sector

from bladefem.errors import InputError
from bladefem.fem import compat, memory, mumps
from bladefem.fem.all_diameters import all_diameters
from bladefem.fem.body import assemble
from bladefem.fem.compat import LARGE_BLOCK, MPI
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import flexible
from bladefem.fem.memory import (
    available_memory,
    check_memory,
    drop_values,
    modal_solve_memory,
    storage_remark,
)
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material, Scene
from bladefem.study.pipeline.bodies import Bodies
from geometry.mesh import cut_face_nodes


@pytest.mark.parametrize(
    "dofs, ranks, on_disk, measured",
    [
        (49_632, 1, False, 0.441e9),
        (148_773, 1, False, 1.318e9),
        (495_732, 1, False, 6.204e9),
        (49_632, 1, True, 0.370e9),
        (148_773, 1, True, 0.904e9),
        (495_732, 1, True, 3.409e9),
        (49_632, 2, False, 0.682e9),
        (148_773, 2, False, 2.007e9),
    ],
)
def test_model_follows_the_measured_peaks(dofs, ranks, on_disk, measured):
    """Wedge sector, one complex nodal diameter, all ranks together."""
    assert modal_solve_memory(dofs, ranks, on_disk) == pytest.approx(measured, rel=0.07)


@pytest.mark.parametrize("dofs, cut, measured", [(47_175, 3672, 1.19e9), (87_885, 5544, 2.48e9)])
def test_wide_cut_faces_are_part_of_the_model(dofs, cut, measured):
    """A sector like a block; a bladed one's are in the peaks above."""
    assert modal_solve_memory(dofs, cut=cut) == pytest.approx(measured, rel=0.07)
    assert modal_solve_memory(73_707, cut=1428) == modal_solve_memory(73_707)


def test_a_sector_is_refused_for_its_cut_faces():
    """354 123 degrees of freedom fit into 8 GB, 14 256 of them on cut faces do not."""
    assert not check_memory(354_123, MPI.COMM_SELF, free=8e9).on_disk
    with pytest.raises(InputError, match=r"354123 degrees of freedom"):
        check_memory(354_123, MPI.COMM_SELF, free=8e9, cut=14_256)


def test_assembly_asks_for_the_memory_of_its_cut_faces():
    mesh = sector(12, (9, 6, 4), "tetra10")
    plan = assemble(mesh, "blade", Material(2e11, 0.3, 7800.0)).plan
    assert plan.memory > modal_solve_memory(3 * len(mesh.points))


def test_a_million_is_predicted_to_fit_into_20_gib():
    assert modal_solve_memory(1_000_000, on_disk=True) < modal_solve_memory(1_000_000) < 20 * 2**30


def test_too_large_is_refused_with_advice():
    with pytest.raises(
        InputError, match=r"1000000 degrees of freedom .* 2.0 GB are free; expected"
    ):
        check_memory(1_000_000, MPI.COMM_WORLD, free=2e9)


@pytest.mark.parametrize(
    "names",
    [
        ("memory.max", "memory.current", "memory.stat", "inactive_file"),
        ("limit_in_bytes", "usage_in_bytes", "memory.stat", "total_inactive_file"),
    ],
)
def test_files_that_a_container_keeps_in_memory_are_free(tmp_path, monkeypatch, names):
    """As the kernel counts: of 3 MB with 2.9 MB in use 2 MB are files that can go."""
    files = [tmp_path / name for name in names[:3]]
    for file, text in zip(
        files, ("3000000\n", "2900000\n", f"anon 900000\n{names[3]} 2000000\n"), strict=True
    ):
        file.write_text(text)
    monkeypatch.setattr(memory, "CONTAINER_FILES", ((*files, names[3]),))
    assert available_memory() == 2.1e6
    files[0].write_text("max\n")
    assert available_memory() > 3e6
    # more in use than the limit, as after it was lowered
    files[0].write_text("100\n")
    assert available_memory() == 0
    with pytest.raises(InputError, match=r" 0\.0 GB are free; expected at most about 0 degrees"):
        check_memory(1_000_000, MPI.COMM_SELF)


def test_a_small_solve_fits_in_memory():
    plan = check_memory(1000, MPI.COMM_SELF)
    assert 0 < plan.memory < available_memory() and not plan.on_disk


def between_the_ways(dofs, cut=0):
    """Free memory in which a solve fits with the factors on disk only."""
    ways = (modal_solve_memory(dofs, on_disk=on_disk, cut=cut) for on_disk in (False, True))
    return sum(ways) / 2


def test_short_memory_puts_factors_on_disk(monkeypatch, tmp_path):
    """The same frequencies; the plan says so, and the files are gone afterwards."""
    monkeypatch.setenv("MUMPS_OOC_TMPDIR", str(tmp_path))
    mesh = sector(8, (5, 3, 2), bump=0.2)
    body = assemble(mesh, "blade", Material(), MPI.COMM_SELF)
    expected = all_diameters(body, 6)
    free = between_the_ways(3 * int((body.rows >= 0).sum()), 3 * cut_face_nodes(mesh))
    monkeypatch.setattr(memory, "available_memory", lambda: free)
    small = assemble(mesh, "blade", Material(), MPI.COMM_SELF)
    assert small.plan.on_disk and str(tmp_path) in storage_remark(small.plan)[0]
    flex = flexible(constrain(small, "clamp", 1))
    assert any(tmp_path.iterdir())
    flex.con.K.core.release()
    for a, b in zip(all_diameters(small, 6), expected, strict=True):
        np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-8)
    assert not any(tmp_path.iterdir())


def test_blades_without_cut_faces_too(monkeypatch, tmp_path):
    monkeypatch.setenv("MUMPS_OOC_TMPDIR", str(tmp_path))
    mesh = box((6, 2, 2), (0.1, 0.02, 0.02))
    expected = modes(constrain(assemble(mesh, "blade", Material(), MPI.COMM_SELF)), 5)
    monkeypatch.setattr(memory, "available_memory", lambda: between_the_ways(3 * len(mesh.points)))
    con = constrain(assemble(mesh, "blade", Material(), MPI.COMM_SELF))
    flex = flexible(con)
    assert any(tmp_path.iterdir())
    found = modes(con, 5, flex)
    np.testing.assert_allclose(found.frequencies, expected.frequencies, rtol=1e-8)


def test_a_full_disk_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MUMPS_OOC_TMPDIR", str(tmp_path / "missing"))
    with pytest.raises(InputError, match=r"GB on disk, 0\.0 GB are free in .*missing"):
        check_memory(100_000, MPI.COMM_SELF, free=between_the_ways(100_000))


def test_a_run_says_that_factors_are_on_disk(monkeypatch, tmp_path):
    """Of bodies that were assembled; without, there is nothing to say."""
    monkeypatch.setenv("MUMPS_OOC_TMPDIR", str(tmp_path))
    mesh = sector(8, (5, 3, 2), bump=0.2)
    free = between_the_ways(3 * len(np.unique(mesh.bodies["blade"])), 3 * cut_face_nodes(mesh))
    bodies = Bodies(Scene(), mesh, MPI.COMM_SELF)
    monkeypatch.setattr(memory, "available_memory", lambda: free)
    assert not bodies.storage_remarks
    assert bodies.still_blade.plan.on_disk
    assert str(tmp_path) in bodies.storage_remarks[0]


BLOCK_THAT_GOES_BACK = """
import ctypes
from bladefem.fem.compat import LARGE_BLOCK
from resident import resident_memory

library = ctypes.CDLL(None)
library.malloc.restype = ctypes.c_void_p
library.malloc.argtypes = [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]
before = resident_memory()
large = library.malloc(4 * LARGE_BLOCK)
ctypes.memset(large, 1, 4 * LARGE_BLOCK)
above = library.malloc(1000)
assert resident_memory() - before > 3.9 * LARGE_BLOCK
library.free(large)
assert resident_memory() - before < LARGE_BLOCK
"""


PAGES_THAT_SERVE_AGAIN = """
import ctypes, resource
from resident import resident_memory
from bladefem.fem.compat import LARGE_BLOCK, pages_kept
from bladefem.fem.memory import give_back
library = ctypes.CDLL(None)
library.malloc.restype = library.memset.restype = ctypes.c_void_p
library.memset.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t]
library.malloc.argtypes, library.free.argtypes = [ctypes.c_size_t], [ctypes.c_void_p]
def filled():
    block = library.malloc(4 * LARGE_BLOCK)
    library.memset(block, 1, 4 * LARGE_BLOCK)
    return block
def cleared():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt * resource.getpagesize()
before = resident_memory()
with pages_kept(large=True):
    block = filled()
    above = library.malloc(1000)
    library.free(block)
    assert resident_memory() - before > 3.9 * LARGE_BLOCK
    handed_out = cleared()
    library.free(filled())
    assert cleared() - handed_out < LARGE_BLOCK / 10
give_back()
assert resident_memory() - before < LARGE_BLOCK / 10
block = filled()
library.free(block)
assert resident_memory() - before < LARGE_BLOCK / 10
"""


@needs_readings
@pytest.mark.parametrize("script", [BLOCK_THAT_GOES_BACK, PAGES_THAT_SERVE_AGAIN])
def test_large_blocks_go_back_to_the_system(script):
    """Those below another one that is still there, too, which MPI's settings keep; amid a block
    that asks for it their pages wait, to serve again.

    In a process of its own: one that ran other tests may have a hole that the block fits into.
    """
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
    environment = {**os.environ, "PYTHONPATH": paths}
    subprocess.run([sys.executable, "-c", script], env=environment, check=True, timeout=120)


def test_factors_lie_in_the_heap_only_where_the_count_takes_their_place(monkeypatch):
    """Those that are kept would leave the pages of others in pieces."""
    heap, seen = [False], []
    numeric = mumps._factorise_numeric

    def watched(factorise):
        seen.append(heap[-1])
        return numeric(factorise)

    monkeypatch.setattr(compat, "_set_allocator", lambda blocks, _: heap.append(blocks == 0))
    monkeypatch.setattr(mumps, "_factorise_numeric", watched)
    body = assemble(sector(8, (4, 3, 1), bump=0.2), "blade", Material())
    modes(constrain(body, "clamp", 1), 3)
    assert seen == [True, True]
    seen.clear()
    con = constrain(body, "clamp", 1)
    modes(con, 3, flexible(con))
    assert seen == [False, True]
    assert not heap[-1]


@needs_readings
def test_values_that_nobody_reads_give_their_memory_back():
    """Whole pages only: what stands before and behind them stays."""
    values = np.ones(4 * LARGE_BLOCK // 8)
    inside = values[7:-7]
    before = resident_memory()
    drop_values(inside)
    assert before - resident_memory() > 3.9 * LARGE_BLOCK
    assert (values[:7] == 1).all() and (values[-7:] == 1).all()
    drop_values(np.ones(3))
