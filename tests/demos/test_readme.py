"""The Python of README and pages works as pasted; pages and links are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import bladefem
from bladefem.cli.main import parser
from bladefem.report.tables import COLUMNS

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))


def code_of(page: Path) -> list[str]:
    """The Python blocks of a page."""
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)


CHAIN, OPENED, MATRICES, _VARIED = code_of(ROOT / "docs" / "python.md")
(SHORT,) = code_of(ROOT / "README.md")


def test_matrices_of_your_own(capsys):
    """One peak of the band, flat: within 0.02 % over 0.1 Hz; the element slips there."""
    exec(compile(MATRICES, "python.md", "exec"), {})
    assert (
        capsys.readouterr().out
        == "178.94 Hz 5.443 um, {'stick': 0, 'slip': 1, 'lift': 0, 'open': 0}\n"
    )
    assert MATRICES.count("\n") <= 12


@pytest.mark.parametrize("code", [CHAIN, OPENED, SHORT], ids=["chain", "opened", "readme"])
def test_the_chain_uses_public_names(code):
    """It runs for a minute, so here only its names; demos/forced_response.py takes the same way."""
    compile(code, "page", "exec")
    assert set(re.findall(r"bladefem\.(\w+)", code)) <= {*bladefem.__all__, "open"}


def test_columns_that_the_page_of_results_explains_are_those_of_tables():
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [^|]*\|([^|]*)\|", text.partition("## Columns of the tables")[2], re.M)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert {"estimated_error", "body_mesh", "state"} <= named <= {*COLUMNS, "state"}


def test_the_readme_is_one_screen():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) < 600
    assert text.count("![") == 1


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(<?([^)#>]+)[^)]*\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_every_page_is_in_the_site():
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert all(f": {page.name}" in site for page in PAGES)


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_commands_of_pages_exist(page):
    """Every bladefem command that a page tells to type is one."""
    known = set(parser()._subparsers._group_actions[0].choices)
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"(?:\./run |`)bladefem ([a-z]+)", text)
    assert set(named) <= known
