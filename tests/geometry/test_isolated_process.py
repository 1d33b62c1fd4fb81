"""Builds in a process of their own: the same mesh, the same words, and no crash, no ranks, no
silence.
"""

import os
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.errors import InputError
from geometry import isolated_process as apart
from geometry.builders import build_here
from geometry.finalise_mesh import refuse_flat
from geometry.isolated_process import build_isolated
from geometry.mesh import Mesh
from geometry.parameters import MeshSize, Punch

SCENE = SimpleNamespace(kind="punch", mesh=MeshSize(size=6e-3), punch=Punch(dimension=2))


class Abort:
    """Aborts the process that reads it, as a segmentation fault inside gmsh would."""

    def __reduce__(self):
        return os.abort, ()


class Mistake:
    """A mistake of ours in the child."""

    def __reduce__(self):
        return int, ("no number",)


def test_the_mesh_is_the_one_of_this_process():
    there, here = build_isolated(SCENE), build_here(SCENE)
    np.testing.assert_array_equal(there.points, here.points)
    np.testing.assert_array_equal(there.bodies["blade"], here.bodies["blade"])
    assert there.report == here.report


def test_a_refusal_keeps_its_words():
    with pytest.raises(InputError, match=r"punch\.radius = 15 mm: expected at most") as caught:
        build_isolated(SimpleNamespace(**vars(SCENE) | {"punch": Punch(radius=0.015)}))
    assert "\n" not in str(caught.value)


def test_a_crash_is_tried_again_and_then_becomes_a_sentence():
    with pytest.raises(
        InputError, match=r"mesh\.size: gmsh crashed \(signal 6\).*change mesh\.size"
    ) as caught:
        build_isolated(SimpleNamespace(**vars(SCENE) | {"punch": Abort()}))
    assert "\n" not in str(caught.value)


def test_the_second_try_takes_the_other_algorithm_and_smaller_elements_and_is_noted(monkeypatch):
    asked = []

    def ask(scene):
        asked.append(scene.mesh)
        return "crashed (signal 11)" if len(asked) == 1 else build_here(scene)

    monkeypatch.setattr(apart, "_ask_child", ask)
    mesh = build_isolated(SCENE)
    assert isinstance(mesh, Mesh)
    (note,) = mesh.report["notes"]
    assert note.startswith("gmsh crashed (signal 11) with mesh.algorithm = 'delaunay'")
    assert "meshed with 'hxt'" in note
    assert [(m.algorithm, m.size) for m in asked] == [
        ("delaunay", 6e-3),
        ("hxt", pytest.approx(5.4e-3)),
    ]


def test_a_mistake_in_the_child_is_not_hidden():
    with pytest.raises(RuntimeError, match="no number"):
        build_isolated(SimpleNamespace(**vars(SCENE) | {"punch": Mistake()}))


def test_the_child_sees_nothing_of_the_ranks(monkeypatch):
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_SIZE"):
        monkeypatch.setenv(name, "1")
    assert not [name for name in apart._child_environment() if name.startswith(apart.MPI_VARIABLES)]


def test_flat_cells_are_refused_with_their_place():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.4, 0.4, 1e-3]], dtype=float)
    with pytest.raises(InputError, match=r"mesh\.size: 1 flat cells.*350, 350"):
        refuse_flat(Mesh(points, "tetra", {"blade": np.array([[0, 1, 2, 3]])}))
