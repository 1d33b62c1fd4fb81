"""``--help`` of a demo says what it shows, and runs nothing of it."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

from bladefem.util.script_help import help_and_exit

ROOT = Path(__file__).resolve().parents[2]
DEMOS = sorted((ROOT / "demos").glob("*.py"))


@pytest.mark.parametrize("option", ["--help", "-h"])
@pytest.mark.parametrize("demo", DEMOS, ids=lambda demo: demo.stem)
def test_help_prints_the_introduction_and_ends(demo, option, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(demo), option])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(demo), run_name="__main__")
    assert not ended.value.code
    printed = capsys.readouterr().out.splitlines()
    # "# # Natural modes" of the file's second line
    assert printed[0] == demo.read_text(encoding="utf-8").splitlines()[1].removeprefix("# ")
    assert printed[-1].startswith("It takes no arguments.")
    assert not any(line.startswith(("import", "# %%")) for line in printed)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("rank", "prints"), [("0", True), ("1", False)])
def test_help_is_printed_by_one_of_several_ranks(rank, prints, monkeypatch, capsys):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
    monkeypatch.setattr(sys, "argv", ["x.py", "--help"])
    with pytest.raises(SystemExit):
        help_and_exit(str(ROOT / "demos" / "sector_modes.py"))
    assert ("takes no arguments" in capsys.readouterr().out) == prints
