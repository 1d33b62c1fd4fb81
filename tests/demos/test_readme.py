"""The README's Python works as pasted."""

from __future__ import annotations

import re
from pathlib import Path

import bladefem

README = (Path(__file__).parents[2] / "README.md").read_text()
CHAIN, MATRICES = re.findall(r"```python\n(.*?)```", README, re.S)


def test_matrices_of_your_own(capsys):
    """One peak of the band; the element slips there."""
    exec(compile(MATRICES, "README.md", "exec"), {})
    assert (
        capsys.readouterr().out
        == "178.90 Hz 5.443 um, {'stick': 0, 'slip': 1, 'lift': 0, 'open': 0}\n"
    )
    assert MATRICES.count("\n") <= 12


def test_the_chain_uses_public_names():
    """It runs for a minute, so here only its names; demos/forced_response.py takes the same way."""
    compile(CHAIN, "README.md", "exec")
    assert set(re.findall(r"bladefem\.(\w+)", CHAIN)) <= set(bladefem.__all__)
