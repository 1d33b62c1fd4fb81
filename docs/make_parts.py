"""Draw the labelled parts of every shipped geometry into docs/parts and list their parameters in docs/parts.md."""

from pathlib import Path

from bladefem.scene import Scene
from bladefem.units import show
from bladefem.view.parts import PARTS
from geometry import parameters
from geometry.quantity import describe

HERE = Path(__file__).parent
TABLES = {"aerofoil": ["Aerofoil"], "platform": ["Platform", "Shank", "Wedge"], "sector": ["Disc"], "plane": ["Plane"],
          "z_mass": ["ZMass"]}


def number(value: object, unit: str) -> str:
    """A value with its unit, empty for none."""
    return show(value, unit or "1") if isinstance(value, float | int) and not isinstance(value, bool) else str(value)


def rows(name: str) -> list[str]:
    """The parameters of one table as Markdown."""
    text = [f"**{name}**", "", "| field | default | accepted | meaning |", "| --- | ---: | --- | --- |"]
    for field in describe(getattr(parameters, name)):
        limits = " or ".join(field["choices"]) if field["choices"] else \
            f"{number(field['low'], field['unit'])} to {number(field['high'], field['unit'])}"
        default = "auto" if field["default"] is None else number(field["default"], field["unit"])
        text.append(f"| {field['name']} | {default} | {limits} | {field['help']} |")
    return [*text, ""]


page = ["# Parts and their parameters", "", "Drawn with the default values by `python docs/make_parts.py`.", ""]
for kind, drawings in PARTS.items():
    page += [f"## {kind}", ""]
    for name, draw in drawings.items():
        draw(Scene(kind=kind), HERE / "parts" / f"{name}.png")
        page += [f"![{name}](parts/{name}.png)", ""]
        for table in TABLES[name]:
            page += rows(table)
(HERE / "parts.md").write_text("\n".join(page), encoding="utf-8")
