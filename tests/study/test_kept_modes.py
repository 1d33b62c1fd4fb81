"""Modes solved once for tables and reduction."""

from __future__ import annotations

import numpy as np
import pytest

from bladefem.scene.toml import load_scene, vary
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import find_modes, responding_diameters
from bladefem.study.pipeline.pipeline import run
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.validate_mesh import found_patches


def test_a_response_has_the_modes_that_it_excites():
    """Whatever nodal diameters the tables are asked for: engine order 9 excites 0, 9 and 18."""
    wedge = load_scene(
        "scenes/wedge.toml", ["mesh.size=24 mm", "mesh.scale=1.5", "aerofoil.fillet=0 mm"]
    )
    mesh = build_mesh(wedge)
    for given, wanted in (([0, 1, 6], [0, 1, 6, 9, 18]), ([0, 3, 9, 18], None), (None, None)):
        listed = vary(wedge, "model.nodal_diameters", given)
        assert responding_diameters(listed, mesh) == wanted


def test_listed_diameters_change_no_stress_and_no_error_of_a_response():
    """Those of the excited diameter, 9, whatever the mode tables list."""
    settings = [
        "mesh.size=24 mm",
        "mesh.scale=1.5",
        "aerofoil.fillet=0 mm",
        "study.loads=80 N",
        "model.modes=6",
    ]
    settings += ["study.own_load=false", "study.stability=false", "model.harmonics=1"]
    settings += ["model.samples=64", "model.damper=rigid", "contact.points=2"]
    plain, listed = (
        run(load_scene("scenes/wedge.toml", [*settings, *more]), None, "reduction")
        for more in ([], ["model.nodal_diameters=0, 1, 6"])
    )
    assert [one.nodal_diameter for one in listed.modes] == [0, 1, 6, 9, 18]
    assert listed.strength.alternating == pytest.approx(plain.strength.alternating, rel=1e-6)
    assert listed.mode_errors.diameter == plain.mode_errors.diameter == 9


def test_the_reduction_takes_the_modes_that_are_solved_already():
    """The port models of kept modes are those of modes solved again."""
    scene = load_scene(
        "scenes/wedge.toml", ["mesh.size=24 mm", "mesh.scale=1.5", "aerofoil.fillet=0 mm"]
    )
    mesh = build_mesh(scene)
    patches = found_patches(scene, mesh, excited=True)
    again = Bodies(scene, mesh)
    kept = Bodies(scene, mesh)
    plain = find_modes(again, count=4)
    shown = find_modes(kept, count=4, reduced=8)
    assert [len(one.frequencies) for one in shown] == [4] * len(plain)
    for one, other in zip(plain, shown, strict=True):
        np.testing.assert_allclose(one.frequencies, other.frequencies, rtol=1e-9)
    diameters = [0, 9, 18]
    first, second = (reduce_sector(b, patches, diameters, 8).sector for b in (again, kept))
    for n in diameters:
        np.testing.assert_allclose(first[n].omega, second[n].omega, rtol=1e-9)
        response = [
            m.shapes @ np.diag(1 / (m.omega**2 - 4e6)) @ m.shapes.conj().T + m.residual
            for m in (first[n], second[n])
        ]
        assert abs(response[0] - response[1]).max() < 1e-6 * abs(response[0]).max()
    assert not kept.kept
