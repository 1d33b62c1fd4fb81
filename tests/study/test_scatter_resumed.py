"""An interrupted 'bladefem scatter' keeps its finished wheels: the same command goes on after them,
on other ranks too, with the numbers of a run that was not interrupted.
"""

import shutil
import sys

import numpy as np
import pandas as pd
import pytest
from mistuned import MISTUNED, ROUGH_MISTUNED
from processes import run_on_ranks

from bladefem.cli.main import main
from bladefem.study.mistuning import drawn_wheels

FEW_WHEELS = [
    *ROUGH_MISTUNED,
    "mistuning.wheels=3",
    "mistuning.families=1",
    "model.harmonics=1",
    "model.samples=64",
]
WHEELS = "stages/scatter_80N_wheels"


def arguments(folder, changes=()):
    overrides = [part for one in (*FEW_WHEELS, *changes) for part in ("--set", one)]
    return ["scatter", str(MISTUNED), "-o", str(folder), *overrides]


@pytest.fixture
def searched(monkeypatch):
    """Counts the wheels that are searched; interrupts before the one of a number."""
    count = {"searched": 0, "interrupted": None}
    search = drawn_wheels.pattern_peak

    def counted(*given):
        if count["searched"] == count["interrupted"]:
            raise KeyboardInterrupt
        count["searched"] += 1
        return search(*given)

    monkeypatch.setattr(drawn_wheels, "pattern_peak", counted)
    return count


def same_results(one, two):
    for name in ("scatter.csv", "scatter_utilisation.csv"):
        first, second = (pd.read_csv(folder / name, comment="#") for folder in (one, two))
        np.testing.assert_allclose(
            first.to_numpy(dtype=float), second.to_numpy(dtype=float), rtol=1e-9, equal_nan=True
        )


def test_finished_wheels_are_kept(tmp_path, searched, capsys):
    stopped, whole, shared = (tmp_path / name for name in ("stopped", "whole", "shared"))
    # the tuned wheel and two of three
    searched["interrupted"] = 3
    assert main(arguments(stopped)) == 130
    assert "finished stages are kept, each finished wheel too;" in capsys.readouterr().err
    kept = sorted((stopped / WHEELS).glob("*.npz"))
    # with the choice of the balance
    assert len(kept) == 4 and not (stopped / "stages" / "scatter_80N.npz").exists()
    shutil.copytree(stopped, whole)
    shutil.rmtree(whole / WHEELS)
    shutil.copytree(stopped, shared)

    searched.update(searched=0, interrupted=None)
    assert main(arguments(stopped)) == 0
    assert searched["searched"] == 1
    # a file for all of them
    assert (stopped / "stages" / "scatter_80N.npz").is_file()
    assert not (stopped / WHEELS).exists()

    searched.update(searched=0)
    assert main(arguments(whole)) == 0
    assert searched["searched"] == 4
    for name in ("scatter.csv", "scatter_utilisation.csv"):
        assert (stopped / name).read_bytes() == (whole / name).read_bytes()

    command = [sys.executable, "-m", "bladefem.cli.main", *arguments(shared)]
    done = run_on_ranks(2, command, timeout=600)
    assert done.returncode == 0, done.stderr
    assert not (shared / WHEELS).exists()
    same_results(whole, shared)


def test_wheels_of_another_scene_are_not_taken(tmp_path):
    made = drawn_wheels.KeptWheels(tmp_path, "wheels", "one scene")
    other = drawn_wheels.KeptWheels(tmp_path, "wheels", "another scene")
    assert made(lambda: 1.5, "peak", (3, 64)) == 1.5
    assert made(lambda: 2.5, "peak", (3, 64)) == 1.5
    assert made(lambda: 2.5, "peak", (7, 64)) == 2.5
    assert other(lambda: 3.5, "peak", (3, 64)) == 3.5
    made.remove()
    assert made(lambda: 4.5, "peak", (3, 64)) == 4.5
    nothing = drawn_wheels.NOTHING_KEPT
    assert [nothing(lambda value=value: value, "peak") for value in (1, 2)] == [1, 2]
