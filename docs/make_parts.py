"""Draw the labelled parts of every shipped geometry into docs/parts and list their parameters in
docs/parts.md.
"""

from pathlib import Path

from bladefem.scene.kinds import KINDS
from bladefem.scene.tables import Scene
from bladefem.scene.units import show
from geometry import parameters
from geometry.quantity import describe_fields

HERE = Path(__file__).parent
TABLES = {
    "aerofoil": ["Aerofoil"],
    "platform": ["Platform", "Shank", "Wedge"],
    "dampers": [],
    "roots": ["Root"],
    "shrouds": ["Shroud"],
    "sector": ["Disc"],
    "plane": ["Plane"],
    "z_mass": ["ZMass"],
    "hertz": ["HertzPair"],
    "punch": ["Punch"],
}
NAMES = """## names

Groups of the mesh, which are the contract with the finite elements and the names that `.msh` and STEP files need, too.
A file that calls them otherwise gets these names in its scene: `names = ["clamp = face_3 + face_4", "tip = face_1"]`
under `[imported]`; `bladefem mesh` lists what the file has.

| name | what | in |
| --- | --- | --- |
| blade, damper | bodies | all, each where it exists |
| clamp | bore of the disc, root of a plane blade, far face of a block | all |
| cyclic_low, cyclic_high | cut faces; the second is the first turned by one sector, node by node | wedge sector |
| seat_left, seat_right | undersides of the platform; the contact face of a block is seat_right | all with contact |
| damper_left, damper_right | flanks of the damper: on this blade's seat_right, on the next blade's seat_left | \
all with contact |
| suction_side, pressure_side, trailing_edge, tip, fillet | skin of the aerofoil | wedge sector |
| shroud_left, shroud_right | ends of a shroud towards the neighbours | wedge sector with a shroud |
| tip_leading, tip_mid, tip_trailing | nodes of the tip: leading edge, half chord, trailing edge | blades |
| load | far face of the indenter | hertz, punch |
| symmetry_x, symmetry_y | planes x = 0 and y = 0 of both bodies; nodes slide in them (y in 3-D only) | hertz, punch |
| footprint, top | lower and upper face of the mass | z mass |
| seat | upper face of the elastic block below it, under the footprint | z mass |
"""


def number(value: object, unit: str) -> str:
    """A value with its unit, empty for none."""
    return (
        show(value, unit or "1")
        if isinstance(value, float | int) and not isinstance(value, bool)
        else str(value)
    )


def rows(name: str) -> list[str]:
    """The parameters of one table as Markdown."""
    text = [
        f"**{name}**",
        "",
        "| field | default | accepted | meaning |",
        "| --- | ---: | --- | --- |",
    ]
    for field in describe_fields(getattr(parameters, name)):
        limits = (
            "true or false"
            if isinstance(field["default"], bool)
            else " or ".join(field["choices"])
            or f"{number(field['low'], field['unit'])} to {number(field['high'], field['unit'])}"
        )
        default = "auto" if field["default"] is None else number(field["default"], field["unit"])
        text.append(f"| {field['name']} | {default} | {limits} | {field['help']} |")
    return [*text, ""]


page = [
    "# Parts and their parameters",
    "",
    "Drawn with the default values by `python docs/make_parts.py`.",
    "",
]
for kind, record in KINDS.items():
    if not record.pictures:
        continue
    page += [f"## {kind}", ""]
    for name, draw in record.pictures.items():
        draw(Scene(kind=kind), file=HERE / "parts" / f"{name}.png")
        page += [f"![{name}](parts/{name}.png)", ""]
        for table in TABLES[name]:
            page += rows(table)
page += ["## element sizes", "", *rows("MeshSize"), NAMES]
(HERE / "parts.md").write_text("\n".join(page), encoding="utf-8")
