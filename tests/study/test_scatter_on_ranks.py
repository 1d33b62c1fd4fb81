"""'bladefem scatter' on two ranks: the files of one rank."""

import shutil
import sys

import numpy as np
import pandas as pd
from mistuned import MISTUNED, ROUGH_MISTUNED
from processes import run_on_ranks

from bladefem.cli.main import main

FEW_WHEELS = [
    *ROUGH_MISTUNED,
    "mistuning.wheels=3",
    "mistuning.families=1",
    "model.harmonics=1",
    "model.samples=64",
]


def arguments(folder):
    changes = [part for one in FEW_WHEELS for part in ("--set", one)]
    return ["scatter", str(MISTUNED), "-o", str(folder), *changes]


def scatter_on(ranks, folder):
    """What the command prints on some ranks."""
    command = [sys.executable, "-m", "bladefem.cli.main", *arguments(folder)]
    done = run_on_ranks(ranks, command, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def without_kept(output):
    """The lines but the last one, which has the time, and but what stages were found in the folder:
    headings and their items.
    """
    lines, heading = [], ""
    for line in output.splitlines()[:-1]:
        heading = heading if line.startswith("  - ") else line
        if heading != "kept:":
            lines.append(line)
    return [line for line in lines if line]


def test_two_ranks_write_what_one_writes(tmp_path, capsys):
    """The second run finds the tuned wheel's stages, and deals its three wheels over the ranks."""
    alone, shared = tmp_path / "alone", tmp_path / "shared"
    assert main(arguments(alone)) == 0
    first = capsys.readouterr().out
    shutil.copytree(alone, shared)
    kept = list((shared / "stages").glob("scatter_*"))
    assert kept
    for file in kept:
        file.unlink()
    second = scatter_on(2, shared)
    assert "robust optimum" not in first
    assert without_kept(first) == without_kept(second)
    for name in ("scatter.csv", "scatter_utilisation.csv"):
        one, two = (pd.read_csv(folder / name, comment="#") for folder in (alone, shared))
        assert len(one) == 1
        np.testing.assert_allclose(
            one.to_numpy(dtype=float), two.to_numpy(dtype=float), rtol=1e-9, equal_nan=True
        )
