"""The examples in docstrings give what they say."""

from __future__ import annotations

import doctest
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
