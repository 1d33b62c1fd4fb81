"""Volumes of a user's mesh with materials of their own: the same modes as the bodies put together
by hand.
"""

from dataclasses import replace

import numpy as np
import pytest
from structured import sector
from writers import write_inp

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.scene.part_materials import part_materials
from bladefem.scene.tables import Imported, Material, Operation, Scene
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import find_modes
from geometry.export import write_msh
from geometry.imported import read_mesh

TITAN = "Outer Ring: E=114 GPa; nu=0.34; rho=4430 kg/m^3"


@pytest.fixture(scope="module")
def parted():
    """A ring sector in two volumes, inner and outer ring."""
    whole = sector(6, (3, 2, 1), "tetra10", inner=0.1, outer=0.3)
    cells = whole.bodies["blade"]
    outside = np.linalg.norm(whole.points[cells[:, :4], :2].mean(axis=1), axis=1) > 0.2
    return replace(whole, bodies={"hub": cells[~outside], "outer ring": cells[outside]})


def scene(*materials, file="mesh.msh"):
    imported = Imported(file=str(file), sectors=6, materials=materials or None)
    return replace(Scene(), kind="imported", imported=imported, operation=Operation(speed=0.0))


@pytest.mark.parametrize("suffix, write", [("msh", write_msh), ("inp", write_inp)])
def test_volumes_keep_their_material(parted, suffix, write, tmp_path):
    if suffix == "inp":
        parted = replace(
            parted, bodies={name.replace(" ", "_"): cells for name, cells in parted.bodies.items()}
        )
    write(parted, tmp_path / f"a.{suffix}")
    mesh = read_mesh(tmp_path / f"a.{suffix}", sectors=6)
    assert {
        name: len(rows) for name, rows in mesh.parts.items() if name in ("hub", "outer_ring")
    } == {
        "hub": len(parted.bodies["hub"]),
        "outer_ring": len(mesh.bodies["blade"]) - len(parted.bodies["hub"]),
    }
    body = Bodies(scene(TITAN), mesh)
    materials = [Material(), Material(E=114e9, nu=0.34, rho=4430.0)]
    for n, found in zip((0, 2), find_modes(body, [0, 2], 5), strict=True):
        by_hand = assemble(
            parted, tuple(parted.bodies), dict(zip(parted.bodies, materials, strict=True))
        )
        exact = modes(constrain(by_hand, "clamp", n), 5).frequencies
        np.testing.assert_allclose(found.frequencies, exact, rtol=1e-8)
    steel = find_modes(Bodies(scene(), mesh), [2], 5)[0].frequencies
    assert abs(steel / find_modes(body, [2], 5)[0].frequencies - 1).max() > 0.01


def test_every_volume_may_have_one(parted, tmp_path):
    """Nothing is left for the blade's own material; one alone for all is as if the blade had it."""
    write_msh(parted, tmp_path / "a.msh")
    mesh = read_mesh(tmp_path / "a.msh", sectors=6)
    soft = find_modes(Bodies(scene("hub: E=70 GPa", "outer_ring: E=70 GPa"), mesh), [1], 3)[
        0
    ].frequencies
    steel = find_modes(Bodies(scene(), mesh), [1], 3)[0].frequencies
    np.testing.assert_allclose(soft, steel / np.sqrt(3), rtol=1e-7)


def test_wrong_words(parted, tmp_path):
    for text, words in (
        ("hub", "one text for each volume"),
        ("hub: E=3 m", "Pa"),
        ("hub: H=3 GPa", "'H' is no property"),
        ("hub: nu=0.5", "imported.materials, nu = 0.5"),
    ):
        with pytest.raises(InputError, match=words):
            part_materials(scene(text))
    with pytest.raises(InputError, match="one text for each volume"):
        part_materials(scene("hub: E=3 GPa", "Hub: E=4 GPa"))
    write_msh(parted, tmp_path / "a.msh")
    mesh = read_mesh(tmp_path / "a.msh", sectors=6)
    with pytest.raises(InputError, match=r"no volume 'hup'.*did you mean 'hub'"):
        Bodies(scene("hup: E=3 GPa"), mesh).still_blade
    double = replace(mesh, parts={**mesh.parts, "all": np.arange(len(mesh.bodies["blade"]))})
    with pytest.raises(InputError, match="shares cells"):
        Bodies(scene("hub: E=3 GPa", "all: E=4 GPa"), double).still_blade
