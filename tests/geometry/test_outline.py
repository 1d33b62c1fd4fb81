"""Drawings: every dimension line of a length is as long as its parameter, and every parameter is drawn."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.outline import drawings
from geometry.parameters import (
    Aerofoil,
    Disc,
    HertzPair,
    MeshSize,
    Plane,
    Platform,
    Punch,
    Shank,
    Wedge,
    ZMass,
)

TABLES = {"aerofoil": Aerofoil(lean=0.1, sweep=0.1), "platform": Platform(), "shank": Shank(), "disc": Disc(),
          "damper": Wedge(), "plane": Plane(), "z_mass": ZMass(), "hertz": HertzPair(), "punch": Punch(),
          "mesh": MeshSize()}
KINDS = {"wedge sector": ("aerofoil", "platform", "shank", "disc", "damper"), "plane blades": ("plane",),
         "z mass": ("z_mass",), "hertz": ("hertz",), "punch": ("punch",)}
NOT_DRAWN = {"aerofoil.lean", "aerofoil.fillet", "damper.clearance", "plane.depth", "z_mass.thickness"}
RELATIVE = {"aerofoil.thickness_root", "aerofoil.camber"}


@pytest.mark.parametrize("kind", KINDS)
def test_dimension_lines_have_the_length_of_their_parameter(kind):
    found = set()
    for drawing in drawings(SimpleNamespace(kind=kind, **TABLES)):
        for line in drawing.dimensions:
            table, name = line.name.split(".")
            found.add(line.name)
            if line.corner is not None:
                continue
            value = getattr(TABLES[table], name) * (TABLES["aerofoil"].chord_root if line.name in RELATIVE else 1)
            exact = line.name not in ("aerofoil.thickness_root", "platform.thickness")
            assert np.linalg.norm(line.end - line.start) == pytest.approx(value, rel=1e-9 if exact else 0.02)
    wanted = {f"{table}.{f.name}" for table in KINDS[kind] for f in fields(TABLES[table])
              if f.metadata["unit"] in ("m", "rad")} - NOT_DRAWN
    assert found >= wanted


@pytest.mark.parametrize("name, value", [("aerofoil.stagger", Aerofoil().stagger), ("aerofoil.twist", Aerofoil().twist),
                                         ("damper.angle", Wedge().angle), ("aerofoil.sweep", 0.1),
                                         ("disc.sectors", 2 * np.pi / Disc().sectors)])
def test_angles(name, value):
    lines = [line for d in drawings(SimpleNamespace(kind="wedge sector", **TABLES)) for line in d.dimensions]
    line = next(line for line in lines if line.name == name)
    a, b = line.start - line.corner, line.end - line.corner
    assert np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)) == pytest.approx(value, rel=1e-6)


def test_neighbours_do_not_overlap_the_damper():
    """The damper touches both platforms along its flanks and lies outside both: areas by shared points only."""
    front = next(d for d in drawings(SimpleNamespace(kind="wedge sector", **TABLES)) if d.title == "Cross-section")
    for name in ("blade", "next blade"):
        shared = [p for p in front.curves["damper"][:-1]
                  if np.linalg.norm(front.curves[name] - p, axis=1).min() < 1e-12]
        assert len(shared) == 2
