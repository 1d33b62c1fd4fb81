"""A damper fitted between the platforms of a STEP blade, against the parametric sector that the
STEP file was drawn from.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.fem.loads import body_volume
from bladefem.scene.toml import scene_of
from geometry.example_step import write_blade_step
from geometry.fillet import with_fillet
from geometry.fitted_wedge import FittedDamper, faces_about_damper, flanks_between
from geometry.parameters import DEG, Aerofoil, Disc, MeshSize, Platform, Root, Shank, Shroud, Wedge
from geometry.profile import sector_profile
from geometry.section import section_outline
from geometry.session import gmsh_session
from geometry.step_file import (
    _import_shapes,
    axis_rotation,
    read_step,
    step_face_names,
)

AXIS = np.array([0.0, 0.0, 1.0])
SIZE = MeshSize(size=0.02, order=1)
# by position in the drawing: see scenes/own_blade.toml
SEATS = ("face_14", "face_11")
BLADE = (Aerofoil(twist=10 * DEG), Platform(), Shank(), Disc())


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    return write_blade_step(tmp_path_factory.mktemp("step") / "blade.step", *BLADE, Wedge())


@pytest.fixture(scope="module")
def mesh(step):
    fitted = FittedDamper(SEATS, Wedge())
    return read_step(step, SIZE, 1.0, BLADE[3].sectors, names=["tip = face_24"], fitted=fitted)


def seat_corners(side: int) -> np.ndarray:
    """(4, 3) of the parametric sector's seat, +1 towards +y."""
    shape = sector_profile(BLADE[1], BLADE[2], BLADE[3], Wedge())
    (xi, yi), (xo, yo), z = *shape.seats[0], Wedge().length / 2
    rows = [[xi, side * yi, -z], [xo, side * yo, -z], [xo, side * yo, z], [xi, side * yi, z]]
    return np.array(rows)


def test_seats_and_damper_are_those_of_the_parametric_sector(mesh):
    for name, side in (("seat_right", 1), ("seat_left", -1)):
        points = mesh.points[np.unique(mesh.faces[name])]
        corners = seat_corners(side)
        assert np.allclose(points.min(axis=0), corners.min(axis=0), atol=1e-9)
        assert np.allclose(points.max(axis=0), corners.max(axis=0), atol=1e-9)
    wedge = sector_profile(BLADE[1], BLADE[2], BLADE[3], Wedge()).damper
    x, y = wedge.T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    assert body_volume(mesh, "damper") == pytest.approx(area * Wedge().length, rel=1e-9)


def test_all_pairs_match_and_other_names_stay(mesh):
    assert set(mesh.pairs) == {"cyclic", "this", "next"}
    for pair in mesh.pairs.values():
        master, slave = pair.nodes
        moved = mesh.points[master] @ pair.rotation.T + pair.shift
        assert np.abs(moved - mesh.points[slave]).max() < 1e-12
    assert {"tip", "clamp", "face_12"} <= set(mesh.faces)
    assert not set(SEATS) & set(mesh.faces)


def test_names_are_known_without_a_mesh(step, mesh):
    fitted = FittedDamper(SEATS, Wedge())
    names = step_face_names(step, 1.0, BLADE[3].sectors, AXIS, ["tip = face_24"], fitted)
    assert names == set(mesh.faces)


def test_a_wrong_number_of_sectors_is_named(step):
    with pytest.raises(InputError, match=r"^imported\.sectors = 30: no face .* 30th of a turn"):
        step_face_names(step, 1.0, 30, AXIS)


def test_the_step_file_has_the_fillet_of_the_parametric_sector(step, tmp_path):
    """What it adds to the volume: r^2 (1 - pi/4) along the outline of the root section, less where
    the arc is cut short above the platform.
    """
    sharp = (replace(BLADE[0], fillet=0.0), *BLADE[1:])
    plain = write_blade_step(tmp_path / "sharp.step", *sharp, Wedge())
    volumes = []
    for file in (step, plain):
        with gmsh_session() as gmsh:
            _import_shapes(gmsh, file, 1.0)
            volumes.append(gmsh.model.occ.getMass(*gmsh.model.getEntities(3)[0]))
    radius = with_fillet(*BLADE, Wedge(), MeshSize()).fillet
    outline = section_outline(BLADE[0], 0.0, 0.0)
    length = np.linalg.norm(np.diff(outline, axis=0, append=outline[:1]), axis=1).sum()
    whole = radius**2 * (1 - pi / 4) * length
    assert 0.75 * whole < volumes[0] - volumes[1] < 1.05 * whole


