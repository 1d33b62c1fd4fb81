"""The paper's demos in their coarse setting end in their number. Remake: BLADEFEM_COARSE=1 ./run demos/paper_NAME.py"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[2]
PINNED = {"element": 0.542996, "zmass": 0.105842, "blades": 3.06908}


@pytest.mark.parametrize("name", PINNED)
def test_demo_ends_in_its_number(name):
    environment = {**os.environ, "BLADEFEM_COARSE": "1", "PYTHONPATH": str(HERE)}
    done = subprocess.run([sys.executable, f"demos/paper_{name}.py"], cwd=HERE, env=environment, capture_output=True,
                          text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-3000:]
    number = float(done.stdout.strip().splitlines()[-1].split(":")[-1])
    assert number == pytest.approx(PINNED[name], rel=1e-3)
