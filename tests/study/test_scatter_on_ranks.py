"""'bladefem scatter' on two ranks: the files of one rank."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

SCENE = Path(__file__).parents[2] / "scenes" / "mistuned.toml"
COARSE = [
    "mesh.size=16 mm",
    "mesh.seat_elements=2",
    "study.loads=80 N",
    "contact.points=2",
    "model.modes=6",
    "model.static=uncoupled",
    "mistuning.wheels=3",
    "mistuning.families=1",
]


def clean_environment():
    """mpirun refuses to start inside a process that already is a rank."""
    mpi = ("OMPI_", "PMIX_", "PRTE_", "ORTE_", "PMI_")
    keep = ("OMPI_ALLOW", "OMPI_MCA_mpi_yield", "OMPI_MCA_btl")
    return {k: v for k, v in os.environ.items() if not k.startswith(mpi) or k.startswith(keep)}


def scatter(folder, ranks):
    start = (
        ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks)] if ranks > 1 else []
    )
    changes = [part for one in COARSE for part in ("--set", one)]
    command = [sys.executable, "-m", "bladefem.cli.main", "scatter", str(SCENE), "-o", str(folder)]
    done = subprocess.run(
        [*start, *command, *changes], capture_output=True, text=True, env=clean_environment()
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_two_ranks_write_what_one_writes(tmp_path):
    """The second run finds the tuned wheel's stages, and deals its three wheels over the ranks."""
    alone, shared = tmp_path / "alone", tmp_path / "shared"
    first = scatter(alone, 1)
    shutil.copytree(alone, shared)
    kept = list((shared / "stages").glob("scatter_*"))
    assert kept
    for file in kept:
        file.unlink()
    second = scatter(shared, 2)
    assert "robust optimum" not in first
    assert first.splitlines()[:-1] == second.splitlines()[:-1]
    for name in ("scatter.csv", "scatter_utilisation.csv"):
        one, two = (pd.read_csv(folder / name, comment="#") for folder in (alone, shared))
        assert len(one) == 1
        np.testing.assert_allclose(
            one.to_numpy(dtype=float), two.to_numpy(dtype=float), rtol=1e-9, equal_nan=True
        )
