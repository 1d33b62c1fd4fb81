"""Fields of element sizes for gmsh: near curves or surfaces, in a box, and by a formula."""

from __future__ import annotations

from types import ModuleType
from typing import Any

# points on each curve or surface that distances are measured from
SAMPLES = 60


def threshold_field(
    field: Any,
    kind: str,
    tags: list[int],
    sizes: tuple[float, float],
    distances: tuple[float, float],
    samples: int = SAMPLES,
) -> int:
    """A size near some entities that grows linearly to another one far from them; returns the tag.

    Args:
        field: ``gmsh.model.mesh.field``.
        kind: of the tags, "CurvesList" or "SurfacesList".
        sizes: near and far [m].
        distances: up to which the first size holds, and from which the second one does [m].
    """
    distance = field.add("Distance")
    threshold = field.add("Threshold")
    field.setNumbers(distance, kind, tags)
    field.setNumber(distance, "Sampling", samples)
    for name, value in (
        ("InField", distance),
        ("SizeMin", sizes[0]),
        ("SizeMax", sizes[1]),
        ("DistMin", distances[0]),
        ("DistMax", distances[1]),
    ):
        field.setNumber(threshold, name, value)
    return threshold


def box_field(
    field: Any,
    inside: float,
    outside: float,
    thickness: float,
    limits: list[float],
) -> int:
    """A size in a box and another one outside; returns the tag.

    Args:
        field: ``gmsh.model.mesh.field``.
        inside, outside: sizes [m].
        thickness: of the layer round the box in which one passes into the other [m].
        limits: low and high x, y and z [m].
    """
    tag = field.add("Box")
    for name, value in zip(("XMin", "XMax", "YMin", "YMax", "ZMin", "ZMax"), limits, strict=True):
        field.setNumber(tag, name, value)
    field.setNumber(tag, "VIn", inside)
    field.setNumber(tag, "VOut", outside)
    field.setNumber(tag, "Thickness", thickness)
    return tag


def set_size_formula(gmsh: ModuleType, formula: str, least: float) -> None:
    """Element sizes by a formula of x, y and z [m]; no element below ``least`` [m]."""
    field = gmsh.model.mesh.field
    tag = field.add("MathEval")
    field.setString(tag, "F", formula)
    field.setAsBackgroundMesh(tag)
    gmsh.option.setNumber("Mesh.MeshSizeMin", least)
