"""Stages are found again when, and only when, they were made from the same things."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pandas as pd
import pytest
import scipy.sparse

from bladefem.data import Elements, ModeSet, Patch, PortModel, PressureMap, RigidBody
from bladefem.errors import InputError
from bladefem.io.array_codec import read_npz, write_npz
from bladefem.io.stage_cache import cached_stage, code_of, key_of, open_folder, write_atomically
from bladefem.scene.tables import Scene
from bladefem.util.message import by_level, warning
from geometry.mesh import Mesh, Pair, Sector

RNG = np.random.default_rng(1)


def small_mesh() -> Mesh:
    nodes = np.array([[0, 1], [2, 3]])
    pair = Pair("cyclic_low", "cyclic_high", nodes, np.eye(3), np.zeros(3))
    return Mesh(
        RNG.random((4, 3)),
        "tetra",
        {"blade": np.array([[0, 1, 2, 3]])},
        {"clamp": np.array([[0, 1, 2]])},
        {"tip_mid": np.array([3])},
        {"cyclic": pair},
        Sector(36, np.eye(3), np.zeros(3)),
        report={"cells": 1, "worst": 0.1, "words": ["a", "b"], "none": None},
    )


def small_patch() -> Patch:
    return Patch(
        "this",
        RNG.random((3, 3)),
        RNG.random(3),
        RNG.random((3, 3, 3)),
        np.array([[0, 1, 2]]),
        np.arange(3),
    )


NOUNS = [
    small_mesh(),
    ModeSet(np.array([220.9]), RNG.random((1, 5, 3)) + 1j, 3, np.array([1e-12])),
    PortModel(
        np.array([0.0, 3.0]),
        RNG.random((4, 2)),
        RNG.random((4, 4)),
        {"contact": slice(0, 3), "load": slice(3, 4)},
    ),
    small_patch(),
    PressureMap(small_patch(), RNG.random(3), np.zeros(3), 1e-15),
    Elements(np.ones(2), np.zeros(2), np.full(2, 0.3), np.array([5.0, -np.inf])),
    RigidBody(np.eye(6), RNG.random((9, 6))),
    Scene(),
    {"list": [1, 2.5, "x", None, True], ("a", 1): (1 + 2j, np.float64(0.1)), "nan": float("nan")},
]


def assert_same(a, b):
    assert type(a) is type(b) or np.isscalar(a)
    if hasattr(a, "__dataclass_fields__"):
        for f in fields(a):
            assert_same(getattr(a, f.name), getattr(b, f.name))
    elif isinstance(a, dict):
        assert list(a) == list(b)
        for k in a:
            assert_same(a[k], b[k])
    elif isinstance(a, (list, tuple)):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    else:
        np.testing.assert_equal(a, b)


@pytest.mark.parametrize("noun", NOUNS, ids=lambda n: type(n).__name__)
def test_nouns_come_back_bit_by_bit(noun, tmp_path):
    write_npz(tmp_path / "x.npz", "key", noun)
    assert_same(noun, read_npz(tmp_path / "x.npz", "key"))


def test_a_stored_warning_stays_a_warning(tmp_path):
    said = [warning("coarse", "refine", "3 of 4 cells"), "plain"]
    write_npz(tmp_path / "x.npz", "key", said)
    back = by_level(read_npz(tmp_path / "x.npz", "key"))
    assert back == by_level(said)
    assert back["warning"][0].parts == ("coarse", "refine", "3 of 4 cells")


@pytest.mark.parametrize("rows", [2, 0])
def test_tables_come_back(rows, tmp_path):
    """With types of their columns, also of one without rows; a key sees each value."""
    table = pd.DataFrame(
        {"mode": [1, 2], "speed": [0.1, np.nan], "wave": ["with", None], "own": [True, False]}
    ).head(rows)
    write_npz(tmp_path / "t.npz", "k", table)
    pd.testing.assert_frame_equal(read_npz(tmp_path / "t.npz", "k"), table)
    if rows:
        assert key_of(table) != key_of(table.assign(mode=[1, 3]))
        with pytest.raises(TypeError, match="rows are not numbered from 0"):
            write_npz(tmp_path / "t.npz", "k", table.iloc[1:])


def test_sparse_matrices_come_back(tmp_path):
    matrix = scipy.sparse.random(5, 7, 0.3, "csr", random_state=1)
    write_npz(tmp_path / "x.npz", "key", {"B": matrix})
    back = read_npz(tmp_path / "x.npz", "key")["B"]
    assert back.shape == (5, 7) and abs(back - matrix).max() == 0


@pytest.mark.parametrize("value", [object(), np.array([object()]), {1, 2}, print])
def test_what_has_no_encoding_is_refused(value, tmp_path):
    with pytest.raises(TypeError, match="cannot be stored"):
        write_npz(tmp_path / "x.npz", "key", value)


def test_equal_content_has_an_equal_key():
    assert key_of(Scene(), np.arange(3), 0.1) == key_of(Scene(), np.arange(3), 0.1)
    keys = {
        key_of(x)
        for x in (
            1,
            1.0,
            "1",
            None,
            np.arange(3),
            np.arange(3.0),
            np.arange(3).reshape(3, 1),
            Scene(),
            Scene(title="other"),
            [1, 2],
            (1, 2),
        )
    }
    assert len(keys) == 11


def test_code_is_part_of_what_a_result_depends_on():
    assert code_of("geometry") == code_of("geometry") != code_of("bladefem.friction")


def test_stage_is_computed_once_and_again_when_its_input_changes(tmp_path):
    calls = []

    def compute():
        calls.append(1)
        return {"x": np.arange(3.0)}

    assert cached_stage(tmp_path, "mesh", "a", compute)[1] is None
    value, seconds = cached_stage(tmp_path, "mesh", "a", compute)
    assert 0 <= seconds < 10 and len(calls) == 1
    np.testing.assert_array_equal(value["x"], np.arange(3.0))
    assert cached_stage(tmp_path, "mesh", "b", compute)[1] is None
    assert len(calls) == 2
    assert cached_stage(None, "mesh", "b", compute)[1] is None


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04", b"not a zip"])
def test_damaged_stage_is_computed_again(tmp_path, damage):
    cached_stage(tmp_path, "modes", "a", lambda: 1.5)
    (tmp_path / "stages" / "modes.npz").write_bytes(damage)
    assert cached_stage(tmp_path, "modes", "a", lambda: 2.5) == (2.5, None)


def test_a_stage_with_any_flipped_bit_is_computed_again_or_as_it_was(tmp_path):
    """Zip heads may then ask for encryption or a compression that nobody knows."""
    cached_stage(tmp_path, "modes", "a", lambda: 1.5)
    file = tmp_path / "stages" / "modes.npz"
    whole = file.read_bytes()
    for place in range(len(whole) - 100, len(whole)):
        for bit in range(8):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << bit
            file.write_bytes(damaged)
            assert cached_stage(tmp_path, "modes", "a", lambda: 1.5)[0] == 1.5


def test_interrupted_stage_leaves_the_finished_ones(tmp_path):
    cached_stage(tmp_path, "mesh", "a", lambda: 1.0)

    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached_stage(tmp_path, "modes", "a", interrupted)
    assert sorted(p.name for p in (tmp_path / "stages").iterdir()) == ["mesh.npz"]
    assert cached_stage(tmp_path, "mesh", "a", lambda: 2.0)[0] == 1.0


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    with pytest.raises(KeyboardInterrupt), write_atomically(tmp_path / "x.txt") as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        open_folder(tmp_path / "file" / "run")
    with pytest.raises(InputError, match="cannot be written"):
        open_folder("/proc/run")


@pytest.mark.mpi
def test_every_rank_gets_the_stage_and_its_error(tmp_path_factory):
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("run"))
    assert cached_stage(folder, "x", "k", lambda: np.arange(4), comm)[1] is None
    value, seconds = cached_stage(folder, "x", "k", lambda: None, comm)
    assert seconds is not None and value.tolist() == [0, 1, 2, 3]
    with pytest.raises(InputError, match="cannot be written"):
        cached_stage("/proc/run", "x", "k", lambda: 1, comm)


WRITE = """
import numpy as np, xarray as xr
from bladefem.io.stage_cache import write_results, read_results
write_results({path!r}, {{"a": xr.Dataset({{"x": ("t", np.arange(3.0))}})}})
assert read_results({path!r}, "a").x.values.tolist() == [0, 1, 2]
"""
ORDERS = {
    "dolfinx first": "import dolfinx",
    "fem first": "import bladefem.fem.compat",
    "h5py first": "import h5py, dolfinx",
    "store first": "import bladefem.io.stage_cache, dolfinx",
    "gmsh between": "import gmsh, dolfinx",
}


@pytest.mark.parametrize("first", ORDERS.values(), ids=ORDERS)
def test_results_are_written_in_any_order_of_imports(first, tmp_path):
    """dolfinx 0.5 shows its HDF5 to all; a later h5py must not fall for it."""
    code = first + WRITE.format(path=str(tmp_path / "r.nc"))
    env = {
        k: v
        for k, v in os.environ.items()
        if not k.startswith(("PMIX_", "OMPI_COMM", "OMPI_UNIVERSE", "ORTE_"))
    }
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stderr