def test_the_step_file_has_root_and_shroud(tmp_path):
    shroud = Shroud(thickness=0.004)
    found = {}
    for name, more in {"plain": (), "both": (Root(lobes=2), shroud)}.items():
        file = write_blade_step(tmp_path / f"{name}.step", *BLADE, Wedge(), *more)
        with gmsh_session() as gmsh:
            _import_shapes(gmsh, file, 1.0)
            found[name] = len(gmsh.model.getEntities(2))
    assert found["both"] > found["plain"] + 10


def variations():
    """Twenty platforms: angle, gap, thickness, and the width of the seats."""
    rng = np.random.default_rng(18)
    for _ in range(20):
        wedge = Wedge(angle=rng.uniform(40, 70) * DEG, length=rng.uniform(0.02, 0.045))
        platform = replace(
            BLADE[1],
            gap=rng.uniform(0.0005, 0.002),
            thickness=rng.uniform(0.003, 0.008),
            seat_width=rng.uniform(0.004, 0.007),
        )
        yield platform, wedge, float(rng.uniform(0.6, 1.0) * platform.seat_width)


def test_twenty_variations_are_fitted(tmp_path):
    """Flanks are where the parametric sector has them: to a nanometre."""
    for number, (platform, wedge, width) in enumerate(variations()):
        file = tmp_path / f"{number}.step"
        write_blade_step(file, BLADE[0], platform, BLADE[2], BLADE[3], wedge)
        shape = sector_profile(platform, BLADE[2], BLADE[3], wedge)
        on = axis_rotation(AXIS, 2 * pi / BLADE[3].sectors)
        with gmsh_session() as gmsh:
            _import_shapes(gmsh, file, 1.0)
            faces = faces_about_damper(gmsh, 14, 11, on)
            flanks = flanks_between(faces, wedge, width, AXIS)
        assert flanks.width == pytest.approx(width, rel=1e-9)
        assert flanks.length == pytest.approx(wedge.length, rel=1e-9)
        outer = np.array([*shape.seats[0, 1], -wedge.length / 2])
        mirrored = on @ (outer * [1, -1, 1])
        assert np.allclose(flanks.ends[0, 1], outer, atol=1e-9)
        assert np.allclose(flanks.ends[1, 1], mirrored, atol=1e-9)


@pytest.mark.parametrize(
    ("seats", "wedge", "width", "said"),
    [
        (("face_14", "face_99"), Wedge(), None, "the file has no face 'face_99'"),
        (("face_19", "face_11"), Wedge(), None, "'face_19' is not one plane face"),
        (("face_11", "face_14"), Wedge(), None, "exchange the two names"),
        (SEATS, Wedge(length=0.07), None, "damper.length = 70 mm: expected at most 60 mm"),
        (SEATS, Wedge(), 0.02, "imported.seat_width = 20 mm: expected at most"),
        (("face_16", "face_15"), Wedge(), None, "expected the inclined undersides"),
    ],
)
def test_what_does_not_fit_is_refused(step, seats, wedge, width, said):
    fitted = FittedDamper(seats, wedge, width)
    with pytest.raises(InputError, match=said):
        read_step(step, SIZE, 1.0, BLADE[3].sectors, fitted=fitted)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seat_width": "5 mm"}, "expected together with imported.seats"),
        ({"seats": ["a", "b"]}, "imported.sectors = 0: expected the number of blades"),
        ({"seats": ["a"], "sectors": 36}, "expected 2 values"),
    ],
)
def test_scenes_are_refused_before_any_drawing(step, changes, said):
    tables = {"kind": "imported", "imported": {"file": str(step), **changes}}
    with pytest.raises(InputError, match=said):
        scene_of(tables)


def test_a_clearance_is_refused(step):
    imported = {"file": str(step), "sectors": 36, "seats": list(SEATS)}
    tables = {"kind": "imported", "imported": imported, "damper": {"clearance": "0.1 mm"}}
    with pytest.raises(InputError, match=r"damper\.clearance"):
        scene_of(tables)
