"""The paper's demos in their coarse setting end in their number. Remake: BLADEFEM_COARSE=1 ./run demos/paper_NAME.py"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[2]
PINNED = {"element": 0.542996, "contact": 0.97322916, "zmass": 0.105900, "blades": 10.42723}


@pytest.mark.parametrize("name", PINNED)
def test_demo_ends_in_its_number(name):
    environment = {**os.environ, "BLADEFEM_COARSE": "1", "PYTHONPATH": str(HERE)}
    done = subprocess.run([sys.executable, f"demos/paper_{name}.py"], cwd=HERE, env=environment, capture_output=True,
                          text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-3000:]
    number = float(done.stdout.strip().splitlines()[-1].split(":")[-1])
    assert number == pytest.approx(PINNED[name], rel=1e-3)


def test_demo_on_two_ranks_prints_once_and_ends_in_the_same_number():
    environment = {**os.environ, "BLADEFEM_COARSE": "1", "PYTHONPATH": str(HERE)}
    ranks = ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", "2"]
    done = subprocess.run([*ranks, sys.executable, "demos/paper_contact.py"], cwd=HERE, env=environment,
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-3000:]
    lines = [line for line in done.stdout.splitlines() if line.startswith("approach over")]
    assert len(lines) == 1
    assert float(lines[0].split(":")[-1]) == pytest.approx(PINNED["contact"], abs=1e-8)
