"""Each demo runs in its coarse setting, alone and on 2 ranks, and ends in the same number; those
of FOUR_RANKS on 4 too. What the others share out are factorisations, seatings and loads, as the
collective tests do on 4 as well, those of tests/fem the modes of a sector among them.

The pinned numbers stand on gmsh 4.15.2; another mesher may move them a little, hence 0.5 % against
the pin and 1e-8 between rank counts. They are the values behind the numbers that the demos print,
which have as many digits as a report. Remake them with: BLADEFEM_COARSE=1 ./run python -c, the text
of WITH_VALUE, demos/NAME.py and the expression of VALUES.

The same mesher moves them from one processor to another, by the last digits of its mathematics
(6805 points and 6811 for one scene with and without fused multiplication). What depends on a coarse
mesh is therefore held to what meshes of this size leave open, BETWEEN_MESHES.
"""

from __future__ import annotations

import runpy
import sys
import time
from pathlib import Path

import pytest
from processes import run_on_ranks

HERE = Path(__file__).resolve().parents[2]
PINNED = {
    "blade_modes": 351.46803792,
    "sector_modes": 375.32827706,
    "damper_seating": 1.0,
    # under the best load, 72 N; under 90 N, on elements of two thirds of the size, with 6, 12, 24
    # and all contact points 182.59, 182.55, 182.58 and 182.55
    "forced_response": 170.41023860,
    "change_geometry": 1.2676242047,
    "plain_matrices": 3.84332830,
    "own_blade": 12.99114303,
}

# what each demo prints last, in its own names and the unit printed
VALUES = {
    "blade_modes": "found.frequencies[0]",
    "sector_modes": "excited.frequencies[0]",
    "damper_seating": "maps[0].force.sum() / expected",
    "forced_response": "1e6 * best.peak_amplitude",
    "change_geometry": "frequencies['12 mm'] / frequencies['8 mm']",
    "plain_matrices": "1e6 * best.peak.height",
    "own_blade": "1e3 * result.contact.problem.mass",
}
# half a unit of the last of four digits, the fewest that are printed
PRINTED_DIGITS = 5e-4
# runs a demo as a script, and prints one of its values with all digits on the first rank
WITH_VALUE = """
import runpy, sys
names = runpy.run_path(sys.argv[1], run_name="__main__")
if "comm" not in names or names["comm"].rank == 0:
    print("value:", repr(float(eval(sys.argv[2], names))))
"""

# relative; measured with element sizes of 10, 9, ... 4 mm: 1.2719, 1.2731, 1.2620, 1.2545, 1.2618,
# 1.2664 and 1.2691 (1.2726, 1.2641, 1.2607 without fused multiplication); all sizes 1.5 times
# larger 1.2676. 170.41 um has an estimated error of 13 %
BETWEEN_MESHES = {"change_geometry": 1.5e-2, "forced_response": 1.5e-2}

FOUR_RANKS = ("plain_matrices",)


def alone(name: str, capsys: pytest.CaptureFixture[str]) -> tuple[float, float]:
    """The last number that a demo prints in this process, and the value behind it."""
    start = time.time()
    capsys.readouterr()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(HERE)
        patch.setenv("BLADEFEM_COARSE", "1")
        names = runpy.run_path(f"demos/{name}.py", run_name="__main__")
    printed = capsys.readouterr().out.strip().splitlines()
    _check_written(printed, start)
    return float(printed[-1].split(":")[-1]), float(eval(VALUES[name], names))


def final_numbers(name: str, ranks: int) -> tuple[float, float]:
    """The same of a process on each of some ranks."""
    start = time.time()
    command = [sys.executable, "-c", WITH_VALUE, f"demos/{name}.py", VALUES[name]]
    done = run_on_ranks(
        ranks,
        command,
        cwd=HERE,
        variables={"BLADEFEM_COARSE": "1"},
        timeout=900,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    lines = done.stdout.strip().splitlines()
    _check_written(lines, start)
    values = [line for line in lines if line.startswith("value:")]
    printed = [line for line in lines if not line.startswith("value:")]
    return float(printed[-1].split(":")[-1]), float(values[-1].split(":")[-1])


def _check_written(lines: list[str], start: float) -> None:
    """The files that a demo tells, once whatever the ranks, are as young as its run."""
    reported = [line.partition(": ")[2] for line in lines if line.startswith("written: ")]
    assert len(reported) <= 1
    for file in reported[0].split(", ") if reported else []:
        # clocks of file systems are coarser than the system's
        assert (HERE / file).stat().st_mtime > start - 1.0


@pytest.mark.parametrize("name", PINNED)
def test_demo_ends_in_its_number_on_any_number_of_ranks(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    printed, value = alone(name, capsys)
    assert value == pytest.approx(PINNED[name], rel=BETWEEN_MESHES.get(name, 5e-3))
    assert printed == pytest.approx(value, rel=PRINTED_DIGITS)
    # a report's digits: no more than six
    assert float(f"{printed:.6g}") == printed
    for ranks in (2, 4) if name in FOUR_RANKS else (2,):
        assert final_numbers(name, ranks) == pytest.approx((printed, value), rel=1e-8)
