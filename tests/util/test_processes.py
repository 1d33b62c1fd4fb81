"""Programs on ranks that hang are ended with everything that they started."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from processes import run_on_ranks

# prints its number, then waits for ever, as a rank in a collective call that nobody else joins
HANGING = """
import os, pathlib, sys, time
pathlib.Path(sys.argv[1], str(os.getpid())).touch()
print("waiting", flush=True)
time.sleep(3600)
"""


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    return state != "Z"


def test_a_program_that_hangs_is_ended_with_its_ranks(tmp_path):
    ranks = 2
    command = [sys.executable, "-c", HANGING, str(tmp_path)]
    with pytest.raises(subprocess.TimeoutExpired) as ended:
        run_on_ranks(ranks, command, timeout=8.0)
    assert str(ended.value.stdout).count("waiting") == ranks
    started = [int(file.name) for file in tmp_path.iterdir()]
    assert len(started) == ranks
    # the kernel takes a moment
    for _ in range(50):
        if not any(map(alive, started)):
            break
        time.sleep(0.1)
    assert not any(map(alive, started))
