"""The examples in docstrings give what they say."""

from __future__ import annotations

import ast
import doctest
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted(
    ".".join(file.relative_to(ROOT).with_suffix("").parts)
    for package in ("bladefem", "geometry")
    for file in (ROOT / package).rglob("*.py")
    if ">>> " in file.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", MODULES)
def test_examples_of(name):
    result = doctest.testmod(import_module(name), optionflags=doctest.ELLIPSIS)
    assert result.attempted > 0
    assert result.failed == 0


def test_public_names_have_examples():
    """Those that a newcomer types first."""
    mesh_and_modes = ("study.pipeline.scene_mesh", "study.pipeline.normal_modes")
    for name in ("scene.toml", "scene.units", *mesh_and_modes, "report.opened"):
        assert f"bladefem.{name}" in MODULES


def arguments_of(function: ast.FunctionDef) -> set[str]:
    """Names in the signature."""
    given = function.args
    every = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    every += [one for one in (given.vararg, given.kwarg) if one is not None]
    return {one.arg for one in every}


def described_arguments(doc: str) -> list[str]:
    """Names before the colons of the section "Args"; "a, b: ..." describes two."""
    section = re.search(r"\n\s*Args:\n(.*?)(?=\n\s*\n|\Z)", doc, re.S)
    if section is None:
        return []
    lines = section[1].splitlines()
    indent = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
    heads = [line for line in lines if len(line) - len(line.lstrip()) == indent]
    names = [re.match(r"\s*([\w, ]+):", line) for line in heads]
    return [name for found in names if found for name in re.split(r"[, ]+", found[1].strip())]


@pytest.mark.parametrize("package", ["bladefem", "geometry", "verification"])
def test_described_arguments_are_in_the_signature(package):
    wrong = []
    for file in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                described = set(described_arguments(ast.get_docstring(node) or ""))
                wrong += [(file.name, node.name, one) for one in described - arguments_of(node)]
    assert wrong == []


MAPPED = (
    "bladefem/contact",
    "bladefem/fem",
    "bladefem/friction",
    "bladefem/friction/simd",
    "bladefem/hbm",
    "bladefem/hbm/linear",
    "bladefem/hbm/solver",
    "bladefem/report",
    "bladefem/study",
    "bladefem/study/adaptive",
    "bladefem/study/mistuning",
    "bladefem/study/modes",
    "bladefem/study/pipeline",
    "bladefem/study/stability",
    "bladefem/view",
    "bladefem/wheel",
)


@pytest.mark.parametrize("package", MAPPED)
def test_the_map_of_a_package_has_its_modules(package):
    """A package of many modules says in its docstring which is for what."""
    folder = ROOT / package
    doc = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))
    there = {file.stem for file in folder.glob("*.py")} - {"__init__"}
    there |= {file.parent.name for file in folder.glob("*/__init__.py")}
    assert set(re.findall(r"``(\w+)``", doc)) == there
