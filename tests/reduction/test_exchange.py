"""Matrices written as DMIG in all three kinds of fields come back; what cannot be read is reported."""

import doctest
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.hbm import model as hbm_model
from bladefem.reduction.beam import beam_matrices
from bladefem.reduction.matrices import port_model_from_matrices, read_matrices

SHORT = """$ a spring and a mass, symmetric, and a real square matrix
DMIG    STIF           0       6       1
DMIG    STIF          27       1              27       1   3.+5
              28       1 -2.5+5
DMIG    STIF          28       1              28       1   2.5+5
GRID          27
DMIG    GYRO           0       1       2
DMIG    GYRO          27       1              28       1  1.0D-3
               4       0    -1.0
"""


def test_short_fields(tmp_path):
    (tmp_path / "a.bdf").write_text(SHORT)
    found = read_matrices(tmp_path / "a.bdf")
    assert found["dofs"].tolist() == [[4, 0], [27, 1], [28, 1]]
    np.testing.assert_array_equal(found["STIF"][1:, 1:], [[3e5, -2.5e5], [-2.5e5, 2.5e5]])
    assert (
        found["GYRO"][2, 1] == 1e-3 and found["GYRO"][0, 1] == -1.0 and found["GYRO"][1, 2] == 0.0
    )


@pytest.mark.parametrize("polar", [0, 1])
def test_complex_terms_by_parts_or_by_amplitude_and_phase(tmp_path, polar):
    """The field POLAR of the header decides; the phase is in degrees."""
    lines = [f"DMIG,DAMP,0,1,3,0,{polar}", "DMIG,DAMP,1,1,,2,1,4.,90."]
    (tmp_path / "a.bdf").write_text("\n".join(lines))
    value = read_matrices(tmp_path / "a.bdf")["DAMP"][1, 0]
    assert value == pytest.approx(4j if polar else 4 + 90j, abs=1e-12)


@pytest.mark.parametrize("free", [False, True])
def test_a_body_through_a_punch_file(tmp_path, free):
    """The beam in long fields, as Nastran punches them, and separated by commas: the same
    frequencies.
    """
    K, M = beam_matrices(elements=3)
    lines = []
    for name, matrix in (("KAAX", K), ("MAAX", M)):
        lines.append(
            f"DMIG,{name},0,6,2"
            if free
            else f"DMIG    {name:8s}{0:8d}{6:8d}{2:8d}{0:8d}{'':8s}{len(K):8d}"
        )
        for j in range(len(K)):
            head = (1 + j // 2, 3 + 2 * (j % 2))
            if free:
                lines.append(f"DMIG*,{name},{head[0]},{head[1]},")
            else:
                lines.append(f"DMIG*   {name:16s}{head[0]:16d}{head[1]:16d}{'':16s}*")
            for i in range(j, len(K)):
                value = f"{matrix[i, j]:.9E}".replace("E", "D")
                row = (1 + i // 2, 3 + 2 * (i % 2))
                term = (
                    f"*,{row[0]},{row[1]},{value}",
                    f"*       {row[0]:16d}{row[1]:16d}{value:>16s}",
                )
                lines.append(term[0] if free else term[1])
    (tmp_path / "beam.pch").write_text("\n".join(lines))
    found = read_matrices(tmp_path / "beam.pch")
    assert found["dofs"].tolist() == [[1, 3], [1, 5], [2, 3], [2, 5], [3, 3], [3, 5]]
    ports = {"contact": np.array([0])}
    omega = port_model_from_matrices(found["MAAX"], found["KAAX"], ports).omega
    np.testing.assert_allclose(omega, port_model_from_matrices(M, K, ports).omega, rtol=1e-7)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("GRID,1", "expected DMIG"),
        ("DMIG,K,0,9,1,,,3\nDMIG,K,1,1,,2,1,1.0", "rectangular"),
        ("DMIG,K,0,6,1\nDMIG,K,1,1,,two,1,1.0", "line 2"),
        ("DMIG,K,1,1,,2,1,1.0", "header"),
    ],
)
def test_bad_dmig(tmp_path, text, word):
    (tmp_path / "a.dmig").write_text(text)
    with pytest.raises(InputError, match=word):
        read_matrices(tmp_path / "a.dmig")


def test_ansys_needs_its_library(tmp_path):
    (tmp_path / "file.full").write_bytes(b"")
    with pytest.raises(InputError, match="ansys-mapdl-reader"):
        read_matrices(tmp_path / "file.full")


def test_a_full_file_comes_without_its_constrained_freedoms(tmp_path, monkeypatch):
    """The library gives upper triangles with empty rows where a freedom is constrained; here it is
    played.

    With the library itself its cylinder (963 freedoms, 63 constrained) has its published
    frequencies: 1283.200, 1283.200, 5781.975, 6919.399 Hz.
    """
    K, M = beam_matrices(elements=2)
    triangles = [np.pad(np.triu(matrix), ((1, 0), (1, 0))) for matrix in (K, M)]
    dofs = np.array([[1, 0], [1, 1], [1, 5], [2, 1], [2, 5]])
    file = SimpleNamespace(load_km=lambda **_: (dofs, *triangles))
    reader = SimpleNamespace(read_binary=lambda path: file)
    monkeypatch.setitem(sys.modules, "ansys", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "ansys.mapdl", SimpleNamespace(reader=reader))
    (tmp_path / "file.full").write_bytes(b"")
    found = read_matrices(tmp_path / "file.full")
    assert np.array_equal(found["K"], K) and np.array_equal(found["M"], M)
    assert np.array_equal(found["dofs"], dofs[1:])


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("a.npz", "cannot be read as .npz"),
        ("a.mat", "cannot be read as .mat"),
        ("a.MTX", "cannot be read as .mtx"),
        ("a.bdf", "cannot be read as .bdf"),
        ("a.sub", "expected one of"),
        ("b.npz", "not found"),
    ],
)
def test_broken_files_are_told_in_one_sentence(tmp_path, name, word):
    if name != "b.npz":
        (tmp_path / name).write_bytes(b"\xff\xfe rubbish")
    with pytest.raises(InputError, match=word) as reported:
        read_matrices(tmp_path / name)
    assert name in str(reported.value)


def test_the_example_in_the_docstring():
    assert doctest.testmod(hbm_model).attempted > 5 and doctest.testmod(hbm_model).failed == 0
