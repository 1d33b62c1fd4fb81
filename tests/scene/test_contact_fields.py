"""The fields of [contact], [contact.left] and [contact.right]: units, written back, and refused in
one sentence.
"""

import pytest

from bladefem.errors import InputError
from bladefem.scene.tables import Seat
from bladefem.scene.toml import dump_scene, load_scene, resolved_rows

WEDGE = "scenes/wedge.toml"


def test_seats_and_units(tmp_path):
    given = [
        "contact.left.mu=0.2",
        "contact.left.kt=2 N/um",
        "contact.right.kn_area=80 N/mm^3",
        "contact.wear_coefficient=1e-5 mm^3/J",
        "contact.stiffness=given",
        "contact.bedded=false",
        "contact.crown=5 m",
        "contact.edge_radius=40 mm",
        "contact.edge_width=1 mm",
    ]
    scene = load_scene(WEDGE, given)
    assert scene.contact.left == Seat(mu=0.2, kt=2e6) and scene.contact.right == Seat(kn_area=8e10)
    assert scene.contact.wear_coefficient == pytest.approx(1e-14)
    assert (
        load_scene(WEDGE, ["contact.wear_coefficient=1e-14 m^2/N"]).contact.wear_coefficient
        == 1e-14
    )
    (tmp_path / "again.toml").write_text(dump_scene(scene))
    assert load_scene(tmp_path / "again.toml") == scene
    rows = {row.name: row for row in resolved_rows(scene)}
    assert rows["contact.left.kt"].value == "2e+06 N/m" and rows["contact.left.kt"].help
    assert rows["contact.right.mu"].value == "auto"


@pytest.mark.parametrize(
    ("scene", "given", "words"),
    [
        ("wedge", ["contact.left.mu=-1"], "contact.left.mu = -1: expected 0 to 2"),
        ("wedge", ["contact.left.nu=1"], "unknown key 'contact.left.nu'"),
        (
            "wedge",
            ["contact.stiffness=map", "contact.kn=1e6"],
            "contact.kn: contact.stiffness = 'map'",
        ),
        (
            "wedge",
            ["contact.stiffness=map", "contact.left.kn_area=1e6"],
            "contact.left.kn_area: contact.stiffness",
        ),
        (
            "wedge",
            ["contact.stiffness=maps"],
            "expected one of given, rigid, map; did you mean 'map'",
        ),
        (
            "wedge",
            ["contact.crown=2 m"],
            "contact.crown = 2 m: bedded .* expected contact.bedded = false",
        ),
        (
            "wedge",
            ["contact.edge_radius=40 mm", "contact.bedded=false"],
            "contact.edge_width: expected together with",
        ),
        ("wedge", ["contact.wear_coefficient=1 mm"], "not a unit of this field, expected m.3/J"),
        ("wedge", ["model.samples=0"], "model.samples = 0: .* in plane models only"),
        (
            "plane",
            ["model.samples=9"],
            "model.samples = 9: expected 16 to 65536, or 0 in plane models",
        ),
        (
            "plane",
            ["contact.crown=2 m", "contact.bedded=false"],
            "contact.crown: plane blades .* contact.crown_across",
        ),
        (
            "zmass",
            ["contact.left.mu=0.1"],
            "contact.left: a scene of kind 'z mass' has no two seats",
        ),
        (
            "hertz",
            ["contact.wear_coefficient=1e-14"],
            r"\[contact\]: a scene of kind 'hertz' does not use this table",
        ),
        ("zmass", ["contact.stiffness=map"], "contact.stiffness = 'map': a scene of kind 'z mass'"),
        (
            "zmass",
            ["study.masses=10 g"],
            "study.masses: .* does not use this field, expected only study.loads",
        ),
        (
            "hertz",
            ["model.harmonics=3"],
            r"\[model\]: .* does not use this table, expected only hertz, mesh, material",
        ),
    ],
)
def test_wrong_values_are_refused(scene, given, words):
    with pytest.raises(InputError, match=words):
        load_scene(f"scenes/{scene}.toml", given)
