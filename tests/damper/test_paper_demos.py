"""The paper's demos in their coarse setting end in their number. Remake: BLADEFEM_COARSE=1 ./run
demos/paper_NAME.py
"""

import sys
from functools import cache
from pathlib import Path

import pytest
from processes import run_on_ranks

HERE = Path(__file__).resolve().parents[2]
# blades: 10.6852 on half the element size, 10.41 on the seats of ten elements that are too coarse
PINNED = {"element": 0.542996, "contact": 0.97322916, "zmass": 0.105900, "blades": 10.67432}


@cache
def output(name: str, ranks: int = 1) -> list[str]:
    """Lines that a demo prints in its coarse setting, run once."""
    command = [sys.executable, f"demos/paper_{name}.py"]
    done = run_on_ranks(
        ranks,
        command,
        cwd=HERE,
        variables={"BLADEFEM_COARSE": "1", "PYTHONPATH": str(HERE)},
        timeout=600,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.strip().splitlines()


@pytest.mark.parametrize("name", PINNED)
def test_demo_ends_in_its_number(name):
    assert float(output(name)[-1].split(":")[-1]) == pytest.approx(PINNED[name], rel=1e-3)


def test_demo_on_two_ranks_speaks_once_and_ends_in_the_same_number():
    """So do zmass and blades on 2 and 4 ranks, which is not repeated here."""
    alone, together = output("contact"), output("contact", 2)
    assert len(together) == len(alone)
    assert float(together[-1].split(":")[-1]) == pytest.approx(
        float(alone[-1].split(":")[-1]), rel=1e-8
    )
