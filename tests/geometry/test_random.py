"""Random parameter sets give a valid mesh, or are refused before any meshing in one line that
names a field; benchmarks/random_geometry.py does 200.
"""

import re
from dataclasses import replace
from functools import partial
from math import pi

import numpy as np
import pytest

from bladefem.errors import InputError
from geometry.parameters import Aerofoil, Disc, MeshSize, Plane, Platform, Shank, Wedge
from geometry.plane import check_plane, plane_blades
from geometry.sampling import sample_around, sample_in_range
from geometry.sector import wedge_sector
from geometry.sector_check import check_sector

TABLES = (Aerofoil, Platform, Shank, Disc, Wedge)
FIELD = re.compile(r"(aerofoil|platform|shank|disc|damper|mesh|plane)\b")


def check_mesh(mesh):
    """Positive Jacobians, and pairs that match node by node."""
    assert mesh.report["min scaled jacobian"] > 0
    for pair in mesh.pairs.values():
        image = mesh.points[pair.nodes[0]] @ pair.rotation.T + pair.shift
        np.testing.assert_allclose(
            mesh.points[pair.nodes[1]], image, atol=1e-12 * np.abs(mesh.points).max()
        )


def refused_by_a_rule(check):
    """Whether arithmetic refuses the set, in one sentence with a field; what it lets pass has to be
    meshed.
    """
    try:
        check()
    except InputError as error:
        assert FIELD.search(str(error)) and "\n" not in str(error)
        return True
    return False


def level(wedge):
    """Plates have seats in one plane."""
    return replace(wedge, angle=pi / 2, angle_next=None) if wedge.shape == "plate" else wedge


@pytest.mark.parametrize("number", range(8))
def test_sectors_round_the_defaults(number):
    rng = np.random.default_rng((7, number))
    aerofoil, platform, shank, disc, wedge = (sample_around(t(), rng, 0.15) for t in TABLES)
    shank = replace(shank, length=min(shank.length, disc.width, platform.length))
    parts = (aerofoil, platform, shank, disc, level(wedge))
    if not refused_by_a_rule(lambda: check_sector(*parts)):
        check_mesh(wedge_sector(*parts, MeshSize(size=8e-3)))


@pytest.mark.parametrize("number", range(6))
def test_sectors_anywhere_in_the_ranges(number):
    rng = np.random.default_rng((8, number))
    parts = [sample_in_range(t, rng) for t in TABLES]
    parts[-1] = level(parts[-1])
    if not refused_by_a_rule(lambda: check_sector(*parts)):
        check_mesh(wedge_sector(*parts, MeshSize()))


def test_flat_cells_are_meshed_anew_with_smaller_elements(monkeypatch):
    """The first mesh counts as flat: the next one is finer, and its report says so."""
    from geometry import finalise_mesh

    parts = [t() for t in TABLES]

    def filled_once(gmsh, *_):
        gmsh.model.mesh.generate(3)
        return ()

    monkeypatch.setattr(finalise_mesh, "fill_with_tetrahedra", filled_once)
    plain = wedge_sector(*parts, MeshSize(size=1.2e-2))
    found = iter([0.001])
    true = finalise_mesh._worst_shape
    monkeypatch.setattr(finalise_mesh, "_worst_shape", lambda mesh: next(found, true(mesh)))
    mesh = wedge_sector(*parts, MeshSize(size=1.2e-2))
    assert mesh.report["notes"][0].startswith("elements are 0.8 times as large as asked for")
    assert mesh.report["cells"] > plain.report["cells"]
    check_mesh(mesh)


@pytest.mark.parametrize("fails", [True, False])
def test_the_other_algorithm_is_told(monkeypatch, fails):
    """The first one counts as failed, or its mesh as flat."""
    from geometry import finalise_mesh

    true, calls = finalise_mesh.improve_tetrahedra, []

    def poor_at_first(gmsh, groups):
        calls.append(gmsh.option.getNumber("Mesh.Algorithm3D"))
        if len(calls) == 1 and fails:
            raise Exception("no tetrahedra")
        return true(gmsh, groups) if len(calls) > 1 else 0.0

    monkeypatch.setattr(finalise_mesh, "improve_tetrahedra", poor_at_first)
    mesh = wedge_sector(*[t() for t in TABLES], MeshSize(size=1.2e-2))
    assert calls == [1, 10]
    why = "failed (no tetrahedra)" if fails else "left cells of shape quality 0"
    assert mesh.report["notes"] == (
        f"gmsh {why} with mesh.algorithm = 'delaunay': meshed with 'hxt'",
    )
    check_mesh(mesh)


@pytest.mark.parametrize(
    ("delaunay", "hxt", "filled"),
    [
        (0.06, 0.5, ["delaunay"]),
        (0.03, 0.04, ["delaunay", "hxt"]),
        (0.04, 0.03, ["delaunay", "hxt", "delaunay"]),
        (0.04, None, ["delaunay", "hxt", "delaunay"]),
    ],
)
def test_the_better_of_two_poor_meshes_is_kept(monkeypatch, delaunay, hxt, filled):
    """By their worst cells; the other algorithm may fail (None)."""
    from geometry import finalise_mesh

    worst, calls = {"delaunay": delaunay, "hxt": hxt}, []

    def fill(gmsh, groups, algorithm):
        calls.append(algorithm)
        if worst[algorithm] is None:
            raise Exception("no tetrahedra")
        return worst[algorithm]

    monkeypatch.setattr(finalise_mesh, "_filled", fill)
    notes = finalise_mesh.fill_with_tetrahedra(None, None, "delaunay")
    assert calls == filled
    assert bool(notes) == (filled[-1] == "hxt")


def test_plane_blades():
    rng = np.random.default_rng(9)
    meshed = 0
    for _ in range(12):
        shape = sample_around(Plane(), rng, 0.2)
        if not refused_by_a_rule(partial(check_plane, shape)):
            check_mesh(plane_blades(shape, MeshSize()))
            meshed += 1
    assert meshed
