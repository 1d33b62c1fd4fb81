"""Temperatures and tables of a scene: what is read, and one sentence for what is wrong."""

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.scene.material_table import material_at, operating_materials, property_at
from bladefem.scene.part_materials import part_materials
from bladefem.scene.tables import Imported, Material, Scene
from bladefem.scene.temperature_file import read_temperatures
from bladefem.scene.toml import dump_scene, scene_of
from bladefem.scene.units import parse

ROWS = [
    "20 degC: E=210 GPa; expansion=1.1e-5 1/K",
    "420 degC: E=190 GPa; expansion=1.3e-5 1/K",
]


def scene(blade=None, **temperature):
    return scene_of(
        {
            "kind": "wedge sector",
            "material": {
                "blade": {"table": ROWS} if blade is None else blade,
                "damper": {"expansion": 1e-5},
            },
            "temperature": temperature,
        }
    )


def test_temperatures_and_expansions_are_read_with_their_units():
    assert parse("20 degC", "K") == 293.15
    assert parse("1.2e-5 1/K", "1/K") == 1.2e-5
    assert parse("12 um/m/K", "1/K") == pytest.approx(1.2e-5)
    with pytest.raises(InputError, match="expected K or degC"):
        parse("20 mm", "K")


def test_properties_between_rows():
    material = Material(table=tuple(ROWS), nu=0.31)
    at = np.array([[293.15, 493.15], [693.15, 393.15]])
    np.testing.assert_allclose(property_at(material, "E", at), [[210e9, 200e9], [190e9, 205e9]])
    assert property_at(material, "nu", at) == 0.31
    hot = material_at(material, 493.15)
    assert hot.E == pytest.approx(200e9) and hot.expansion == pytest.approx(1.2e-5)
    assert hot.table is None


def test_a_scene_with_a_table(tmp_path):
    hot = scene(uniform="220 degC")
    assert operating_materials(hot)[0].E == pytest.approx(200e9)
    # without a temperature that of reference
    assert operating_materials(scene())[0].E == pytest.approx(210e9)
    from bladefem.scene.toml import load_scene

    file = tmp_path / "scene.toml"
    file.write_text(dump_scene(hot))
    assert load_scene(file) == hot


@pytest.mark.parametrize(
    "rows, sentence",
    [
        (["20 degC; E=1"], "expected a temperature and its properties"),
        (["20 mm: E=210 GPa"], "not a unit of this field, expected K or degC"),
        (["20 degC: F=210 GPa"], "'F' is no property of a row"),
        (["20 degC: E=210"], "expected 1 MPa"),
        (["20 degC: E=210 GPa", "90 degC: nu=0.3"], "expected E as in the first row"),
        (["90 degC: E=210 GPa", "20 degC: E=211 GPa"], "rise in temperature"),
        (["20 degC: E=210 GPa", "20 degC: E=211 GPa"], "rise in temperature"),
        (["20 degC: orthotropic=1e11, 2e11"], "orthotropic has 2 values, expected 9"),
        (["-300 degC: E=210 GPa"], "at least 0 K"),
    ],
)
def test_wrong_tables(rows, sentence):
    with pytest.raises(InputError, match=sentence):
        scene({"table": rows})


def test_temperatures_outside_the_table():
    with pytest.raises(InputError, match="expected a temperature from 293.15 to 693.15 K"):
        scene(uniform="500 degC")
    with pytest.raises(InputError, match="it has no properties at"):
        scene(reference="0 degC")


def test_what_does_not_go_together(tmp_path):
    with pytest.raises(InputError, match=r"material\.blade\.expansion is missing"):
        scene({}, uniform=500)
    with pytest.raises(InputError, match="there is no such file"):
        scene(file="nowhere.csv")
    file = tmp_path / "t.csv"
    file.write_text("x,y,z,T\n0,0,0,400\n")
    with pytest.raises(InputError, match="not both"):
        scene(file=str(file), uniform=400)
    with pytest.raises(InputError, match="has no temperature"):
        scene_of({"kind": "punch", "material": {"blade": {"table": ROWS}}})


def test_a_file_of_places(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text("\ufeffT [degC], x [mm], y [mm], z [mm], note\n20, 1, 2, 3, a\n\n30,4,5,6,b\n")
    found = read_temperatures(str(file))
    np.testing.assert_allclose(found.places, [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]])
    np.testing.assert_allclose(found.values, [293.15, 303.15])


def test_a_file_of_nodes(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text("Node, T [degC]\n7, 20\n12, 30\n")
    found = read_temperatures(str(file))
    assert found.places is None
    assert found.nodes.tolist() == [7, 12]
    np.testing.assert_allclose(found.values, [293.15, 303.15])
    with pytest.raises(InputError, match="expected those of places"):
        scene({"expansion": "1e-5 1/K"}, file=str(file))


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("", "no rows"),
        ("x,y,T\n0,0,400", "column 'z' is missing"),
        ("x,y,z,T\n0,0,0,hot", "row 2 is not four numbers"),
        ("x,y,z,T\n0,0,0,1\n0,0,1", "row 3 is not four numbers"),
        ("x,y,z,T\n0,0,0,nan", "not finite"),
        ("node,T\n1,400\n1,500", "node 1 comes 2 times"),
        ("node,T\n1.5,400", "a node is 1.5"),
        ("node,T\n1,", "row 2 is not two numbers, expected node and T"),
        ("node\n1", "column 'T' is missing"),
        ("x,y,z,T [mm]\n0,0,0,1", "not a unit of this field"),
        ("x,y,z,T [degC]\n0,0,0,-300", "at least 0 K"),
    ],
)
def test_wrong_files(tmp_path, text, sentence):
    file = tmp_path / "t.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_temperatures(str(file))


def test_rows_of_a_named_volume():
    imported = Imported(
        materials=("disc: E=114 GPa", "disc at 300 K: E=110 GPa", "disc at 600 K: E=100 GPa")
    )
    disc = part_materials(Scene(kind="imported", imported=imported))["disc"]
    assert material_at(disc, 450.0).E == pytest.approx(105e9)
